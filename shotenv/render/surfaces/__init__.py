"""What rays meet: the triangles of a world on the device, and scene files as Mitsuba reads them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
