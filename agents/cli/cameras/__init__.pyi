from .camera_calibrate_command import CALIBRATE as CALIBRATE
from .camera_commands import DESCRIBE as DESCRIBE, read_camera as read_camera
from .correct_command import CORRECT as CORRECT
from .record_command import RECORD as RECORD
