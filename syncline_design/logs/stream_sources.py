"""Recordings as the files that `reading` works on: one source for each stream that plays a part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects.record import Array
from syncline_design.logs.cloud_ranging import NO_ARMS, Arms, with_ranges
from syncline_design.logs.columns import (
    ATTITUDE,
    GEODETIC,
    POSITION,
    RANGING,
    RATE,
    REFERENCE,
    REFERENCE_ATTITUDE,
    TARGET,
    TARGET_ID,
    VELOCITY,
)
from syncline_design.logs.frame_fit import Turns
from syncline_design.logs.one_frame import (
    flattened,
    in_one_frame,
    on_one_datum,
    seconds_of,
    slope_of,
)
from syncline_design.logs.places import geodetic_to_ned
from syncline_design.logs.readers.stream import UNSET, Nanoseconds
from syncline_design.logs.refusals import refuse
from syncline_design.logs.roles import Offer, Part, Role, parts_of
from syncline_design.logs.row_source import NANOSECONDS, Clock, RowSource
from syncline_design.logs.stream_times import UTC_CLOCK, on_one_timeline
from syncline_design.logs.stream_values import (
    GLOBE,
    StreamValues,
    all_values,
)
from syncline_design.logs.surveys import Survey
from syncline_design.spec.log_block import LogChoice

Mask = NDArray[np.bool_]
_OF_A_CLOUD: Final[tuple[Role, ...]] = ("ranging", "position", "attitude")


class StreamSource:
    """One stream's columns, as a file of them."""

    def __init__(self, path: Path, name: str, time_ns: Nanoseconds, calendar: bool,
                 columns: Mapping[str, Array], notes: Sequence[str],
                 shown: Literal["ned"] | None = None,
                 shown_body: Literal["flu", "frd"] | None = None,
                 laid: Turns | None = None) -> None:  # fmt: skip
        self.path = path.joinpath(name.strip("/").replace("/", "."))
        self.header = ("time_s", *columns)
        self.cut = 0
        self.notes = tuple(notes)
        self.shown = shown  # axes that the file does not tell, as other places show them
        self.shown_body = shown_body  # and those of the body, as they are taken
        self.laid: Turns | None = laid  # how it was turned, beside shifted, onto another's frame
        self._time_ns, self._calendar, self._columns = time_ns, calendar, columns

    def clock(self, name: str) -> Clock:
        """The stamps, whole where they are a calendar's."""
        if self._calendar:
            return Clock(None, self._time_ns, zoned=True)
        seconds = self._time_ns / NANOSECONDS
        return Clock(np.where(self._time_ns == UNSET, np.nan, seconds), None, spans=True)

    def numbers(self, names: Sequence[str], keep: Mask) -> dict[str, Array]:
        return {name: self._columns[name][keep] for name in names}

    def labels(self, name: str, keep: Mask) -> Array:
        labels: Array = self._columns[name][keep]
        return labels


def sources_of(
    offers: Sequence[Offer], choice: LogChoice, prefix: str, poses: bool,
    held: frozenset[Role] = frozenset(), survey: Survey | None = None, arms: Arms = NO_ARMS,
) -> list[StreamSource]:  # fmt: skip
    """The streams that a diagnosis needs of some recordings, canonical and on one timeline.

    prefix: of the first stage's columns.  poses: whether the system has an attitude sensor, so that
    of two trajectories both places and attitudes are compared.  held: parts that other files play.
    survey, arms: of targets and of the vehicle, for ranges that a cloud's points tell.
    """
    parts = demand_parts(offers, choice, held)
    pair = poses and is_pose_pair(parts)
    if pair:
        parts = _of_the_tested(parts)
    used = {id(part.offer): part.offer for part in parts.values()}
    read = all_values(list(used.values()), choice)
    values = dict(zip(used, read, strict=True))
    several = list(values.values())
    clocks = _clocks(offers, used, several, choice)
    calendar = on_one_timeline([*several, *clocks], choice)
    _demand_places(parts, values)
    on_one_datum([*several, *clocks], parts, values)
    turns: Turns | None = None
    if "reference" in parts and "position" in parts:
        turns = in_one_frame(parts, values, choice, pair, arms[1])
    ranging = parts.get("ranging")
    if ranging is not None and not ranging.offer.has("ranging"):
        _demand_trajectory(ranging.offer, parts)
        cloud, place, turn = (values[id(parts[r].offer)] for r in _OF_A_CLOUD)
        with_ranges(cloud, place, turn, choice, survey, arms)
    return [
        _source(one, _roles(parts, key), prefix, pair, calendar,
                turns if "reference" in _roles(parts, key) else None)
        for key, one in values.items()
    ]  # fmt: skip


