"""Tools that know nothing of light: files written whole, loops compiled, tensors, sections, progress."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
