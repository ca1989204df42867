"""A camera's own numbers, by its recordings.

    BenchRecording    frames of one recording, and what is known of it
    moments_of        its mean, temporal variance and flags by pixel, which all that follows needs
    calibrate         what the recordings tell, each number with its interval, and what they do not

Every estimator is a function of arrays, with the source of its formula, and serves alone.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
