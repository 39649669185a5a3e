"""Findings of noise: what of the fitted noise is not the spec's, with its uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.consequence import Weights
from syncline_design.diagnosis.episodes import Episode, episode_effect
from syncline_design.diagnosis.finding import estimate, finding, named_finding
from syncline_design.diagnosis.fitting import Data, Model, Opened, bounds_of
from syncline_design.diagnosis.noise import (
    NoiseLevel,
    SensorKey,
    clipped,
    marginal_variance,
    precision,
)
from syncline_design.diagnosis.range_tails import RANGE, RangeTails, tails_effect
from syncline_design.diagnosis.result import Estimate, Finding, readings_words
from syncline_design.diagnosis.sensor_tails import SensorTails, sensor_tails
from syncline_design.diagnosis.settling import Settled
from syncline_design.diagnosis.unlike_readings import Unlike, factor_effect, slopes_of_readings
from syncline_design.effects.record import OUTLIER_FACTOR, Effect
from syncline_design.model.figure_text import format_nats, to_digits
from syncline_design.model.known import EffectEntry


def stochastic_findings(final: Settled, opened: Opened, weights: Weights) -> list[Finding]:
    """Values of a stochastic effect from the fitted noise; uncertainty from the likelihood."""
    data, model = final.data, final.model
    effect, label = opened.candidate.effect, opened.candidate.label
    stage = data.view.system.stages[label[2]]
    sensor = (stage.name, label[1])
    mean = next((k for k, a in enumerate(model.acting) if a.label == label), None)
    if mean is not None:
        at = sum(len(a.effect.slopes()) for a in model.acting[:mean])
        spread = float(np.sqrt(max(model.covariance[at, at], 0.0)))
        figures = [(float(model.acting[mean].values[effect.parameters[0].name]), spread)]
    elif opened.what == "size":
        value = model.level.size[opened.directed]
        figures = [(value, value * _log_spread(data, model, ("size", opened.directed, 0)))]
    elif opened.what == "factor":
        index = [w.sensor for w in data.structure.white].index(sensor)
        value = model.level.factor[index]
        figures = [(value, value * _log_spread(data, model, ("factor", index, 0)))]
    else:
        figures = _wander(data, model, sensor, opened.what)
    shown = {
        p.name: estimate(v, s, p.unit) for p, (v, s) in zip(effect.parameters, figures, strict=True)
    }
    return [named_finding(final, effect, label, shown, _noise_size(data, model, opened), weights)]


def tail_findings(final: Settled, opened: Opened, weights: Weights) -> list[Finding]:
    """Heavy tails, and how much wider than the spec's the core of that noise is, if it is."""
    data, model = final.data, final.model
    effect, label = opened.candidate.effect, opened.candidate.label
    stage = data.view.system.stages[label[2]].name
    tails = sensor_tails(data, model, (stage, label[1]))
    shown = _shown_tails(effect, tails)
    size_m = _noise_size(data, model, opened)
    if not tails.scale > 1.0:
        return [named_finding(final, effect, label, shown, size_m, weights)]
    part = next(w for w in data.structure.white if w.sensor == (stage, label[1]))
    visible = np.isfinite(data.view.log.truth_m)
    own = float(np.mean(np.sum(np.einsum("nii->ni", part.covariance) * visible, axis=1)))
    core_m = math.sqrt((tails.scale**2 - 1.0) * own)
    size_m = math.sqrt(max(size_m**2 - core_m**2, 0.0))
    return [
        named_finding(final, effect, label, shown, size_m, weights),
        _wider_core(tails, (stage, label[1]), core_m, weights),
    ]


def _shown_tails(effect: Effect, tails: SensorTails) -> dict[str, Estimate]:
    figures = [
        (tails.degrees_of_freedom, tails.freedom_uncertainty, tails.freedom95),
        (tails.outlier_rate, tails.rate_uncertainty, tails.rate95),
    ]
    return {
        p.name: estimate(value, spread, p.unit, interval95=ends)
        for p, (value, spread, ends) in zip(effect.parameters, figures, strict=True)
    }


