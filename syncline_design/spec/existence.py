"""Whether a product can work where it would stand: its facts against those of the stage.

Each rule compares two figures and says both.  What an entry does not tell rules nothing out; it is
named, so that somebody looks it up.  The rules know neither specs nor catalogs, only entries.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Literal, get_args

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_quantity
from syncline_design.model.quantity import Dimension, Quantity
from syncline_design.spec.catalog import Product, SensorEntry
from syncline_design.spec.exact import fraction_of
from syncline_design.spec.facts import FULL_TURN, FieldOfView, Medium

Code = Literal[
    "reach", "medium", "gnss", "field_of_view", "rate", "depth", "temperature", "discontinued",
    "unknown-fact",
]  # fmt: skip
ORDER: tuple[Code, ...] = get_args(Code)  # the strongest reason first
SOUND_MPS = 1500.0  # in sea water, unless a stage says otherwise
_ACOUSTIC = re.compile(r"[us]s?bl|lbl|sonar|beam|mbes|sbes|echo|acoustic|adcp|dvl")
_SLACK = 1e-12  # of sums and differences of angles


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What a stage asks of its sensors; None: it asks nothing of that kind.

    nearest, farthest: distance to the object [m]; medium: of the path to it; reflectivity: of the
    object, 0.8 for 80 %; speed: the vehicle's largest [m/s]; spacing: between two samples at that
    speed, at most [m]; sound_speed: in the water [m/s]; interpolated: roles whose samples are
    interpolated for a vehicle that is said to accelerate, with that vehicle's stage.
    """

    stage: str
    nearest: float
    farthest: float
    medium: Medium | None = None
    look: FieldOfView | None = None
    depth: float | None = None
    temperature: Quantity | None = None
    reflectivity: float | None = None
    speed: float | None = None
    spacing: float | None = None
    sound_speed: float = SOUND_MPS
    interpolated: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class RuledOut:
    """Why an entry cannot work where it would stand: what it says and what is asked of it."""

    code: Code
    reason: str
    figure: str
    limit: str


@dataclass(frozen=True, slots=True)
class NotTold:
    """A fact that a rule needs and an entry does not give."""

    entry: str
    key: str
    reason: str


def strongest(found: Sequence[RuledOut]) -> RuledOut:
    """The reason that is told of several."""
    return min(found, key=lambda one: ORDER.index(one.code))


def ruled_out(
    identity: str, sensor: SensorEntry, around: Surroundings, allow_discontinued: bool = False
) -> Iterator[RuledOut]:
    """Every reason why a sensor cannot work on a stage."""
    yield from out_of_reach(identity, sensor, around)
    yield from out_of_place(identity, sensor, around)
    if sensor.modality == "ranging":
        yield from too_sparse(identity, sensor, around)
    if not allow_discontinued:
        yield from not_sold(identity, sensor)


def out_of_place(identity: str, sensor: SensorEntry, around: Surroundings) -> Iterator[RuledOut]:
    """Reasons of the place that hold at any distance."""
    if sensor.modality == "ranging":
        yield from _medium(identity, sensor, around)
        yield from _look(identity, sensor, around)
    yield from _depth(identity, sensor, around)
    yield from too_hot_or_cold(identity, sensor, around.stage, around.temperature)


def interval_of(sensor: SensorEntry, reflectivity: float | None) -> tuple[float, float]:
    """Distances [m] between which nothing that is known speaks against a sensor."""
    reach = sensor.reach
    if sensor.modality != "ranging" or reach is None:
        return 0.0, math.inf
    far = reach.surely_ends(reflectivity)
    return reach.min or 0.0, math.inf if far is None else far


