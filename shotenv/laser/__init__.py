"""The laser: energy, heat, trip, ageing and eye safety of what is chosen.

What is made of arithmetic alone takes torch tensors and NumPy arrays alike. Every effect is a
parameter of `LaserConfig` that is off at zero, and then costs no operation.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
