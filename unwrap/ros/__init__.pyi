from .cdr import CdrEncoder as CdrEncoder
from .mcap_files import McapLog as McapLog, mcap_log as mcap_log
from .ros_messages import (
    DEFINITIONS as DEFINITIONS,
    IMAGE as IMAGE,
    POINT_CLOUD as POINT_CLOUD,
    image_message as image_message,
    point_cloud_message as point_cloud_message,
)
