"""Runs of the hidden world: a manoeuvre, its stamps and what is sighted at each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tests.world.motions import DEGREE, MOTIONS, Motion, Sensors, survey_chain
from tests.world.trajectory import Array, Path

Indices = NDArray[np.int64]
CHAIN = "survey_chain"
SEGMENT_S = 2.0
PER_SEGMENT = 4


@dataclass(frozen=True)
class Carrier:
    """One stage: a vehicle, its true motion and its sensors."""

    name: str
    path: Path
    sensors: Sensors
    v_max_mps: float
    omega_max_radps: float
    distance_m: float


@dataclass(frozen=True)
class Scenario:
    """A run: carriers, stamps and what is sighted from the last carrier at every stamp."""

    name: str
    seed: int
    kind: str  # georeference | position
    duration_s: float
    rate_hz: float
    stamps_s: Array
    carriers: tuple[Carrier, ...]
    targets_m: Array  # (m, 3) true NED
    sighted: Indices  # (n,) index of the target sighted in each row

    def without(self, spans: tuple[tuple[float, float], ...]) -> Scenario:
        """The same run with gaps: rows whose stamps lie inside any of the spans are missing."""
        keep = np.ones(self.stamps_s.size, bool)
        for start, stop in spans:
            keep &= ~((self.stamps_s >= start) & (self.stamps_s < stop))
        return replace(self, stamps_s=self.stamps_s[keep], sighted=self.sighted[keep])


def _targets(rng: np.random.Generator, motion: Motion, stamps_s: Array) -> tuple[Array, Indices]:
    """Targets all around the way, and one in sight at every stamp.

    Bearings within 15 degrees of the vertical are passed over where there is a choice: a real
    sensor's azimuth means nothing there.
    """
    count = int(np.ceil(stamps_s[-1] / SEGMENT_S)) + 1
    middle = motion.path.position((np.arange(count, dtype=np.float64) + 0.5) * SEGMENT_S)
    around = np.repeat(middle, PER_SEGMENT, axis=0)
    angle = rng.uniform(-np.pi, np.pi, len(around))
    distance = rng.uniform(*motion.offsets_m, len(around))
    level = rng.uniform(*motion.levels_m, len(around))
    north, east = distance * np.cos(angle), distance * np.sin(angle)
    targets = np.column_stack([around[:, 0] + north, around[:, 1] + east, level])
    segment = np.minimum((stamps_s / SEGMENT_S).astype(np.int64), count - 1)
    choice = segment * PER_SEGMENT + rng.integers(0, PER_SEGMENT, (8, stamps_s.size))
    here = motion.path.position(stamps_s)
    into_body = motion.path.rotation(stamps_s).inv().as_matrix()
    seen = np.einsum("nij,knj->kni", into_body, targets[choice] - here)
    slope = np.abs(seen[..., 2]) / np.linalg.norm(seen[..., :2], axis=2)
    near_vertical = slope > np.tan(75.0 * DEGREE)
    pick = np.argmin(near_vertical, axis=0)  # the first of the eight that is not near vertical
    steepest = np.where(near_vertical.all(axis=0), np.argmin(slope, axis=0), pick)
    return targets, choice[steepest, np.arange(stamps_s.size)]


def _stamps(rng: np.random.Generator, duration_s: float, rate_hz: float) -> Array:
    """Row stamps: evenly spaced but for 2 % of scatter, to the 0.1 ms that a log keeps."""
    count = round(duration_s * rate_hz)
    return np.round((np.arange(count) + rng.uniform(0.0, 0.02, count)) / rate_hz, 4)


def _carrier(name: str, motion: Motion) -> Carrier:
    return Carrier(name, motion.path, motion.sensors, *motion.limits)


def scenario(
    name: str,
    seed: int,
    duration_s: float = 300.0,
    rate_hz: float = 10.0,
    kind: str = "georeference",
) -> Scenario:
    """A seeded run of a named manoeuvre.

    name: one of MOTIONS, or "survey_chain" (vessel and underwater vehicle, two stages).
    kind: "georeference" (surveyed targets are sighted) or "position" (a better system's
    reference position beside every fix).
    """
    rng = np.random.default_rng([seed, 11])
    if name == CHAIN:
        first, last = survey_chain(rng, duration_s)
        carriers: tuple[Carrier, ...] = (_carrier("vessel", first), _carrier("auv", last))
    else:
        last = MOTIONS[name](rng, duration_s)
        if kind == "position":
            last = replace(last, sensors=replace(last.sensors, ranging=None, attitude_rad=None))
        carriers = (_carrier(name.split("_")[0], last),)
    stamps = _stamps(rng, duration_s, rate_hz)
    targets, sighted = _targets(rng, last, stamps)
    return Scenario(name, seed, kind, duration_s, rate_hz, stamps, carriers, targets, sighted)
