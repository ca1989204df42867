"""What a sample is: shots, words, frames; samples to phase; wiggle; the sensor's description.

The words of the masks over pixels (`valid`, `strong`, `known`, ...) are defined in `frames.py`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
