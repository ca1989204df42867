"""What a sample is: shots, words, frames; samples to phase; wiggle; the sensor's description."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
