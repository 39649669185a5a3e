"""What a simulation found."""

from __future__ import annotations

import math
import platform
from collections.abc import Iterable, Mapping
from typing import Annotated, Final, Literal

import numpy as np

from syncline_design import __version__
from syncline_design.effects.record import Array
from syncline_design.machine.input_files import FileRead
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, Unbounded, optional
from syncline_design.model.figure_text import format_quantity, percent, to_digits
from syncline_design.model.quantity import Dimension
from syncline_design.simulation.distribution import Binned, ErrorValues
from syncline_design.simulation.settings import Envelope

SCHEMA: Final = "syncline-design/simulation/v1"
HISTOGRAM_BINS: Final = 60


@dataclass(frozen=True, slots=True)
class QuantileEstimate(Record):
    """A quantile of |error| [m] with its confidence interval; an open side is 0 or infinite."""

    value_m: Unbounded
    low_m: Unbounded
    high_m: Unbounded


@dataclass(frozen=True, slots=True)
class ProportionEstimate(Record):
    """P(|error| <= target_m) with its confidence interval.

    limit_written: the limit as the spec has it, `0.30 m`.
    """

    target_m: float
    value: float
    low: float
    high: float
    limit_written: str | None = optional()

    @property
    def limit(self) -> float:
        """The limit that it is held against [m]."""
        return self.target_m

    @property
    def unit(self) -> str:
        """Of the limit."""
        return "m"


@dataclass(frozen=True, slots=True)
class Histogram(Record):
    """Density of |error|: edges_m (n + 1,), density (n,) [1/m]."""

    edges_m: tuple[float, ...]
    density: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class Ensemble(Record):
    """Over what the quantiles run: every sample is a mission of its own.

    mission_constants: what is one value all through a mission, and drawn anew in each sample;
    per_sample: what else is drawn; outside: where a file leaves the platform's limits or the
    horizon; text: all of it in one sentence.
    """

    over: Literal["over_missions"]
    mission_constants: tuple[str, ...]
    per_sample: tuple[str, ...]
    outside: tuple[str, ...]
    text: str


@dataclass(frozen=True, slots=True)
class Bounded(Record):
    """For what a bound holds: relative time shifts, tilt, and the sensors' errors."""

    shift_s: float
    tilt_rad: float
    sensors: Literal["one sigma"]


@dataclass(frozen=True, slots=True)
class Certificate(Record):
    """How much a better direction could still add to a worst case.

    gap: how far, relatively, the bound is above what was found; triangle_m: the terms' sum, lever
    arms included.
    """

    gap: float
    triangle_m: float
    envelope: Bounded
    text: str


@dataclass(frozen=True, slots=True)
class WorstCase(Record):
    """The largest error found at relative shifts of at most tau_s.

    value_m: |e| of the best directions found; syncline_m: the Syncline at tau_s plus systematic
    terms; bound_m: nothing in the envelope of the certificate gives more.
    """

    tau_s: float
    value_m: float
    syncline_m: float
    ratio_to_syncline: Unbounded
    bound_m: float
    certificate: Certificate


@dataclass(frozen=True, slots=True)
class FlownWay(Record):
    """The way of a stage from above, thinned to what a figure can show."""

    stage: str
    north_m: tuple[float, ...]
    east_m: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class FlownStretch(Record):
    """Simulated errors at random moments of a stretch of a trajectory's time.

    north_m, east_m: the last stage's place at its middle; speed, turn rate and distance: of that
    stage, averaged over the stretch.
    """

    from_s: float
    to_s: float
    north_m: float
    east_m: float
    quantile95_m: float
    rms_m: float
    speed_mps: float
    turn_rate_radps: float
    distance_m: float


@dataclass(frozen=True, slots=True)
class Along(Record):
    """The trajectory of a file, and the errors along it; samples: of each stretch."""

    samples: int
    ways: tuple[FlownWay, ...]
    stretches: tuple[FlownStretch, ...]

    @property
    def largest(self) -> FlownStretch:
        """The stretch with the largest 95 % quantile."""
        return max(self.stretches, key=lambda one: one.quantile95_m)


