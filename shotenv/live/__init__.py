"""A camera that is there, in place of a bank: the same choices, from frames as they come."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
