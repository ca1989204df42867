"""Policies played on the same drives, compared in pairs; what there is to win."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
