"""Streams in one local frame and above one datum, whatever each of them is about."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from syncline_design.effects.kinematics import euler_to_rotation, rotation_to_euler
from syncline_design.effects.record import Array
from syncline_design.logs.columns import ATTITUDE, POSITION, VELOCITY
from syncline_design.logs.frame_fit import (
    Laid,
    LaidTrack,
    StillError,
    Turns,
    laid,
    mean_turn,
)
from syncline_design.logs.places import geodetic_to_ned
from syncline_design.logs.readers.stream import UNSET, Nanoseconds
from syncline_design.logs.refusals import refuse
from syncline_design.logs.roles import Part, Role
from syncline_design.logs.smoothing import velocity_of
from syncline_design.logs.stream_values import (
    ENU_TO_NED,
    GLOBE,
    StreamValues,
    body_untold,
    hangs,
    height_of,
    rolled_over,
    separation_of,
)
from syncline_design.model.figure_text import to_digits, to_places
from syncline_design.spec.log_block import LogChoice

WORTH_SAYING_RAD: Final = 1e-4
SWAPPED: Final = 0.3  # of what is left in the axes assumed, where others are the right ones
TILTED: Final = 0.3  # what a turn about any axis has to leave of the rest, where down is not told


def on_one_datum(
    several: Sequence[StreamValues], parts: Mapping[Role, Part], values: Mapping[int, StreamValues]
) -> None:
    """Heights of all places above the ellipsoid; left out where one is above sea level only."""
    separation = separation_of(several)
    roles: tuple[Role, ...] = ("position", "reference")
    placed = [values[id(parts[r].offer)] for r in roles if r in parts]
    told = {}
    for one in placed:
        told[id(one)] = height_of(one, separation) if one.has(GLOBE) else None
        if one.origin is not None:
            one.origin = one.origin + np.array([0.0, 0.0, separation or 0.0])
            told[id(one)] = separation is not None
            above = "as it is, though above sea level"
            if separation is not None:
                above = f"plus {to_places(separation, 2)} m"
            one.note(f"the height of its origin was taken {above}")
    if True in told.values() and False in told.values():
        for one in placed:
            if told[id(one)] is False:
                one.columns.pop("height_m", None)
                one.columns.pop(POSITION[2], None)
                one.note("its height is above sea level, the other's above the ellipsoid: not used")
    elif False in told.values() and None in told.values():
        for one in placed:
            if told[id(one)] is False:
                one.note(
                    "its height is above sea level, and so that of the spec's origin is taken "
                    "to be: where that is above the ellipsoid, down is off by the geoid's height"
                )


def in_one_frame(
    parts: Mapping[Role, Part], values: Mapping[int, StreamValues], choice: LogChoice, pair: bool,
    arm_m: Array,
) -> Turns | None:  # fmt: skip
    """Tested and reference in one local frame, where a stated origin does not see to it.

    arm_m: the spec's lever arm of the tested.  The turns that the one was laid onto the other by,
    beside a shift; None where nothing had to be laid.
    """
    tested = values[id(parts["position"].offer)]
    reference = values[id(parts["reference"].offer)]
    for one, other in ((tested, reference), (reference, tested)):
        if one.has(GLOBE) and not other.has(GLOBE):
            if other.origin is not None:
                _about(one, other.origin, f"the origin of {other.offer.name}")
                return None
            if choice.origin is not None:
                if other.assumed and choice.frame is None:
                    _with_fitting_axes(other, one, np.asarray(choice.origin, dtype=float))
                return None  # `places` makes it local there
            first = _first_place(one)
            _about(one, first, "its own first fix")
    if tested.has(POSITION[:2]) and reference.has(POSITION[:2]) and choice.origin is None:
        return _lay(reference, tested, pair, arm_m)
    return None


def _with_fitting_axes(one: StreamValues, globe: StreamValues, origin: Array) -> None:
    """Axes that nothing tells, as places of WGS 84 show them: assumed, or north, east, down.

    One of the two has to leave far less than the other; a delay costs metres, wrong axes the way.
    """
    if not one.has(POSITION):
        return
    heights = globe.columns.get("height_m", np.full(globe.time_ns.shape, origin[2]))
    place = geodetic_to_ned(np.stack([*(globe.columns[n] for n in GLOBE), heights], 1), origin)
    own = _track(one, globe.time_ns).place
    other = own @ ENU_TO_NED.T
    level = slice(0, 2)
    left = [_left(place[:, level] - places[:, level]) for places in (own, other)]
    if not np.isfinite(left).all() or left[1] > SWAPPED * left[0]:
        return
    one.shown = "ned"
    one.put(POSITION, one.vectors(POSITION) @ ENU_TO_NED.T)
    if one.has(VELOCITY):
        one.put(VELOCITY, one.vectors(VELOCITY) @ ENU_TO_NED.T)
    if one.has(ATTITUDE):
        turned = ENU_TO_NED @ euler_to_rotation(one.vectors(ATTITUDE))
        one.put(ATTITUDE, rotation_to_euler(turned))
        if one.shown_body is not None and hangs(turned):
            one.notes[:] = [n for n in one.notes if "the body axes are not told" not in n]
            rolled_over(one)
            one.note(body_untold(one))
    made = ("the frame is not told", "in east, north, up were made", "frame east, north, up)")
    one.notes[:] = [n for n in one.notes if not any(words in n for words in made)]
    one.note(
        f"the frame is not told: as east, north, up it is {to_digits(left[0], 3)} m from "
        f"{globe.offer.name}, as north, east, down {to_digits(left[1], 3)} m: taken as the latter "
        "(log: {frame: ned})"
    )


def _left(apart: Array) -> float:
    known = apart[np.isfinite(apart).all(axis=1)]
    return float(np.sqrt(np.mean(np.sum(known**2, axis=1)))) if known.shape[0] > 3 else float("nan")


def _first_place(one: StreamValues) -> Array:
    place = np.stack([one.columns[n] for n in GLOBE], axis=1)
    heights = one.columns.get("height_m", np.zeros(place.shape[0]))
    whole = np.column_stack([place, heights])
    known = np.flatnonzero(np.isfinite(whole).all(axis=1))
    if not known.shape[0]:
        raise refuse(one.offer.path, f"{one.offer.name} holds no position")
    first: Array = whole[known[0]]
    return first


def _about(one: StreamValues, origin: Array, where: str) -> None:
    """Places in WGS 84 to north, east, down about an origin."""
    heights = one.columns.pop("height_m", None)
    place = np.column_stack(
        [one.columns.pop(GLOBE[0]), one.columns.pop(GLOBE[1]),
         np.full(one.time_ns.shape, origin[2]) if heights is None else heights]
    )  # fmt: skip
    local = geodetic_to_ned(place, origin)
    one.put(POSITION, local)
    if heights is None:
        del one.columns[POSITION[2]]
    at = (
        f"{to_places(np.degrees(origin[0]), 7)} deg, {to_places(np.degrees(origin[1]), 7)} "
        f"deg, {to_places(origin[2], 3)} m"
    )
    one.note(f"WGS 84 positions were made north, east, down about {where}, {at}")


def _lay(reference: StreamValues, tested: StreamValues, pair: bool, arm_m: Array) -> Turns | None:
    """The reference's frame onto the tested one's, where they are not the same already."""
    flat = _drop_idle_down(reference, tested)
    track = _track(reference, tested.time_ns)
    onto = tested.vectors(POSITION) if not flat else flattened(tested)
    free = reference.assumed or tested.assumed
    turns: Turns = "none" if _know_north(reference, tested) else "heading"
    try:
        fit = laid(track, onto, turns, arm_m)
        freely = laid(track, onto, "any", arm_m) if fit is not None and free and not flat else None
    except StillError as still:
        raise refuse(
            reference.offer.path,
            f"nothing relates the frame of {reference.offer.name} to that of {tested.offer.name}, "
            f"and the log cannot: {still}",
            expected="a log that moves, or frames that are known",
            hint="state the origin: log: {origin: [47.3 deg, 8.55 deg, 460 m]}",
        ) from None
    if fit is not None and freely is not None and freely.rms_m < TILTED * fit.rms_m:
        fit, turns = freely, "any"
    if fit is not None:
        _move(reference, fit)
        _say_laid(reference, tested, fit)
    if pair and free:
        _lay_bodies(reference, tested, 0.0 if fit is None else fit.delay_s)
    return None if fit is None else turns


def _know_north(*several: StreamValues) -> bool:
    """Whether all frames are true to north: WGS 84, and those that call themselves so."""
    return all(one.offer.stream.frame in ("wgs84", "ned") for one in several)


def _drop_idle_down(reference: StreamValues, tested: StreamValues) -> bool:
    """A reference that only ever says one height tells none."""
    down = reference.columns.get(POSITION[2])
    idle = down is None or float(np.nanmax(down) - np.nanmin(down)) == 0.0
    if idle and down is not None:
        del reference.columns[POSITION[2]]
        reference.columns.pop(VELOCITY[2], None)
        tested.columns.pop(POSITION[2], None)
        reference.note("its height never changes: down is not compared, and its motion is level")
    return idle or POSITION[2] not in tested.columns


def flattened(one: StreamValues) -> Array:
    zero = np.zeros(one.time_ns.shape)
    return np.stack([one.columns[n] for n in POSITION[:2]] + [zero], axis=1)


def _track(one: StreamValues, stamps: Nanoseconds) -> LaidTrack:
    """Its places, velocities and body axes at other stamps; NaN outside its own."""
    order = np.argsort(one.time_ns, kind="stable")
    base = int(one.time_ns[order[0]])
    own, at = (one.time_ns[order] - base) / 1e9, (stamps - base) / 1e9
    zero = np.zeros(own.shape)
    places = np.stack([one.columns.get(n, zero)[order] for n in POSITION], axis=1)
    speeds = slope_of(own, places)

    def between(vectors: Array) -> Array:
        parts = [np.interp(at, own, column, np.nan, np.nan) for column in vectors.T]
        return np.stack(parts, axis=1)

    body = None
    if one.has(ATTITUDE):
        nearest = order[np.clip(np.searchsorted(own, at), 0, own.shape[0] - 1)]
        body = euler_to_rotation(one.vectors(ATTITUDE)[nearest])
    return LaidTrack(between(places), between(speeds), body)


def _move(one: StreamValues, fit: Laid) -> None:
    down = POSITION[2] in one.columns
    places = one.vectors(POSITION) if down else flattened(one)
    one.put(POSITION, places @ fit.turn.T + fit.shift_m)
    if not down:
        del one.columns[POSITION[2]]
    if one.has(VELOCITY[:2]):
        level = np.zeros(one.time_ns.shape)
        moved = np.stack([one.columns.get(n, level) for n in VELOCITY], axis=1) @ fit.turn.T
        one.columns |= {n: moved[:, k] for k, n in enumerate(VELOCITY) if n in one.columns}
    if one.has(ATTITUDE):
        turned = fit.turn @ euler_to_rotation(one.vectors(ATTITUDE))
        one.put(ATTITUDE, rotation_to_euler(turned))


def _say_laid(reference: StreamValues, tested: StreamValues, fit: Laid) -> None:
    turn = f"turned by {to_places(np.degrees(fit.heading_rad), 3)} deg about down"
    if _know_north(reference, tested):
        turn = "kept to its north"
    elif fit.tilt_rad > WORTH_SAYING_RAD:
        turn += f" and {to_places(np.degrees(fit.tilt_rad), 3)} deg of tilt"
    reference.note(
        f"nothing relates its frame to that of {tested.offer.name}: it was {turn} and "
        f"shifted by {to_places(float(np.linalg.norm(fit.shift_m)), 3)} m onto it (left: "
        f"{to_places(fit.rms_m, 3)} m RMS over "
        f"{to_places(fit.extent_m, 1)} m); a constant shift or turn between the two cannot be found"
    )


def _lay_bodies(reference: StreamValues, tested: StreamValues, delay_s: float) -> None:
    """A constant turn between the bodies, where their axes are not told."""
    moments = tested.time_ns - round(delay_s * 1e9)
    order = np.argsort(reference.time_ns, kind="stable")
    own = reference.time_ns[order]
    nearest = order[np.clip(np.searchsorted(own, moments), 0, own.shape[0] - 1)]
    inside = (moments >= own[0]) & (moments <= own[-1])
    a = euler_to_rotation(reference.vectors(ATTITUDE)[nearest[inside]])
    b = euler_to_rotation(tested.vectors(ATTITUDE)[inside])
    between = np.swapaxes(a, 1, 2) @ b
    known = np.isfinite(between).all(axis=(1, 2))
    if not np.any(known):
        return
    turn = mean_turn(between[known])
    whole = euler_to_rotation(reference.vectors(ATTITUDE)) @ turn
    reference.put(ATTITUDE, rotation_to_euler(whole))
    angle = np.degrees(np.arccos(np.clip((np.trace(turn) - 1.0) / 2.0, -1.0, 1.0)))
    reference.note(
        f"its body axes were turned by {to_places(angle, 3)} deg, constant, onto those of "
        f"{tested.offer.name}: a constant mounting error between the two cannot be found"
    )


def seconds_of(time_ns: Nanoseconds) -> Array:
    set_ = time_ns != UNSET
    base = int(time_ns[set_].min()) if np.any(set_) else 0
    seconds: Array = np.where(set_, (time_ns - base) / 1e9, np.nan)
    return seconds


def slope_of(seconds: Array, places: Array) -> Array:
    """Velocity by rising stamps, each stamp once; given back in the order of the file."""
    slope = np.full(places.shape, np.nan)
    known = np.flatnonzero(np.isfinite(seconds) & np.isfinite(places).all(axis=1))
    order = known[np.argsort(seconds[known], kind="stable")]
    if np.unique(seconds[order]).shape[0] >= 3:
        slope[order] = velocity_of(seconds[order], places[order])
    return slope
