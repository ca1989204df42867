"""Tools that know nothing of light: files, compiled loops, tensors, progress."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
