"""One simulated flight, and writers of it in formats of others, with the formats' own libraries.

The flight: figures of eight about a place, at 10 Hz, attitude and rates with it; nothing of the
package is used.  Every writer follows the conventions of its format, not those of the package.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

ORIGIN = (47.3, 8.55, 460.0)  # degrees, degrees, metres above the ellipsoid
START_NS = 1_700_000_000_123_456_789
A, E2 = 6_378_137.0, 6.694_379_990_141_316e-3  # WGS 84


@dataclass(frozen=True)
class Flight:
    """Truth at stamps: NED places and velocities, rotations body (FRD) to NED, body rates."""

    stamp_ns: np.ndarray
    place: np.ndarray
    velocity: np.ndarray
    turn: Rotation
    rate: np.ndarray

    def __len__(self) -> int:
        return len(self.stamp_ns)


def flight(
    seconds: float = 60.0, hertz: float = 10.0, late_s: float = 0.0, noise_m: float = 0.0
) -> Flight:
    """late_s: how much older the state is than its stamp; noise_m: white, of the places."""
    count = round(seconds * hertz)
    since = np.arange(count) / hertz
    t = since - late_s
    stamp = START_NS + np.round(since * 1e9).astype(np.int64)

    def place_at(u: np.ndarray) -> np.ndarray:
        return np.stack(
            [60 * np.sin(0.11 * u), 45 * np.sin(0.22 * u), -40 + 6 * np.sin(0.31 * u)], axis=1
        )

    def turn_at(u: np.ndarray) -> Rotation:
        yaw = 0.9 * np.sin(0.23 * u) + 0.05 * u
        euler = np.stack([yaw, 0.12 * np.sin(0.7 * u), 0.15 * np.cos(0.5 * u)], axis=1)
        return Rotation.from_euler("ZYX", euler)

    h = 1e-4
    velocity = (place_at(t + h) - place_at(t - h)) / (2 * h)
    rate = (turn_at(t - h).inv() * turn_at(t + h)).as_rotvec() / (2 * h)
    scatter = noise_m * np.random.default_rng(5).standard_normal((count, 3))
    return Flight(stamp, place_at(t) + scatter, velocity, turn_at(t), rate)


def geodetic(ned: np.ndarray) -> np.ndarray:
    """Latitude, longitude [deg], height [m] by Earth-centred coordinates (Bowring, iterated)."""
    lat0, lon0 = np.radians(ORIGIN[:2])
    n0 = A / np.sqrt(1 - E2 * np.sin(lat0) ** 2)
    r0 = np.array(
        [
            (n0 + ORIGIN[2]) * np.cos(lat0) * np.cos(lon0),
            (n0 + ORIGIN[2]) * np.cos(lat0) * np.sin(lon0),
            (n0 * (1 - E2) + ORIGIN[2]) * np.sin(lat0),
        ]
    )
    north = np.array([-np.sin(lat0) * np.cos(lon0), -np.sin(lat0) * np.sin(lon0), np.cos(lat0)])
    east = np.array([-np.sin(lon0), np.cos(lon0), 0.0])
    down = -np.array([np.cos(lat0) * np.cos(lon0), np.cos(lat0) * np.sin(lon0), np.sin(lat0)])
    x, y, z = (r0 + ned @ np.stack([north, east, down])).T
    p = np.hypot(x, y)
    lat = np.arctan2(z, p * (1 - E2))
    for _ in range(8):
        n = A / np.sqrt(1 - E2 * np.sin(lat) ** 2)
        height = p / np.cos(lat) - n
        lat = np.arctan2(z, p * (1 - E2 * n / (n + height)))
    return np.stack([np.degrees(lat), np.degrees(np.arctan2(y, x)), height], axis=1)


TO_ENU = Rotation.from_matrix([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
TO_FLU = Rotation.from_matrix(np.diag([1.0, -1.0, -1.0]))


def ros_quaternion(turn: Rotation) -> np.ndarray:
    """x, y, z, w of body (forward, left, up) to east, north, up."""
    return (TO_ENU * turn * TO_FLU.inv()).as_quat()


def ros_messages(store, made: Flight, seq: bool, fixes: Flight | None = None) -> list:  # type: ignore[no-untyped-def]
    """(topic, type, log time, message) of a NavSatFix, an Imu and an Odometry a stamp.

    fixes: what the receiver says, where that is another state than the truth.
    """
    types = store.types
    header = types["std_msgs/msg/Header"]
    time = types["builtin_interfaces/msg/Time"]
    vector, point = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Point"]
    quaternion = types["geometry_msgs/msg/Quaternion"]
    globe = geodetic((fixes or made).place)
    turned = ros_quaternion(made.turn)
    flu = made.rate * np.array([1.0, -1.0, -1.0])
    enu = TO_ENU.apply(made.place)
    forward = made.turn.inv().apply(made.velocity) * np.array([1.0, -1.0, -1.0])
    found = []
    for k in range(len(made)):
        ns = int(made.stamp_ns[k])

        def head(frame: str, ns: int = ns, k: int = k):  # type: ignore[no-untyped-def]
            stamp = time(sec=ns // 10**9, nanosec=ns % 10**9)
            return header(**({"seq": k} if seq else {}), stamp=stamp, frame_id=frame)

        late = ns + 4_000_000
        q = quaternion(*(float(v) for v in turned[k]))
        nine = np.zeros(9)
        status = types["sensor_msgs/msg/NavSatStatus"](status=0, service=1)
        fix = types["sensor_msgs/msg/NavSatFix"](
            header=head("gps"), status=status, latitude=float(globe[k, 0]),
            longitude=float(globe[k, 1]), altitude=float(globe[k, 2]),
            position_covariance=nine, position_covariance_type=0,
        )  # fmt: skip
        imu = types["sensor_msgs/msg/Imu"](
            header=head("imu"), orientation=q, orientation_covariance=nine,
            angular_velocity=vector(*map(float, flu[k])), angular_velocity_covariance=nine,
            linear_acceleration=vector(0.0, 0.0, 9.81), linear_acceleration_covariance=nine,
        )  # fmt: skip
        pose = types["geometry_msgs/msg/Pose"](position=point(*map(float, enu[k])), orientation=q)
        twist = types["geometry_msgs/msg/Twist"](
            linear=vector(*map(float, forward[k])), angular=vector(*map(float, flu[k]))
        )
        odometry = types["nav_msgs/msg/Odometry"](
            header=head("odom"), child_frame_id="base_link",
            pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=np.zeros(36)),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](
                twist=twist, covariance=np.zeros(36)
            ),
        )  # fmt: skip
        for topic, kind, message in (
            ("/fix", "sensor_msgs/msg/NavSatFix", fix),
            ("/imu", "sensor_msgs/msg/Imu", imu),
            ("/odom", "nav_msgs/msg/Odometry", odometry),
        ):
            found.append((topic, kind, late, message))
    return found


def write_ros1(path: Path, made: Flight, packing: str = "", fixes: Flight | None = None) -> Path:
    """packing: bz2, lz4 or nothing."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    writer = Writer(path)
    writer.chunk_threshold = 30_000
    if packing:
        writer.set_compression(Writer.CompressionFormat[packing.upper()])
    with writer:
        topics = {}
        for topic, kind, at, message in ros_messages(store, made, True, fixes):
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(topics[topic], at, store.serialize_ros1(message, kind))
    return path


