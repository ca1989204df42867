"""Tools that know nothing of light: whole files, compiled loops, tensors, threads, progress."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
