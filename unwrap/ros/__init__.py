"""Files of ROS 2: depth images and point clouds as messages in MCAP, without ROS."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
