"""Names of what was chosen: the design as a spec would pin it."""

from __future__ import annotations

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.roles import RoleName


@dataclass(frozen=True, slots=True)
class RoleSelection:
    """One role of one stage, by the ids of the catalogs (`inline` for a figure given in place)."""

    stage: str
    role: RoleName
    sensor: str
    primitive: str
    method: str


@dataclass(frozen=True, slots=True)
class ClockSelection:
    """The clock discipline of a vehicle's host; id None: timelines taken as common."""

    vehicle: str
    id: str | None


@dataclass(frozen=True, slots=True)
class Selection:
    """All roles and clocks of a design."""

    roles: tuple[RoleSelection, ...]
    clocks: tuple[ClockSelection, ...] = ()

    def role(self, stage: str, role: RoleName) -> RoleSelection | None:
        """What was chosen for one role."""
        for one in self.roles:
            if one.stage == stage and one.role == role:
                return one
        return None

    def clock(self, vehicle: str) -> str | None:
        """The clock discipline of a vehicle."""
        for one in self.clocks:
            if one.vehicle == vehicle:
                return one.id
        return None