def _roles(parts: Mapping[Role, Part], offer: int) -> list[Role]:
    return [role for role, part in parts.items() if id(part.offer) == offer]


def laid_by(sources: Sequence[RowSource]) -> Turns | None:
    """The turns by which a reference was laid onto the tested, where nothing relates the two."""
    return next((s.laid for s in sources if isinstance(s, StreamSource) and s.laid), None)


def is_pose_pair(parts: Mapping[Role, Part]) -> bool:
    """Whether tested and reference both tell place and attitude."""
    if "reference" not in parts or "position" not in parts or "ranging" in parts:
        return False
    tested, reference = parts["position"].offer, parts["reference"].offer
    return tested is not reference and tested.has("attitude") and reference.has("attitude")


def _of_the_tested(parts: Mapping[Role, Part]) -> dict[Role, Part]:
    """In a pair of poses the attitude is that of the tested; motion is the reference's."""
    kept: dict[Role, Part] = {r: p for r, p in parts.items() if r not in ("attitude", "rate")}
    tested = parts["position"]
    kept["attitude"] = Part("attitude", tested.offer, tested.sure, "the tested trajectory's own")
    return kept


def left_of(parts: Mapping[Role, Part], held: frozenset[Role]) -> dict[Role, Part]:
    """The parts that no other file plays; ranges and a reference do not go together."""
    kept = {role: part for role, part in parts.items() if role not in held or part.sure == "stated"}
    reference = kept.get("reference")
    if "ranging" in held and reference is not None and reference.sure != "stated":
        del kept["reference"]
    return kept


def demand_parts(
    offers: Sequence[Offer], choice: LogChoice, held: frozenset[Role]
) -> dict[Role, Part]:
    """The parts that recordings play beside those that other files do (held); refused where a
    diagnosis lacks one."""
    parts = left_of(parts_of(offers, choice, surveyed="target" in held), held)
    _demand_parts(offers, {*parts, *held})
    return parts


def _demand_parts(offers: Sequence[Offer], parts: set[Role]) -> None:
    path = offers[0].path
    if "position" not in parts:
        raise refuse(
            path,
            "no stream of positions",
            expected="positions of at least 10 messages, and something to hold them against",
            hint="`syncline-design log inspect` lists what is there",
        )
    if "reference" not in parts and "ranging" not in parts:
        raise refuse(
            path,
            "nothing to hold the positions against",
            expected="a second trajectory, or ranges to surveyed targets",
            hint="give its file too, or name it: log: {streams: {reference: NAME}}",
        )
    if "attitude" not in parts:
        raise refuse(
            path,
            "no stream of attitudes",
            expected="attitudes of the vehicle, to lay lever arms along, and to ask whether one of "
            "0 m is as short",
            hint="name one: log: {streams: {attitude: NAME}}",
        )


def _demand_trajectory(cloud: Offer, parts: Mapping[Role, Part]) -> None:
    """Points become ranges by the trajectory that they were made with; a table's may be another."""
    if not {"position", "attitude"} <= parts.keys():
        raise refuse(
            cloud.path,
            f"{cloud.name} tells places of points, and no recording beside it its trajectory",
            expected="places and attitudes in one file, such as an SBET",
            hint="name no `ranging` in log: {streams: ...} where a table's columns tell the ranges",
        )


def _demand_places(parts: Mapping[Role, Part], values: Mapping[int, StreamValues]) -> None:
    """A stream may have positions by its kind and never a valid one."""
    placed: tuple[Role, ...] = ("position", "reference")
    for role in placed:
        part = parts.get(role)
        if part is None:
            continue
        one = values[id(part.offer)]
        names = GLOBE if one.has(GLOBE) else POSITION[:2]
        if not one.has(names) or not np.isfinite(one.vectors(names)).all(axis=1).any():
            raise refuse(
                one.offer.path,
                f"{one.offer.name} ({role}) never holds a valid position",
                found=f"{one.time_ns.shape[0]} messages",
                hint=f"name another stream: log: {{streams: {{{role}: NAME}}}}",
            )


def _clocks(
    offers: Sequence[Offer],
    held: Mapping[int, Offer],
    several: Sequence[StreamValues],
    choice: LogChoice,
) -> list[StreamValues]:
    """Streams that play no part but tell UTC or the geoid, of recordings that need it."""
    recordings = {id(one.offer.recording) for one in several}
    telling = [
        offer
        for offer in offers
        if id(offer) not in held
        and id(offer.recording) in recordings
        and (UTC_CLOCK in offer.stream.columns)
        and not any(UTC_CLOCK in one.columns and one.offer.recording is offer.recording
                    for one in several)
    ]  # fmt: skip
    return all_values(telling, choice)