def not_told(identity: str, sensor: SensorEntry, around: Surroundings) -> Iterator[NotTold]:
    """Facts that a rule of this stage needs and an entry does not give."""
    if sensor.modality == "ranging":
        if around.medium is not None and sensor.medium is None:
            yield _unknown(identity, "medium", f"{around.stage} looks into {around.medium}")
        yield from _reach_not_told(identity, sensor, around)
        for axis, wanted in around.look or ():
            seen = sensor.field_of_view
            if wanted is not None and (seen is None or getattr(seen, axis) is None):
                asked = f"{around.stage} looks {wanted.text} in {axis}"
                yield _unknown(identity, f"field_of_view.{axis}", asked)
        if around.spacing is not None and sensor.rate is None:
            asked = f"samples are to be {_length(around.spacing)} apart at most"
            yield _unknown(identity, "rate", asked)
    moves = dict(around.interpolated).get(sensor.modality)
    if moves and sensor.rate is None and not (sensor.modality == "ranging" and around.spacing):
        asked = f"{moves} accelerates between its samples"
        yield _unknown(identity, "rate", asked)
    if around.depth and sensor.depth_rating is None:
        yield _unknown(identity, "depth_rating", f"{around.stage} is at {_length(around.depth)}")
    if around.temperature is not None and sensor.temperature is None:
        yield _unknown(identity, "temperature", f"{around.stage} has {around.temperature.text}")


def _reach_not_told(identity: str, sensor: SensorEntry, around: Surroundings) -> Iterator[NotTold]:
    """A far end that nothing says of this target; beyond that of brighter ones it is told."""
    reach = sensor.reach
    if reach is not None and reach.farthest(around.reflectivity) is not None:
        return
    ends = None if reach is None else reach.surely_ends(around.reflectivity)
    if ends is None or around.farthest <= ends:
        asked = f"{around.stage}.distance is {_length(around.farthest)}"
        target = getattr(around.reflectivity, "text", "") if ends is not None else ""
        figure = f"reach for a target of {target}" if target else "reach"
        yield _unknown(identity, "reach", asked, figure)


def is_acoustic(kind: str) -> bool:
    """Whether a sensor's type names one that ranges by sound: usbl, mbes, single_beam, sonar."""
    return _ACOUSTIC.search(kind.casefold()) is not None


def is_charged(sensor: SensorEntry, strict: bool) -> bool:
    """Whether the way of the sound counts in the ledger: nobody corrects for it, or a spec that is
    strict about facts is not told whether somebody does."""
    silent = sensor.corrects is None and strict
    return is_acoustic(sensor.type) and (sensor.corrects == () or silent)


def too_sparse(identity: str, sensor: SensorEntry, around: Surroundings) -> Iterator[RuledOut]:
    """Samples at v_max are no farther apart than asked: v_max / rate.

    Of sound the next ping waits for the echo: the rate is at most c / (2 d).
    """
    found = spacing_m(sensor, around)
    if around.spacing is None or found is None or found <= around.spacing:
        return
    rate = getattr(sensor.rate, "text", "") or f"{_length(around.farthest)} for sound and back"
    figure = f"rate: {rate}, {_length(found)} apart"
    reason = (
        f"{identity}: samples are {_length(found)} apart at {around.stage}'s v_max ({rate}), "
        f"asked are {_length(around.spacing)}"
    )
    yield RuledOut("rate", reason, figure, f"sample_spacing: {_length(around.spacing)}")


def spacing_m(sensor: SensorEntry, around: Surroundings) -> float | None:
    """Ground between two samples at the stage's speed [m], as far as it is told; None: not told."""
    waits = []
    speed = around.speed or 0.0
    if sensor.rate is not None:
        waits.append(fraction_of(speed) / fraction_of(sensor.rate))
    if is_acoustic(sensor.type):
        echo = 2 * fraction_of(around.farthest) / fraction_of(around.sound_speed)
        waits.append(fraction_of(speed) * echo)
    return float(max(waits)) if waits else None


def _unknown(identity: str, key: str, asked: str, figure: str = "") -> NotTold:
    told = f"{identity} gives no {figure or key}, {asked}: look this up first"
    return NotTold(identity, key, told)


def _medium(identity: str, sensor: SensorEntry, around: Surroundings) -> Iterator[RuledOut]:
    """Sound goes through water, light and radio through air; who does both says so."""
    if sensor.medium is None or around.medium is None:
        return
    if "both" not in (sensor.medium, around.medium) and sensor.medium != around.medium:
        reason = (
            f"{identity}: measures through {sensor.medium}, "
            f"{around.stage} looks into {around.medium}"
        )
        yield RuledOut("medium", reason, f"medium: {sensor.medium}", f"medium: {around.medium}")


