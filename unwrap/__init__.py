"""From raw samples of an indirect time-of-flight sensor to depth. Usable alone.

Public names are listed in `__init__.pyi`, here and in every room, and loaded when they are asked
for: importing this package loads no torch.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
