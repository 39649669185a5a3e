"""What explanations are made from, and where their figures come from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.pairing import distance_m
from syncline_design.model.roles import RoleName
from syncline_design.model.system import Sensor, Stage, System
from syncline_design.model.underway import Underway
from syncline_design.spec.requirement import Requirement
from syncline_design.verdict.named import NamedDesign
from syncline_design.verdict.tree import Source


@dataclass(frozen=True, slots=True)
class Worked:
    """What an explanation is made from; asked: the spec's requirements by id."""

    system: System
    model: str
    design: NamedDesign
    sources: Sequence[Source]
    asked: Mapping[str, Requirement] = field(default_factory=dict)
    seed: int = 0

    def source(self, *entries: str) -> str:
        """Where the figures of entries come from."""
        told = {one.entry: one.source for one in self.sources}
        return "\n".join(f"{entry}: {told[entry]}" for entry in entries if told.get(entry))

    def stamped(self, stage: Stage, role: RoleName) -> str:
        """Where the figures of a role's timestamping come from."""
        named = next((one for one in self.design.stages if one.name == stage.name), None)
        found = None if named is None else named.roles.get(role)
        return "" if found is None else self.source(found.timestamping)

    def of(self, sensor: Sensor | None) -> str:
        """Where the figures of a sensor come from."""
        return "" if sensor is None else self.source(sensor.id)


def apart(one: Underway) -> tuple[str, str]:
    """(formula, numbers) of the time between two samples."""
    rate, sound = one.sensor.rate_hz, one.sensor.sound_mps
    waits = [] if rate is None else [("1 / rate", f"1 / {float(rate)!r}")]
    if sound is not None:
        waits.append(("2 d / c", f"2 * {float(distance_m(one.owner))!r} / {float(sound)!r}"))
    if len(waits) == 1:
        return waits[0]
    return "max(1 / rate, 2 d / c)", f"max({', '.join(numbers for _, numbers in waits)})"
