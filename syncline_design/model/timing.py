"""Timestamp error of one sensor under one timestamping method, and its bound.

mu is the paper's synchronisation error [s]: a measurement stamped t was valid at t + mu
(eq. state_space_y).  `latency = -mu`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

DEFAULT_COVERAGE_FACTOR = 3.0


@dataclass(frozen=True, slots=True)
class Uniform:
    """mu uniform on [low_s, high_s]."""

    low_s: float
    high_s: float


@dataclass(frozen=True, slots=True)
class Normal:
    """mu normal with mean_s and std_s."""

    mean_s: float
    std_s: float


@dataclass(frozen=True, slots=True)
class Constant:
    """mu fixed at value_s."""

    value_s: float


@dataclass(frozen=True, slots=True)
class Empirical:
    """mu drawn from measured values_s with equal weight."""

    values_s: tuple[float, ...]


Distribution = Uniform | Normal | Constant | Empirical


@dataclass(frozen=True, slots=True)
class TimingError:
    """A timestamp error mu: its distribution and, if its mean is calibrated out, what remains.

    `calibrated_s` None: mu follows the distribution as it stands.  Otherwise the known mean is
    removed and a constant of unknown sign, at most `calibrated_s`, remains (about 2 ms is what
    practice reaches).
    `drifted_s`: what a free-running clock has drifted away [s], drift times holdover: a further
    uniform draw between plus and minus it.  `bound_s`: a measured bound of |mu| that takes the
    place of the distribution's own.
    """

    distribution: Distribution
    calibrated_s: float | None = None
    drifted_s: float = 0.0
    bound_s: float | None = None


NO_ERROR = TimingError(Constant(0.0))


def mean(distribution: Distribution) -> float:
    """Mean of mu [s]."""
    match distribution:
        case Uniform(low, high):
            return 0.5 * (low + high)
        case Normal(mu, _):
            return mu
        case Constant(value):
            return value
        case Empirical(values):
            return math.fsum(values) / len(values)


def expected(error: TimingError) -> float:
    """Mean of mu [s] that is left: none where it is calibrated out."""
    return 0.0 if error.calibrated_s is not None else mean(error.distribution)


def bound(error: TimingError, coverage_factor: float = DEFAULT_COVERAGE_FACTOR) -> float:
    """Bound tau_i [s] of |mu|.

    |mean| + k std for a normal error (k: coverage factor), the larger absolute end for a uniform
    one, |value| for a constant one, the largest absolute value of an empirical one.  With the mean
    calibrated out, the bound of the centred error plus what remains of the mean.  What the clock
    has drifted away adds to either.
    """
    if error.bound_s is not None:
        return error.bound_s + error.drifted_s
    shift = 0.0 if error.calibrated_s is None else mean(error.distribution)
    remains = 0.0 if error.calibrated_s is None else error.calibrated_s
    match error.distribution:
        case Uniform(low, high):
            spread = max(abs(low - shift), abs(high - shift))
        case Normal(mu, std):
            spread = abs(mu - shift) + coverage_factor * std
        case Constant(value):
            spread = abs(value - shift)
        case Empirical(values):
            spread = max(abs(value - shift) for value in values)
    return spread + remains + error.drifted_s


def support(
    error: TimingError, coverage_factor: float = DEFAULT_COVERAGE_FACTOR
) -> tuple[float, float]:
    """(smallest, largest) mu [s]; of a normal error mean - k std and mean + k std.

    As `bound`, but each end by itself: data that are late by 0 to 50 ms span -50 ms to 0.
    """
    if error.bound_s is not None:
        return -error.bound_s - error.drifted_s, error.bound_s + error.drifted_s
    match error.distribution:
        case Uniform(low, high):
            ends = (low, high)
        case Normal(mu, std):
            ends = (mu - coverage_factor * std, mu + coverage_factor * std)
        case Constant(value):
            ends = (value, value)
        case Empirical(values):
            ends = (min(values), max(values))
    calibrated = error.calibrated_s is not None
    shift = mean(error.distribution) if calibrated else 0.0
    wider = (error.calibrated_s or 0.0) + error.drifted_s
    return ends[0] - shift - wider, ends[1] - shift + wider
