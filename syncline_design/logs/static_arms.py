"""Lever arms that a log states (`/tf_static`), in the body of the vehicle, beside the spec's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.logs.readers.stream import StaticPose
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record
from syncline_design.model.figure_text import to_places
from syncline_design.model.roles import ROLES
from syncline_design.spec.spec import Spec

BODIES: Final = ("base_link", "base", "body", "vehicle", "base_footprint")  # ROS REP 105
# parts of a frame's name that tell which role stands there
WORDS: Final = {
    "position": ("gps", "gnss", "navsat", "antenna", "rtk", "prism"),
    "ranging": ("lidar", "laser", "velodyne", "ouster", "hesai", "livox", "scan", "sonar", "radar",
                "camera"),
    "attitude": ("imu", "ins", "ahrs", "gyro"),
}  # fmt: skip
AGREES_M: Final = 0.01
FLU_TO_FRD: Final = np.array([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True)
class ArmBeside(Record):
    """A lever arm of the log, forward, right, down from the body's frame [m], and the spec's.

    role: of the spec, as `stage.role`, that the frame's name tells; None where it tells none or
    the spec gives no arm.  apart_m: how far the two are from one another.
    """

    frame: str
    body: str
    log_m: tuple[float, float, float]
    role: str | None
    spec_m: tuple[float, float, float] | None
    apart_m: float | None

    @property
    def agrees(self) -> bool:
        return self.apart_m is None or self.apart_m <= AGREES_M


def arms_beside(
    poses: Sequence[StaticPose], given: Mapping[str, tuple[float, float, float]]
) -> tuple[ArmBeside, ...]:
    """Every frame that stands still on the body; given: the spec's arms by `stage.role`."""
    body = _body(poses)
    found = []
    for name, place in sorted(_places(poses, body).items()):
        if name == body:
            continue
        log_m = tuple(float(v) + 0.0 for v in place * FLU_TO_FRD)
        role = _role(name, given)
        spec_m = None if role is None else given[role]
        apart = None if spec_m is None else float(np.linalg.norm(np.subtract(log_m, spec_m)))
        found.append(ArmBeside(name, body, log_m, role, spec_m, apart))  # type: ignore[arg-type]
    return tuple(found)


def spec_arms(spec: Spec) -> dict[str, tuple[float, float, float]]:
    """The spec's lever arms by `stage.role`."""
    found = {}
    for stage in spec.stages:
        for name in ROLES:
            role = stage.role(name)
            if role is not None and role.lever_arm is not None:
                x, y, z = (float(v) for v in role.lever_arm)
                found[f"{stage.name}.{name}"] = x, y, z
    return found


def arm_notes(beside: Sequence[ArmBeside]) -> tuple[str, ...]:
    """What a diagnosis says of arms that the log states for a role of the spec: where the two are
    apart, a lever arm that is found beside the spec's may be no more than that."""
    notes = []
    for one in beside:
        if one.role is None or one.apart_m is None:
            continue
        place = ", ".join(to_places(v, 3) for v in one.log_m)
        said = f"{one.frame}: the log's own lever arm of {one.role} is {place} m (forward, right, "
        if one.agrees:
            notes.append(f"{said}down from {one.body}), as the spec has it")
        else:
            notes.append(f"{said}down from {one.body}), {to_places(one.apart_m, 3)} m from the "
                         "spec's, which was used")  # fmt: skip
    return tuple(notes)


def _body(poses: Sequence[StaticPose]) -> str:
    """The frame that the vehicle is known by, else the one that no other holds."""
    names = {one.parent for one in poses} | {one.child for one in poses}
    plain = {name.strip("/").rpartition("/")[2].lower(): name for name in sorted(names)}
    for word in BODIES:
        if word in plain:
            return plain[word]
    children = {one.child for one in poses}
    return min((name for name in names if name not in children), default="")


def _places(poses: Sequence[StaticPose], body: str) -> dict[str, Array]:
    """Places of all frames that hang on the body, along the chain of transforms."""
    turns = {body: np.eye(3)}
    places = {body: np.zeros(3)}
    left = list(poses)
    while left:
        rest = []
        for one in left:
            if one.parent in places:
                places[one.child] = places[one.parent] + turns[one.parent] @ np.array(one.place_m)
                turns[one.child] = turns[one.parent] @ _matrix(one.quaternion)
            else:
                rest.append(one)
        if len(rest) == len(left):
            break  # hangs on nothing that is known
        left = rest
    return places


def _matrix(quaternion: tuple[float, float, float, float]) -> Array:
    """Of x, y, z, w; what is no turn turns nothing."""
    from scipy.spatial.transform import Rotation

    length = float(np.linalg.norm(quaternion))
    if not 0.5 < length < 2.0:
        return np.eye(3)
    matrix: Array = Rotation.from_quat(quaternion).as_matrix()
    return matrix


def _role(frame: str, given: Mapping[str, tuple[float, float, float]]) -> str | None:
    """The one role of the spec that the frame's name tells."""
    low = frame.lower()
    kinds = [kind for kind, words in WORDS.items() if any(word in low for word in words)]
    fitting = [role for role in given if kinds and role.rpartition(".")[2] == kinds[0]]
    return fitting[0] if len(fitting) == 1 else None
