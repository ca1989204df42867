"""Schedulers judged on recordings.

Those tell less than simulated drives: there may be no reference, or four samples alone.

Where distances are scored against a reference and eight samples were recorded, recordings are
judged as any drives are, by `agents.evaluation`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
