"""Whether a chosen payload can exist where it stands, worked out anew from the spec.

The rules, written down once more for the recheck: a sensor that receives GNSS stands on a stage
that has it; a method needs GNSS time where its sensor is, a clock where one of its vehicle's stages
is.  A stage has GNSS if it says so; silent, the first one has it at the surface (no depth, or
zero), and no other one.  Time also comes along `timing_from`, as many cables on as there are.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from syncline_design.spec.case import Case
from syncline_design.spec.selection import Selection

# Types of sensors that receive GNSS: parts of words, ends of words, the rest as whole words.
RECEIVER = re.compile(
    r"gnss|gps|satnav|(?:rtk|ppk)(?![a-z0-9])"
    r"|(?<![a-z0-9])(?:navstar|glonass|galileo|beidou|bds|qzss|navic|irnss|sbas|egnos|waas|msas|gagan"
    r"|sdcm|kass|ppp|vrs|ntrip|omnistar|terrastar|satellite|global[^a-z0-9]+positioning)(?![a-z0-9])"
)


def impossible(case: Case, selection: Selection) -> list[str]:
    """What of a selection cannot work where it stands, in words; empty where all can."""
    return [*_sensors_and_methods(case, selection), *_clocks(case, selection)]


def _sensors_and_methods(case: Case, selection: Selection) -> Iterator[str]:
    received, timed = _received(case), _timed(case)
    stages = {stage.choice.name: stage for stage in case.stages}
    for one in selection.roles:
        role: Any = stages[one.stage].role(one.role)
        sensor, method = role.sensor(one.sensor), role.method(one.method)
        listens = _asks(sensor) or RECEIVER.search(sensor.type.casefold()) is not None
        if listens and one.stage not in received:
            yield f"{one.sensor} ({one.role} of {one.stage}) needs GNSS, {one.stage} has none"
        if role.inline is not None:
            continue  # an error given in place names no method
        if _asks_with_hardware(case, method) and one.stage not in timed:
            yield f"{one.method} ({one.role} of {one.stage}) needs GNSS time, there is none"


def _clocks(case: Case, selection: Selection) -> Iterator[str]:
    timed = _timed(case)
    for one in selection.clocks:
        clock = case.clock(one.vehicle, one.id)
        if clock is None or not _asks_with_hardware(case, clock):
            continue
        aboard = {s.name for s in case.spec.stages if (s.vehicle or s.name) == one.vehicle}
        if not aboard & timed:
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
