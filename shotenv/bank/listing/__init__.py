"""What is in a bank, and which banks there are: numbers, tables, pictures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
