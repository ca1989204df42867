"""Frames of real cameras in one order and unit, their depth, and how their planes are labelled."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
