"""Figures of many ROS messages taken at once: to the last bit those of each message unpacked alone.

The oracle is the library of the format, which unpacks message by message.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.ros_columns import MessageForm, UnevenError
from syncline_design.logs.readers.ros_meaning import meaning_of
from syncline_design.logs.readers.ros_rows import MOST_SHAPES, FiguresOf
from syncline_design.logs.readers.ros_types import Encoding, MessageType
from tests.flight_logs import flight, write_ros1, write_ros2

OWN = {
    "gps_common/msg/GPSStatus": "std_msgs/Header header\nuint16 satellites_used\n"
    "int32[] satellite_used_prn\nint16 status\nuint16 motion_source",
    "gps_common/msg/GPSFix": "std_msgs/Header header\ngps_common/GPSStatus status\n"
    "float64 latitude\nfloat64 longitude\nfloat64 altitude\nfloat64 track\nfloat64 speed\n"
    "float64 climb\nfloat64 pitch\nfloat64 time\nfloat64[9] position_covariance",
    "novatel_oem7_msgs/msg/Oem7Header": "string message_name\nuint16 message_id\n"
    "uint16 gps_week_number\nuint32 gps_week_milliseconds",
    "novatel_oem7_msgs/msg/INSPVA": "std_msgs/Header header\n"
    "novatel_oem7_msgs/Oem7Header nov_header\nfloat64 latitude\nfloat64 longitude\n"
    "float64 height\nfloat32 undulation\nfloat64 north_velocity\nfloat64 east_velocity\n"
    "float64 up_velocity\nfloat64 roll\nfloat64 pitch\nfloat64 azimuth\nbool good",
    "novatel_oem7_msgs/msg/BESTPOS": "std_msgs/Header header\n"
    "novatel_oem7_msgs/Oem7Header nov_header\nint8 kind\nfloat64 lat\nfloat64 lon\nfloat64 hgt\n"
    "float32 undulation\nfloat32 lat_stdev\nfloat32 lon_stdev\nfloat32 hgt_stdev\nstring[2] base",
}
KINDS = [
    "sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped", "geometry_msgs/msg/TransformStamped",
    "geometry_msgs/msg/PointStamped", "geometry_msgs/msg/QuaternionStamped",
    "geometry_msgs/msg/TwistStamped", "geometry_msgs/msg/TwistWithCovarianceStamped",
    "sensor_msgs/msg/NavSatFix", "gps_common/msg/GPSFix", "novatel_oem7_msgs/msg/INSPVA",
    "novatel_oem7_msgs/msg/BESTPOS",
]  # fmt: skip
TEXTS = ("base_link", "", "österlicher Rahmen", "map")
ODD = (0.0, -0.0, float("nan"), float("inf"), -float("inf"), 1e300, 5e-324)


def store_of(encoding: Encoding) -> Any:
    store = get_typestore(Stores.ROS1_NOETIC if encoding == "ros1" else Stores.ROS2_HUMBLE)
    for name, text in OWN.items():
        store.register(get_types_from_msg(text, name))
    return store


def drawn(store: Any, kind: str, rng: np.random.Generator, text: str, length: int) -> Any:
    """A message with figures at random, some of them odd; texts and lengths as given."""

    def value(node: int, what: Any) -> Any:
        if node == 2:
            return drawn(store, what, rng, text, length)
        if node == 1:
            return text if what[0] == "string" else figure(what[0])
        (inner, name), count = what
        count = count if node == 3 else length
        if inner == 1 and name[0] != "string":
            return np.array([figure(name[0]) for _ in range(count)], dtype=name[0])
        return [value(int(inner), name) for _ in range(count)]

    def figure(name: str) -> Any:
        if name.startswith("float"):
            odd = rng.integers(20) == 0
            drawn_one = float(ODD[rng.integers(len(ODD))] if odd else rng.normal())
            return drawn_one if name == "float64" or not abs(drawn_one) < 1e39 else float(
                np.float32(drawn_one))  # fmt: skip
        if name == "bool":
            return bool(rng.integers(2))
        info = np.iinfo({"byte": "int8", "char": "uint8"}.get(name, name))
        return int(rng.integers(info.min, info.max, dtype=info.dtype, endpoint=True))

    made = {name: value(int(node), what) for name, (node, what) in store.fielddefs[kind][1]}
    if "float32" in OWN.get(kind, ""):  # no figure too large for it
        made = {n: 1.5 if isinstance(v, float) and abs(v) > 1e38 else v for n, v in made.items()}
    return store.types[kind](**made)


def written(store: Any, encoding: Encoding, kind: str, message: Any) -> bytes:
    if encoding == "ros1":
        return bytes(store.serialize_ros1(message, kind))
    return bytes(store.serialize_cdr(message, kind))


def type_of(store: Any, encoding: Encoding, kind: str) -> tuple[MessageType, list[int]]:
    calls = [0]
    whole = store.deserialize_ros1 if encoding == "ros1" else store.deserialize_cdr

    def unpack(data: bytes) -> Any:
        calls[0] += 1
        return whole(data, kind)

    return MessageType(kind, encoding, store.fielddefs, unpack), calls


def oracle(type_: MessageType, row: Any, messages: list[bytes], width: int) -> np.ndarray:
    rows = []
    for data in messages:
        unpacked = type_.unpacked(data)
        with np.errstate(all="ignore"):
            rows.append([np.nan] * width if unpacked is None else [float(v) for v in row(unpacked)])
    return np.array(rows).T


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
@pytest.mark.parametrize("kind", KINDS)
def test_together_as_one_by_one(kind: str, encoding: Encoding) -> None:
    """Of every type that is read; texts of several lengths, foreign and cut bytes among them."""
    store, rng = store_of(encoding), np.random.default_rng(KINDS.index(kind))
    made = [drawn(store, kind, rng, TEXTS[rng.integers(4) if k % 5 == 0 else 0], k % 7 // 6)
            for k in range(120)]  # fmt: skip
    messages = [written(store, encoding, kind, message) for message in made]
    messages[30] = messages[30][:-9]
    messages[60] = messages[60] + bytes(9)
    messages[90] = bytes(rng.integers(0, 256, len(messages[90]), dtype=np.uint8))
    type_, calls = type_of(store, encoding, kind)
    first = drawn(store, kind, np.random.default_rng(1000), "map", 0)
    meaning = meaning_of("/a", kind, first)
    assert meaning is not None
    width = len(meaning.columns)
    assert width
    expected = oracle(type_, meaning.row, messages, width)
    calls[0] = 0
    figures = FiguresOf(meaning, type_)
    found = np.concatenate([figures.table(messages[:50]), figures.table(messages[50:])], axis=1)
    np.testing.assert_array_equal(found.view(np.uint64), expected.view(np.uint64))
    assert calls[0] <= 45  # those of rare shapes alone


def test_messages_of_one_shape_are_unpacked_once() -> None:
    store, rng, kind = store_of("cdr"), np.random.default_rng(3), "nav_msgs/msg/Odometry"
    messages = [written(store, "cdr", kind, drawn(store, kind, rng, "odom", 0)) for _ in range(500)]
    type_, calls = type_of(store, "cdr", kind)
    meaning = meaning_of("/a", kind, type_.unpacked(messages[0]))
    assert meaning is not None
    FiguresOf(meaning, type_).table(messages)
    assert calls[0] == 2  # here, and to hold the first shape against


def test_messages_of_ever_other_shapes_cost_no_more_than_unpacking() -> None:
    store, rng, kind = store_of("ros1"), np.random.default_rng(4), "sensor_msgs/msg/NavSatFix"
    messages = [
        written(store, "ros1", kind, drawn(store, kind, rng, "x" * k, 0)) for k in range(60)
    ]
    type_, calls = type_of(store, "ros1", kind)
    meaning = meaning_of("/a", kind, type_.unpacked(messages[0]))
    assert meaning is not None
    figures = FiguresOf(meaning, type_)
    figures.table(messages)
    assert len(figures._shapes) == MOST_SHAPES
    assert calls[0] == 1 + 60


def test_the_other_byte_order_is_unpacked_by_the_library() -> None:
    store, rng, kind = store_of("cdr"), np.random.default_rng(5), "sensor_msgs/msg/Imu"
    made = [drawn(store, kind, rng, "imu", 0) for _ in range(20)]
    messages = [bytes(store.serialize_cdr(m, kind, little_endian=False)) for m in made]
    with pytest.raises(UnevenError):
        MessageForm(messages[0], store.fielddefs, kind, "cdr")
    type_, _ = type_of(store, "cdr", kind)
    meaning = meaning_of("/a", kind, made[0])
    assert meaning is not None
    expected = oracle(type_, meaning.row, messages, len(meaning.columns))
    found = FiguresOf(meaning, type_).table(messages)
    np.testing.assert_array_equal(found.view(np.uint64), expected.view(np.uint64))


def hostile() -> Iterator[tuple[str, str]]:
    """Definitions by the names of ROS whose fields are others."""
    header = "std_msgs/Header header\n"
    yield (
        "sensor_msgs/msg/NavSatFix",
        (
            header + "sensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\n"
            "float64 altitude\nfloat64[3] position_covariance\nuint8 position_covariance_type"
        ),
    )
    yield (
        "sensor_msgs/msg/NavSatFix",
        (
            header + "sensor_msgs/NavSatStatus status\nstring latitude\nstring longitude\n"
            "string altitude\nfloat64[9] position_covariance\nuint8 position_covariance_type"
        ),
    )
    yield "geometry_msgs/msg/PointStamped", header + "string point"
    yield "geometry_msgs/msg/QuaternionStamped", header + "geometry_msgs/Point quaternion"
    yield "sensor_msgs/msg/PointCloud2", header + "uint32 point_step\nstring fields"
    yield "sensor_msgs/msg/LaserScan", header + "string time_increment\nfloat32[] ranges"
    yield "livox_ros_driver/msg/CustomMsg", header + "string timebase\nfloat32[] points"


@pytest.mark.parametrize(("kind", "text"), list(hostile()))
def test_types_that_only_bear_the_names_of_known_ones_are_listed(
    tmp_path: Path, kind: str, text: str
) -> None:
    from rosbags.rosbag1 import Writer

    store = get_typestore(Stores.ROS1_NOETIC)
    del store.fielddefs[kind.replace("livox_ros_driver/msg/CustomMsg", "sensor_msgs/msg/Imu")]
    store.register(get_types_from_msg(text, kind))
    rng = np.random.default_rng(6)
    with Writer(tmp_path / "a.bag") as writer:
        topic = writer.add_connection("/a", kind, typestore=store)
        for k in range(30):
            message = drawn(store, kind, rng, "word", 2)
            writer.write(topic, k + 1, store.serialize_ros1(message, kind))
    recording = open_recording(tmp_path / "a.bag")
    (stream,) = recording.streams()
    assert stream.messages == 30
    assert sum(p.primary_ns.shape[0] for p in recording.samples("/a")) == 30


@pytest.mark.parametrize("write", [write_ros1, write_ros2])
def test_pieces_hold_every_message_once(tmp_path: Path, write: Any, monkeypatch: Any) -> None:
    from syncline_design.logs.readers import ros_recording, ros_rows

    made = flight(30.0)
    recording = open_recording(write(tmp_path / "bag", made))
    whole = list(recording.samples("/odom"))
    monkeypatch.setattr(ros_rows, "MOST_WAITING", 5_000)
    monkeypatch.setattr(ros_recording, "PIECE_ROWS", 37)
    pieces = list(recording.samples("/odom"))
    assert len(whole) == 1
    assert [p.primary_ns.shape[0] for p in pieces] == [37] * 8 + [4]
    for name, values in whole[0].columns.items():
        np.testing.assert_array_equal(np.concatenate([p.columns[name] for p in pieces]), values)
