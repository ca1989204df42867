from .bank_config import own_bank as own_bank
from .scene_worlds import OwnScene as OwnScene, own_world as own_world, read_scene as read_scene
from .ways import motion_of as motion_of
