"""What a simulation found; frozen, with JSON beside each type."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from syncline_design import __version__
from syncline_design.effects.record import Array
from syncline_design.simulation.distribution import Binned, Values
from syncline_design.simulation.ensemble import Ensemble
from syncline_design.simulation.worst_case import WorstCase

SCHEMA = "syncline-design/simulation/v1"
Json = dict[str, object]


@dataclass(frozen=True, slots=True)
class QuantileEstimate:
    """A quantile of |error| [m] with its confidence interval; an open side is 0 or inf."""

    quantile: float
    value_m: float
    low_m: float
    high_m: float

    def to_json(self) -> Json:
        return {
            "value_m": finite(self.value_m),
            "low_m": finite(self.low_m),
            "high_m": finite(self.high_m),
        }


@dataclass(frozen=True, slots=True)
class ProportionEstimate:
    """P(|error| <= target_m) with its confidence interval."""

    target_m: float
    value: float
    low: float
    high: float

    def to_json(self) -> Json:
        return {
            "target_m": self.target_m,
            "value": self.value,
            "low": self.low,
            "high": self.high,
        }


@dataclass(frozen=True, slots=True)
class Histogram:
    """Density of |error|: edges_m (n + 1,), density (n,) [1/m]."""

    edges_m: tuple[float, ...]
    density: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class MonteCarlo:
    """The probabilistic answer, and the worst case at the system's tau."""

    samples: int
    seed: int
    envelope: str
    confidence: float
    quantiles: tuple[QuantileEstimate, ...]
    within_target: ProportionEstimate | None
    worst_case: WorstCase
    histogram: Histogram
    ensemble: Ensemble | None = None
    distribution: Values | Binned | None = field(default=None, repr=False, compare=False)

    def quantile(self, quantile: float) -> QuantileEstimate:
        """The estimate of one of the quantiles asked for."""
        return next(found for found in self.quantiles if found.quantile == quantile)

    def to_json(self) -> Json:
        """The `monte_carlo` part of a verdict."""
        within = self.within_target
        return {
            "samples": self.samples,
            "seed": self.seed,
            "envelope": self.envelope,
            "estimator": "plain",  # the one there is: every sample drawn and counted alike
            "effective_samples": self.samples,
            "confidence": self.confidence,
            "ensemble": None if self.ensemble is None else self.ensemble.to_json(),
            "quantiles": {repr(q.quantile): q.to_json() for q in self.quantiles},
            "probability_within_target": None if within is None else within.to_json(),
            "worst_case": worst_case_json(self.worst_case),
            "histogram": {
                "edges_m": list(self.histogram.edges_m),
                "density": list(self.histogram.density),
            },
        }


@dataclass(frozen=True, slots=True)
class ComparisonRow:
    """The worst case against the Syncline at one tau, and in words why the ratio is what it is.

    causes: of `lever_arm`, `chord`, `range_noise`, those that matter, strongest first; empty
    where the ratio is near 1.
    """

    worst_case: WorstCase
    reason: str
    causes: tuple[str, ...] = ()

    def to_json(self) -> Json:
        found = self.worst_case
        return {
            "tau_s": found.tau_s,
            "worst_case_m": found.value_m,
            "syncline_m": found.syncline_m,
            "ratio": finite(found.ratio),
            "bound_m": found.bound_m,
            "gap": found.gap,
            "reason": self.reason,
            "causes": list(self.causes),
        }


@dataclass(frozen=True, slots=True)
class SimulationResult:
    """Everything `simulate` found."""

    monte_carlo: MonteCarlo
    grid: tuple[ComparisonRow, ...]
    tau_crit_s: float
    sensor_error_m: float
    sync_rate_mps: float
    trajectory: str | None = None

    def to_json(self) -> Json:
        """Schema `syncline-design/simulation/v1`."""
        return {
            "schema": SCHEMA,
            "monte_carlo": self.monte_carlo.to_json(),
            "syncline": {
                "sensor_error_m": self.sensor_error_m,
                "sync_rate_mps": self.sync_rate_mps,
                "tau_s": self.monte_carlo.worst_case.tau_s,
                "tau_crit_s": finite(self.tau_crit_s),
            },
            "trajectory": self.trajectory,
            "grid": [row.to_json() for row in self.grid],
            "versions": versions(),
        }


def worst_case_json(found: WorstCase) -> Json:
    """The `worst_case` part: value, ratio, bound, and how much is certified."""
    return {
        "tau_s": found.tau_s,
        "value_m": found.value_m,
        "syncline_m": found.syncline_m,
        "ratio_to_syncline": finite(found.ratio),
        "bound_m": found.bound_m,
        "certificate": {
            "gap": found.gap,
            "triangle_m": found.triangle_m,
            "envelope": {
                "shift_s": found.tau_s,
                "tilt_rad": found.tilt_rad,
                "sensors": "one sigma",
            },
            "text": f"{envelope_words(found)}, nothing exceeds the bound; what was found is "
            f"{100 * found.gap:.2g} % below it",
        },
    }


def envelope_words(found: WorstCase) -> str:
    """Where the bound holds."""
    tilt = f"{math.degrees(found.tilt_rad):.3g} deg"
    return (
        f"With every sensor at one sigma, relative time shifts up to {found.tau_s:.4g} s (and what "
        f"known effects add), tilt up to {tilt}, and known effects at what they are charged"
    )


def finite(value: float) -> float | None:
    """The value, or None where JSON has no number for it."""
    return value if math.isfinite(value) else None


def versions() -> dict[str, str]:
    """What the numbers depend on."""
    return {
        "syncline-design": __version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }


def histogram(found: Values | Binned, bins: int = 60) -> Histogram:
    """The density over equal bins from 0 to the largest error."""
    return _histogram(*found.histogram(bins))


def _histogram(edges: Array, density: Array) -> Histogram:
    return Histogram(tuple(_floats(edges)), tuple(_floats(density)))


def _floats(values: Array) -> Iterable[float]:
    return (float(value) for value in values)
