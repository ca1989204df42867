from .own_bank import own_bank as own_bank
from .own_world import OwnScene as OwnScene, own_world as own_world, read_scene as read_scene
from .ways import motion_of as motion_of
