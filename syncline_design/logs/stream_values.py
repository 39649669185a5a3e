"""A stream's samples in the package's conventions: SI, north-east-down, forward-right-down.

Every conversion is noted in words; nothing is turned, shifted or scaled silently.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any, Final, Literal

import numpy as np

from syncline_design.effects.kinematics import euler_to_rotation, rotate, rotation_to_euler
from syncline_design.effects.record import Array
from syncline_design.logs.columns import ATTITUDE, POSITION, RANGING, RATE, TARGET, VELOCITY
from syncline_design.logs.readers.stream import Body, Frame, Nanoseconds, Piece
from syncline_design.logs.refusals import refuse
from syncline_design.logs.roles import Offer
from syncline_design.logs.run_parts import pieces_of
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_places
from syncline_design.model.quantity import si_name, suffix_unit
from syncline_design.spec.log_block import LogChoice

MOST_ROWS: Final = 20_000_000
ENU_TO_NED: Final = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU_TO_FRD: Final = np.diag([1.0, -1.0, -1.0])
QUATERNION: Final = tuple(f"quaternion_{a}" for a in "wxyz")
XYZ: Final = tuple(f"position_{a}_m" for a in "xyz")
SPEED: Final = tuple(f"velocity_{a}_mps" for a in "xyz")
BODY_SPEED: Final = tuple(f"velocity_body_{a}_mps" for a in "xyz")
GLOBE: Final = ("latitude_rad", "longitude_rad")
ORIGIN: Final = ("origin_latitude_rad", "origin_longitude_rad", "origin_height_msl_m")
ASSUMED_FRAME: Final[Literal["enu"]] = "enu"
ASSUMED_BODY: Final[Literal["flu"]] = "flu"
HANGS: Final = -0.5  # mean of down of the body along down, below which it is upside down
_OTHER: Final[Mapping[Body, Literal["flu", "frd"]]] = {"flu": "frd", "frd": "flu"}
_FRAMES: Final = {"enu": "east, north, up", "ned": "north, east, down", "utm": "UTM"}
_BODIES: Final = {"flu": "forward, left, up", "frd": "forward, right, down"}


@dataclass(slots=True)
class StreamValues:
    """A stream's samples: stamps as in the file, canonical SI columns, and what was done to them.

    latitude_rad, longitude_rad, height_m stand as they are; everything else is local.  assumed:
    axes that neither the log nor the spec tells.  shown, shown_body: what other places, and gravity
    on the way, tell instead; shown_body is None where the body axes are told.
    """

    offer: Offer
    time_ns: Nanoseconds
    columns: dict[str, Array]
    notes: list[str] = field(default_factory=list)
    origin: Array | None = None  # latitude, longitude [rad], height [m] of the local frame
    assumed: bool = False
    shown: Literal["ned"] | None = None
    shown_body: Literal["flu", "frd"] | None = None

    def has(self, names: Sequence[str]) -> bool:
        return all(name in self.columns for name in names)

    def vectors(self, names: Sequence[str]) -> Array:
        return np.stack([self.columns[name] for name in names], axis=1)

    def put(self, names: Sequence[str], vectors: Array) -> None:
        self.columns |= {name: vectors[:, k] for k, name in enumerate(names)}

    def note(self, words: str) -> None:
        """Say something of this stream, once."""
        said = f"{self.offer.name}: {words}"
        if said not in self.notes:
            self.notes.append(said)


def all_values(offers: Sequence[Offer], choice: LogChoice) -> list[StreamValues]:
    """The samples of some streams, made canonical; every recording is gone through once."""
    recordings = {id(offer.recording): offer.recording for offer in offers}
    held: dict[tuple[int, str], list[Piece]] = {}
    for key, recording in recordings.items():
        names = [offer.name for offer in offers if id(offer.recording) == key]
        rows = 0
        for name, piece in pieces_of(recording, names):
            rows += int(piece.primary_ns.shape[0])
            if rows > MOST_ROWS:
                raise refuse(recording.path, "too many rows", expected=f"at most {MOST_ROWS}")
            held.setdefault((key, name), []).append(piece)
    return [
        values_of(offer, held.get((id(offer.recording), offer.name), []), choice)
        for offer in offers
    ]


def values_of(offer: Offer, pieces: Sequence[Piece], choice: LogChoice) -> StreamValues:
    """All samples of a stream, made canonical."""
    time_ns, raw = _collected(offer, pieces)
    columns: dict[str, Any] = {}
    for name, values in raw.items():
        if name.startswith("clock_"):  # whole nanoseconds stay whole
            columns[name] = values
            continue
        factor = suffix_unit(name)[0]
        columns[si_name(name)] = values * factor if factor != 1.0 else values
    found = StreamValues(offer, time_ns, columns)
    for words in offer.stream.notes:  # what its reader did
        found.note(words)
    frame, body = _axes(found, choice)
    turn, body = _attitude(found, frame, body)
    _position(found, frame)
    _velocity(found, frame, body, turn)
    _rates(found, body)
    if any(name.endswith("_deg") or name.endswith("_degps") for name in raw):
        found.note("degrees were made radians")
    kept = {*GLOBE, "height_m", "height_msl_m", "separation_m", *POSITION, *ATTITUDE, *VELOCITY}
    kept |= {*RATE, *RANGING, *TARGET, "target_id", *(f"target_{g}" for g in (*GLOBE, "height_m"))}
    kept |= {"clock_utc_ns"}
    if "points" in offer.stream.quantity:
        kept |= {"utm_zone", *(f"point_{a}_m" for a in "xyz")}
        label = choice.columns.get("target_id", "")
        if label in found.columns:
            found.columns["target_id"] = found.columns[label].astype(float)
            found.note(f"{label} tells which target a point is of, as the spec says")
    found.columns = {name: v for name, v in found.columns.items() if name in kept}
    return found


def _collected(offer: Offer, pieces: Sequence[Piece]) -> tuple[Nanoseconds, dict[str, Any]]:
    if not pieces:
        raise refuse(offer.path, f"{offer.name} has no messages")
    names = list(dict.fromkeys(name for one in pieces for name in one.columns))
    whole = {
        name: np.concatenate([one.columns[name] for one in pieces])
        for name in names
        if all(name in one.columns for one in pieces)
    }
    with np.errstate(
        invalid="ignore"
    ):  # damaged bytes may be signalling NaN: they become quiet ones
        figures = {n: v if v.dtype.kind == "i" else v.astype(float) for n, v in whole.items()}
    return np.concatenate([one.primary_ns for one in pieces]), figures


def _axes(values: StreamValues, choice: LogChoice) -> tuple[Frame, Body]:
    """Frame and body by the stream, else by the spec, else assumed and said."""
    stream = values.offer.stream
    frame, body = stream.frame, stream.body
    local = any(name in values.columns for name in (*XYZ, *SPEED, *QUATERNION))
    if frame == "unknown" and local:
        frame = choice.frame or ASSUMED_FRAME
        if choice.frame is None:
            values.assumed = True
            values.note(f"the frame is not told: {_FRAMES[frame]} is assumed (log: {{frame: ...}})")
    turned = any(n in values.columns for n in (*QUATERNION, *BODY_SPEED, *RATE))
    if body == "unknown" and turned:
        body = choice.body or ASSUMED_BODY
        if choice.body is None:
            values.assumed = True
            values.shown_body = body
    return frame, body


def _to_ned(frame: Frame) -> Array:
    return ENU_TO_NED if frame in ("enu", "utm") else np.eye(3)


def _to_frd(body: Body) -> Array:
    return FLU_TO_FRD if body == "flu" else np.eye(3)


def hangs(turn: Array) -> bool:
    """Whether a body is upside down on the way, by its axes in north, east, down, (n, 3, 3)."""
    down = turn[:, 2, 2]
    known = down[np.isfinite(down)]
    return bool(known.shape[0]) and float(np.mean(known)) < HANGS


def rolled_over(values: StreamValues) -> None:
    """Attitudes and rates by the other body axes: right for left, and down for up."""
    values.shown_body = _OTHER[values.shown_body or ASSUMED_BODY]
    if values.has(ATTITUDE):
        turned = euler_to_rotation(values.vectors(ATTITUDE)) @ FLU_TO_FRD
        values.put(ATTITUDE, rotation_to_euler(turned))
    if values.has(RATE):
        values.put(RATE, values.vectors(RATE) @ FLU_TO_FRD)


def _attitude(values: StreamValues, frame: Frame, body: Body) -> tuple[Array | None, Body]:
    """Roll, pitch, yaw from a quaternion; gives the rotations body to NED, where they are told, and
    the body axes: of those that nothing tells the ones in which it is upright."""
    turn: Array | None = None
    if values.has(QUATERNION):
        from scipy.spatial.transform import Rotation

        raw = values.vectors(QUATERNION)
        known = np.isfinite(raw).all(axis=1) & (np.linalg.norm(raw, axis=1) > 0.5)
        whole = np.where(known[:, None], raw, np.array([1.0, 0.0, 0.0, 0.0]))
        given = Rotation.from_quat(whole[:, [1, 2, 3, 0]]).as_matrix()
        turn = np.where(known[:, None, None], _to_ned(frame) @ given @ _to_frd(body), np.nan)
        if values.shown_body is not None and hangs(turn):
            turn = turn @ FLU_TO_FRD
            body = values.shown_body = _OTHER[values.shown_body]
        values.put(ATTITUDE, rotation_to_euler(turn))
        shown = "wgs84" if frame == "wgs84" else _FRAMES.get(frame, frame)
        values.note(f"quaternions (body {_BODIES[body]}, frame {shown}) were made roll, pitch, yaw")
        if not np.all(known):
            values.note(f"{int(np.sum(~known))} quaternions are none (zero or not finite)")
    elif values.has(ATTITUDE):
        turn = euler_to_rotation(values.vectors(ATTITUDE))
    elif "heading_rad" in values.columns:
        values.columns.setdefault(ATTITUDE[2], values.columns["heading_rad"])
        values.note("the heading was read as yaw")
    if values.shown_body is not None:
        values.note(body_untold(values))
    return turn, body


def body_untold(values: StreamValues) -> str:
    """That nothing tells the body axes, and what they are taken for."""
    body = values.shown_body or ASSUMED_BODY
    if body == ASSUMED_BODY:
        return f"the body axes are not told: {_BODIES[body]} is assumed (log: {{body: ...}})"
    return (
        f"the body axes are not told: as {_BODIES[ASSUMED_BODY]} it would be upside down, taken "
        f"as {_BODIES[body]} (log: {{body: {body}}})"
    )


def _position(values: StreamValues, frame: Frame) -> None:
    if not values.has(XYZ):
        return
    values.put(POSITION, values.vectors(XYZ) @ _to_ned(frame).T)
    if frame != "ned":
        values.note(f"positions in {_FRAMES.get(frame, frame)} were made north, east, down")
    if values.has(ORIGIN):
        place = values.vectors(ORIGIN)
        known = place[np.isfinite(place).all(axis=1)]
        if known.shape[0]:
            values.origin = np.median(known, axis=0)
            moved = float(np.max(np.ptp(known[:, :2], axis=0))) * 6.4e6
            if moved > 0.1:
                values.note(f"its origin moves by up to {to_places(moved, 1)} m within the log")


def _velocity(values: StreamValues, frame: Frame, body: Body, turn: Array | None) -> None:
    if values.has(VELOCITY):
        return
    if values.has(BODY_SPEED) and turn is not None:
        own = values.vectors(BODY_SPEED) @ _to_frd(body).T
        values.put(VELOCITY, rotate(turn, own))
        values.note("velocities in the body were turned by the stream's own attitude")
    elif values.has(SPEED):
        values.put(VELOCITY, values.vectors(SPEED) @ _to_ned(frame).T)
        values.note(f"velocities in {_FRAMES.get(frame, frame)} were made north, east, down")


def _rates(values: StreamValues, body: Body) -> None:
    """Body rates in forward, right, down; figures that nobody filled in are none."""
    if values.has(RATE) and values.has(ATTITUDE) and not np.any(values.vectors(RATE)):
        for name in RATE:
            del values.columns[name]
        values.note("body rates are zero throughout: not filled in, told by attitudes instead")
    if values.has(RATE) and body == "flu":
        values.put(RATE, values.vectors(RATE) @ FLU_TO_FRD.T)
        values.note("body rates (forward, left, up) were made forward, right, down")


def height_of(values: StreamValues, separation_m: float | None) -> bool | None:
    """Give `height_m` above the ellipsoid, if the log knows it; whether it does, None without one.

    separation_m: geoid above ellipsoid, where another stream of the log tells it.
    """
    columns = values.columns
    if "height_m" in columns and np.any(np.isfinite(columns["height_m"])):
        return True
    if "height_msl_m" not in columns:
        return None
    own = columns.get("separation_m")
    if own is not None and np.any(np.isfinite(own)):
        columns["height_m"] = columns["height_msl_m"] + own
        values.note("heights above sea level plus the log's separation are above the ellipsoid")
        return True
    if separation_m is not None:
        columns["height_m"] = columns["height_msl_m"] + separation_m
        words = (
            f"heights above sea level plus {to_places(separation_m, 2)} m, as another "
            f"stream tells it"
        )
        values.note(f"{words}, are above the ellipsoid")
        return True
    columns["height_m"] = columns["height_msl_m"]
    values.note("heights are above sea level: the log does not know the ellipsoid's")
    return False


def separation_of(several: Sequence[StreamValues]) -> float | None:
    """Geoid above ellipsoid [m] where one stream has both heights."""
    for one in several:
        columns: Mapping[str, Array] = one.columns
        if "height_m" in columns and "height_msl_m" in columns:
            apart = columns["height_m"] - columns["height_msl_m"]
            known = apart[np.isfinite(apart)]
            if known.shape[0]:
                return float(np.median(known))
    return None
