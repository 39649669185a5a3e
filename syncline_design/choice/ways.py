"""How a sensor may be stamped in a role: every primitive and method, or why it is none."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import Literal

from syncline_design.choice.option import Requires
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.barred import barred_method
from syncline_design.spec.case import Case, RoleCase, StageCase, usable_primitives
from syncline_design.spec.catalog import SensorEntry, TimestampingEntry
from syncline_design.spec.exact import tau_bound
from syncline_design.spec.existence import RuledOut

INLINE = "inline"


@dataclass(frozen=True, slots=True)
class Way:
    """One way of stamping: a primitive and a method, or why it is none.

    entry: None where the spec gives the error in place; barred: why it cannot work on this stage;
    served, offered: what does not fit one another.
    """

    primitive: str
    method: str
    tau: Fraction = Fraction(0)
    timeline: Literal["host", "utc"] = "host"
    entry: TimestampingEntry | None = None
    requires: Requires = ()
    barred: RuledOut | None = None
    served: str = ""
    offered: str = ""

    @property
    def fits(self) -> bool:
        """Whether it is an option, poor as it may be."""
        return self.barred is None and not self.offered


def ways_of_stamping(
    case: Case, stage: StageCase, role: RoleCase, sensor: SensorEntry
) -> Iterator[Way]:
    """Every way of stamping a sensor of these signals, or why it is none.

    Where the spec gives the error in place, a primitive that is pinned has to be the sensor's.
    """
    pinned, factor = role.choice.primitive, case.spec.coverage_factor
    if role.inline is not None:
        if pinned is not None and pinned not in sensor.serves:
            yield Way("", INLINE, served=", ".join(sensor.serves), offered=pinned)
            return
        tau, timeline = tau_bound(role.inline.error, factor), role.inline.timeline
        yield Way(pinned or INLINE, INLINE, tau, "utc" if timeline == "utc" else "host")
        return
    for method in role.methods:
        entry = method.entry
        timeline = "utc" if entry.timeline == "utc" else "host"
        primitives = usable_primitives(sensor, entry, pinned)
        barred = barred_method(case, stage, method)
        tau, requires = tau_bound(entry.error, factor), tuple(sorted(entry.requires.items()))
        for primitive in primitives:
            yield Way(primitive, method.id, tau, timeline, entry, requires, barred)
        if not primitives:
            offered = pinned or ", ".join(sensor.serves)
            yield Way("", method.id, served=", ".join(entry.primitives), offered=offered)
