"""Published methods of phase unwrapping and depth from time of flight, to compare with.

Each module names its paper and says what is adapted to one modulation frequency, few samples and
the compute of the project's own networks.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
