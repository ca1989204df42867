"""A live camera as a bank.

The same choices from the same features as in `shotenv.env`, of frames as they come.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
