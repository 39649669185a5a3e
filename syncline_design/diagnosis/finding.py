"""One finding in words and figures: what it is called, how sure it is, what else it could be."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.charges import fitted_figures
from syncline_design.diagnosis.consequence import Weights
from syncline_design.diagnosis.identify import Alias, Comparison
from syncline_design.diagnosis.lines import wave_of
from syncline_design.diagnosis.one_value import Uneven
from syncline_design.diagnosis.result import Estimate, Finding, Rival, WithinNoise
from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.settling import Settled
from syncline_design.effects.record import Effect
from syncline_design.model.figure_text import (
    format_chance,
    format_components,
    format_estimate,
    format_nats,
    percent,
)
from syncline_design.model.known import EffectEntry
from syncline_design.model.normal import NORMAL_95

Label = tuple[str, str, int]
Rivals = tuple[tuple[Rival, ...], tuple[Rival, ...], tuple[Rival, ...]]
WORDS = {"position": "position", "attitude": "attitude", "ranging": "range", "target": "target"}
MOST_EXCLUDED = 4
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


def texts_of(parameters: Mapping[str, Estimate]) -> dict[str, str]:
    """Parameters as sentences tell them: the components of one vector in one unit."""
    seen = {
        name: (one.value, one.standard_uncertainty, one.unit)
        for name, one in parameters.items()
        if one.seen and not isinstance(one.value, str)
    }
    return {name: one.text for name, one in parameters.items()} | format_components(seen)


def in_words(effect: Effect, sensor: str, parameters: Mapping[str, Estimate]) -> str:
    """An effect in one sentence, without its capital."""
    return effect.in_words(WORDS[sensor], texts_of(parameters))


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
    text = in_words(effect, sensor, parameters)
    texts = texts_of(parameters)
    return Finding(
        effect.name,
        sensor,
        stage,
        {name: replace(own, text=texts[name]) for name, own in parameters.items()},
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


def evidence_words(
    gain: float, log10_p: float | None, *, noise_kept: bool = False, changing: bool = False
) -> str:
    """What an effect saves, and the chance that noise alone saves as much (None: none at all).

    noise_kept: against the noise that is left with it, and not against one that is fitted anew
    without it, which would take much of a large effect for noise.  changing: noise that stays the
    same over the log is not meant, for it would do the same.
    """
    chance = format_chance(log10_p)
    kept = " with the noise kept" if noise_kept else ""
    noise = "noise that changes along the log" if changing else "noise alone"
    return f"saves {format_nats(gain)}{kept}; {noise} does that with a chance of {chance}"


def is_noise(effect: Effect) -> bool:
    """Whether an effect says how a sensor's own noise differs from the spec's."""
    return effect.kind == "stochastic" and effect.opens != "size"


def _probability(aliases: Sequence[Rival]) -> float:
    return 1.0 / (1.0 + sum(odds(one.nats_worse) for one in aliases))


def odds(worse: float) -> float:
    """Posterior odds against the named effect, of one that fits and pays so much worse [nat]."""
    return math.exp(-min(max(worse, -MOST_NATS), MOST_NATS))


def named_finding(
    final: Settled,
    effect: Effect,
    label: Label,
    found: Mapping[str, Estimate],
    size_m: float,
    weights: Weights,
    constant: WithinNoise | None = None,
) -> Finding:
    """One effect of the final model, with its RMS; constant: noise that would do the same."""
    view, evidence = final.data.view, final.evidence[label]
    compared = final.classes.get(label, Comparison())
    log10_p = evidence.log_p / math.log(10.0) if math.isfinite(evidence.log_p) else None
    words = evidence_words(evidence.gain, log10_p, changing=constant is not None)
    lists = (compared.aliases, compared.lookalikes, compared.excluded[:MOST_EXCLUDED])
    wider = _wider(final, label)
    aliases, lookalikes, excluded = (tuple(_rival(view, a, wider) for a in own) for own in lists)
    where = view.system.stages[label[2]].name
    total = 1.0 + sum(odds(one.nats_worse) for one in aliases)
    aliases = tuple(replace(one, probability=odds(one.nats_worse) / total) for one in aliases)
    rivals = (aliases, lookalikes, excluded)
    values = tuple((name, e.value) for name, e in found.items())
    material = weights.material(size_m, EffectEntry(effect.name, label[1], where, values))
    named = finding(
        effect, label[1], where, found, words, evidence.gain, log10_p, rivals, material, size_m
    )
    return _uneven(replace(named, within_noise=constant), final.uneven.get(label))


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
