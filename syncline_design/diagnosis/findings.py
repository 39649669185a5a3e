"""A fitted model in words and figures: what is missing, where, how sure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from syncline_design.diagnosis.fitting import Data, Model, Opened
from syncline_design.diagnosis.gross import Gross
from syncline_design.diagnosis.identify import Alias, Comparison
from syncline_design.diagnosis.noise import NoiseLevel, precision
from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.settling import Settled
from syncline_design.diagnosis.tails import tails_in
from syncline_design.effects.record import Effect
from syncline_design.model.estimates import figure

Label = tuple[str, str, int]
WORDS = {"position": "position", "attitude": "attitude", "ranging": "range", "target": "target"}
MOST_EXCLUDED = 4
NOT_SEEN = "(not seen)"


@dataclass(frozen=True, slots=True)
class Figure:
    """One parameter: its value and standard uncertainty in SI; a convention is a word.

    seen: whether the log says anything of it; a lever arm has no seen down part in a planar log.
    """

    value: float | str
    standard_uncertainty: float | None
    unit: str
    seen: bool = True


def figure_text(shown: Figure) -> str:
    """A parameter as every output prints it."""
    if isinstance(shown.value, str):
        return shown.value
    if not shown.seen:
        return NOT_SEEN
    return figure(shown.value, shown.standard_uncertainty, shown.unit)


@dataclass(frozen=True, slots=True)
class AliasFigure:
    """Another effect beside the named one; nats_worse counts the freedom of both.

    possible: whether it fits with values that the effect can have.  refitted: with noise fitted
    anew, as the evidence is; otherwise to first order with the named effect's noise.
    """

    effect: str
    sensor: str
    stage: str
    cosine: float
    nats_worse: float
    possible: bool = True
    refitted: bool = True


@dataclass(frozen=True, slots=True)
class Finding:
    """One missing effect."""

    effect: Effect
    sensor: str
    stage: str
    parameters: Mapping[str, Figure]
    aliases: tuple[AliasFigure, ...]
    excluded: tuple[AliasFigure, ...]
    gain_nat: float
    log10_p: float | None
    gross: bool = False
    lookalikes: tuple[AliasFigure, ...] = ()

    @property
    def sentence(self) -> str:
        """What is wrong, with figures."""
        shown = {name: figure_text(f) for name, f in self.parameters.items()}
        text = self.effect.sentence.format(sensor=WORDS[self.sensor], **shown)
        return text[0].upper() + text[1:]

    @property
    def evidence(self) -> str:
        """How sure this is, in words."""
        if self.gross:
            return f"undoing it makes the usual error {math.exp(self.gain_nat):.0f} times smaller"
        chance = "less than 1e-300"
        if self.log10_p is not None and self.log10_p > -300:
            chance = f"1e{math.floor(self.log10_p)}"
        return f"saves {self.gain_nat:.1f} nat; noise alone does that with a chance of {chance}"


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
    figures: dict[str, Figure] = {}
    for p in one.effect.parameters:
        spread, seen = None, True
        if p in one.effect.slopes():
            seen = bool(model.covariance[at, at] > 0.0)
            spread = float(np.sqrt(model.covariance[at, at])) if seen else math.inf
            at += 1
        figures[p.name] = Figure(float(one.values[p.name]), spread, p.unit, seen)
    return _finding(final, one.effect, one.label, figures)


def _finding(
    final: Settled, effect: Effect, label: Label, figures: Mapping[str, Figure]
) -> Finding:
    view, evidence = final.data.view, final.evidence[label]
    compared = final.classes.get(label, Comparison())
    return Finding(
        effect,
        label[1],
        view.system.stages[label[2]].name,
        figures,
        tuple(_alias(view, a) for a in compared.aliases),
        tuple(_alias(view, a) for a in compared.excluded[:MOST_EXCLUDED]),
        evidence.gain,
        evidence.log_p / math.log(10.0) if math.isfinite(evidence.log_p) else None,
        lookalikes=tuple(_alias(view, a) for a in compared.lookalikes),
    )


def _alias(view: Scene, alias: Alias) -> AliasFigure:
    name, sensor, stage = alias.candidate.label
    where = view.system.stages[stage].name
    return AliasFigure(
        name, sensor, where, alias.cosine, alias.loss, alias.possible, alias.refitted
    )


def _gross(view: Scene, fault: Gross) -> Finding:
    effect, label = fault.acting.effect, fault.acting.label
    figures = {p.name: Figure(fault.acting.values[p.name], None, p.unit) for p in effect.parameters}
    stage = view.system.stages[label[2]].name
    gain = math.log(fault.falls_by)
    return Finding(effect, label[1], stage, figures, (), (), gain, None, gross=True)


def _stochastic(final: Settled, opened: Opened) -> Finding:
    """Values of a stochastic effect from the fitted noise; uncertainty from the likelihood."""
    data, model = final.data, final.model
    effect, label = opened.candidate.effect, opened.candidate.label
    stage = data.view.system.stages[label[2]]
    units = {p.name: p.unit for p in effect.parameters}
    sensor = (stage.name, label[1])
    mean = next((k for k, a in enumerate(model.acting) if a.label == label), None)
    if mean is not None:
        at = sum(len(a.effect.slopes()) for a in model.acting[:mean])
        name = effect.parameters[0].name
        spread = float(np.sqrt(max(model.covariance[at, at], 0.0)))
        figures = {name: (float(model.acting[mean].values[name]), spread)}
    elif opened.what == "size":
        value = model.level.size[opened.directed]
        spread = value * _log_spread(data, model, ("size", opened.directed, 0))
        figures = {effect.parameters[0].name: (value, spread)}
    elif opened.what == "tails":
        found = tails_in(data, model)
        figures = {
            "degrees_of_freedom": (found.degrees_of_freedom, found.freedom_uncertainty),
            "outlier_rate": (found.outlier_rate, math.inf),
        }
    elif opened.what == "factor":
        index = [w.sensor for w in data.structure.white].index(sensor)
        value = model.level.factor[index]
        figures = {"factor": (value, value * _log_spread(data, model, ("factor", index, 0)))}
    else:
        figures = _wander(data, model, sensor, opened.what)
    shown = {name: Figure(v, s, units[name]) for name, (v, s) in figures.items()}
    return _finding(final, effect, label, shown)


def _wander(
    data: Data, model: Model, sensor: tuple[str, str], what: str
) -> dict[str, tuple[float, float]]:
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
    return {
        "std_m": (size, size * float(np.mean(spreads)) / math.sqrt(len(axes))),
        "time_constant_s": (time_s, time_s * _log_spread(data, model, ("time", index, axes[0]))),
    }


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
