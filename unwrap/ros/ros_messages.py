"""Messages of ROS 2: their definitions, and depth images and point clouds as CDR."""

from __future__ import annotations

import numpy as np

from unwrap.ros.cdr import CdrEncoder

IMAGE, POINT_CLOUD = "sensor_msgs/msg/Image", "sensor_msgs/msg/PointCloud2"
PARTS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "sensor_msgs/PointField": (
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\n"
        "uint8 UINT32=6\nuint8 FLOAT32=7\nuint8 FLOAT64=8\n"
        "string name\nuint32 offset\nuint8 datatype\nuint32 count\n"
    ),
}
IMAGE_FIELDS = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n"
    "uint32 step\nuint8[] data\n"
)
POINT_CLOUD_FIELDS = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\n"
    "bool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n"
)
FLOAT32 = 7
"""Of the constants of `PointField`."""
NS_PER_S = 10**9


def _definition(fields: str, *parts: str) -> str:
    """Fields, and after each line of 80 signs those of a message that they name."""
    return fields + "".join(f"{'=' * 80}\nMSG: {part}\n{PARTS[part]}" for part in parts)


HEADER_PARTS = ("std_msgs/Header", "builtin_interfaces/Time")
DEFINITIONS = {
    IMAGE: _definition(IMAGE_FIELDS, *HEADER_PARTS),
    POINT_CLOUD: _definition(POINT_CLOUD_FIELDS, *HEADER_PARTS, "sensor_msgs/PointField"),
}
"""Of the messages here, in the form that MCAP calls `ros2msg`."""


def image_message(depth_mm: np.ndarray, time_ns: int, frame_id: str) -> bytes:
    """`IMAGE` of a depth image uint16 [H, W], encoding 16UC1: millimetres, 0 where not known."""
    encoder, (height, width) = _header(time_ns, frame_id), depth_mm.shape
    encoder.number("I", height)
    encoder.number("I", width)
    encoder.text("16UC1")
    encoder.number("B", 0)  # is_bigendian
    encoder.number("I", 2 * width)  # step
    encoder.array(_little_bytes(depth_mm, "<u2"))
    return encoder.message()


def point_cloud_message(points: np.ndarray, time_ns: int, frame_id: str) -> bytes:
    """`POINT_CLOUD` of an organised cloud float32 [H, W, 4]: x, y, z and intensity; NaN is none."""
    encoder, (height, width, count) = _header(time_ns, frame_id), points.shape
    encoder.number("I", height)
    encoder.number("I", width)
    encoder.number("I", count)
    for place, name in enumerate(("x", "y", "z", "intensity")):
        encoder.text(name)
        encoder.number("I", 4 * place)  # offset
        encoder.number("B", FLOAT32)
        encoder.number("I", 1)  # count
    encoder.number("?", False)  # is_bigendian
    encoder.number("I", 4 * count)  # point_step
    encoder.number("I", 4 * count * width)  # row_step
    encoder.array(_little_bytes(points, "<f4"))
    encoder.number("?", bool(np.isfinite(points).all()))  # is_dense
    return encoder.message()


def _header(time_ns: int, frame_id: str) -> CdrEncoder:
    """Encoder that has written the `Header` with which the messages begin."""
    encoder = CdrEncoder()
    seconds, rest_ns = divmod(time_ns, NS_PER_S)
    encoder.number("i", seconds)
    encoder.number("I", rest_ns)
    encoder.text(frame_id)
    return encoder


def _little_bytes(values: np.ndarray, dtype: str) -> np.ndarray:
    return np.ascontiguousarray(values, dtype).reshape(-1).view(np.uint8)
