"""MCAP files of depth images and point clouds, as ROS 2 records them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from unwrap.ros.ros_messages import (
    DEFINITIONS,
    IMAGE,
    NS_PER_S,
    POINT_CLOUD,
    image_message,
    point_cloud_message,
)
from unwrap.support import replacing

TOPICS = {IMAGE: "/camera/depth/image", POINT_CLOUD: "/camera/depth/points"}
POINTS_FRAME, OPTICAL_FRAME = "camera", "camera_optical"
"""Axes ahead, left, up; and right, down, ahead, those of images (REP 103)."""


class McapLog:
    """A file that is being written, a depth image and a point cloud for each frame.

    Parameters
    ----------
    writer : mcap.writer.Writer
        Started.
    frame_rate_hz : float
        Of frames whose time is not known.
    """

    def __init__(self, writer: Any, frame_rate_hz: float) -> None:
        self._writer, self._frame_rate_hz, self._frames = writer, frame_rate_hz, 0
        self._channels = {name: self._channel(name) for name in DEFINITIONS}

    def _channel(self, name: str) -> int:
        schema = self._writer.register_schema(name, "ros2msg", DEFINITIONS[name].encode("utf-8"))
        return self._writer.register_channel(TOPICS[name], "cdr", schema)

    def add(self, depth_mm: np.ndarray, points: np.ndarray, *, time_s: float | None = None) -> None:
        """One frame.

        Parameters
        ----------
        depth_mm : uint16 [H, W]
            Depth along the axis of the camera, millimetres; 0 where it is not known (REP 118).
        points : float32 [H, W, 4]
            Metres ahead, left and up, and the intensity; NaN where there is none.
        time_s : float, optional
            When it was recorded; by the number of the frame and the frame rate without.
        """
        seconds = self._frames / self._frame_rate_hz if time_s is None else time_s
        time_ns = round(seconds * NS_PER_S)
        messages = {
            IMAGE: image_message(depth_mm, time_ns, OPTICAL_FRAME),
            POINT_CLOUD: point_cloud_message(points, time_ns, POINTS_FRAME),
        }
        for name, message in messages.items():
            self._writer.add_message(
                self._channels[name], time_ns, message, time_ns, sequence=self._frames
            )
        self._frames += 1


@contextmanager
def mcap_log(path: Path, frame_rate_hz: float) -> Iterator[McapLog]:
    """An MCAP file that replaces `path` at the end, or leaves it as it was.

    Raises
    ------
    ImportError
        The package mcap is not installed.
    ValueError
        The frame rate is not positive.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise ImportError(
            "MCAP files need mcap, which is not installed: pip install 'shotenv[ros]'"
        ) from None
    if not 0 < frame_rate_hz < float("inf"):
        raise ValueError(f"frame_rate_hz is {frame_rate_hz:g}; expected a positive number")
    with replacing(path) as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="shotenv")
        yield McapLog(writer, frame_rate_hz)
        writer.finish()