def out_of_reach(identity: str, sensor: SensorEntry, around: Surroundings) -> Iterator[RuledOut]:
    """min <= distance <= max, at both ends of the distance."""
    near, far = interval_of(sensor, around.reflectivity)
    if around.farthest > far:
        asked = f"{around.stage}.distance is {_length(around.farthest)}"
        yield RuledOut(
            "reach", f"{identity}: reaches {_length(far)}, {asked}",
            f"reach: {_length(far)}", f"distance: {_length(around.farthest)}",
        )  # fmt: skip
    if around.nearest < near:
        asked = f"{around.stage}.distance is {_length(around.nearest)}"
        yield RuledOut(
            "reach", f"{identity}: measures from {_length(near)} on, {asked}",
            f"reach: from {_length(near)}", f"distance: {_length(around.nearest)}",
        )  # fmt: skip


def _look(identity: str, sensor: SensorEntry, around: Surroundings) -> Iterator[RuledOut]:
    """Where the stage has to look lies inside the field of view; azimuth goes round."""
    if around.look is None or sensor.field_of_view is None:
        return
    for axis, wanted in around.look:
        seen: Quantity | None = getattr(sensor.field_of_view, axis)
        if wanted is None or seen is None or lies_within(wanted, seen, axis == "azimuth"):
            continue
        reason = f"{identity}: sees {seen.text} in {axis}, {around.stage} looks {wanted.text}"
        yield RuledOut("field_of_view", reason, f"{axis}: {seen.text}", f"{axis}: {wanted.text}")


def lies_within(inner: Quantity, outer: Quantity, goes_round: bool) -> bool:
    """Whether one interval of angles [rad] is part of another, modulo a turn if it goes round."""
    if goes_round and outer.high - outer.low >= FULL_TURN * (1.0 - _SLACK):
        return True
    turns = math.ceil((outer.low - inner.low) / FULL_TURN - _SLACK) if goes_round else 0
    low, high = inner.low + turns * FULL_TURN, inner.high + turns * FULL_TURN
    return low >= outer.low - _SLACK and high <= outer.high + _SLACK


def _depth(identity: str, sensor: SensorEntry, around: Surroundings) -> Iterator[RuledOut]:
    """The housing stands the depth of the stage."""
    rating = sensor.depth_rating
    if around.depth and rating is not None and rating < around.depth:
        reason = (
            f"{identity}: goes down to {_length(rating)}, {around.stage} is at "
            f"{_length(around.depth)}"
        )
        figure, limit = f"depth_rating: {_length(rating)}", f"depth: {_length(around.depth)}"
        yield RuledOut("depth", reason, figure, limit)


def too_hot_or_cold(
    identity: str, entry: Product, where: str, asked: Quantity | None
) -> Iterator[RuledOut]:
    """All temperatures of a place lie within those that the product works at."""
    works = entry.temperature
    if asked is None or works is None:
        return
    if asked.low < works.low or asked.high > works.high:
        reason = f"{identity}: works at {works.text}, {where} has {asked.text}"
        figure, limit = f"temperature: {works.text}", f"temperature: {asked.text}"
        yield RuledOut("temperature", reason, figure, limit)


def not_sold(identity: str, entry: Product) -> Iterator[RuledOut]:
    """Only what can be had today, unless the spec allows more."""
    lifecycle = entry.lifecycle
    if lifecycle is None or lifecycle.status == "active":
        return
    follower = f", {lifecycle.successor} follows it" if lifecycle.successor else ""
    reason = (
        f"{identity}: {lifecycle.status}, read {lifecycle.read}{follower}; "
        "allow_discontinued: yes lets it in"
    )
    figure = f"lifecycle: {lifecycle.status}"
    yield RuledOut("discontinued", reason, figure, "allow_discontinued: no")


def _length(value: float) -> str:
    return str(getattr(value, "text", "") or format_quantity(value, Dimension.LENGTH))
