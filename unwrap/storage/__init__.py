"""Folders at a URL, published whole or not at all.

    place.py        a folder at a URL: its files are read, written and listed through fsspec
    listing.py      which files something has, by the digest of what is in them
    publishing.py   a local folder's files onto a place: objects first, contents last
    fetching.py     from a place into a local folder, each file verified

Where renames are not atomic, or there are none, only the order of writing can keep what is half
there from being taken for whole:

    <place>/objects/<sha256>             each file, named by what is in it
    <place>/parts/<label>/<part>.json    a part (a clip), written after its objects
    <place>/contents.json                what was published, written last

Nothing is changed once it stands, so two that write the same part do no harm: each names objects of
its own, which are the same where their bytes are.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