@dataclass(frozen=True, slots=True)
class MonteCarlo(Record):
    """The probabilistic answer, and the worst case at the system's tau.

    distances_m: by stage, the end of its distances that was simulated: the one where errors are
    largest.  along: where a trajectory's file is followed and a figure was asked for.
    """

    samples: int
    seed: int
    envelope: Envelope
    estimator: Literal["plain"]  # the one there is: every sample drawn and counted alike
    effective_samples: int
    confidence: float
    ensemble: Ensemble
    quantiles: Mapping[str, QuantileEstimate]
    probability_within_target: ProportionEstimate | None
    worst_case: WorstCase
    histogram: Histogram
    distances_m: Mapping[str, float] | None = optional()
    along: Along | None = optional()

    def quantile(self, quantile: float) -> QuantileEstimate:
        """The estimate of one of the quantiles asked for."""
        return self.quantiles[repr(quantile)]


@dataclass(frozen=True, slots=True)
class ComparisonRow(Record):
    """The worst case against the Syncline at one tau, and in words why the ratio is what it is.

    causes: of `lever_arm`, `chord`, `range_noise`, `tilt`, those that matter, strongest first;
    empty where the ratio is near 1.
    """

    tau_s: float
    worst_case_m: float
    syncline_m: float
    ratio: Unbounded
    bound_m: float
    gap: float
    reason: str
    causes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class SimulatedSyncline(Record):
    """The Syncline that is simulated, and the tau it was asked about."""

    sensor_error_m: float
    sync_rate_mps: float
    tau_s: float
    tau_crit_s: Unbounded


@dataclass(frozen=True, slots=True)
class SpecName(Record):
    """The spec that a simulated system comes from."""

    name: str
    file: str


@dataclass(frozen=True, slots=True)
class SpecContent(Record):
    """The files whose content entered a simulation."""

    spec_sha256: str
    catalogs_sha256: str
    files: tuple[FileRead, ...]


@dataclass(frozen=True, slots=True)
class Simulation(Record):
    """Everything `simulate` found, schema `syncline-design/simulation/v1`.

    spec, provenance: missing where a system was simulated that comes from no spec.
    """

    schema: Annotated[str, SchemaName(SCHEMA)]
    monte_carlo: MonteCarlo
    syncline: SimulatedSyncline
    trajectory: str | None
    grid: tuple[ComparisonRow, ...]
    versions: Mapping[str, str]
    spec: SpecName | None = optional()
    provenance: SpecContent | None = optional()


def worst_case(
    tau_s: float,
    value_m: float,
    bound_m: float,
    triangle_m: float,
    syncline_m: float,
    tilt_rad: float,
) -> WorstCase:
    """A worst case with its ratio (1 where both are 0) and its certificate."""
    of_nothing = 1.0 if value_m == 0.0 else math.inf
    ratio = value_m / syncline_m if syncline_m > 0.0 else of_nothing
    gap = 1.0 - value_m / bound_m if bound_m > 0.0 else 0.0
    shift = format_quantity(tau_s, Dimension.TIME)
    text = (
        f"With every sensor at one sigma, relative time shifts up to {shift} (and what known "
        f"effects add), tilt up to {to_digits(math.degrees(tilt_rad), 3)} deg, and known "
        f"effects at what "
        f"they are charged, nothing exceeds the bound; what was found is "
        f"{percent(gap, 2)} below it"
    )
    certificate = Certificate(gap, triangle_m, Bounded(tau_s, tilt_rad, "one sigma"), text)
    return WorstCase(tau_s, value_m, syncline_m, ratio, bound_m, certificate)


def histogram(found: ErrorValues | Binned) -> Histogram:
    """The density over equal bins from 0 to the largest error."""
    edges, density = found.histogram(HISTOGRAM_BINS)
    return Histogram(tuple(_floats(edges)), tuple(_floats(density)))


def _floats(values: Array) -> Iterable[float]:
    return (float(value) for value in values)


def versions() -> dict[str, str]:
    """What the numbers depend on."""
    return {
        "syncline-design": __version__,
        "numpy": np.__version__,
        "python": platform.python_version(),
    }
