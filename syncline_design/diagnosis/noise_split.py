"""How much noise each sensor has, with an interval that counts what they can be taken for.

The sizes of noise are those of the likelihood of the series in time (`noise_in_time`).  What is
asked beside them of rows alone is split by directions: with S_i = F_i + sum_a t_a C_ai the
covariance of row i, t_a the variance over the spec's of some readings of a sensor,
    I_ab = tr(S^-1 C_a S^-1 C_b) / 2,   g_a = e' S^-1 C_a S^-1 e / 2 - tr(S^-1 C_a S^-1 F) / 2,
summed over the rows, t = I^-1 g, again until it rests (Fisher scoring of normal variance
components).  Its covariance is that of leaving out one of sixteen stretches after the other, so
tails count, and at least I^-1, which normal noise leaves at best: sixteen stretches that happen to
agree are no proof where sensors are hardly told apart.
Source: Searle, Casella, McCulloch, Variance Components (1992), ch. 6.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.diagnosis.fitting import Data, Model
from syncline_design.diagnosis.noise import SensorKey, as_specified, white_covariance
from syncline_design.diagnosis.noise_in_time import sizes_in_time
from syncline_design.diagnosis.noise_parts import NoisePart, noise_parts
from syncline_design.diagnosis.unlike_readings import READINGS, Unlike
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import student_limit
from syncline_design.model.normal import NORMAL_95

BLOCKS: Final = 16
ROUNDS: Final = 6
LEAST: Final = 1e-3  # of the spec's variance, while weights are found
LEAST_ROWS: Final = 64


@dataclass(frozen=True, slots=True)
class NoiseFactor:
    """Standard deviation over the spec's of a sensor or of some of its readings, white and slow
    noise together, with its 95 % interval.  readings: their names; none: all of them.
    """

    value: float
    low: float
    high: float
    readings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class NoiseFactors:
    """Of one sensor, the loudest readings first; share: of each in its variance at the platform's
    distance.  sigma: of its readings by the spec, SI.
    """

    parts: tuple[NoiseFactor, ...]
    share: tuple[float, ...] = (1.0,)
    sigma: tuple[float, ...] = ()

    @property
    def loudest(self) -> NoiseFactor:
        return self.parts[0]

    @property
    def whole(self) -> tuple[float, float, float]:
        """The factor of all readings by their share, with the ends of its interval."""
        parts = list(zip(self.share, self.parts, strict=True))
        ends = [[f.value, f.low, f.high] for _, f in parts]
        value, low, high = (
            math.sqrt(sum(s * end[k] ** 2 for (s, _), end in zip(parts, ends, strict=True)))
            for k in range(3)
        )
        return value, low, high

    @property
    def most(self) -> float:
        """The factor on all of the sensor that is as bad as what the log leaves open at most."""
        known = [s * f.value**2 for s, f in zip(self.share, self.parts, strict=True)]
        more = [s * (f.high**2 - f.value**2) for s, f in zip(self.share, self.parts, strict=True)]
        return math.sqrt(sum(known) + max(more))


def factors(data: Data, model: Model, unlike: Sequence[Unlike] = ()) -> Mapping[str, NoiseFactors]:
    """Of every sensor that the log's error is made of, by `stage/sensor`."""
    split = noise_parts(data, unlike)
    if len(data.view) < LEAST_ROWS or not split or not data.axes:
        return {}
    found: dict[SensorKey, list[tuple[NoiseFactor, float]]] = {}
    for one, size in zip(split, sizes_in_time(data, model, split), strict=True):
        names = tuple(READINGS[one.sensor[1]][k] for k in one.readings)
        value, low, high = (math.sqrt(v) for v in (size.value, size.low, size.high))
        factor = NoiseFactor(value, low, high, names if len(names) < 3 else ())
        found.setdefault(one.sensor, []).append((factor, _share(data, one)))
    return {"/".join(key): _loudest_first(own, _sigma(data, key)) for key, own in found.items()}


def stated_m(data: Data) -> Mapping[str, float]:
    """RMS [m] that every sensor's white noise makes on a log by the spec, by `stage/sensor`."""
    compared = np.isfinite(data.view.log.truth_m)
    return {
        "/".join(white.sensor): math.sqrt(
            float(np.mean(np.sum(np.einsum("nii->ni", white.covariance) * compared, axis=1)))
        )
        for white in data.structure.white
    }


