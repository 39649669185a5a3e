"""Known effects of a system as plain data, and what they add to its budget."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True, slots=True)
class EffectEntry:
    """A known systematic effect of a system: its name, where it acts, its parameters in SI."""

    effect: str
    sensor: str
    stage: str
    parameters: tuple[tuple[str, float | str], ...]


@dataclass(frozen=True, slots=True)
class Known:
    """What effects add: tau [s] by (stage, role), and systematic terms (name, stage, value [m]).

    The terms are added to the total [eq:sensor_error_ub is without them].
    """

    extra_tau_s: Mapping[tuple[str, Literal["position", "attitude", "ranging"]], float] = field(
        default_factory=dict
    )
    systematic: tuple[tuple[str, str, float], ...] = ()


NOTHING_KNOWN = Known()