def write_ros2(
    path: Path, made: Flight, mcap: bool = False, packing: str = "", fixes: Flight | None = None
) -> Path:
    """A folder; packing: message, file or nothing."""
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    plugin = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    writer = Writer(path, version=9, storage_plugin=plugin)
    if packing:
        writer.set_compression(CompressionMode[packing.upper()], CompressionFormat.ZSTD)
    with writer:
        topics = {}
        for topic, kind, at, message in ros_messages(store, made, False, fixes):
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(topics[topic], at, store.serialize_cdr(message, kind))
    return path


def write_mcap(
    path: Path, made: Flight, packing: str = "zstd", fixes: Flight | None = None
) -> Path:
    """By the mcap library's own writer, with ROS 2 messages as its support package writes them."""
    from mcap.writer import CompressionType, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    kinds = {"": CompressionType.NONE, "lz4": CompressionType.LZ4, "zstd": CompressionType.ZSTD}
    with path.open("wb") as file:
        writer = Writer(file, compression=kinds[packing], chunk_size=20_000)
        writer.start(profile="ros2", library="test")
        channels = {}
        for topic, kind, at, message in ros_messages(store, made, False, fixes):
            if topic not in channels:
                text, _ = store.generate_msgdef(kind, ros_version=2)
                schema = writer.register_schema(kind, "ros2msg", text.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            data = bytes(store.serialize_cdr(message, kind))
            writer.add_message(channels[topic], at, data, at - 1_000_000)
        writer.finish()
    return path


def ulog_record(kind: str, data: bytes) -> bytes:
    return struct.pack("<HB", len(data), ord(kind)) + data


ULOG_FORMATS = (
    "vehicle_attitude:uint64_t timestamp;uint64_t timestamp_sample;float[4] q;"
    "uint8_t quat_reset_counter;uint8_t[7] _padding0",
    "vehicle_gps_position:uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;"
    "int32_t alt;int32_t alt_ellipsoid;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;"
    "uint8_t fix_type;uint8_t[3] _padding0",
    "vehicle_local_position:uint64_t timestamp;uint64_t timestamp_sample;uint64_t ref_timestamp;"
    "double ref_lat;double ref_lon;float x;float y;float z;float vx;float vy;float vz;"
    "float ref_alt",
    "vehicle_angular_velocity:uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;"
    "uint8_t[4] _padding0",
)
BOOT_NS = 12_345_678_000
GEOID_M = 48.0


def ulog_bytes(made: Flight, fixes: Flight | None = None) -> bytes:
    """A flight log by the public description of the format, bytes made here."""
    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", BOOT_NS // 1000)]
    out.append(ulog_record("B", bytes(40)))
    out += [ulog_record("F", text.encode()) for text in ULOG_FORMATS]
    names = [text.partition(":")[0] for text in ULOG_FORMATS]
    for number, name in enumerate(names):
        out.append(ulog_record("A", struct.pack("<BH", 0, number) + name.encode()))
    globe = geodetic((fixes or made).place)
    turn = made.turn.as_quat()[:, [3, 0, 1, 2]]
    for k in range(len(made)):
        boot = (int(made.stamp_ns[k] - made.stamp_ns[0]) + BOOT_NS) // 1000
        utc = int(made.stamp_ns[k]) // 1000
        rows = (
            struct.pack("<QQ4fB", boot + 300, boot, *turn[k], 0),
            struct.pack(
                "<QQ4i3fB", boot, utc if k >= 3 else 0, *np.round(globe[k, :2] * 1e7).astype(int),
                round((globe[k, 2] - GEOID_M) * 1e3), round(globe[k, 2] * 1e3),
                *made.velocity[k], 3 if k >= 3 else 0,
            ),
            struct.pack(
                "<QQQdd7f", boot + 200, boot, boot, *ORIGIN[:2], *made.place[k], *made.velocity[k],
                ORIGIN[2] - GEOID_M,
            ),
            struct.pack("<QQ3f", boot + 100, boot, *made.rate[k]),
        )  # fmt: skip
        out += [ulog_record("D", struct.pack("<H", n) + row) for n, row in enumerate(rows)]
    return b"".join(out)


def write_ulog(path: Path, made: Flight, fixes: Flight | None = None) -> Path:
    path.write_bytes(ulog_bytes(made, fixes))
    return path
