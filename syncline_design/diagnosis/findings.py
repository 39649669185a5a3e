"""A fitted model in words and figures: what is missing, where, how sure."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from syncline_design.diagnosis.cancelling import cancelling
from syncline_design.diagnosis.charges import fitted_figures
from syncline_design.diagnosis.consequence import Weights, rms_m
from syncline_design.diagnosis.episodes import Episode, episode_effect
from syncline_design.diagnosis.fitting import Data, Model, Opened, bounds_of
from syncline_design.diagnosis.gross import Gross
from syncline_design.diagnosis.identify import Alias, Comparison
from syncline_design.diagnosis.lines import wave_of
from syncline_design.diagnosis.noise import (
    NoiseLevel,
    clipped,
    marginal_variance,
    precision,
)
from syncline_design.diagnosis.one_value import Uneven
from syncline_design.diagnosis.result import Estimate, Finding, Rival, Stretch, readings_words
from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.search import VARIES
from syncline_design.diagnosis.sensor_tails import sensor_tails
from syncline_design.diagnosis.settling import Settled
from syncline_design.diagnosis.spans import span_of
from syncline_design.diagnosis.stretches import is_inside
from syncline_design.diagnosis.unlike_readings import Unlike, factor_effect
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Effect
from syncline_design.logs.stream_times import ASSUMED_GPS, GPS_MINUS_UTC_S, TELL_CLOCK
from syncline_design.model.figure_text import format_estimate, format_nats, percent, to_places
from syncline_design.model.known import EffectEntry
from syncline_design.model.normal import NORMAL_95

Label = tuple[str, str, int]
Rivals = tuple[tuple[Rival, ...], tuple[Rival, ...], tuple[Rival, ...]]
WORDS = {"position": "position", "attitude": "attitude", "ranging": "range", "target": "target"}
MOST_EXCLUDED = 4
ONE_VALUE = 0.001  # chance below which a parameter is not one value along the log
MOST_NATS = 300.0
NOT_SEEN = "(not seen)"


def estimate(
    value: float | str,
    spread: float | None = None,
    unit: str = "",
    seen: bool = True,
    interval95: tuple[float, float] | None = None,
) -> Estimate:
    """A parameter with the text that every output prints."""
    text = (
        value
        if isinstance(value, str)
        else format_estimate(value, spread, unit)
        if seen
        else NOT_SEEN
    )
    return Estimate(value, spread, unit, seen, text, interval95)


def finding(
    effect: Effect,
    sensor: str,
    stage: str,
    parameters: Mapping[str, Estimate],
    evidence: str,
    gain_nat: float,
    log10_p: float | None = None,
    rivals: Rivals = ((), (), ()),
    material: bool = True,
    size_m: float | None = None,
) -> Finding:
    """A missing effect in words; rivals: aliases, lookalikes, excluded."""
    shown = {name: one.text for name, one in parameters.items()}
    text = effect.in_words(WORDS[sensor], shown)
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
        kind="stand_in" if wave_of(effect) else "noise" if is_noise(effect) else "cause",
        material=material,
        size_m=size_m,
        probability=_probability(rivals[0]) if rivals[0] else None,
    )


def evidence_words(gain: float, log10_p: float | None) -> str:
    """What an effect saves, and the chance that noise alone saves as much (None: none at all)."""
    chance = "less than 1e-300"
    if log10_p is not None and log10_p > -300.0:
        power = math.floor(log10_p)
        digit = round(10.0 ** (log10_p - power))
        chance = f"{digit}e{power:03d}" if digit < 10 else f"1e{power + 1:03d}"
    return f"saves {format_nats(gain)}; noise alone does that with a chance of {chance}"


def is_noise(effect: Effect) -> bool:
    """Whether an effect says how a sensor's own noise differs from the spec's."""
    return effect.kind == "stochastic" and effect.opens != "size"


def _probability(aliases: Sequence[Rival]) -> float:
    return 1.0 / (1.0 + sum(_odds(one) for one in aliases))


def _odds(alias: Rival) -> float:
    """Posterior odds of an alias against the named effect, by what each fits and pays."""
    return math.exp(-min(max(alias.nats_worse, -MOST_NATS), MOST_NATS))


def findings(
    final: Settled, gross: Sequence[Gross], weights: Weights, refuted: bool = False
) -> tuple[Finding, ...]:
    """All findings: gross faults, material ones, causes before noise, by what they explain.

    refuted: what is left is no noise, so no chance is stated: it would rest on that noise.
    """
    spreads = {label: judged.spread for label, judged in final.judged.items()}
    undone = cancelling(final.data, final.model, spreads, weights.spec_m)
    found = [
        _undone(_deterministic(final, k, weights), undone.get(final.model.acting[k].label))
        for k in _single(final.model)
    ]
    for opened in final.model.opened:
        one = _tails if opened.what == "tails" else _stochastic
        found += one(final, opened, weights)
    if refuted:
        found = [_without_chance(one) for one in found]
    found.sort(key=lambda f: (not f.material, f.kind == "noise", -f.gain_nat))
    return (*(_gross(final.data.view, g) for g in gross), *found)


def _undone(one: Finding, other: Label | None) -> Finding:
    """The finding, a stand-in where another one undoes it."""
    if other is None:
        return one
    name, sensor, _ = other
    words = f"{one.sentence}; {name} ({sensor}) undoes nearly all of it, so neither is shown"
    return replace(one, kind="stand_in", sentence=words, changed_once=None)


def _without_chance(one: Finding) -> Finding:
    words = f"leaving it out costs {format_nats(one.gain_nat)}"
    return replace(one, evidence=words, log10_p=None)


def entry_of(one: Finding) -> EffectEntry:
    """The finding as an effect of a system."""
    values = tuple((name, e.value) for name, e in one.parameters.items())
    return EffectEntry(one.effect, one.sensor, one.stage, values)


def _single(model: Model) -> list[int]:
    """Indices of acting effects that are findings of their own (a packet's mean is not)."""
    opened = {o.candidate.label for o in model.opened}
    return [k for k, a in enumerate(model.acting) if a.label not in opened]


def _deterministic(final: Settled, index: int, weights: Weights) -> Finding:
    model = final.model
    one = model.acting[index]
    at = sum(len(a.effect.slopes()) for a in model.acting[:index])
    found: dict[str, Estimate] = {}
    judged = final.judged[one.label]
    spreads = iter(judged.spread)
    for p in one.effect.parameters:
        spread, seen, value = None, True, float(one.values[p.name])
        interval = None
        if p in one.effect.slopes():
            seen, spread = bool(model.covariance[at, at] > 0.0), float(next(spreads))
            spread = spread if seen else math.inf
            half = judged.coverage * spread
            interval = (value - half, value + half) if seen else None
            at += 1
        found[p.name] = estimate(value, spread, p.unit, seen, interval)
    wave = wave_of(one.effect)
    if wave is not None:
        said = wave.shown({p.name: one.values[p.name] for p in one.effect.parameters})
        found = {name: estimate(value, None, unit) for name, (value, unit) in said.items()}
    others = tuple(a for a in model.acting if a.label != one.label)
    size_m = rms_m(final.data, final.data.error(others) - model.error)
    named = _finding(final, one.effect, one.label, found, size_m, weights)
    if one.label in final.refuted:
        named = replace(named, kind="stand_in")
    part = _in_its_part(named, one.effect, final.data.view.log.ends_s)
    return _along_the_log(final, one, part)


def _in_its_part(named: Finding, effect: Effect, ends_s: tuple[float, float]) -> Finding:
    """The finding with the part of the log that it is cut to.

    What is built in does not come and go: cut to a part it is the word for something else, unless
    it changed once.
    """
    span = span_of(effect)
    if span is None:
        return named
    first, last = (format_estimate(end, None, "s") for end in (span.from_s, span.to_s))
    words = f"{named.sentence}, from {first} to {last}"
    kind = named.kind if effect.passing else "stand_in"
    once = kind != named.kind == "cause" and not is_inside(span.from_s, span.to_s, ends_s)
    return replace(named, sentence=words, kind=kind, from_s=span.from_s, to_s=span.to_s,
                   changed_once=once or None)  # fmt: skip


def _along_the_log(final: Settled, one: Acting, named: Finding) -> Finding:
    """The finding with how it varies: slowly by quarters, quickly by how much within how long."""
    varying, quick = _varying(final, one), final.wandering.get(one.label)
    if varying is not None:
        return replace(named, varying=varying, sentence=f"{named.sentence}, varying along the log")
    if quick is None:
        return named
    unit = one.effect.slopes()[0].unit
    by, within = format_estimate(quick.std, None, unit), format_estimate(quick.over_s, None, "s")
    return replace(
        named,
        sentence=f"{named.sentence}, varying by {by} within {within}",
        varying=tuple(
            Stretch(a, b, value, format_estimate(value, None, unit)) for a, b, value in quick.values
        ),
        varying_std=estimate(quick.std, None, unit),
        varying_over_s=quick.over_s,
    )


def _varying(final: Settled, one: Acting) -> tuple[Stretch, ...] | None:
    """The quarters of a log in which a parameter is not one value."""
    course = final.courses.get(one.label)
    names = [p for p in one.effect.parameters if p in one.effect.slopes()]
    if course is None or course.log_p > math.log(ONE_VALUE):
        return None
    whole = float(one.values[names[0].name])
    if np.std(course.values) < VARIES * abs(whole):
        return None
    time_s = final.data.view.log.time_s
    ends = time_s[np.linspace(0, len(time_s) - 1, len(course.values) + 1).astype(int)]
    return tuple(
        Stretch(float(a), float(b), value, format_estimate(value, None, names[0].unit))
        for (a, b), value in zip(pairwise(ends), course.values, strict=True)
    )


def _finding(
    final: Settled,
    effect: Effect,
    label: Label,
    found: Mapping[str, Estimate],
    size_m: float,
    weights: Weights,
) -> Finding:
    view, evidence = final.data.view, final.evidence[label]
    compared = final.classes.get(label, Comparison())
    log10_p = evidence.log_p / math.log(10.0) if math.isfinite(evidence.log_p) else None
    words = evidence_words(evidence.gain, log10_p)
    lists = (compared.aliases, compared.lookalikes, compared.excluded[:MOST_EXCLUDED])
    wider = _wider(final, label)
    aliases, lookalikes, excluded = (tuple(_rival(view, a, wider) for a in own) for own in lists)
    where = view.system.stages[label[2]].name
    total = 1.0 + sum(_odds(one) for one in aliases)
    aliases = tuple(replace(one, probability=_odds(one) / total) for one in aliases)
    rivals = (aliases, lookalikes, excluded)
    values = tuple((name, e.value) for name, e in found.items())
    material = weights.material(size_m, EffectEntry(effect.name, label[1], where, values))
    named = finding(
        effect, label[1], where, found, words, evidence.gain, log10_p, rivals, material, size_m
    )
    return _uneven(named, final.uneven.get(label))


def _uneven(named: Finding, found: Uneven | None) -> Finding:
    """The finding, a stand-in where it is not one value wherever the vehicle goes."""
    if found is None or named.kind != "cause":
        return named
    changes = (
        f"it changes with the {found.covariate.replace('_', ' ')}, by {percent(found.share, 2)} of "
        "itself over a standard deviation of that, so it stands for something else"
    )
    return replace(named, kind="stand_in", sentence=f"{named.sentence}; {changes}")


def _wider(final: Settled, label: Label) -> float:
    """Standard uncertainties by the fitted noise that a 95 % interval spans to either side, as of
    the named effect, whose uncertainty holds in noise of another kind as well."""
    judged = final.judged.get(label)
    if judged is None:
        return NORMAL_95
    fitted = np.array(list(fitted_figures(final.model, label)[1].values()))
    seen = fitted > 0.0
    times = judged.spread[seen] / fitted[seen]
    return judged.coverage * max(1.0, float(np.max(times, initial=1.0)))


def _rival(view: Scene, alias: Alias, wider: float) -> Rival:
    candidate = alias.candidate
    where = view.system.stages[candidate.stage].name
    found = {
        p.name: _of_rival(alias.values[p.name], alias.spreads[p.name], wider, p.unit)
        for p in candidate.effect.parameters
        if p.name in alias.values
    }
    return Rival(
        candidate.effect.name, candidate.sensor, where, alias.cosine, alias.loss, alias.possible,
        alias.refitted, parameters=found or None,
    )  # fmt: skip


def _of_rival(value: float, spread: float, wider: float, unit: str) -> Estimate:
    if spread <= 0.0:
        return estimate(value, math.inf, unit, seen=False)
    half = wider * spread
    return estimate(value, half / NORMAL_95, unit, interval95=(value - half, value + half))


def _gross(view: Scene, fault: Gross) -> Finding:
    effect, label = fault.acting.effect, fault.acting.label
    found = {p.name: estimate(fault.acting.values[p.name], unit=p.unit) for p in effect.parameters}
    stage = view.system.stages[label[2]].name
    gain = math.log(fault.falls_by)
    words = f"undoing it makes the usual error {to_places(math.exp(gain), 0)} times smaller"
    return finding(effect, label[1], stage, found, words + _of_a_clock(view, fault), gain)


def _of_a_clock(view: Scene, fault: Gross) -> str:
    """What else leap seconds may be: of stamps whose clock the file does not tell."""
    slip = fault.acting.values.get("seconds")
    taken = [note.split(":")[0] for note in view.log.notes if ASSUMED_GPS in note]
    if not taken or not isinstance(slip, float) or round(abs(slip)) != GPS_MINUS_UTC_S:
        return ""
    return (f"; {taken[0]} was {ASSUMED_GPS}, and {GPS_MINUS_UTC_S} s is what UTC differs by: not "
            f"the position's stamps may be wrong but that ({TELL_CLOCK})")  # fmt: skip


def _stochastic(final: Settled, opened: Opened, weights: Weights) -> list[Finding]:
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
    return [_finding(final, effect, label, shown, _noise_size(data, model, opened), weights)]


def _tails(final: Settled, opened: Opened, weights: Weights) -> list[Finding]:
    """Heavy tails, and how much wider than the spec's the core of that noise is, if it is."""
    data, model = final.data, final.model
    effect, label = opened.candidate.effect, opened.candidate.label
    stage = data.view.system.stages[label[2]].name
    tails = sensor_tails(data, model, (stage, label[1]))
    figures = [
        (tails.degrees_of_freedom, tails.freedom_uncertainty),
        (tails.outlier_rate, math.inf),
    ]
    shown = {
        p.name: estimate(v, s, p.unit) for p, (v, s) in zip(effect.parameters, figures, strict=True)
    }
    size_m = _noise_size(data, model, opened)
    if not tails.scale > 1.0:
        return [_finding(final, effect, label, shown, size_m, weights)]
    wider = factor_effect()
    part = next(w for w in data.structure.white if w.sensor == (stage, label[1]))
    visible = np.isfinite(data.view.log.truth_m)
    own = float(np.mean(np.sum(np.einsum("nii->ni", part.covariance) * visible, axis=1)))
    core_m = math.sqrt((tails.scale**2 - 1.0) * own)
    factor = {
        wider.parameters[0].name: estimate(
            tails.scale, tails.scale_uncertainty, wider.parameters[0].unit
        )
    }
    values = ((wider.parameters[0].name, tails.scale),)
    material = weights.material(core_m, EffectEntry(wider.name, label[1], stage, values))
    words = f"a core as wide as the spec's costs {format_nats(tails.wider)}"
    size_m = math.sqrt(max(size_m**2 - core_m**2, 0.0))
    return [
        _finding(final, effect, label, shown, size_m, weights),
        finding(wider, label[1], stage, factor, words, tails.wider, None,
                material=material, size_m=core_m),
    ]  # fmt: skip


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