def _source(
    one: StreamValues, roles: Sequence[Role], prefix: str, pair: bool, calendar: bool,
    laid: Turns | None,
) -> StreamSource:  # fmt: skip
    """Only the columns that belong to the parts that the stream plays."""
    columns: dict[str, Array] = {}
    if "reference" in roles:
        columns |= _of_reference(one, prefix, pair)
    if "position" in roles:
        names = (*POSITION, *GEODETIC)
        columns |= {prefix + n: one.columns[n] for n in names if n in one.columns}
    for role, names in _ROLE_COLUMNS.items():
        if role in roles and not (role == "velocity" and "reference" in roles):
            columns |= {prefix + n: one.columns[n] for n in names if n in one.columns}
    if "target" in roles:
        names = (*TARGET, TARGET_ID, *(f"target_{g}" for g in GEODETIC))
        columns |= {n: one.columns[n] for n in names if n in one.columns}
    if "ranging" in roles and TARGET_ID in one.columns:
        columns[TARGET_ID] = one.columns[TARGET_ID]
    return StreamSource(one.offer.path, one.offer.name, one.time_ns, calendar, columns, one.notes,
                        one.shown, one.shown_body, laid)  # fmt: skip


_ROLE_COLUMNS: Final[Mapping[Role, tuple[str, ...]]] = {
    "attitude": ATTITUDE, "velocity": VELOCITY, "rate": RATE, "ranging": RANGING,
}  # fmt: skip


def _of_reference(one: StreamValues, prefix: str, pair: bool) -> dict[str, Array]:
    """Places, and the motion at its own rate: its velocities, else the slope of its places."""
    columns = {n: one.columns[p] for n, p in zip(REFERENCE, POSITION, strict=True)
               if p in one.columns}  # fmt: skip
    columns |= {f"reference_{g}": one.columns[g] for g in GEODETIC if g in one.columns}
    motion = _motion(one)
    if motion is not None:
        columns |= {prefix + n: motion[:, k] for k, n in enumerate(VELOCITY)}
    if pair and one.has(ATTITUDE):
        columns |= {n: one.columns[a] for n, a in zip(REFERENCE_ATTITUDE, ATTITUDE, strict=True)}
    return columns


def _motion(one: StreamValues) -> Array | None:
    """Velocities of a stream (n, 3): its own, and the slope of its places where it lacks them.

    Receivers' sentences tell no vertical speed; some say speed and course less often than places.
    None where it tells none and its places are not local yet: they are derived when they are.
    """
    nothing = np.full(one.time_ns.shape, np.nan)
    own = np.stack([one.columns.get(n, nothing) for n in VELOCITY], axis=1)
    lacking = ~np.isfinite(own)
    local = one.has(POSITION[:2])
    if np.all(lacking) and not local:
        return None
    if not np.any(lacking):
        return own
    places, level = _local_places(one)
    if places is None:
        return np.where(lacking & [False, False, True], 0.0, own)
    _say_derived(one, lacking, level)
    return np.where(lacking, slope_of(seconds_of(one.time_ns), places), own)


def _local_places(one: StreamValues) -> tuple[Array | None, bool]:
    """North, east, down of its places, of those in WGS 84 about the first; whether it is level."""
    if one.has(POSITION[:2]):
        level = POSITION[2] not in one.columns
        return flattened(one) if level else one.vectors(POSITION), level
    if not one.has(GEODETIC[:2]):
        return None, True
    heights = one.columns.get(GEODETIC[2], np.zeros(one.time_ns.shape))
    globe = np.stack([*(one.columns[n] for n in GEODETIC[:2]), heights], axis=1)
    known = np.flatnonzero(np.isfinite(globe).all(axis=1))
    if not known.shape[0]:
        return None, True
    return geodetic_to_ned(globe, globe[known[0]]), GEODETIC[2] not in one.columns


def _say_derived(one: StreamValues, lacking: Array, level: bool) -> None:
    """Which velocities come of the places, and how."""
    rows = int(np.count_nonzero(lacking[:, :2].any(axis=1)))
    how = "derived from its places, at its own rate (smoothing spline)"
    if rows == lacking.shape[0]:
        one.note(f"velocity was {how}")
    elif rows:
        one.note(f"velocities of {rows} rows that have none were {how}")
    if rows < lacking.shape[0] and not level and np.any(lacking[:, 2]):
        one.note(f"velocity down, which it does not tell, was {how}")