def _wider_core(tails: SensorTails, key: SensorKey, core_m: float, weights: Weights) -> Finding:
    """How much wider than the spec's the noise is that has the tails; core_m: RMS that it adds."""
    wider, (stage, sensor) = factor_effect(), key
    (one,) = wider.parameters
    factor = {one.name: estimate(tails.scale, tails.scale_uncertainty, one.unit)}
    entry = EffectEntry(wider.name, sensor, stage, ((one.name, tails.scale),))
    words = f"a core as wide as the spec's costs {format_nats(tails.wider)}"
    return finding(wider, sensor, stage, factor, words, tails.wider, None,
                   material=weights.material(core_m, entry), size_m=core_m)  # fmt: skip


def range_tail_findings(data: Data, one: RangeTails, weights: Weights) -> list[Finding]:
    """Heavy tails of ranges, and how much wider than the spec's their core is, if it is."""
    effect, tails, (stage, sensor) = tails_effect(), one.tails, one.sensor
    along = slopes_of_readings(data)[one.sensor][:, :, RANGE]
    own = np.sum(along**2 * np.isfinite(data.view.log.truth_m), axis=1)
    wider = max(tails.scale, 1.0) ** 2
    size_m = math.sqrt(max(float(np.mean(own * (one.growth**2 - wider))), 0.0))
    shown = _shown_tails(effect, tails)
    values = tuple((name, e.value) for name, e in shown.items())
    material = weights.material(size_m, EffectEntry(effect.name, sensor, stage, values))
    words = f"saves {format_nats(one.gain)} beside normal noise along the line of sight"
    if tails.outlier_rate and tails.outliers > OUTLIER_FACTOR:
        words += (f"; the outliers have {to_digits(tails.outliers, 2)} times the spec's deviation, "
                  f"{to_digits(OUTLIER_FACTOR, 2)} times in the effect of this name")  # fmt: skip
    found = finding(effect, sensor, stage, shown, words, one.gain, None,
                    material=material, size_m=size_m)  # fmt: skip
    if not tails.scale > 1.0:
        return [found]
    core_m = math.sqrt((wider - 1.0) * float(np.mean(own)))
    return [found, _wider_core(tails, one.sensor, core_m, weights)]


def episode_finding(data: Data, one: Episode, weights: Weights) -> Finding:
    """Noise of a sensor that is larger for a while."""
    effect = episode_effect()
    time_s = data.structure.time_s
    shown = {"factor": estimate(one.factor, one.spread)}
    ends = {"from_s": one.from_s - time_s[0], "to_s": one.to_s - time_s[0]}
    shown |= {name: estimate(float(end), None, "s") for name, end in ends.items()}
    part = next(w for w in data.structure.white if w.sensor == one.sensor)
    variance = np.einsum("nii->ni", part.covariance) * np.isfinite(data.view.log.truth_m)
    more = np.mean(np.sum(variance, axis=1) * (one.growth(time_s) ** 2 - 1.0))
    size_m = float(np.sqrt(max(more, 0.0)))
    stage, sensor = one.sensor
    values = tuple((name, e.value) for name, e in shown.items())
    material = weights.material(size_m, EffectEntry(effect.name, sensor, stage, values))
    words = f"saves {format_nats(one.gain)} in its part of the log"
    found = finding(effect, sensor, stage, shown, words, one.gain, None,
                    material=material, size_m=size_m)  # fmt: skip
    return replace(found, from_s=one.from_s, to_s=one.to_s)


def with_unlike_readings(
    named: Sequence[Finding], final: Settled, found: Sequence[Unlike], weights: Weights
) -> tuple[Finding, ...]:
    """The findings, each sensor of unlike readings with the factor of its loudest, said once."""
    effect = factor_effect()
    known = {(effect.name, *one.sensor) for one in found}
    rest = [one for one in named if (one.effect, one.stage, one.sensor) not in known]
    return (*rest, *(_unlike_finding(effect, final, one, weights) for one in found))


