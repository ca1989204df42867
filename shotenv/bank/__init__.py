"""Sequences of frames on disk: rendered once, then read.

`open_bank("starter")` opens a bank by the name of its configuration and renders it into the
user's cache folder on first use; `open_bank("path/to/bank")` opens a folder; `open_bank("pocket")`
one that comes with the package.

    files/              what a bank is on disk: arrays, records, table of contents, folders
    clip_jobs.py        which clips a configuration asks for
    clip_rendering.py   one clip from its seed
    build.py            all that are missing, by worker processes
    published.py        a bank on a place (`s3://...`): published there clip by clip, fetched
    opening.py          a bank by name, path or URL
    bank.py             a bank that is open: its clips, splits and frames; one with every pixel
    clip_arrays.py      its arrays on disk, opened as they are asked for
    thinned.py          one that has a pixel of each few, and what was made of its full frames
    compatibility.py    whether a sensor and a frame rate are those it was made for
    word_bank.py        one that has what a camera delivered, in place of light
    recorded_bank.py    such a one on disk
    predictions.py      what networks make of its gray images, kept
    listing/            what is in a bank, and which there are: words, numbers, pictures
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
