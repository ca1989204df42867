"""Schedulers judged on recordings that tell less than simulated drives: no reference, four samples.

Where distances are scored against a reference and eight samples were recorded, recordings are
judged as any drives are, by `agents.evaluation`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
