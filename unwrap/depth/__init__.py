"""Phase to distance: one to three frequencies, merging, correction, classical methods, metrics."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
