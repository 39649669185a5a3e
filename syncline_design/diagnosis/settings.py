"""What a diagnosis may be told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

Progress = Callable[[str, float], None]  # (what is being done, share done 0..1)


def silent(_: str, __: float) -> None:
    """No progress shown."""


@dataclass(frozen=True, slots=True)
class DiagnosisSettings:
    """seed: of everything drawn.  false_alarm_rate: chance that a clean log is found at fault.

    max_effects: how many effects are named at most.  exclude_effects: names that must not be used.
    """

    seed: int = 0
    false_alarm_rate: float = 0.05
    max_effects: int = 4
    exclude_effects: tuple[str, ...] = ()
