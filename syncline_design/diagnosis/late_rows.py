"""A device that is late in some rows of a log."""

from __future__ import annotations

from typing import Final

from syncline_design.diagnosis.looked_up import Index
from syncline_design.effects import plain_delay
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import ActsOn, Array
from syncline_design.machine.quick_dataclass import dataclass

AS_GOOD_NATS: Final = 4.5  # within which another device fits as well


@dataclass(frozen=True, slots=True)
class Late:
    """A device that is late (or early) in some rows, by how much at most, and how far that puts
    them off [m].  ends_s: of a delay that grows or falls, the first and last one.  single: whether
    sound rows lie between.  of_log: the share of all rows that are late, where that is told."""

    sensor: ActsOn
    rows: Index
    delay_s: float
    spread_s: float
    off_m: Array
    ends_s: tuple[float, float] | None = None
    single: bool = False
    of_log: float | None = None


def acting_late(sensor: ActsOn, delay_s: float) -> Acting:
    """A sensor of the only vehicle that is late by a constant time."""
    delay = plain_delay()
    return Acting(delay, sensor, 0, {delay.parameters[0].name: delay_s})
