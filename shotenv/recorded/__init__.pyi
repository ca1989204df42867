from .bank_import import import_bank as import_bank
from .delivered_drive import DeliveredDrive as DeliveredDrive, deliver_drive as deliver_drive
from .drive_folder import require_camera as require_camera, write_drives as write_drives
from .recordings_file import (
    RECORDINGS_FILE as RECORDINGS_FILE,
    RecordedFile as RecordedFile,
    RecordingsConfig as RecordingsConfig,
)
