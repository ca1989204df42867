from .bank_import import import_bank as import_bank
from .recordings_file import (
    RECORDINGS_FILE as RECORDINGS_FILE,
    RecordedFile as RecordedFile,
    RecordingsConfig as RecordingsConfig,
)
