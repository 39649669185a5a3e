"""One effect tried in a model: its fit by re-simulation, whether it is possible, its chance."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.candidates import EDGE, STEP_TIMES, Signature, zero_values
from syncline_design.diagnosis.fitting import Data, Model, Opened, adjusted, fit
from syncline_design.diagnosis.noise import NoiseLevel
from syncline_design.diagnosis.scatter import directed_index, usual_noise_size, with_size
from syncline_design.diagnosis.scene import Acting
from syncline_design.diagnosis.scores import log_p_of
from syncline_design.effects.record import Effect

AGREE = 0.3  # how far a scatter may be from what the mean says, as a share of it


def freedom_of(effect: Effect) -> int:
    """Figures that are fitted: parameters, and the size of a scatter that has one of its own."""
    own_size = effect.kind == "stochastic" and effect.sensitivity is not None
    return len(effect.parameters) + own_size


def log_chance(effect: Effect, gain: float, freedom: int) -> float:
    """log of the chance that noise alone saves `gain` [nat] in this one effect.

    A step is charged for the places at which it was looked for.
    """
    located = any(p.located for p in effect.parameters)
    charge = math.log(STEP_TIMES) if located else 0.0
    return min(log_p_of(2.0 * gain, freedom) + charge, 0.0)


def with_effect(data: Data, model: Model, found: Signature, level: NoiseLevel) -> Model:
    """The model with one more effect that moves the mean, fitted from zero by re-simulation."""
    start = found.candidate.acting(zero_values(found.candidate.effect, found.at))
    opened = model.opened
    if found.candidate.effect.kind == "stochastic":
        directed = directed_index(data, found.candidate)
        opened = (*opened, Opened(found.candidate, "size", directed))
        level = with_size(level, directed, 0.3 * usual_noise_size(data, directed))
    fitted = fit(data, (*model.acting, start), opened, start=level)
    return located(data, fitted) if found.at else fitted


def plausible(model: Model) -> bool:
    """Whether every fitted parameter is of a size that its effect can have."""
    for one in model.acting:
        for p in one.effect.slopes():
            value = one.values[p.name]
            if abs(value) > p.high or (not p.signed and value < 0.0):
                return False
    return all(_mean_and_scatter_agree(model, one) for one in model.opened)


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
    for _ in range(4):
        centre = best.acting[-1].values[name]
        low, high = max(centre - reach, first), min(centre + reach, last_time)
        for t in np.linspace(low, high, 7):
            moved = replace(best.acting[-1], values={**best.acting[-1].values, name: float(t)})
            trial = refitted(data, (*best.acting[:-1], moved), best)
            best = trial if trial.nll < best.nll else best
        reach /= 3.5
    return best


def refitted(data: Data, acting: tuple[Acting, ...], like: Model) -> Model:
    """The same noise, other effects, one adjustment."""
    now, error, covariance = adjusted(data, acting, like.precision, data.error(acting), steps=1)
    nll = like.precision.negative_log_likelihood(error)
    return replace(like, acting=now, error=error, covariance=covariance, nll=nll)
