"""What a bank is on disk: its arrays, records and table of contents, and the folder they lie in.

layout.py     what lies in a bank's folder: arrays, records, table of contents
store.py      writing that whole or not at all; reading and verifying it
folders.py    where a bank lies, and which configuration it is of
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