def _unlike_finding(effect: Effect, final: Settled, one: Unlike, weights: Weights) -> Finding:
    data, level = final.data, final.model.level
    index = [w.sensor for w in data.structure.white].index(one.sensor)
    part, name = data.structure.white[index], effect.parameters[0].name
    factor = level.factor[index] * max(one.growth)
    shown = {name: estimate(factor, factor * one.spread)}
    visible = np.isfinite(data.view.log.truth_m)
    grown = level.factor[index] ** 2 * part.grown(level).covariance - part.covariance
    more = float(np.mean(np.sum(np.einsum("nii->ni", grown) * visible, axis=1)))
    size_m = math.sqrt(max(more, 0.0))
    stage, sensor = one.sensor
    entry = EffectEntry(effect.name, sensor, stage, ((name, factor),))
    words = f"saves {format_nats(one.gain)} beside one size for all readings of the sensor"
    told = finding(effect, sensor, stage, shown, words, one.gain, None,
                   material=weights.material(size_m, entry), size_m=size_m)  # fmt: skip
    times = {name: level.factor[index] * own for name, own in one.of_each.items()}
    return replace(told, readings=times, sentence=f"{told.sentence}, {readings_words(times)}")


def _noise_size(data: Data, model: Model, opened: Opened) -> float:
    """RMS [m] of what one stochastic effect of the fitted noise has beyond the spec's."""
    others = bounds_of(data, [one for one in model.opened if one is not opened])
    within = clipped(model.level, others)
    sizes = (0.0 if k == opened.directed else s for k, s in enumerate(model.level.size))
    within = replace(within, size=tuple(sizes), episodes=model.level.episodes)
    levels = [marginal_variance(data.structure, level) for level in (model.level, within)]
    visible = np.isfinite(data.view.log.truth_m)
    return float(np.sqrt(max(np.mean(np.sum((levels[0] - levels[1]) * visible, axis=1)), 0.0)))


def _wander(
    data: Data, model: Model, sensor: tuple[str, str], what: str
) -> list[tuple[float, float]]:
    """Standard deviation [m] (root mean square over the axes it is on) and time constant [s]."""
    index = [s.sensor for s in data.structure.slow].index(sensor)
    axes = [2] if what == "down" else [0, 1, 2]
    white = [w.sensor for w in data.structure.white].index(sensor)
    scale = max(model.level.factor[white], 1.0)
    sigma = np.sqrt(np.median(np.sum(data.structure.slow[index].loading ** 2, axis=1), axis=0))
    parts = [scale * sigma[k] * math.sqrt(model.level.slow[index][k]) for k in axes]
    size = float(np.sqrt(np.mean(np.square(parts))))
    spreads = [0.5 * _log_spread(data, model, ("slow", index, k)) for k in axes]
    time_s = model.level.time_constant_s[index][axes[0]]
    return [
        (size, size * float(np.mean(spreads)) / math.sqrt(len(axes))),
        (time_s, time_s * _log_spread(data, model, ("time", index, axes[0]))),
    ]


def _log_spread(data: Data, model: Model, where: tuple[str, int, int]) -> float:
    """Standard uncertainty of the logarithm of one noise figure, from the likelihood's curve."""
    error = model.scatter[data.noise_rows]
    share = len(data.noise_rows) / max(len(data.view), 1)
    step = 0.1
    nll = [
        precision(
            data.noise_structure, _scaled(model.level, where, math.exp(k * step))
        ).negative_log_likelihood(error)
        for k in (-1, 0, 1)
    ]
    curvature = (nll[0] - 2.0 * nll[1] + nll[2]) / step**2 / share
    return 1.0 / math.sqrt(curvature) if curvature > 1e-6 else math.inf


def _scaled(level: NoiseLevel, where: tuple[str, int, int], by: float) -> NoiseLevel:
    kind, index, axis = where
    if kind == "size":
        sizes = tuple(s * by if k == index else s for k, s in enumerate(level.size))
        return replace(level, size=sizes)
    if kind == "factor":
        factors = tuple(f * by if k == index else f for k, f in enumerate(level.factor))
        return replace(level, factor=factors)
    if kind == "time":
        times = tuple(
            tuple(t * by for t in own) if k == index else own
            for k, own in enumerate(level.time_constant_s)
        )
        return replace(level, time_constant_s=times)
    slow = tuple(
        tuple(v * by if (k, a) == (index, axis) else v for a, v in enumerate(own))
        for k, own in enumerate(level.slow)
    )
    return replace(level, slow=slow)
