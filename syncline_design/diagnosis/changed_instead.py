"""What is built in and changed once, where the search took it for a step of stamps or a drift.

The search knows no arm that is knocked: at much the same speed the step of a delay is the nearest
word for it, and of a heading that is turned once one that drifts.  A drift is held against the
change that is clearest without it.  A step of stamps at t is therefore held against everything that
is built in, from t to the end; one beside a delay of the same sensor, against it from the beginning
to t as well.  Each is fitted again beside the rest of the model,
    ln L = (S - S') / (2 s2) - (p / 2) ln N,
S and S' the squares over the spec's noise before and after, s2 what the best of them leaves of a
row's and p the figures.  A step that is no likelier by 4.5 nat is taken out of the model: what then
stands out there is named by what fits it.
Source of the charge of p figures: Schwarz, Ann. Statist. 6 (1978).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from syncline_design.diagnosis.candidates import Signature
from syncline_design.diagnosis.covariance import Precision
from syncline_design.diagnosis.fitting import Data, Model, Stepped, stepped
from syncline_design.diagnosis.identity import Label
from syncline_design.diagnosis.noise import precision
from syncline_design.diagnosis.once_changed import SURE
from syncline_design.diagnosis.stretch_fits import AS_GOOD_NATS, Hit, as_loud, in_stretch
from syncline_design.diagnosis.stretch_windows import log_chi2
from syncline_design.diagnosis.stretches import changed_once
from syncline_design.effects import plain_delay
from syncline_design.effects.acting import Acting
from syncline_design.machine.quick_dataclass import dataclass

_Place = tuple[tuple[Label, ...], tuple[float, float]]  # what falls, and where something acts [s]


@dataclass(frozen=True, slots=True)
class ChangedInstead:
    """A model less steps that what is built in explains as well, and where each of these acts."""

    model: Model
    hits: tuple[Hit, ...] = ()


@dataclass(frozen=True, slots=True)
class _Rival:
    """The model without a step, what acts instead, and by how many nat that is likelier."""

    less: Model
    hit: Hit
    nats: float


def changed_instead(data: Data, model: Model, asked: Sequence[Signature]) -> ChangedInstead:
    """The model without steps of stamps that are as likely a change of what is built in.

    asked: candidates that are looked for in stretches.
    """
    built_in = [s for s in asked if not s.candidate.effect.passing]
    found = ChangedInstead(model)
    for named in [a for a in model.acting if _is_step(a) or a.effect.grows]:
        of = _of_step if _is_step(named) else _of_drift
        rivals = _rivals(data, found.model, of(data, found.model, named, built_in), built_in)
        best = max(rivals, key=lambda one: one.nats, default=None)
        if best is not None and best.nats > -AS_GOOD_NATS:
            found = ChangedInstead(best.less, (*found.hits, best.hit))
    return found


def _is_step(one: Acting) -> bool:
    """Whether a sensor's stamps are off from some moment on."""
    located = any(p.located for p in one.effect.parameters)
    return located and one.effect.comes_with == "stamps" and one.effect.sensitivity is not None


def _of_drift(
    data: Data, model: Model, drift: Acting, built_in: Sequence[Signature]
) -> list[_Place]:
    """Where something changed once, by what is left without a drift."""
    kept = tuple(a for a in model.acting if a.label != drift.label)
    without = replace(model, acting=kept, error=data.error(kept))
    hit = changed_once(data, without, built_in)
    return [] if hit is None else [((drift.label,), (hit.from_s, hit.to_s))]


def _of_step(data: Data, model: Model, step: Acting, built_in: Sequence[Signature]) -> list[_Place]:
    """From a step of stamps on; beside a delay of the same sensor, until then as well."""
    time_s = data.view.log.time_s
    at_s = float(time_s[0]) + float(step.values["time_s"])  # of a log its first row is the start
    delay = (plain_delay().name, step.sensor, step.stage)
    places: list[_Place] = [((step.label,), (at_s, float(time_s[-1])))]
    if delay in model.labels:
        before_s = float(time_s[max(int(np.searchsorted(time_s, at_s)) - 1, 0)])
        places.append(((step.label, delay), (float(time_s[0]), before_s)))
    return places


def _rivals(
    data: Data, model: Model, places: Sequence[_Place], built_in: Sequence[Signature]
) -> Iterator[_Rival]:
    """Of each stretch that something may be taken for, what is built in and fits best."""
    white = precision(data.structure, as_loud(data.structure, model))
    own = _at_best(data, model.acting, white)
    for labels, stretch in places:
        less = tuple(a for a in model.acting if a.label not in labels)
        tried = [
            (s, _at_best(data, (*less, in_stretch(data, s, stretch)), white)) for s in built_in
        ]
        tried = [(s, fit) for s, fit in tried if _is_in_reach(s, fit.acting[-1])]
        if tried:
            s, fit = min(tried, key=lambda pair: pair[1].squares)
            yield _rival(data, model, (own, _at_best(data, less, white), fit), s, stretch)


def _rival(
    data: Data, model: Model, fits: tuple[Stepped, Stepped, Stepped], s: Signature,
    stretch: tuple[float, float],
) -> _Rival:  # fmt: skip
    """What fits best in place of a step; fits: with the step, without, and with this instead."""
    own, without, instead = fits
    rows = max(float(np.sum(np.isfinite(data.view.log.truth_m[:, list(data.axes)]))), 1.0)
    scale2 = max(min(own.squares, instead.squares) / rows, 1.0)
    width = s.columns.shape[2]
    more = len(without.columns[0, 0]) + width - len(own.columns[0, 0])
    nats = 0.5 * (own.squares - instead.squares) / scale2 - 0.5 * more * math.log(rows)
    gained = np.array([max(without.squares - instead.squares, 0.0) / scale2])
    log_p = min(float(log_chi2(gained, width)[0]), math.log(SURE) - 1.0)  # the search bore it out
    kept = instead.acting[:-1]
    less = replace(model, acting=kept, error=data.error(kept))
    return _Rival(less, Hit(*stretch, log_p, scale2, s), nats)


def _at_best(data: Data, acting: tuple[Acting, ...], white: Precision) -> Stepped:
    return stepped(data, acting, white, data.error(acting), steps=6)


def _is_in_reach(s: Signature, one: Acting) -> bool:
    """Whether its values are some that a build can be wrong by."""
    return all(abs(float(one.values[p.name])) <= p.high for p in s.candidate.effect.slopes())
