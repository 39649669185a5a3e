"""A fitted model in words and figures: what is missing, where, how sure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.fitting import Data, Model, Opened
from syncline_design.diagnosis.gross import Gross
from syncline_design.diagnosis.identify import Alias, Comparison
from syncline_design.diagnosis.noise import NoiseLevel, precision
from syncline_design.diagnosis.result import Estimate, Finding, Rival
from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.settling import Settled
from syncline_design.diagnosis.tails import tails_in
from syncline_design.effects.record import Effect
from syncline_design.model.quantity import format_estimate

Label = tuple[str, str, int]
Rivals = tuple[tuple[Rival, ...], tuple[Rival, ...], tuple[Rival, ...]]
WORDS = {"position": "position", "attitude": "attitude", "ranging": "range", "target": "target"}
MOST_EXCLUDED = 4
NOT_SEEN = "(not seen)"


def estimate(
    value: float | str, spread: float | None = None, unit: str = "", seen: bool = True
) -> Estimate:
    """A parameter with the text that every output prints."""
    text = (
        value
        if isinstance(value, str)
        else format_estimate(value, spread, unit)
        if seen
        else NOT_SEEN
    )
    return Estimate(value, spread, unit, seen, text)


def finding(
    effect: Effect,
    sensor: str,
    stage: str,
    parameters: Mapping[str, Estimate],
    evidence: str,
    gain_nat: float,
    log10_p: float | None = None,
    rivals: Rivals = ((), (), ()),
) -> Finding:
    """A missing effect in words; rivals: aliases, lookalikes, excluded."""
    shown = {name: one.text for name, one in parameters.items()}
    text = effect.sentence.format(sensor=WORDS[sensor], **shown)
    return Finding(
        effect.name,
        sensor,
        stage,
        parameters,
        *rivals,
        sentence=text[0].upper() + text[1:],
        evidence=evidence,
        gain_nat=gain_nat,
        log10_p=log10_p,
        confused_with=effect.confused_with,
        separated_by=effect.separated_by,
        source=effect.source,
    )


def findings(final: Settled, gross: Sequence[Gross]) -> tuple[Finding, ...]:
    """All findings, gross faults first, then by what leaving them out would cost."""
    found = [_deterministic(final, k) for k in _single(final.model)]
    found += [_stochastic(final, o) for o in final.model.opened]
    found.sort(key=lambda f: -f.gain_nat)
    return (*(_gross(final.data.view, g) for g in gross), *found)


def _single(model: Model) -> list[int]:
    """Indices of acting effects that are findings of their own (a packet's mean is not)."""
    opened = {o.candidate.label for o in model.opened}
    return [k for k, a in enumerate(model.acting) if a.label not in opened]


def _deterministic(final: Settled, index: int) -> Finding:
    model = final.model
    one = model.acting[index]
    at = sum(len(a.effect.slopes()) for a in model.acting[:index])
    found: dict[str, Estimate] = {}
    for p in one.effect.parameters:
        spread, seen = None, True
        if p in one.effect.slopes():
            seen = bool(model.covariance[at, at] > 0.0)
            spread = float(np.sqrt(model.covariance[at, at])) if seen else math.inf
            at += 1
        found[p.name] = estimate(float(one.values[p.name]), spread, p.unit, seen)
    return _finding(final, one.effect, one.label, found)


def _finding(
    final: Settled, effect: Effect, label: Label, found: Mapping[str, Estimate]
) -> Finding:
    view, evidence = final.data.view, final.evidence[label]
    compared = final.classes.get(label, Comparison())
    log10_p = evidence.log_p / math.log(10.0) if math.isfinite(evidence.log_p) else None
    chance = "less than 1e-300"
    if log10_p is not None and log10_p > -300:
        chance = f"1e{math.floor(log10_p)}"
    words = f"saves {evidence.gain:.1f} nat; noise alone does that with a chance of {chance}"
    lists = (compared.aliases, compared.lookalikes, compared.excluded[:MOST_EXCLUDED])
    aliases, lookalikes, excluded = (tuple(_rival(view, a) for a in own) for own in lists)
    where = view.system.stages[label[2]].name
    rivals = (aliases, lookalikes, excluded)
    return finding(effect, label[1], where, found, words, evidence.gain, log10_p, rivals)


def _rival(view: Scene, alias: Alias) -> Rival:
    name, sensor, stage = alias.candidate.label
    where = view.system.stages[stage].name
    return Rival(name, sensor, where, alias.cosine, alias.loss, alias.possible, alias.refitted)


def _gross(view: Scene, fault: Gross) -> Finding:
    effect, label = fault.acting.effect, fault.acting.label
    found = {p.name: estimate(fault.acting.values[p.name], unit=p.unit) for p in effect.parameters}
    stage = view.system.stages[label[2]].name
    gain = math.log(fault.falls_by)
    words = f"undoing it makes the usual error {math.exp(gain):.0f} times smaller"
    return finding(effect, label[1], stage, found, words, gain)


def _stochastic(final: Settled, opened: Opened) -> Finding:
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
    elif opened.what == "tails":
        found = tails_in(data, model)
        freedom = (found.degrees_of_freedom, found.freedom_uncertainty)
        figures = [freedom, (found.outlier_rate, math.inf)]
    elif opened.what == "factor":
        index = [w.sensor for w in data.structure.white].index(sensor)
        value = model.level.factor[index]
        figures = [(value, value * _log_spread(data, model, ("factor", index, 0)))]
    else:
        figures = _wander(data, model, sensor, opened.what)
    shown = {
        p.name: estimate(v, s, p.unit) for p, (v, s) in zip(effect.parameters, figures, strict=True)
    }
    return _finding(final, effect, label, shown)


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
    error = model.error[data.noise_rows]
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
