"""What any policy could reach: tables of every outcome, choices played on them, the optimum."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