def components(data: Data, unlike: Sequence[Unlike]) -> tuple[tuple[SensorKey, ...], Array, Array]:
    """Sensors of the readings that have a factor, C_a (m, n, k, k) of each and F (n, k, k) [m2]."""
    split, axes = noise_parts(data, unlike), list(data.axes)
    parts = np.stack([_on(one.covariance, axes) for one in split])
    whole = white_covariance(data.structure, as_specified(data.structure))
    return tuple(one.sensor for one in split), parts, _on(whole, axes) - parts.sum(0)


def estimated(error: Array, parts: Array, fixed: Array) -> tuple[Array, Array]:
    """t of every part, and half of its 95 % interval in noise that is white, (m,).

    error (n, k), parts (m, n, k, k), fixed (n, k, k).
    """
    block = np.arange(len(error)) * BLOCKS // len(error)
    share = np.ones(len(parts))
    for _ in range(ROUNDS):
        information, score = _sums(error, parts, fixed, share, block)
        share = np.maximum(_solved(information.sum(0), score.sum(0)), LEAST)
    values = _solved(information.sum(0), score.sum(0))
    less = [_solved(information.sum(0) - i, score.sum(0) - s)
            for i, s in zip(information, score, strict=True)]  # fmt: skip
    off = np.array(less) - np.mean(less, axis=0)
    spread = np.sqrt((BLOCKS - 1) / BLOCKS * np.sum(off**2, axis=0))
    at_best = np.sqrt(np.maximum(np.diag(_inverse(information.sum(0))), 0.0))
    by_stretch = student_limit(0.025, BLOCKS - 1) * spread
    return values, np.maximum(by_stretch, NORMAL_95 * at_best)


def _sigma(data: Data, key: SensorKey) -> tuple[float, ...]:
    stage = next(s for s in data.view.system.stages if s.name == key[0])
    return tuple(float(s) for s in getattr(stage, key[1]).sigma)


def _loudest_first(
    own: Sequence[tuple[NoiseFactor, float]], sigma: tuple[float, ...]
) -> NoiseFactors:
    ranked = sorted(own, key=lambda pair: -pair[0].value)
    whole = sum(share for _, share in ranked) or 1.0
    return NoiseFactors(
        tuple(f for f, _ in ranked), tuple(share / whole for _, share in ranked), sigma
    )


def _share(data: Data, one: NoisePart) -> float:
    """Variance [m2] that readings add to a target at the platform's distance, by the spec."""
    stage = next(s for s in data.view.system.stages if s.name == one.sensor[0])
    distance_m, sigma = stage.platform.distance_m, _sigma(data, one.sensor)
    arms = {"position": (1.0,) * 3, "attitude": (distance_m,) * 3,
            "ranging": (1.0, distance_m, distance_m)}[one.sensor[1]]  # fmt: skip
    return float(sum((sigma[k] * arms[k]) ** 2 for k in one.readings))


def _on(covariance: Array, axes: Sequence[int]) -> Array:
    found: Array = covariance[:, axes][:, :, axes]
    return found


def _sums(
    error: Array, parts: Array, fixed: Array, share: Array, block: NDArray[np.int64]
) -> tuple[Array, Array]:
    """I (G, m, m) and g (G, m) of every stretch."""
    total = fixed + np.einsum("a,anij->nij", share, parts)
    inverse = np.linalg.inv(total)
    weighted = np.einsum("nij,nj->ni", inverse, error)
    turned = inverse @ parts  # S^-1 C_a
    own = 0.5 * np.einsum("anij,bnji->nab", turned, turned)
    score = 0.5 * np.einsum("ni,anij,nj->na", weighted, parts, weighted)
    score -= 0.5 * np.einsum("anij,nji->na", turned, inverse @ fixed)
    groups = [np.flatnonzero(block == k) for k in range(BLOCKS)]
    return np.array([own[g].sum(0) for g in groups]), np.array([score[g].sum(0) for g in groups])


def _solved(information: Array, score: Array) -> Array:
    found: Array = _inverse(information) @ score
    return found


def _inverse(information: Array) -> Array:
    """Of columns scaled alike; nothing for directions that are not seen."""
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    inverse = np.linalg.pinv(information / scale[:, None] / scale, rcond=1e-9, hermitian=True)
    found: Array = inverse / scale[:, None] / scale
    return found
