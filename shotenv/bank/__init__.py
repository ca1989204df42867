"""Sequences of frames on disk.

`open_bank("starter")` opens a bank by the name of its configuration and renders it into the
user's cache folder on first use; `open_bank("path/to/bank")` opens a folder.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
