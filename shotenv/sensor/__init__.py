"""Light becomes electrons, noise and converter words.

    Exposure          noise-free light of frames, from a bank
    sensitivity       what that is worth in electrons at a laser power and integration time
    incident_light    both together, as the loops over pixels take them
    acquire           taps, noise, full well, offset, converter: 2, 4 or 8 samples (RawFrame)
    capture_gray      the gray image, of ambient light alone

`expose` checks its input and does the first four. The laser's heat is in `shotenv.laser`, what
becomes of the samples in `unwrap`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
