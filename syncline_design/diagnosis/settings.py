"""What a diagnosis is asked for, and how it shows its progress."""

from __future__ import annotations

from collections.abc import Callable

from syncline_design.machine.quick_dataclass import dataclass

SearchProgress = Callable[[str, float], None]  # (what is being done, share done 0..1)


def silent(_: str, __: float) -> None:
    """No progress shown."""


@dataclass(frozen=True, slots=True)
class DiagnosisSettings:
    """seed: of everything drawn.  false_alarm_rate: chance that a clean log is found at fault.

    max_effects: how many effects are named at most.  exclude_effects: names that must not be used.
    unseen_block: whether to search once more without a block of the log, to judge on it.
    """

    seed: int = 0
    false_alarm_rate: float = 0.05
    max_effects: int = 8
    exclude_effects: tuple[str, ...] = ()
    unseen_block: bool = True
