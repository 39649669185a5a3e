"""What the messages of ROS measure: columns with unit, frame and body, by type.

Conventions: REP 103 (x forward, y left, z up; quaternions x, y, z, w; local frames east, north,
up), REP 105 (map and odom have an origin of their own), REP 145 (IMU), and the definitions of
sensor_msgs, nav_msgs and geometry_msgs.  Twists of Odometry are in child_frame_id, the body.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from syncline_design.logs.readers.stream import Body, Frame, StaticPose
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

Row = tuple[Any, ...]  # figures of a message, or of many, each as an array
NAN: Final = math.nan
PLACE: Final = ("position_x_m", "position_y_m", "position_z_m")
TURN: Final = ("quaternion_w", "quaternion_x", "quaternion_y", "quaternion_z")
RATE: Final = ("rate_x_radps", "rate_y_radps", "rate_z_radps")
PUSH: Final = ("acceleration_x_mps2", "acceleration_y_mps2", "acceleration_z_mps2")
BODY_SPEED: Final = ("velocity_body_x_mps", "velocity_body_y_mps", "velocity_body_z_mps")
SPEED: Final = ("velocity_x_mps", "velocity_y_mps", "velocity_z_mps")
NORTH_SPEED: Final = ("velocity_north_mps", "velocity_east_mps", "velocity_down_mps")
GLOBE: Final = ("latitude_deg", "longitude_deg", "height_m")
SPREAD: Final = ("variance_east_m2", "variance_north_m2", "variance_up_m2")
GEODETIC_FRAMES: Final = ("earth", "wgs84", "ecef")
LEAST_TURN: Final = 0.5  # norm of a quaternion that is one
UNKNOWN_COVARIANCE: Final = -1.0
NO_FIX: Final = -1

XYZW: Final = "quaternions are x, y, z, w in the message"
FLU: Final = "body forward, left, up (REP 103)"
MAP: Final = "east, north, up (REP 103); where its zero lies on Earth the log does not say"


@dataclass(frozen=True, slots=True)
class TopicMeaning:
    """How the messages of one topic are read."""

    quantity: tuple[str, ...]
    columns: tuple[str, ...]
    row: Callable[[Any], Row]
    frame: Frame = "unknown"
    body: Body = "unknown"
    notes: tuple[str, ...] = ()
    is_cloud: bool = False
    static: tuple[StaticPose, ...] = ()


def has_meaning(topic: str, kind: str) -> bool:
    """Whether messages of this kind are unpacked at all."""
    return _maker(topic, kind) is not None


def meaning_of(topic: str, kind: str, first: Any) -> TopicMeaning | None:
    """By type, with what the first message says of its frame; None for other types."""
    make = _maker(topic, kind)
    try:
        found = None if make is None else make(first)
        with np.errstate(all="ignore"):
            fits = found is None or len(np.array(found.row(first), float)) == len(found.columns)
        return found if fits else None
    except (AttributeError, TypeError, ValueError, IndexError, KeyError):
        return None  # a type of that name with other fields


def _turn(q: Any) -> Row:
    """A quaternion as w, x, y, z of length one; NaN where it is none."""
    norm = np.sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z)
    norm = np.where(norm > LEAST_TURN, norm, NAN)
    return q.w / norm, q.x / norm, q.y / norm, q.z / norm


def _vector(v: Any) -> Row:
    return v.x, v.y, v.z


def _imu(first: Any) -> TopicMeaning:
    known = first.orientation_covariance[0] != UNKNOWN_COVARIANCE
    known = known and math.isfinite(_turn(first.orientation)[0])
    turned = ("attitude",) if known else ()

    def row(m: Any) -> Row:
        turn = _turn(m.orientation) if known else ()
        return (*turn, *_vector(m.angular_velocity), *_vector(m.linear_acceleration))

    said = (XYZW, FLU, "orientation against east, north, up (REP 145)") if known else (FLU,)
    columns = (*(TURN if known else ()), *RATE, *PUSH)
    return TopicMeaning((*turned, "rate", "acceleration"), columns, row, "enu", "flu", said)


def _odometry(first: Any) -> TopicMeaning:
    frame, said = _frame_of(first.header.frame_id, first.pose.pose.position)
    speeds = first.twist.twist
    moving = first.twist.covariance[0] != UNKNOWN_COVARIANCE
    rates = any(v != 0.0 for v in (*_vector(speeds.linear), *_vector(speeds.angular)))

    def row(m: Any) -> Row:
        pose, twist = m.pose.pose, m.twist.twist
        turned = (*_vector(pose.position), *_turn(pose.orientation))
        return (*turned, *_vector(twist.linear), *_vector(twist.angular))

    child = str(getattr(first, "child_frame_id", "")) or "the body"
    notes = (XYZW, FLU, f"twist is in {child[:60]}, the body", said)
    quantity = ("position", "attitude", *(("velocity", "rate") if moving or rates else ()))
    return TopicMeaning(quantity, (*PLACE, *TURN, *BODY_SPEED, *RATE), row, frame, "flu", notes)


def _frame_of(frame_id: str, place: Any) -> tuple[Frame, str]:
    """By the frame's name, and by size: eastings and northings are not of a local frame."""
    name = str(frame_id).strip("/").lower()
    shown = f"frame {str(frame_id)[:60]!r}"
    if "utm" in name or (1e5 <= abs(place.x) < 1e6 and 1e6 < abs(place.y) < 1.1e7):
        return "utm", f"{shown}: eastings and northings, by name or size; the zone is not told"
    if name in GEODETIC_FRAMES:
        return "unknown", f"{shown}: about the Earth's centre"
    if "ned" in name.split("_"):
        return "ned", f"{shown}: north, east, down by its name"
    return "enu", f"{shown}: {MAP}"


