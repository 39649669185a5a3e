"""Whether a chosen payload can exist where it stands, worked out anew from the spec.

The rules, written down once more for the recheck: a sensor that receives GNSS stands on a stage
that has it; a method needs GNSS time where its sensor is, a clock where one of its vehicle's stages
is.  A stage has GNSS if it says so; silent, the first one has it at the surface (no depth, or
zero), and no other one.  Time also comes along `timing_from`, as many cables on as there are.
A ranging sensor measures through the medium of its path (the stage's word, water below the surface,
the platform's word), from its least to its largest distance, in every direction that is looked at.
Housings stand the depth, everything stands the temperature, and can be had.  What is not told
speaks against nothing, unless the spec is strict about facts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from fractions import Fraction
from itertools import pairwise
from typing import Any

from syncline_design.model.figure_text import to_digits
from syncline_design.spec.case import Case
from syncline_design.spec.selection import Selection

# Types of sensors that receive GNSS: parts of words, ends of words, the rest as whole words.
RECEIVER = re.compile(
    r"gnss|gps|satnav|(?:rtk|ppk)(?![a-z0-9])"
    r"|(?<![a-z0-9])(?:navstar|glonass|galileo|beidou|bds|qzss|navic|irnss|sbas|egnos|waas|msas|gagan"
    r"|sdcm|kass|ppp|vrs|ntrip|omnistar|terrastar|satellite|global[^a-z0-9]+positioning)(?![a-z0-9])"
)

# Types of sensors that range by sound.
SONAR = re.compile("usbl|ssbl|sbl|lbl|mbes|sbes|sonar|beam|echo|acoustic|adcp|dvl")


def impossible(case: Case, selection: Selection) -> list[str]:
    """What of a selection cannot work where it stands, in words; empty where all can."""
    return [*_sensors_and_methods(case, selection), *_clocks(case, selection)]


def sample_spacing(case: Case, selection: Selection) -> tuple[Fraction | None, list[str]]:
    """Largest ground between two samples of a ranging sensor at v_max [m], as far as it is told,
    and the sensors that do not tell how often they measure.

    v_max / rate; who ranges by sound waits 2 d / c besides, whatever the rate: the slower counts.
    """
    stages = {stage.choice.name: stage for stage in case.stages}
    found, silent = [], []
    for one in selection.roles:
        stage: Any = stages[one.stage]
        if one.role != "ranging":
            continue
        sensor = stage.role("ranging").sensor(one.sensor)
        speed, distance = (_exact(getattr(stage.platform.entry, k)) for k in ("v_max", "distance"))
        if sensor.rate is None:
            silent.append(one.sensor)
        else:
            found.append(speed / _exact(sensor.rate))
        if SONAR.search(sensor.type.lower()):
            sound = stage.choice.sound_speed
            sound = Fraction(1500) if sound is None else _exact(sound)
            found.append(speed * 2 * distance / sound)
    return max(found, default=None), silent


def _exact(value: Any) -> Fraction:
    return Fraction(getattr(value, "exact", value))


def _sensors_and_methods(case: Case, selection: Selection) -> Iterator[str]:
    received, timed = _received(case), _timed(case)
    stages = {stage.choice.name: stage for stage in case.stages}
    for one in selection.roles:
        role: Any = stages[one.stage].role(one.role)
        sensor, method = role.sensor(one.sensor), role.method(one.method)
        listens = _asks(sensor) or RECEIVER.search(sensor.type.casefold()) is not None
        if listens and one.stage not in received:
            yield f"{one.sensor} ({one.role} of {one.stage}) needs GNSS, {one.stage} has none"
        yield from _standing(case, stages[one.stage], one.sensor, sensor)
        if role.inline is not None:
            continue  # an error given in place names no method
        if _asks_with_hardware(case, method) and one.stage not in timed:
            yield f"{one.method} ({one.role} of {one.stage}) needs GNSS time, there is none"
        yield from _parts(case, one.method, method, [stages[one.stage].choice])


def _clocks(case: Case, selection: Selection) -> Iterator[str]:
    timed = _timed(case)
    for one in selection.clocks:
        clock = case.clock(one.vehicle, one.id)
        if clock is None:
            continue
        aboard = [s for s in case.spec.stages if (s.vehicle or s.name) == one.vehicle]
        yield from _parts(case, str(one.id), clock, aboard)
        if _asks_with_hardware(case, clock) and not {s.name for s in aboard} & timed:
            yield f"clock {one.id} of {one.vehicle} needs GNSS time, there is none"


def _received(case: Case) -> set[str]:
    """Stages with GNSS of their own."""
    found = set()
    for number, stage in enumerate(case.spec.stages):
        silent = number == 0 and not (stage.depth or 0)
        if silent if stage.gnss is None else stage.gnss:
            found.add(stage.name)
    return found


def _timed(case: Case) -> set[str]:
    """Stages with GNSS time: grown from those with GNSS, cable by cable, until nothing is new."""
    found, grown = _received(case), True
    while grown:
        reached = {s.name for s in case.spec.stages if s.timing_from in found} - found
        found |= reached
        grown = bool(reached)
    return found


def _asks(entry: Any) -> bool:
    return "gnss" in entry.needs


def _asks_with_hardware(case: Case, entry: Any) -> bool:
    hardware = (case.hardware[name].entry for name in entry.requires)
    return _asks(entry) or any(_asks(one) for one in hardware)


def _parts(case: Case, name: str, entry: Any, stages: list[Any]) -> Iterator[str]:
    """A method or clock, and the hardware behind it: sold, and warm enough on every stage."""
    for part, one in ((name, entry), *((i, case.hardware[i].entry) for i in entry.requires)):
        yield from _sold(case, part, one)
        for stage in stages:
            yield from _warm(part, one, stage)


def _standing(case: Case, stage: Any, name: str, sensor: Any) -> Iterator[str]:
    """A sensor against what its stage asks."""
    choice = stage.choice
    yield from _sold(case, name, sensor)
    yield from _warm(name, sensor, choice)
    if choice.depth and sensor.depth_rating is not None and choice.depth > sensor.depth_rating:
        yield (
            f"{name} stands {to_digits(sensor.depth_rating)} m, {choice.name} is "
            f"{to_digits(choice.depth)} m deep"
        )
    if sensor.modality == "ranging":
        yield from _path(stage, name, sensor)
        yield from _directions(choice, name, sensor)
    if case.spec.strict_facts:
        asked = any(one.kind == "sample_spacing" for one in case.spec.requirements)
        if asked and sensor.modality == "ranging" and sensor.rate is None:
            yield f"{name} does not tell its rate"
        yield from (f"{name} does not tell its {key}" for key in _silent(stage, sensor))
        if sensor.rate is None and _interpolated_for(case, stage, sensor.modality) is not None:
            yield f"{name} does not tell its rate"


def underway(case: Case, selection: Selection, distances: Mapping[str, Fraction]) -> Fraction:
    """What is added for sound under way and for samples that are interpolated [m].

    distances: of the objects [m], by stage.  A sonar that says that it corrects for nothing (of a
    strict spec: that does not say): its stage moves at v_max + d omega_max for the 2 d / c until
    the echo is back, and so does, at its own v_max, a vehicle that it locates.  Whoever accelerates
    is off the straight line between two samples T apart by a T^2 / 8 at most, an attitude times d;
    a sonar does not ping again before its echo is back; who is located by the stage before has its
    fixes.
    """
    stages = {stage.choice.name: stage for stage in case.stages}
    total = Fraction(0)
    for one in selection.roles:
        stage: Any = stages[one.stage]
        sensor, platform = stage.role(one.role).sensor(one.sensor), stage.platform.entry
        d = distances[one.stage]
        speed, turn = _exact(platform.v_max), _exact(platform.omega_max)
        echo = Fraction(0)
        if one.role == "ranging" and SONAR.search(sensor.type.lower()):
            sound = stage.choice.sound_speed
            echo = 2 * d / (Fraction(1500) if sound is None else _exact(sound))
            told = sensor.corrects
            if case.spec.strict_facts if told is None else "travel_time" not in told:
                total += echo * speed + echo * turn * d
                total += echo * _speed_of_the_located(case, stage)
        accelerates = _interpolated_for(case, stage, one.role)
        if accelerates is not None:
            apart = max(echo, Fraction(0) if sensor.rate is None else 1 / _exact(sensor.rate))
            bend = _exact(accelerates) * apart * apart / 8
            total += bend * d if one.role == "attitude" else bend
    return total


def _speed_of_the_located(case: Case, stage: Any) -> Fraction:
    """v_max of the vehicle that a stage locates for the next one; 0 of an object that is none."""
    after = [one for one in case.stages if one.index == stage.index + 1]
    return _exact(after[0].platform.entry.v_max) if after else Fraction(0)


def _interpolated_for(case: Case, stage: Any, role: str) -> Any:
    """The acceleration between the samples of a role; None: nobody says one, or it does not enter.

    Of a ranging sensor that of the vehicle it locates for the next stage.
    """
    if role == "position":
        return stage.platform.entry.acceleration
    if role == "attitude":
        ranges = stage.role("ranging") is not None
        return stage.platform.entry.angular_acceleration if ranges else None
    after = [one for one in case.stages if one.index == stage.index + 1]
    return after[0].platform.entry.acceleration if after else None


def _sold(case: Case, name: str, entry: Any) -> Iterator[str]:
    state = "active" if entry.lifecycle is None else entry.lifecycle.status
    if state in ("discontinued", "announced") and not case.spec.allow_discontinued:
        yield f"{name} is {state}"


def _warm(name: str, entry: Any, choice: Any) -> Iterator[str]:
    asked, stands = choice.temperature, entry.temperature
    if asked is not None and stands is not None:
        inside = stands.low <= asked.low <= asked.high <= stands.high
        if not inside:
            yield f"{name} works at {stands.text}, {choice.name} has {asked.text}"


def _medium(stage: Any) -> str | None:
    """Of the path from a stage to its object; None: nobody says."""
    choice, platform = stage.choice, stage.platform.entry
    found: str | None = choice.medium or ("water" if choice.depth else platform.medium)
    return found


def _path(stage: Any, name: str, sensor: Any) -> Iterator[str]:
    where, through = stage.choice.name, _medium(stage)
    nearest, distance = stage.distances
    if (sensor.medium, through) in (("air", "water"), ("water", "air")):
        yield f"{name} measures through {sensor.medium}, {where} looks into {through}"
    reach = sensor.reach
    if reach is None:
        return
    if reach.min is not None and nearest < reach.min:
        yield f"{name} begins at {to_digits(reach.min)} m, {where} is {to_digits(nearest)} m away"
    known = _told_reach(stage.choice.reflectivity, reach)[1]
    if known is not None and distance > known:
        yield f"{name} ends at {to_digits(known)} m, {where} is {to_digits(distance)} m away"


def _told_reach(reflectivity: float | None, reach: Any) -> tuple[float | None, float | None]:
    """How far is told for a target, and beyond what it surely does not measure.

    Rows of a table hold for targets at least as bright as they say; a single length for those that
    `at` names, if it names any.
    """
    if reach.max is None:
        return None, None
    rows = reach.max
    if not isinstance(rows, dict):
        named = re.search(r"[0-9.]+ ?%", reach.at)
        rows = {named[0] if named else "": rows}
    if reflectivity is None:
        return min(rows.values()), min(rows.values())
    plain, darker, brighter = [], [], []
    for target, length in rows.items():
        if target.endswith("dB"):
            continue
        if not target:
            plain.append(length)
        elif float(target.rstrip("% ")) / 100.0 <= reflectivity * (1.0 + 1e-12):
            darker.append(length)
        else:
            brighter.append(length)
    if plain or darker:
        return max(plain + darker), max(plain + darker)
    return None, min(brighter) if brighter else max(rows.values())


def _directions(choice: Any, name: str, sensor: Any) -> Iterator[str]:
    """Each asked direction lies in the field of view; azimuth is the same after a turn.

    On the circle it is enough to look at both ends, and midway between every two angles at which
    seeing begins or ends.
    """
    for axis in ("azimuth", "elevation"):
        asked = getattr(choice.look, axis, None)
        seen = getattr(sensor.field_of_view, axis, None)
        if asked is None or seen is None:
            continue
        turns = [k * 2.0 * math.pi for k in range(-4, 5)] if axis == "azimuth" else [0.0]
        edges = [end + turn for end in (seen.low, seen.high) for turn in turns]
        inner = sorted({asked.low, asked.high, *(e for e in edges if asked.low < e < asked.high)})
        points = [*inner[:: len(inner) - 1 or 1], *((a + b) / 2 for a, b in pairwise(inner))]
        if not all(
            any(seen.low - 1e-12 <= at + turn <= seen.high + 1e-12 for turn in turns)
            for at in points
        ):
            yield f"{name} sees {axis} {seen.text}, {choice.name} looks {asked.text}"


def _silent(stage: Any, sensor: Any) -> Iterator[str]:
    """Facts that the stage asks for and the entry does not give."""
    choice = stage.choice
    if choice.depth and sensor.depth_rating is None:
        yield "depth rating"
    if choice.temperature is not None and sensor.temperature is None:
        yield "temperature"
    if sensor.modality != "ranging":
        return
    if _medium(stage) is not None and sensor.medium is None:
        yield "medium"
    if sensor.reach is None or _told_reach(choice.reflectivity, sensor.reach)[0] is None:
        yield "reach"
    for axis in ("azimuth", "elevation"):
        asked, seen = (getattr(one, axis, None) for one in (choice.look, sensor.field_of_view))
        if asked is not None and seen is None:
            yield f"field of view in {axis}"
