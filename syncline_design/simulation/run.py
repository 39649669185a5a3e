"""The simulator's questions, answered: cross_check, simulate, decide."""

from __future__ import annotations

import math
from dataclasses import field, replace
from functools import lru_cache
from typing import Literal

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.budget import budget
from syncline_design.model.ends import at_ends, distances_of
from syncline_design.model.system import SimulationError, System
from syncline_design.simulation import distribution
from syncline_design.simulation.along import along
from syncline_design.simulation.comparison import DEFAULT_GRID_S, comparison
from syncline_design.simulation.distribution import KEPT_VALUES, Binned, ErrorValues
from syncline_design.simulation.ensemble import ensemble_of
from syncline_design.simulation.excursions import excursions, follows_a_file
from syncline_design.simulation.intervals import proportion_interval, quantile_ranks
from syncline_design.simulation.kernel import norm
from syncline_design.simulation.results import (
    SCHEMA,
    Ensemble,
    MonteCarlo,
    ProportionEstimate,
    QuantileEstimate,
    SimulatedSyncline,
    Simulation,
    WorstCase,
    histogram,
    versions,
)
from syncline_design.simulation.sampling import JOB, run_jobs
from syncline_design.simulation.settings import (
    DEFAULT_MANOEUVRE,
    SimulationSettings,
    demand_simulable,
)
from syncline_design.simulation.worker import tally
from syncline_design.simulation.worst_case import worst_cases

DEFAULT_SETTINGS = SimulationSettings()
DEFAULT_CAP = 4_000_000
Status = Literal["pass", "fail", "indeterminate"]
LOOK_GROWTH = 4  # each further look of `decide` has this many times the samples
CROSS_CHECK_GAP = 1e-3  # where a cross-check stops looking: so near, relatively, to the bound
CROSS_CHECK_ITERATIONS = 30


@dataclass(frozen=True, slots=True)
class CrossCheck:
    """A Monte Carlo with the errors that it counted, so that `decide` need not draw them again."""

    monte_carlo: MonteCarlo
    errors: ErrorValues | Binned = field(repr=False, compare=False)
    system: System  # at one distance a stage


def cross_check(system: System, settings: SimulationSettings = DEFAULT_SETTINGS) -> CrossCheck:
    """Quantiles, P(|error| <= limit) and the worst case at the system's own tau.

    Where stages give several distances, at those of their ends where the largest of the quantiles
    is largest.  Raises SimulationError for a system or settings that cannot be simulated.
    """
    demand_simulable(system)
    ends = list(at_ends(system))
    if len(ends) == 1:
        return _cross_check(ends[0], settings)
    found = [_cross_check(end, settings) for end in ends]
    last = repr(max(settings.quantiles, default=0.95))
    worst = max(found, key=lambda one: _value(one.monte_carlo, last))
    where = distances_of(system, worst.system)
    return replace(worst, monte_carlo=replace(worst.monte_carlo, distances_m=where))


def _value(found: MonteCarlo, quantile: str) -> float:
    estimate = found.quantiles.get(quantile)
    return found.worst_case.value_m if estimate is None else estimate.value_m


def _cross_check(system: System, settings: SimulationSettings) -> CrossCheck:
    """The same at one distance a stage."""
    worst = own_worst_case(system, settings.seed)
    errors = error_distribution(system, settings)
    drawn = ensemble_of(
        system, settings.envelope, follows_a_file(settings), excursions(system, settings)
    )
    return CrossCheck(_monte_carlo(settings, errors, worst, drawn), errors, system)


@lru_cache(maxsize=64)  # a study asks for the same system at one limit after the other
def own_worst_case(system: System, seed: int) -> WorstCase:
    """The worst case at the system's own tau, as near to its bound as a cross-check asks."""
    (worst,) = worst_cases(
        system,
        np.array([budget(system).tau_s]),
        seed,
        iterations=CROSS_CHECK_ITERATIONS,
        enough_gap=CROSS_CHECK_GAP,
    )
    return worst


def simulate(system: System, settings: SimulationSettings = DEFAULT_SETTINGS) -> Simulation:
    """Monte Carlo and the worst case against the Syncline over the grid of tau."""
    found = cross_check(system, settings).monte_carlo
    found = replace(found, along=along(found, system, settings))
    figures = budget(system)
    grid = settings.tau_grid_s or DEFAULT_GRID_S
    trajectory = None
    if settings.envelope == "trajectory":
        trajectory = str(settings.trajectory or DEFAULT_MANOEUVRE)
    return Simulation(
        schema=SCHEMA,
        monte_carlo=found,
        syncline=SimulatedSyncline(
            figures.sensor_error_m,
            figures.sync_rate_mps,
            found.worst_case.tau_s,
            figures.tau_crit_s,
        ),
        trajectory=trajectory,
        grid=comparison(system, grid, seed=settings.seed),
        versions=versions(),
    )


def _monte_carlo(
    settings: SimulationSettings, found: ErrorValues | Binned, worst: WorstCase, drawn: Ensemble
) -> MonteCarlo:
    estimates = quantile_estimates(found, settings.quantiles, settings.confidence)
    within = None
    if settings.limit_m is not None:
        count = found.within(settings.limit_m)
        low, high = proportion_interval(count, found.count, settings.confidence)
        share = count / found.count
        within = ProportionEstimate(settings.limit_m, share, low, high, settings.limit_written)
    return MonteCarlo(
        samples=settings.samples,
        seed=settings.seed,
        envelope=settings.envelope,
        estimator="plain",
        effective_samples=settings.samples,
        confidence=settings.confidence,
        ensemble=drawn,
        quantiles={repr(q): one for q, one in zip(settings.quantiles, estimates, strict=True)},
        probability_within_target=within,
        worst_case=worst,
        histogram=histogram(found),
    )