def _pose_like(pick: Callable[[Any], Any]) -> Callable[[Any], TopicMeaning]:
    """Pose(Stamped, WithCovarianceStamped): place and turn of the body in the header's frame."""

    def make(first: Any) -> TopicMeaning:
        frame, said = _frame_of(first.header.frame_id, pick(first).position)

        def row(m: Any) -> Row:
            pose = pick(m)
            return (*_vector(pose.position), *_turn(pose.orientation))

        notes = (XYZW, FLU, said)
        return TopicMeaning(("position", "attitude"), (*PLACE, *TURN), row, frame, "flu", notes)

    return make


def _transform(first: Any) -> TopicMeaning:
    frame, said = _frame_of(first.header.frame_id, first.transform.translation)

    def row(m: Any) -> Row:
        return (*_vector(m.transform.translation), *_turn(m.transform.rotation))

    return TopicMeaning(
        ("position", "attitude"), (*PLACE, *TURN), row, frame, "flu", (XYZW, FLU, said)
    )


def _point(first: Any) -> TopicMeaning:
    frame, said = _frame_of(first.header.frame_id, first.point)
    return TopicMeaning(("position",), PLACE, lambda m: _vector(m.point), frame, notes=(said,))


def _quaternion(first: Any) -> TopicMeaning:
    notes = (XYZW, FLU, MAP)
    return TopicMeaning(("attitude",), TURN, lambda m: _turn(m.quaternion), "enu", "flu", notes)


def _twist_like(pick: Callable[[Any], Any]) -> Callable[[Any], TopicMeaning]:
    """Twist(Stamped, WithCovarianceStamped): of the body where the frame is the body's own."""

    def make(first: Any) -> TopicMeaning:
        name = str(first.header.frame_id).lower()
        own = any(word in name for word in ("base", "body", "imu", "link")) and "local" not in name
        where = "the body" if own else "east, north, up"
        note = f"twist is in frame {name[:60]!r}, taken as {where}"

        def row(m: Any) -> Row:
            twist = pick(m)
            return (*_vector(twist.linear), *_vector(twist.angular))

        columns = (*(BODY_SPEED if own else SPEED), *RATE)
        return TopicMeaning(("velocity", "rate"), columns, row, "enu", "flu", (note, FLU))

    return make


def _fix(first: Any) -> TopicMeaning:
    """NavSatFix: altitude is above the ellipsoid by definition; no fix, no position."""

    def row(m: Any) -> Row:
        spread = (m.position_covariance[0], m.position_covariance[4], m.position_covariance[8])
        known = m.position_covariance_type != 0
        found = m.status.status > NO_FIX
        place = [np.where(found, v, NAN) for v in (m.latitude, m.longitude, m.altitude)]
        return (*place, *(np.where(known, v, NAN) for v in spread), m.status.status)

    notes = ("heights are above the WGS 84 ellipsoid (sensor_msgs/NavSatFix)",)
    return TopicMeaning(("position",), (*GLOBE, *SPREAD, "fix_status"), row, "wgs84", notes=notes)


def _gps_fix(first: Any) -> TopicMeaning:
    """GPSFix of gps_common: track is the course over ground, not the heading."""

    def row(m: Any) -> Row:
        return (m.latitude, m.longitude, m.altitude, m.track, m.speed, m.climb, m.time)

    columns = (*GLOBE, "course_deg", "speed_mps", "climb_mps", "clock_gnss_s")
    notes = ("course_deg is that over ground, not the heading",)
    return TopicMeaning(("position", "clock"), columns, row, "wgs84", notes=notes)


