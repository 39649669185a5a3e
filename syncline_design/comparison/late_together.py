"""Data that seem younger than their stamps: all others late by as much are the same log.

A delay common to all sensors moves nothing over ground that stands still, so that one sensor that
is early and the two others late by one time, as an INS is that gives places and attitudes, are the
same readings.  Of the two only the delay is met often: data that are valid after their stamp take a
stamp that is early.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

from syncline_design.comparison.departing import Departing, amount
from syncline_design.comparison.in_doubt import OneWay
from syncline_design.diagnosis.result import Estimate
from syncline_design.effects import plain_delay
from syncline_design.spec.case import Case

_SENSORS: Final = {"position", "attitude", "ranging"}  # of one vehicle, against its targets


def others_late(part: Departing, case: Case, kind: str) -> Iterator[OneWay]:
    """The other sensors of the vehicle late by as much as this one is early, where it is.

    kind: of the log; against a better system, whose stamps are true, nothing is common to all.
    """
    roles = [one.role for one in case.stages[0].roles]
    alone = len(case.stages) == 1 and set(roles) == _SENSORS and len(part.sensors) == 1
    told = list(part.parameters.values())
    if part.effect != plain_delay().name or not alone or kind != "georeference" or not told:
        return
    if all(float(one.value) < 0.0 for one in told):
        others = tuple(role for role in roles if role not in part.sensors)
        late = {name: _turned(one) for name, one in part.parameters.items()}
        yield OneWay((Departing(part.effect, others, part.stage, late),), together=True)


def _turned(one: Estimate) -> Estimate:
    """The same with the other sign."""
    value = -float(one.value)
    ends = one.interval95
    interval = None if ends is None else (-ends[1], -ends[0])
    return replace(one, value=value, text=amount(value, one.unit), interval95=interval)
