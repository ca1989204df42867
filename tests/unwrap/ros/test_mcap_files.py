"""MCAP files, read back with the package that other people use, and CDR by a decoder of theirs."""

from __future__ import annotations

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from unwrap.ros.cdr import CdrEncoder
from unwrap.ros.mcap_files import OPTICAL_FRAME, POINTS_FRAME, TOPICS, mcap_log
from unwrap.ros.ros_messages import (
    DEFINITIONS,
    IMAGE,
    POINT_CLOUD,
    image_message,
    point_cloud_message,
)

ROS = get_typestore(Stores.ROS2_HUMBLE)
RANDOM = np.random.default_rng(4)
DEPTH_MM = RANDOM.integers(0, 2**16, (5, 7)).astype(np.uint16)
POINTS = RANDOM.normal(0, 10, (5, 7, 4)).astype(np.float32)
POINTS[1, 2] = np.nan


def test_numbers_are_aligned_to_their_size_as_the_standard_says():
    encoder = CdrEncoder()
    encoder.number("B", 1)
    encoder.number("d", 1.5)  # at 8: counted from after the header
    encoder.text("ab")
    encoder.number("I", 2)
    encoder.array(np.array([1, 258], ">u2"))
    encoder.array(np.array([], "f8"))
    encoder.number("i", -1)
    expected = (
        "00 01 00 00  01 00 00 00 00 00 00 00  00 00 00 00 00 00 f8 3f"
        "03 00 00 00 61 62 00 00  02 00 00 00  02 00 00 00 01 00 02 01  00 00 00 00  ff ff ff ff"
    )
    assert encoder.message() == bytes.fromhex(expected)


@pytest.mark.parametrize("name", [IMAGE, POINT_CLOUD])
def test_definitions_are_those_of_ros(name):
    theirs = get_types_from_msg(DEFINITIONS[name], name)
    for part, fields in theirs.items():
        assert fields == ROS.fielddefs[part]
    assert name in theirs and "builtin_interfaces/msg/Time" in theirs


# Names of every length, so that what follows them is moved by 0 to 3 bytes.
@pytest.mark.parametrize("frame_id", ["", "c", "ca", "cam", "camera"])
def test_messages_are_decoded_by_others(frame_id):
    time_ns = 1_700_000_000_123_456_789
    image = ROS.deserialize_cdr(image_message(DEPTH_MM, time_ns, frame_id), IMAGE)
    cloud = ROS.deserialize_cdr(point_cloud_message(POINTS, time_ns, frame_id), POINT_CLOUD)
    for message in (image, cloud):
        assert message.header.stamp.sec == 1_700_000_000
        assert message.header.stamp.nanosec == 123_456_789
        assert message.header.frame_id == frame_id
        assert (message.height, message.width) == (5, 7) and not message.is_bigendian
    assert image.encoding == "16UC1" and image.step == 14
    np.testing.assert_array_equal(image.data.view("<u2").reshape(5, 7), DEPTH_MM)
    fields = [(f.name, f.offset, f.datatype, f.count) for f in cloud.fields]
    names = ("x", "y", "z", "intensity")
    assert fields == [(name, 4 * i, 7, 1) for i, name in enumerate(names)]
    assert (cloud.point_step, cloud.row_step, cloud.is_dense) == (16, 112, False)
    np.testing.assert_array_equal(cloud.data.view("<f4").reshape(5, 7, 4), POINTS)
    dense = point_cloud_message(np.nan_to_num(POINTS), time_ns, frame_id)
    assert ROS.deserialize_cdr(dense, POINT_CLOUD).is_dense
    # To the byte what that encoder writes.
    assert bytes(ROS.serialize_cdr(image, IMAGE)) == image_message(DEPTH_MM, time_ns, frame_id)


def test_maps_of_any_layout_are_written_row_by_row():
    turned = np.asfortranarray(POINTS[::-1])
    cloud = ROS.deserialize_cdr(point_cloud_message(turned, 0, "a"), POINT_CLOUD)
    np.testing.assert_array_equal(cloud.data.view("<f4").reshape(5, 7, 4), POINTS[::-1])
    image = ROS.deserialize_cdr(image_message(DEPTH_MM.T.astype(">u2"), 0, "a"), IMAGE)
    np.testing.assert_array_equal(image.data.view("<u2").reshape(7, 5), DEPTH_MM.T)


def read(path):
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        return reader.get_header(), list(reader.iter_messages())


def test_a_file_holds_two_messages_a_frame_at_their_times(tmp_path):
    path = tmp_path / "sub" / "depth.mcap"
    with mcap_log(path, frame_rate_hz=8.0) as log:
        for frame in range(3):
            log.add(DEPTH_MM + np.uint16(frame), POINTS)
        log.add(DEPTH_MM, POINTS, time_s=12.25)
    header, messages = read(path)
    assert header.profile == "ros2"
    assert len(messages) == 8
    for name, frame_id in ((IMAGE, OPTICAL_FRAME), (POINT_CLOUD, POINTS_FRAME)):
        own = [(c, m) for schema, c, m in messages if schema.name == name]
        assert {channel.topic for channel, _ in own} == {TOPICS[name]}
        assert {channel.message_encoding for channel, _ in own} == {"cdr"}
        times_ns = [0, 125_000_000, 250_000_000, 12_250_000_000]
        assert [m.log_time for _, m in own] == [m.publish_time for _, m in own] == times_ns
        decoded = [ROS.deserialize_cdr(m.data, name) for _, m in own]
        stamps = [d.header.stamp.sec * 10**9 + d.header.stamp.nanosec for d in decoded]
        assert stamps == times_ns and decoded[0].header.frame_id == frame_id
    schema = next(schema for schema, *_ in messages if schema.name == IMAGE)
    assert schema.encoding == "ros2msg" and schema.data.decode() == DEFINITIONS[IMAGE]


def test_what_fails_half_way_leaves_no_file(tmp_path):
    path = tmp_path / "depth.mcap"
    path.write_bytes(b"mine")
    with pytest.raises(ZeroDivisionError), mcap_log(path, 10.0) as log:
        log.add(DEPTH_MM, POINTS)
        raise ZeroDivisionError
    assert path.read_bytes() == b"mine" and list(tmp_path.iterdir()) == [path]


def test_what_cannot_be_is_refused(tmp_path, monkeypatch):
    with pytest.raises(ValueError, match="frame_rate_hz is 0"), mcap_log(tmp_path / "a", 0.0):
        pass
    monkeypatch.setitem(__import__("sys").modules, "mcap.writer", None)
    with pytest.raises(ImportError, match=r"shotenv\[ros\]"), mcap_log(tmp_path / "a", 10.0):
        pass