def _inspva(first: Any) -> TopicMeaning:
    """INSPVA(X) of NovAtel: azimuth from north, clockwise; body right, forward, up there."""
    undulated = hasattr(first, "undulation")

    def row(m: Any) -> Row:
        height = m.height + (m.undulation if undulated else 0.0)
        place = (m.latitude, m.longitude, height)
        speed = (m.north_velocity, m.east_velocity, -m.up_velocity)
        return (*place, *speed, m.roll, m.pitch, m.azimuth, *_gps_time(m))

    columns = (*GLOBE, *NORTH_SPEED, "roll_deg", "pitch_deg", "yaw_deg", "gps_week", "gps_week_s")
    height = "height above sea level plus undulation" if undulated else "height above the ellipsoid"
    notes = (
        f"{height} (NovAtel)",
        "azimuth is read as yaw",
        "GPS week and second beside the stamp",
    )
    quantity = ("position", "attitude", "velocity", "clock")
    return TopicMeaning(quantity, columns, row, "wgs84", "frd", notes)


def _bestpos(first: Any) -> TopicMeaning:
    def row(m: Any) -> Row:
        place = (m.lat, m.lon, m.hgt + m.undulation)
        return (*place, m.lat_stdev, m.lon_stdev, m.hgt_stdev, *_gps_time(m))

    columns = (*GLOBE, "sigma_north_m", "sigma_east_m", "sigma_up_m", "gps_week", "gps_week_s")
    notes = ("height above sea level plus undulation (NovAtel)",)
    return TopicMeaning(("position", "clock"), columns, row, "wgs84", notes=notes)


def _gps_time(m: Any) -> Row:
    header = m.nov_header
    return header.gps_week_number, header.gps_week_milliseconds * 1e-3


def _cloud(first: Any) -> TopicMeaning:
    notes = ("points are not unpacked, but for their times",)
    return TopicMeaning(("points",), (), lambda m: (), "unknown", "unknown", notes, is_cloud=True)


def _static(first: Any) -> TopicMeaning:
    """What stands still on the vehicle: lever arms, said one by one."""
    some = list(first.transforms)[:40]
    poses = tuple(_static_pose(one) for one in some)
    return TopicMeaning((), (), lambda m: (), notes=tuple(_arm(one) for one in some), static=poses)


def _static_pose(one: Any) -> StaticPose:
    q = one.transform.rotation
    x, y, z = _vector(one.transform.translation)
    axes = float(q.x), float(q.y), float(q.z), float(q.w)
    return StaticPose(str(one.child_frame_id), str(one.header.frame_id), (x, y, z), axes)


def _arm(one: Any) -> str:
    x, y, z = _vector(one.transform.translation)
    place = f"x {to_digits(x, 4)} m, y {to_digits(y, 4)} m, z {to_digits(z, 4)} m"
    child, parent = str(one.child_frame_id)[:60], str(one.header.frame_id)[:60]
    return f"lever arm of {child} in {parent} (forward, left, up): {place}"


_MAKERS: Final[dict[str, Callable[[Any], TopicMeaning]]] = {
    "sensor_msgs/msg/Imu": _imu,
    "nav_msgs/msg/Odometry": _odometry,
    "geometry_msgs/msg/PoseStamped": _pose_like(lambda m: m.pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": _pose_like(lambda m: m.pose.pose),
    "geometry_msgs/msg/TransformStamped": _transform,
    "geometry_msgs/msg/PointStamped": _point,
    "geometry_msgs/msg/QuaternionStamped": _quaternion,
    "geometry_msgs/msg/TwistStamped": _twist_like(lambda m: m.twist),
    "geometry_msgs/msg/TwistWithCovarianceStamped": _twist_like(lambda m: m.twist.twist),
    "sensor_msgs/msg/NavSatFix": _fix,
    "gps_common/msg/GPSFix": _gps_fix,
    "gps_msgs/msg/GPSFix": _gps_fix,
    "novatel_oem7_msgs/msg/INSPVA": _inspva,
    "novatel_oem7_msgs/msg/INSPVAX": _inspva,
    "novatel_oem7_msgs/msg/BESTPOS": _bestpos,
    "sensor_msgs/msg/PointCloud2": _cloud,
    "sensor_msgs/msg/LaserScan": _cloud,
    "livox_ros_driver/msg/CustomMsg": _cloud,
    "livox_ros_driver2/msg/CustomMsg": _cloud,
}


def _maker(topic: str, kind: str) -> Callable[[Any], TopicMeaning] | None:
    static = topic.rpartition("/")[2] == "tf_static" and kind.lower().endswith("tfmessage")
    return _static if static else _MAKERS.get(kind)
