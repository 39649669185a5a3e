"""Effects tried in a model: their fit by re-simulation, whether they are possible, their chance.

Those that move the mean start from zero; those that only change the covariance start where a
rough guess of theirs lowers the likelihood, and are not tried where none does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.candidates import (
    EDGE,
    STEP_TIMES,
    Candidate,
    Signature,
    slopes,
    zero_values,
)
from syncline_design.diagnosis.fitting import (
    Data,
    Model,
    Opened,
    adjusted,
    fit,
    inverse_scaled,
)
from syncline_design.diagnosis.motion_scatter import grows_with_motion
from syncline_design.diagnosis.noise import NoiseLevel, precision, with_size
from syncline_design.diagnosis.noise_fit import TIME_LEAST_S, TIME_LEAST_STAMPS
from syncline_design.diagnosis.parts import STRETCHES
from syncline_design.diagnosis.scores import log_p_of
from syncline_design.diagnosis.spans import span_of
from syncline_design.effects.acting import Acting
from syncline_design.effects.kinematics import elapsed
from syncline_design.effects.record import Array, Effect

ROUNDS, PLACES = 4, 7  # in which the place of a step is refined; places tried in each
QUICK = 1.25  # times the least time constant, up to which noise is as good as white
AGREE = 0.3  # how far a scatter may be from what the mean says, as a share of it


def freedom_of(effect: Effect) -> int:
    """Figures that are fitted: parameters, and the size of a scatter that has one of its own."""
    own_size = effect.kind == "stochastic" and effect.sensitivity is not None
    return len(effect.parameters) + own_size


def log_chance(effect: Effect, gain: float, freedom: int) -> float:
    """log of the chance that noise alone saves `gain` [nat] in this one effect.

    A step is charged for the places at which it was looked for, what acts in a part of the log for
    the stretches.
    """
    places = STEP_TIMES if any(p.located for p in effect.parameters) else 1
    stretches = STRETCHES if span_of(effect) is not None else 1
    return min(log_p_of(2.0 * gain, freedom) + math.log(places * stretches), 0.0)


def with_effect(
    data: Data, model: Model, found: Signature, level: NoiseLevel, against: float = math.inf
) -> Model:
    """The model with one more effect that moves the mean, fitted from zero by re-simulation.

    against: NLL of what it is held against [nat], see `fit`.
    """
    values = {**zero_values(found.candidate.effect, found.at), **found.start}
    start = found.candidate.acting(values)
    opened = model.opened
    if found.candidate.effect.kind == "stochastic":
        directed = directed_index(data, found.candidate)
        opened = (*opened, Opened(found.candidate, "size", directed))
        level = with_size(level, directed, 0.3 * usual_noise_size(data, directed))
    fitted = fit(data, (*model.acting, start), opened, start=level, against=against)
    if not found.at:
        return fitted
    placed = located(data, fitted)  # in the noise that a step at the wrong place leaves
    return fit(data, placed.acting, opened, start=placed.level, against=against)


def plausible(data: Data, model: Model) -> bool:
    """Whether every fitted parameter is of a size that its effect can have, and jitter is seen."""
    return _possible_values(model) and _possible_noise(data, model)


def plausible_in_place(data: Data, model: Model, of: Model) -> bool:
    """The same of a rival; noise that speaks against the one whose place it takes has no say."""
    return _possible_values(model) and (
        _possible_noise(data, model) or not _possible_noise(data, of)
    )


def _possible_values(model: Model) -> bool:
    for one in model.acting:
        for p in one.effect.slopes():
            value = one.values[p.name]
            if abs(value) > p.high or (not p.signed and value < 0.0):
                return False
    return all(_mean_and_scatter_agree(model, one) for one in model.opened)


def _possible_noise(data: Data, model: Model) -> bool:
    return all(
        _lasts(data, model, one) and seen_in_motion(data, model, one) for one in model.opened
    )


def _lasts(data: Data, model: Model, opened: Opened) -> bool:
    """Whether slow noise, if it is some, is slower than what is as good as white in the log.

    White noise of one axis that is larger than the others' passes for the quickest there is.
    """
    if opened.what not in ("slow", "down"):
        return True
    sensor = (data.view.system.stages[opened.candidate.stage].name, opened.candidate.sensor)
    stamps = np.unique(data.structure.time_s)
    usual_s = float(np.median(np.diff(stamps))) if stamps.size > 1 else 0.0
    least_s = max(TIME_LEAST_S, TIME_LEAST_STAMPS * usual_s)
    return all(
        max(times) > QUICK * least_s
        for part, times in zip(data.structure.slow, model.level.time_constant_s, strict=True)
        if part.sensor == sensor
    )


def seen_in_motion(data: Data, model: Model, opened: Opened) -> bool:
    """Whether a scatter of stamps, if it is one, shows as such: it grows with the motion."""
    return opened.directed < 0 or grows_with_motion(data, model, opened.directed)


def _mean_and_scatter_agree(model: Model, opened: Opened) -> bool:
    """An effect with a mean and a scatter of one parameter needs both to say the same."""
    for one in model.acting:
        if one.label == opened.candidate.label:
            value = one.values[one.effect.parameters[0].name]
            return abs(model.level.size[opened.directed] - value) < AGREE * value
    return True


def located(data: Data, model: Model) -> Model:
    """Refine where the newest effect starts, by halving the grid around the best place."""
    last = model.acting[-1]
    name = next(p.name for p in last.effect.parameters if p.located)
    since = data.view.log.time_s - data.view.log.time_s[0]
    first, last_time = np.quantile(since, [EDGE, 1.0 - EDGE])
    reach = (last_time - first) / STEP_TIMES
    best = model
    for _ in range(ROUNDS):
        centre = best.acting[-1].values[name]
        low, high = max(centre - reach, first), min(centre + reach, last_time)
        place = _best_place(data, best, name, np.linspace(low, high, PLACES))
        moved = replace(best.acting[-1], values={**best.acting[-1].values, name: place})
        trial = refitted(data, (*best.acting[:-1], moved), best)
        best = trial if trial.nll < best.nll else best
        reach /= 3.5
    return best


def _best_place(data: Data, model: Model, name: str, places: Array) -> float:
    """Where the newest effect saves most to first order, the others fitted again beside it."""
    one = model.acting[-1]
    always = replace(one, values={**one.values, name: -math.inf})
    values = [one.values[p.name] for p in one.effect.slopes()]
    shape = np.nan_to_num(slopes(data.view, (always,))) @ np.array(values)
    since = elapsed(data.view.rows[one.stage])
    error = model.error + shape * (since >= one.values[name])[:, None]
    moved = shape[:, :, None] * (since[:, None] >= places)[:, None, :]
    others = np.nan_to_num(slopes(data.view, model.acting))[:, :, : -len(values)]
    columns = np.concatenate([others, moved, error[:, :, None]], axis=2)
    normal = model.precision.information(columns)
    width, count = others.shape[2], len(places)
    held, cross = normal[:width, :width], normal[:width, width:]
    left = normal[width:, width:] - cross.T @ inverse_scaled(held) @ cross
    gains = left[:count, count] ** 2 / np.maximum(np.diag(left)[:count], 1e-300)
    return float(places[int(np.argmax(gains))])


def refitted(data: Data, acting: tuple[Acting, ...], like: Model) -> Model:
    """The same noise, other effects, one adjustment."""
    now, error, covariance = adjusted(data, acting, like.precision, data.error(acting), steps=1)
    nll = like.precision.negative_log_likelihood(error)
    return replace(like, acting=now, error=error, covariance=covariance, nll=nll)


def scatter_candidates(
    data: Data, found: Sequence[Candidate], model: Model, least: float
) -> list[tuple[Opened, NoiseLevel]]:
    """Stochastic effects worth a fit, each with a noise level to start from.

    Worth a fit is what lowers the NLL when some of it is simply put in.
    """
    result = []
    least = max(1.0, least * len(data.noise_rows) / len(data.view))
    error = model.scatter[data.noise_rows]
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
            # One axis may wander alone: more on the others as well would then look worse.
            axes = ((2,),) if what == "down" else ((0, 1, 2), (0,), (1,), (2,))
            levels = [_times_slow(data, level, sensor, on, k) for on in axes for k in (1.5, 6.0)]
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
    data: Data, level: NoiseLevel, sensor: tuple[str, str], axes: tuple[int, ...], by: float
) -> NoiseLevel:
    slow = tuple(
        tuple(
            max(v, 0.5) * by if part.sensor == sensor and k in axes else v
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


def directed_index(data: Data, candidate: Candidate) -> int:
    """Which directed part of the noise structure is this candidate's."""
    return [d.key for d in data.structure.directed].index(candidate.key)
