"""Files of real cameras: the description of a camera, and a reader for each kind of file."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
