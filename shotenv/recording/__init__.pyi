from .delivered_drive import DeliveredDrive as DeliveredDrive, deliver_drive as deliver_drive
from .drive_folder import require_camera as require_camera, write_drives as write_drives
