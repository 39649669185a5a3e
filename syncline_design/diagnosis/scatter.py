"""Effects that only change the covariance: which are worth a fit, and where to start it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.candidates import Candidate
from syncline_design.diagnosis.fitting import Data, Model, Opened
from syncline_design.diagnosis.noise import NoiseLevel, precision


def scatter_candidates(
    data: Data, found: Sequence[Candidate], model: Model, least: float
) -> list[tuple[Opened, NoiseLevel]]:
    """Stochastic effects worth a fit, each with a noise level to start from.

    Worth a fit is what lowers the NLL when some of it is simply put in.
    """
    result = []
    least = max(1.0, least * len(data.noise_rows) / len(data.view))
    error = model.error[data.noise_rows]
    base = precision(data.noise_structure, model.level).negative_log_likelihood(error)
    for candidate in found:
        if candidate.label in model.labels or candidate.effect.sensitivity is not None:
            continue
        if _free_already(candidate, model):
            continue
        for opened, level in _put_in(data, candidate, model):
            found_nll = precision(data.noise_structure, level).negative_log_likelihood(error)
            if found_nll < base - least:
                result.append((opened, level))
                break
    return result


def _free_already(candidate: Candidate, model: Model) -> bool:
    """Whether the noise that an effect would free is free: heavy tails free their sensor's size."""
    free = {(o.candidate.sensor, o.candidate.stage) for o in model.opened if o.what == "tails"}
    return candidate.effect.opens == "factor" and (candidate.sensor, candidate.stage) in free


def _put_in(data: Data, candidate: Candidate, model: Model) -> list[tuple[Opened, NoiseLevel]]:
    """Noise levels with a moderate, then a large share of a stochastic effect."""
    level, what = model.level, candidate.effect.opens
    sensor = (data.view.system.stages[candidate.stage].name, candidate.sensor)
    match what:
        case "factor":
            levels = [_times_factor(data, level, sensor, k) for k in (1.15, 2.0)]
        case "slow" | "down":
            levels = [_times_slow(data, level, sensor, what, k) for k in (1.5, 6.0)]
        case "size":
            index = directed_index(data, candidate)
            unit = usual_noise_size(data, index)
            sized = [with_size(level, index, k * unit) for k in (0.3, 1.0)]
            return [(Opened(candidate, what, index), one) for one in sized]
        case _:
            return []
    return [(Opened(candidate, what), one) for one in levels]


def _times_factor(data: Data, level: NoiseLevel, sensor: tuple[str, str], by: float) -> NoiseLevel:
    pairs = zip(data.structure.white, level.factor, strict=True)
    return replace(level, factor=tuple(f * by if w.sensor == sensor else f for w, f in pairs))


def _times_slow(
    data: Data, level: NoiseLevel, sensor: tuple[str, str], what: str, by: float
) -> NoiseLevel:
    slow = tuple(
        tuple(
            max(v, 0.5) * by if part.sensor == sensor and (what == "slow" or k == 2) else v
            for k, v in enumerate(values)
        )
        for part, values in zip(data.structure.slow, level.slow, strict=True)
    )
    return replace(level, slow=slow)


def usual_noise_size(data: Data, index: int) -> float:
    """Size at which a directed part has the variance of the white noise, in the median row."""
    direction = data.noise_structure.directed[index].direction
    own = float(np.median(np.sum(direction**2, axis=(1, 2))))
    white = sum(np.einsum("nii->n", w.covariance) for w in data.noise_structure.white)
    return float(np.sqrt(np.median(white) / max(own, 1e-300)))


def with_size(level: NoiseLevel, index: int, size: float) -> NoiseLevel:
    sizes = tuple(size if k == index else s for k, s in enumerate(level.size))
    return replace(level, size=sizes)


def directed_index(data: Data, candidate: Candidate) -> int:
    """Which directed part of the noise structure is this candidate's."""
    return [d.key for d in data.structure.directed].index(candidate.key)
