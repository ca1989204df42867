from .geometry import REACH_M as REACH_M, faces_of as faces_of, posed as posed
from .mitsuba_file import (
    Part as Part,
    SceneFileError as SceneFileError,
    file_within as file_within,
    parse_mitsuba as parse_mitsuba,
)
from .probes import nearest_face as nearest_face
from .scattering import Onward as Onward, chances as chances
from .scene import (
    SURFACE_OFFSET_M as SURFACE_OFFSET_M,
    Hit as Hit,
    Scene as Scene,
    Surroundings as Surroundings,
    triangle_mesh as triangle_mesh,
)
from .texture import noise_texture as noise_texture
