"""What a verdict rests on, read off its design and its spec."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Final

from syncline_design.comparison.acceptance import AssumptionName
from syncline_design.comparison.stamp_meaning import ARRIVAL
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.roles import RoleName
from syncline_design.spec.case import Case, StageCase
from syncline_design.spec.yaml_text import KeyPath
from syncline_design.verdict.named import NamedDesign, NamedRole
from syncline_design.verdict.tree import Verdict

# What besides its stamps, its delay and its noise a sensor of a role is taken to have right.
_MOUNTED: Final[dict[str, tuple[AssumptionName, ...]]] = {
    "position": ("lever_arm",), "attitude": ("mounting",), "ranging": ("lever_arm", "mounting"),
}  # fmt: skip
DEPARTING: Final[tuple[AssumptionName, ...]] = ("latency", "lever_arm", "mounting")  # from the spec
_UNITS: Final[dict[AssumptionName, str]] = {
    "timing": "s", "latency": "s", "lever_arm": "m", "mounting": "rad", "noise": "1",
    "clock": "s", "speed": "m/s", "rate": "rad/s",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Assumed:
    """One assumption: where, what, its figure (SI), and the key of the spec that says it.

    on_arrival: of a timing, whether the design itself stamps on arrival.  holdover_s: of a clock,
    for how long without a reference its figure is [s], None where it is of a clock in lock.
    """

    stage: str
    role: str
    name: AssumptionName
    value: float | None
    key: KeyPath
    on_arrival: bool = False
    holdover_s: float | None = None

    @property
    def unit(self) -> str:
        """SI unit of its figure."""
        return _UNITS[self.name]


def assumptions(case: Case, verdict: Verdict, told: Collection[str] = ()) -> tuple[Assumed, ...]:
    """Every assumption of a verdict on a design, stage by stage.

    told: vehicles of whose clock there are logs, so that one that the spec does not name is asked
    for too: its offset is taken as 0.
    """
    design = verdict.design
    if design is None:
        return ()
    found: list[Assumed] = []
    for stage, named in zip(case.stages, design.stages, strict=True):
        for role in stage.roles:
            found += _of_sensor(stage, role.role, named.roles[role.role])
        found += _of_vehicle(case, stage, design, found, told)
        found += _of_platform(stage)
    return tuple(found)


def _of_sensor(stage: StageCase, role: RoleName, named: NamedRole) -> Iterator[Assumed]:
    name, key = stage.choice.name, ("stages", stage.index, role)
    on_arrival = named.primitive == ARRIVAL
    yield Assumed(name, role, "timing", named.tau_s, (*key, "timestamping"), on_arrival)
    yield Assumed(name, role, "latency", 0.0, (*key, "timestamping"))
    for one in _MOUNTED[role]:
        yield Assumed(name, role, one, 0.0, (*key, "lever_arm") if one == "lever_arm" else key)
    yield Assumed(name, role, "noise", 1.0, (*key, "sensor"))


def _of_vehicle(
    case: Case, stage: StageCase, design: NamedDesign, before: list[Assumed],
    told: Collection[str],
) -> Iterator[Assumed]:  # fmt: skip
    """The host clock of a vehicle, at the first of its stages."""
    vehicle = stage.choice.vehicle_name
    clock = next((one for one in design.clocks if one.vehicle == vehicle), None)
    aboard = {one.name for one in design.stages if one.vehicle == vehicle}
    if any(a.name == "clock" and a.stage in aboard for a in before):
        return
    name, key = stage.choice.name, ("stages", stage.index)
    if clock is not None:
        entry = case.clock(vehicle, clock.id)
        free_s = None if entry is None else entry.alone_s
        place = (*key, "clock")
        yield Assumed(name, "clock", "clock", clock.offset_bound_s, place, holdover_s=free_s)
    elif vehicle in told:
        yield Assumed(name, "clock", "clock", 0.0, key)


def _of_platform(stage: StageCase) -> Iterator[Assumed]:
    entry, key = stage.platform.entry, ("stages", stage.index, "platform")
    name = stage.choice.name
    yield Assumed(name, "platform", "speed", float(entry.v_max), (*key, "v_max"))
    yield Assumed(name, "platform", "rate", float(entry.omega_max), (*key, "omega_max"))
