"""What a log cannot tell apart: other effects whose signature lies along the named one's.

All members of a class are fitted in the place of the named one, on the same rows, from the same
noise, and the best of them is named.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import field, replace

import numpy as np

from syncline_design.diagnosis.candidates import (
    AS_GOOD_NATS,
    Candidate,
    Signature,
    commonness,
    slopes,
)
from syncline_design.diagnosis.charges import Charge, charge, fitted_figures
from syncline_design.diagnosis.fitting import Data, Model, inverse_scaled, scored
from syncline_design.diagnosis.identity import Label, effect_of, without
from syncline_design.diagnosis.spans import cut_to, cuttable, span_of
from syncline_design.diagnosis.trials import plausible, plausible_in_place, with_effect
from syncline_design.effects import registry
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

SAME = 0.99  # |cos| of the whitened angle above which two effects are one class
NEAR = 0.97  # above which another is refitted in its place: first order is not the last word
CLASS_NATS = 15.0  # ... unless re-simulation fits worse by more than this
MOST_REFITTED = 8
RIVAL_COSINE = 0.7  # from which a rival that fits as well is said not to be told apart
RIVAL_NATS = 3.0  # a rival that fits worse by less than this is not excluded by the data


@dataclass(frozen=True, slots=True)
class Alias:
    """Another effect beside the named one.

    cosine: of the whitened angle between the named signature and the span of the other's.
    fit: how much worse the other fits [nat]; loss: the same with what each pays for its freedom.
    possible: whether it fits with values that the effect can have.
    refitted: whether it was re-simulated with its noise fitted anew, as evidence is; otherwise the
    figures are of first order, with the named effect's noise, and larger than what a refit leaves.
    values, spreads: its figures in the named one's place and their standard uncertainties by the
    fitted noise, where it was refitted.
    """

    candidate: Candidate
    cosine: float
    fit: float
    loss: float
    possible: bool = True
    refitted: bool = False
    values: Mapping[str, float] = field(default_factory=dict)
    spreads: Mapping[str, float] = field(default_factory=dict)

    @property
    def acts_always(self) -> bool:
        return not any(p.located for p in self.candidate.effect.parameters)


@dataclass(frozen=True, slots=True)
class Comparison:
    """All other effects against a named one, nearest first.

    aliases: cannot be told apart.  lookalikes: the same signature to first order, but re-simulation
    fits worse, or one that fits as well only with impossible values or another signature.
    excluded: another signature that does not fit.
    """

    aliases: tuple[Alias, ...] = ()
    lookalikes: tuple[Alias, ...] = ()
    excluded: tuple[Alias, ...] = ()


def competed(
    data: Data,
    model: Model,
    label: Label,
    others: Sequence[Signature],
    fallen: Collection[Label] = (),
    again: int = 2,
) -> tuple[Model, Comparison]:
    """The model with the best effect in a named one's place, and the rest against that one.

    Its class competes, and whatever fits as well to first order: with the other effects of the
    model fitted again, an effect of quite another signature may be the better one by far.  So may
    what always acts where a step is named: the noise has taken up what the step leaves of it.  What
    fell (noise of another kind shows as much of it) is compared, and never named.  The model has to
    be fitted.
    """
    span = span_of(effect_of(model, label))
    if span is not None:  # rivals act in the same part of the log
        time_s = data.view.log.time_s
        others = [cut_to(span, s, time_s) for s in others if cuttable(s.candidate.effect)]
    screened, found = _screened(data, model, label, others)
    placed = any(p.located for p in effect_of(model, label).parameters)
    like = RIVAL_COSINE if placed else NEAR
    near = [a for a in screened
            if a.cosine > (like if a.acts_always else NEAR) or a.fit < RIVAL_NATS]  # fmt: skip
    near = sorted(near, key=lambda a: (a.fit, a.candidate.label))[:MOST_REFITTED]
    rest = without(model, label)
    rivals = [a.candidate.label for a in near]
    fits = {
        rival: with_effect(data, rest, found[rival], rest.level, against=model.nll)
        for rival in rivals
    }
    charges = {one: charge(data, fitted, one, model) for one, fitted in fits.items()}
    charges[label] = charge(data, model, label, model)
    able = {rival: one for rival, one in fits.items() if rival not in fallen}
    best = _best(data, model, label, able, charges)
    if best != label and again:
        return competed(data, fits[best], best, others, fallen, again - 1)
    return model, _sorted_out(data, model, label, screened, fits, charges)


def _best(
    data: Data,
    named: Model,
    label: Label,
    fits: Mapping[Label, Model],
    charges: Mapping[Label, Charge],
) -> Label:
    """The likeliest member of a class; of those as good, the one of fewest figures, the commonest.

    As good is what noise of the columns of motion may have made worse.
    """
    scores = {label: named.nll + charges[label].nats + charges[label].prior}
    for other, model in fits.items():
        if plausible_in_place(data, model, named):
            scores[other] = model.nll + charges[other].nats + charges[other].prior
    if any(plausible(data, fits[one]) for one in scores if one != label) and not plausible(
        data, named
    ):
        del scores[label]
    least = min(scores, key=lambda one: (scores[one], one))
    close = [
        one for one, score in scores.items()
        if score <= scores[least] + AS_GOOD_NATS + charges[one].doubt(charges[least])
    ]  # fmt: skip

    def order(one: Label) -> tuple[bool, int, int, bool, int, float, Label]:
        mine, (seldom, sensor) = charges[one], commonness(one)
        unstated = not _is_unstated_arm(data, one)
        return mine.unusual, mine.count, seldom, unstated, sensor, scores[one], one

    return min(close, key=order)


def _is_unstated_arm(data: Data, label: Label) -> bool:
    """Whether it is the arm of a ranging sensor that the spec leaves at zero.

    The reference point may be the antenna by definition; two sensors do not sit in one place.
    """
    name, sensor, stage = label
    rows = data.view.rows[stage]
    is_arm = name in registry() and registry()[name].breaks == "lever_arm"
    return is_arm and sensor == "ranging" and not np.any(rows.ranging_m)


def _sorted_out(
    data: Data,
    named: Model,
    label: Label,
    screened: Sequence[Alias],
    fits: Mapping[Label, Model],
    charges: Mapping[Label, Charge],
) -> Comparison:
    """Aliases, lookalikes and what is excluded, with the losses of the refits where there are."""
    lists: tuple[list[Alias], list[Alias], list[Alias]] = ([], [], [])
    for one in screened:
        model, doubt = fits.get(one.candidate.label), 0.0
        if model is not None:
            worse = model.nll - named.nll
            own, other = charges[label], charges[one.candidate.label]
            doubt = own.doubt(other)
            loss = _beyond(worse + other.nats - own.nats, doubt) + other.prior - own.prior
            doubt += max(other.borrowed - own.borrowed, 0.0)
            values, spreads = fitted_figures(model, one.candidate.label)
            one = replace(
                one,
                fit=worse,
                loss=loss,
                possible=plausible_in_place(data, model, named),
                refitted=True,
                values=values,
                spreads=spreads,
            )
        lists[_place(one, doubt)].append(one)
    aliases, lookalikes, excluded = lists
    return Comparison(tuple(aliases), tuple(lookalikes), tuple(excluded))


def _beyond(loss: float, doubt: float) -> float:
    """What of a difference [nat] is beyond doubt."""
    return math.copysign(max(abs(loss) - doubt, 0.0), loss)


def _place(one: Alias, doubt: float) -> int:
    """Which list an effect belongs to: 0 aliases, 1 lookalikes, 2 excluded.

    doubt: by how much it may seem worse than it is [nat].
    """
    same, rivals = one.cosine > SAME, one.fit < RIVAL_NATS + doubt
    if one.possible and (
        (rivals and one.cosine > RIVAL_COSINE) or (same and one.fit < CLASS_NATS + doubt)
    ):
        return 0
    return 1 if same or rivals else 2


def _screened(
    data: Data, model: Model, label: Label, others: Sequence[Signature]
) -> tuple[list[Alias], dict[Label, Signature]]:
    """Every other effect to first order, nearest first, and its best signature."""
    index = [a.label for a in model.acting].index(label)
    named = model.acting[index]
    rest = tuple(a for k, a in enumerate(model.acting) if k != index)
    own = np.nan_to_num(slopes(data.view, (named,)))
    base = np.nan_to_num(slopes(data.view, rest))
    values = np.array([named.values[p.name] for p in named.effect.slopes()])
    added = (own @ values)[:, :, None]
    free = [s for s in others if s.candidate.label not in model.labels]
    columns = np.concatenate([base, added, *(np.nan_to_num(s.columns) for s in free)], axis=2)
    normal, score = scored(model.precision, columns, model.error + added[:, :, 0])
    normal, score = _without(normal, score, base.shape[2])
    best: dict[Label, Alias] = {}
    found: dict[Label, Signature] = {}
    at = 1
    for s in free:
        group = slice(at, at + s.columns.shape[2])
        at = group.stop
        alias = _first_order(s.candidate, normal, score, group)
        if s.candidate.label not in best or best[s.candidate.label].fit > alias.fit:
            best[s.candidate.label] = alias
            found[s.candidate.label] = s
    ranked = sorted(best.values(), key=lambda a: (-a.cosine, a.candidate.label))
    return ranked, found


def _first_order(candidate: Candidate, normal: Array, score: Array, group: slice) -> Alias:
    """Cosine and loss of one effect by its linear signature."""
    inverse = inverse_scaled(normal[group, group])
    cross = normal[0, group]
    inside = max(float(cross @ inverse @ cross), 0.0)
    cosine = math.sqrt(inside / max(float(normal[0, 0]), 1e-300))
    loss = _gain_of_named(score, normal) - 0.5 * float(score[group] @ inverse @ score[group])
    return Alias(candidate, min(cosine, 1.0), loss, loss)


def _gain_of_named(score: Array, normal: Array) -> float:
    return 0.5 * float(score[0] ** 2 / max(normal[0, 0], 1e-300))


def _without(normal: Array, score: Array, width: int) -> tuple[Array, Array]:
    """Normal matrix and scores freed of the first `width` columns."""
    if not width:
        return normal, score
    inverse = inverse_scaled(normal[:width, :width])
    cross = normal[:width, width:]
    return (
        normal[width:, width:] - cross.T @ inverse @ cross,
        score[width:] - cross.T @ inverse @ score[:width],
    )


def unseen(data: Data, model: Model, others: Sequence[Signature]) -> tuple[str, ...]:
    """What this log could not show: parameters that at their plausible most stay below 3 sigma."""
    hidden = []
    for s in others:
        if not s.plain:
            continue
        columns = np.nan_to_num(s.columns)
        own = np.sqrt(np.maximum(model.precision.squares(columns), 0.0))
        slopes_of = s.candidate.effect.slopes()
        names = [p.name for k, p in enumerate(slopes_of) if p.high * own[k] < 3.0]
        if names:
            which = "" if len(names) == len(slopes_of) else f": {', '.join(names)}"
            name, sensor, _ = s.candidate.label
            hidden.append(f"{name} ({sensor}){which}")
    return tuple(hidden)