def quantile_estimates(
    found: ErrorValues | Binned, quantiles: tuple[float, ...], confidence: float
) -> tuple[QuantileEstimate, ...]:
    """Quantiles, each between two order statistics that enclose it with `confidence`."""
    ranks = [quantile_ranks(quantile, found.count, confidence) for quantile in quantiles]
    values = iter(found.order_statistics([rank for ends in ranks for rank in ends]))
    estimates = []
    for _ in quantiles:
        low, value, high = next(values), next(values), next(values)
        estimates.append(QuantileEstimate(value, low, high))
    return tuple(estimates)


@dataclass(frozen=True, slots=True)
class Decision:
    """Whether a quantile of |error| is at most a limit.

    status `indeterminate`: after `samples` the interval still straddles the limit.  estimate: of
    the quantile; within: of P(|error| <= limit), what the decision rests on.  Each of `looks`
    looks was taken at `look_confidence`, so that all of them together are right with at least
    `confidence` (Bonferroni).
    """

    status: Status
    limit_m: float
    samples: int
    looks: int
    confidence: float
    look_confidence: float
    estimate: QuantileEstimate
    within: ProportionEstimate


def decide(
    system: System,
    settings: SimulationSettings,
    quantile: float,
    limit_m: float,
    cap_samples: int = DEFAULT_CAP,
    first: CrossCheck | None = None,
) -> Decision:
    """Whether the quantile of |error| is at most limit_m, sampling on while it is undecided.

    Passes when P(|error| <= limit) >= quantile for the whole interval, fails when for none of it.
    Starts with `settings.samples` (those of `first`, when given, are not drawn again) and takes
    four times as many at each further look, up to `cap_samples`.  An error that is not a number
    counts as beyond the limit.  Where stages give several distances, the limit has to hold at every
    end of them, and the decision is that of the worst.
    """
    demand_simulable(system)
    if not 0.0 < quantile < 1.0:
        raise SimulationError(f"quantile: expected a number between 0 and 1, found {quantile}")
    found: list[Decision] = []
    for end in at_ends(system):
        own = first if first is not None and first.system == end else None
        found.append(_decide(end, settings, quantile, limit_m, cap_samples, own))
        if found[-1].status == "fail":
            break
    order: tuple[Status, ...] = ("pass", "indeterminate", "fail")
    return max(found, key=lambda one: (order.index(one.status), one.estimate.value_m))


def _decide(
    system: System,
    settings: SimulationSettings,
    quantile: float,
    limit_m: float,
    cap_samples: int,
    first: CrossCheck | None,
) -> Decision:
    """The same at one distance a stage."""
    sizes = look_sizes(settings.samples, cap_samples)
    look_confidence = 1.0 - (1.0 - settings.confidence) / len(sizes)
    counts, within, drawn = _counted(first, settings, limit_m)
    for size in sizes:
        if drawn < size:
            # a shorter first run may have ended inside a job: that job is drawn again
            if drawn % JOB:
                counts, within, drawn = _counted(None, settings, limit_m)
            found, more = tally(system, settings, drawn, size, limit_m)
            counts, within, drawn = counts + found, within + more, size
        low, high = proportion_interval(within, size, look_confidence)
        status = _status(low, high, quantile)
        if status != "indeterminate":
            break
    (estimate,) = quantile_estimates(Binned(counts), (quantile,), look_confidence)
    share = ProportionEstimate(limit_m, within / size, low, high)
    looks = sizes.index(size) + 1
    return Decision(
        status, limit_m, size, looks, settings.confidence, look_confidence, estimate, share
    )


def _counted(
    first: CrossCheck | None, settings: SimulationSettings, limit_m: float
) -> tuple[distribution.Counts, int, int]:
    """(counts, how many within the limit, how many) of the samples of a first run, if any fits."""
    counts = distribution.no_counts()
    if first is None or not isinstance(first.errors, ErrorValues):
        return counts, 0, 0
    drawn = first.monte_carlo
    if (drawn.samples, drawn.seed, drawn.envelope) != (
        settings.samples,
        settings.seed,
        settings.envelope,
    ):
        return counts, 0, 0
    distribution.add_counts(counts, first.errors.errors_m)
    return counts, first.errors.within(limit_m), drawn.samples


def _status(low: float, high: float, quantile: float) -> Status:
    """Whether P(|error| <= limit), between low and high, reaches the quantile."""
    if low >= quantile:
        return "pass"
    return "fail" if high < quantile else "indeterminate"


def look_sizes(samples: int, cap_samples: int) -> list[int]:
    """Sample counts of the looks: growing by LOOK_GROWTH, the last one the cap."""
    sizes = [samples]
    while sizes[-1] < cap_samples:
        sizes.append(min(sizes[-1] * LOOK_GROWTH, cap_samples))
    return sizes


def error_distribution(system: System, settings: SimulationSettings) -> ErrorValues | Binned:
    """Distribution of |error| over `settings.samples` samples; memory does not grow beyond
    `KEPT_VALUES` of them."""
    demand_simulable(system)
    if settings.samples <= KEPT_VALUES:
        kept = np.empty(settings.samples)

        def keep(start: int, errors: Array) -> None:
            kept[start : start + errors.shape[1]] = norm(errors)

        run_jobs(system, settings, 0, settings.samples, keep)
        return ErrorValues(kept)
    counts, _ = tally(system, settings, 0, settings.samples, math.inf)
    return Binned(counts)
