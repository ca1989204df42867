from .camera_files import export_policy as export_policy
from .camera_modes import (
    mode_switching as mode_switching,
    modes_of_shots as modes_of_shots,
)
