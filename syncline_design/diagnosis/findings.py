"""A fitted model in words and figures: what is missing, where, how sure."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from syncline_design.diagnosis.cancelling import cancelling
from syncline_design.diagnosis.consequence import Weights, rms_m
from syncline_design.diagnosis.constant_noise import within_noise
from syncline_design.diagnosis.finding import Label, estimate, finding, named_finding
from syncline_design.diagnosis.fitting import Model
from syncline_design.diagnosis.gross import Gross
from syncline_design.diagnosis.lines import wave_of
from syncline_design.diagnosis.noise_findings import stochastic_findings, tail_findings
from syncline_design.diagnosis.result import Estimate, Finding, Stretch
from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.search import VARIES
from syncline_design.diagnosis.settling import Settled
from syncline_design.diagnosis.spans import span_of
from syncline_design.diagnosis.stretches import is_inside
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Effect
from syncline_design.logs.stream_times import ASSUMED_GPS, GPS_MINUS_UTC_S, TELL_CLOCK
from syncline_design.model.figure_text import format_estimate, format_nats, to_places
from syncline_design.model.known import EffectEntry
from syncline_design.model.normal import NORMAL_95

MUCH = 3.0  # times that undoing a gross fault makes an error smaller
ONE_VALUE = 0.001  # chance below which a parameter is not one value along the log


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
        one = tail_findings if opened.what == "tails" else stochastic_findings
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
    made = final.data.error(others) - model.error
    size_m, constant = rms_m(final.data, made), within_noise(final.data, made)
    named = named_finding(final, one.effect, one.label, found, size_m, weights, constant)
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


def _gross(view: Scene, fault: Gross) -> Finding:
    effect, label = fault.acting.effect, fault.acting.label
    found = {
        p.name: _of_gross(fault.acting.values[p.name], fault.spread, p.unit)
        for p in effect.parameters
    }
    stage = view.system.stages[label[2]].name
    gain = math.log(fault.falls_by)
    words = f"undoing it makes the usual error {_times_smaller(fault.falls_by)}"
    words += f"; {fault.witness}" if fault.witness else ""
    named = finding(effect, label[1], stage, found, words + _of_a_clock(view, fault), gain)
    sentence = fault.sentence or named.sentence
    if fault.velocity_alike:
        sentence = f"{sentence}, and so do those of the velocity"
    if fault.readings:
        sentence = f"{sentence}, in {fault.readings} alone"
    return replace(named, sentence=sentence)


def _of_gross(value: float | str, spread: float | None, unit: str) -> Estimate:
    if spread is None or isinstance(value, str):
        return estimate(value, unit=unit)
    half = NORMAL_95 * spread
    return estimate(value, spread, unit, interval95=(value - half, value + half))


def _times_smaller(falls_by: float) -> str:
    """Of what is not grossly off its noise to a tenth."""
    places = 0 if falls_by >= MUCH else 1
    return f"{to_places(falls_by, places)} times smaller"


def _of_a_clock(view: Scene, fault: Gross) -> str:
    """What else leap seconds may be: of stamps whose clock the file does not tell."""
    slip = fault.acting.values.get("seconds")
    taken = [note.split(":")[0] for note in view.log.notes if ASSUMED_GPS in note]
    if not taken or not isinstance(slip, float) or round(abs(slip)) != GPS_MINUS_UTC_S:
        return ""
    return (f"; {taken[0]} was {ASSUMED_GPS}, and {GPS_MINUS_UTC_S} s is what UTC differs by: not "
            f"the position's stamps may be wrong but that ({TELL_CLOCK})")  # fmt: skip
