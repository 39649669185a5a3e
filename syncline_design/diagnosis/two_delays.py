"""Two delays of a device, of which each row of a log has one."""

from __future__ import annotations

from dataclasses import replace

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, slots=True)
class TwoDelays:
    """Two delays of a device: [s], chance of the second, how loud the noise is over the spec's
    (variance), of each row how likely it is of the second, and the log-likelihood."""

    delays: tuple[float, float]
    chance: float
    loud2: float
    second: Array
    log_l: float

    def turned(self) -> TwoDelays:
        """The same with the second as the first."""
        first, second = self.delays
        return replace(self, delays=(second, first), chance=1.0 - self.chance,
                       second=1.0 - self.second)  # fmt: skip
