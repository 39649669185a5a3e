"""Settle the final model: the best of every class is named, and what is needless goes."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from syncline_design.diagnosis.borrowed import doubt_nats
from syncline_design.diagnosis.candidates import Signature
from syncline_design.diagnosis.charges import told_nats
from syncline_design.diagnosis.fitting import Data, Model, fit
from syncline_design.diagnosis.identify import Comparison, competed
from syncline_design.diagnosis.identity import Label, effect_of, without
from syncline_design.diagnosis.judged import Course, Judged
from syncline_design.diagnosis.noise import as_specified
from syncline_design.diagnosis.one_value import Uneven, uneven_effects
from syncline_design.diagnosis.slow_states import States, fitted_of, names_of
from syncline_design.diagnosis.step_form import refuted_steps
from syncline_design.diagnosis.tails import tails_in
from syncline_design.diagnosis.trials import freedom_of, log_chance, seen_in_motion
from syncline_design.diagnosis.wandering import Wandering
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Effect
from syncline_design.machine.quick_dataclass import dataclass

APART = 2.0  # standard uncertainties between the values by two noise models
NEEDLESS = 0.2  # chance of as good a fit by noise alone, from which an effect is of no use
SURELY_TOLD_NATS = 12.0  # of an effect's figures, by their covariance, from which no refit is asked
ROUNDS = 3  # in which exchanging one effect may make another one of its class the better one


@dataclass(frozen=True, slots=True)
class Evidence:
    """What leaving an effect out of the final model costs [nat], the others and the noise refitted.

    log_p: log of the chance that noise alone gains as much from this one effect.
    """

    gain: float
    log_p: float


@dataclass(frozen=True, slots=True)
class Settled:
    """The final model on its data, with the evidence of each effect and the rest of its class.

    judged: what noise that is not the model's lets be said of each effect that moves the mean.
    courses: how it runs along the log.  stairs: the model with the strongest effect alone, the
    strongest two, ... , all of them.  refuted: steps that the data want to be ramps, or that do as
    well from the start on.  uneven: effects that are no one value wherever the vehicle goes.
    wandering: effects that are another size every few seconds.
    """

    data: Data
    model: Model
    evidence: Mapping[Label, Evidence]
    classes: Mapping[Label, Comparison]
    judged: Mapping[Label, Judged]
    courses: Mapping[Label, Course | None]
    stairs: tuple[tuple[Label, Model], ...]
    refuted: frozenset[Label] = frozenset()
    uneven: Mapping[Label, Uneven] = field(default_factory=dict)
    wandering: Mapping[Label, Wandering] = field(default_factory=dict)


def settle(
    data: Data,
    model: Model,
    others: Sequence[Signature],
    threshold: Callable[[Model], float],
    states: States,
    standing: Callable[[Judged, Effect], bool],
    fallen: Collection[Label] = (),
) -> Settled:
    """Let every class compete, then drop the weakest effect while chance does as well.

    The last one that is left has to bear its own evidence like any other.
    threshold: log p that the best candidate of a clean log falls below at the stated rate, given
    the model without the effect.  standing: whether an effect stands up in noise of another kind.
    fallen: what did not.
    """
    while True:
        model = _standing(data, model, states, standing)
        known = set(model.labels)
        model, classes = _decided(data, model, others, fallen)
        if set(model.labels) != known and set(model.labels) != set(
            _standing(data, model, states, standing).labels
        ):
            continue
        less = {label: refitted_without(data, model, label) for label in model.labels}
        evidence = {label: _evidence(data, model, label, one) for label, one in less.items()}
        weakest = max(evidence, key=lambda label: (evidence[label].log_p, label), default=None)
        if weakest is None or evidence[weakest].log_p <= threshold(less[weakest]):
            break
        model = less[weakest]
    model, own = valued(data, model, states)
    judged = dict(zip((a.label for a in model.acting), own, strict=True))
    ran = zip((a.label for a in model.acting), states.courses_of(model), strict=True)
    stairs = _stairs(data, model, evidence)
    return Settled(
        data, model, evidence, classes, judged, dict(ran), stairs,
        refuted_steps(states, model), uneven_effects(states, model),
    )  # fmt: skip


def valued(data: Data, model: Model, states: States) -> tuple[Model, list[Judged]]:
    """The model with the values to report, and what is said of them.

    Where a value by the fitted noise is further from the robust one than noise of the model's kind
    would put it, the noise is of another kind, and all values are the robust ones.
    """
    own = states.own(model, freed=True)
    for _ in range(ROUNDS):
        off = [np.abs(one.values - fitted_of(a)) for a, one in zip(model.acting, own, strict=True)]
        if not any(np.any(o > APART * j.spread) for o, j in zip(off, own, strict=True)):
            break
        moved = tuple(
            replace(
                a, values={**a.values, **dict(zip(names_of(a), map(float, j.values), strict=True))}
            )
            for a, j in zip(model.acting, own, strict=True)
        )
        error = data.error(moved)
        nll = model.precision.negative_log_likelihood(error)
        model = replace(model, acting=moved, error=error, nll=nll)
        own = states.own(model, freed=True)
    return model, own


def _standing(
    data: Data, model: Model, states: States, standing: Callable[[Judged, Effect], bool]
) -> Model:
    """The model without the effects that noise of another kind shows as well, weakest first.

    Scatter of stamps that does not grow with the motion goes after them.
    """
    while model.acting:
        judged = weaker_judged(data, model, states)
        fallen = [(one.log_p, a.label) for a, one in judged if not standing(one, a.effect)]
        if not fallen:
            break
        model = refitted_without(data, model, max(fallen)[1])
    moving = {a.label for a in model.acting}
    for one in model.opened:
        if one.candidate.label not in moving and not seen_in_motion(data, model, one):
            model = refitted_without(data, model, one.candidate.label)
    return model


def weaker_judged(data: Data, model: Model, states: States) -> list[tuple[Acting, Judged]]:
    """Every effect that moves the mean, with what less is said for it of two noises.

    What stands by the fitted noise has to stand by the spec's as well, larger where it is larger: a
    sensor whose noise is fitted far too small lends its weight to whatever moves that sensor.
    """
    stated = as_specified(data.structure)
    larger = tuple(max(own, 1.0) for own in model.level.factor)
    by_spec = replace(
        model,
        level=replace(stated, factor=larger, size=model.level.size, episodes=model.level.episodes),
    )
    both = zip(model.acting, states.own(model), states.own(by_spec), strict=True)
    return [(a, max(pair, key=lambda one: one.log_p)) for a, *pair in both]


def _decided(
    data: Data, model: Model, others: Sequence[Signature], fallen: Collection[Label]
) -> tuple[Model, dict[Label, Comparison]]:
    """The model with the best of every class, and what each is compared with."""
    classes: dict[Label, Comparison] = {}
    for _ in range(ROUNDS):
        model = fit(data, model.acting, model.opened, start=model.level)  # as its rivals will be
        before, classes = set(model.labels), {}
        for label in [a.label for a in model.acting]:
            less = _needless(data, model, label)
            if less is not None:
                model = less
                continue
            known = set(model.labels)
            model, compared = competed(data, model, label, others, fallen)
            own = (set(model.labels) - known) or {label}
            classes[own.pop()] = compared
        if set(model.labels) == before:
            break
    return model, classes


def _needless(data: Data, model: Model, label: Label) -> Model | None:
    """The model without an effect that others have made needless, before its class competes."""
    if len(model.labels) < 2 or told_nats(model, label) > SURELY_TOLD_NATS:
        return None
    less = refitted_without(data, model, label)
    return less if _evidence(data, model, label, less).log_p > math.log(NEEDLESS) else None


def borne_out(
    data: Data,
    model: Model,
    states: States,
    threshold: Callable[[Model], float],
    standing: Callable[[Judged, Effect], bool],
) -> Model:
    """The model without what these rows do not bear out, weakest first.

    What moves the mean is weighed by its values and their covariance, not refitted without.
    """
    model = _standing(data, model, states, standing)
    while model.labels:
        weighed = [_weighed(data, model, label) for label in model.labels]
        log_p, label, less = max(weighed, key=lambda one: one[:2])
        if log_p <= threshold(model):
            break
        model = less or refitted_without(data, model, label)
    return model


def _weighed(data: Data, model: Model, label: Label) -> tuple[float, Label, Model | None]:
    """log of the chance that noise alone gains as much; the model without, where it was made."""
    if any(one.label == label for one in model.acting):
        effect = effect_of(model, label)
        return log_chance(effect, told_nats(model, label), freedom_of(effect)), label, None
    less = refitted_without(data, model, label)
    return _evidence(data, model, label, less).log_p, label, less


def refitted_without(data: Data, model: Model, label: Label) -> Model:
    """The model less one effect, the others and the noise fitted again."""
    less = without(model, label)
    return fit(data, less.acting, less.opened, start=model.level)


def _evidence(data: Data, model: Model, label: Label, less: Model) -> Evidence:
    effect = effect_of(model, label)
    gain = less.nll - model.nll
    borrowed, without_it = (data.borrowed_nats(one, model.precision) for one in (model, less))
    if borrowed < without_it:  # noise that an effect takes out of the columns is no evidence
        gain -= without_it - borrowed + doubt_nats(borrowed, without_it)
    gain = max(gain, 0.0)
    if any(o.candidate.label == label and o.what == "tails" for o in model.opened):
        gain += max(tails_in(data, model).gain, 0.0)  # not in the normal likelihood
    return Evidence(gain, log_chance(effect, gain, freedom_of(effect)))


def _stairs(
    data: Data, model: Model, evidence: Mapping[Label, Evidence]
) -> tuple[tuple[Label, Model], ...]:
    """Models of the final effects, added one by one, strongest first."""
    ranked = sorted(evidence, key=lambda label: (-evidence[label].gain, label))
    stairs = []
    for count in range(1, len(ranked)):
        part = model
        for label in ranked[count:]:
            part = without(part, label)
        fitted = fit(data, part.acting, part.opened, start=model.level)
        stairs.append((ranked[count - 1], fitted))
    return (*stairs, (ranked[-1], model)) if ranked else ()
