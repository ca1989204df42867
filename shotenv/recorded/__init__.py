"""Cameras' recordings as banks, and simulated drives as recordings.

recordings_file.py  what `recordings.yaml` tells beside the recordings
frame_tables.py     what is told of each frame in files of their own: truth, speeds, offsets
clip_settings.py    what a recording was made with, one number for all of its frames
taking_in.py        one recording to the arrays of a clip, piece by piece
bank_import.py      all of a folder, written whole or not at all, with a configuration
delivered_drive.py  what an imager delivers of a simulated drive
drive_folder.py     such drives as a folder of a camera's recordings
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
