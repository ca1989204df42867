"""Networks that tell the wrap: what they see, what they are, their weights, how they predict."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
