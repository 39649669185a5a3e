"""What a log cannot tell apart: other effects whose signature lies along the named one's."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from syncline_design.diagnose.candidates import Candidate, Signature, slopes, zero_values
from syncline_design.diagnose.fitting import Data, Model, fit, inner, inverse_scaled
from syncline_design.diagnose.noise import precision
from syncline_design.effects.base import Array

Label = tuple[str, str, int]
SAME = 0.99  # |cos| of the whitened angle above which two effects are one class
CLASS_NATS = 15.0  # ... unless re-simulation fits worse by more than this
MOST_REFITTED = 5
RIVAL_COSINE = 0.7  # ... if it also points roughly the same way
RIVAL_NATS = 3.0  # a rival that fits worse by less than this is not excluded by the data


@dataclass(frozen=True, slots=True)
class Alias:
    """An effect that this log cannot tell from the named one.

    cosine: of the whitened angle between the named signature and the span of the other's.
    loss: how much worse the other fits [nat].
    """

    candidate: Candidate
    cosine: float
    loss: float


@dataclass(frozen=True, slots=True)
class Comparison:
    """All other effects against a named one: those that cannot be told apart, and the rest."""

    aliases: tuple[Alias, ...]
    excluded: tuple[Alias, ...]  # nearest first


def compare(data: Data, model: Model, index: int, others: Sequence[Signature]) -> Comparison:
    """Compare the index-th acting effect of a model with all signatures not in the model."""
    named = model.acting[index]
    rest = tuple(a for k, a in enumerate(model.acting) if k != index)
    own = np.nan_to_num(slopes(data.view, (named,)))
    base = np.nan_to_num(slopes(data.view, rest))
    values = np.array([named.values[p.name] for p in named.effect.slopes()])
    added = (own @ values)[:, :, None]
    free = [s for s in others if s.candidate.label not in model.labels]
    columns = np.concatenate([base, added, *(np.nan_to_num(s.columns) for s in free)], axis=2)
    weighted = model.precision.solve(columns)
    normal = inner(columns, weighted)
    score = inner(weighted, (model.error + added[:, :, 0])[:, :, None])[:, 0]
    normal, score = _without(normal, score, base.shape[2])
    length = float(normal[0, 0])
    best: dict[Label, Alias] = {}
    found: dict[Label, Signature] = {}
    at = 1
    for s in free:
        group = slice(at, at + s.columns.shape[2])
        at = group.stop
        inverse = inverse_scaled(normal[group, group])
        cross = normal[0, group]
        inside = max(float(cross @ inverse @ cross), 0.0)
        cosine = math.sqrt(inside / max(length, 1e-300))
        gain = 0.5 * float(score[group] @ inverse @ score[group])
        alias = Alias(s.candidate, min(cosine, 1.0), _gain_of_named(score, normal) - gain)
        if s.candidate.label not in best or best[s.candidate.label].loss > alias.loss:
            best[s.candidate.label] = alias
            found[s.candidate.label] = s
    ranked = sorted(best.values(), key=lambda a: (-a.cosine, a.candidate.label))
    near = [a for a in ranked if a.cosine > SAME or _rivals(a)]
    refitted = [_refitted(data, model, index, a, found) for a in near[:MOST_REFITTED]]
    same = tuple(a for a in refitted if _rivals(a) or (a.cosine > SAME and a.loss < CLASS_NATS))
    kept = {a.candidate.label for a in same}
    return Comparison(same, tuple(a for a in ranked if a.candidate.label not in kept))


def _rivals(alias: Alias) -> bool:
    return alias.loss < RIVAL_NATS and alias.cosine > RIVAL_COSINE


def _refitted(
    data: Data, model: Model, index: int, alias: Alias, found: Mapping[Label, Signature]
) -> Alias:
    """The loss by re-simulation: a large latency and a large filter lag differ after all."""
    rest = tuple(a for k, a in enumerate(model.acting) if k != index)
    signature = found[alias.candidate.label]
    start = alias.candidate.acting(zero_values(alias.candidate.effect, signature.at))
    rival = fit(data, (*rest, start), model.opened, start=model.level)
    loss = rival.nll - model.nll
    if alias.candidate.effect.kind == "stochastic":
        loss = _with_scatter(data, rival, alias.candidate) - model.nll
    return Alias(alias.candidate, alias.cosine, loss)


def _with_scatter(data: Data, rival: Model, candidate: Candidate) -> float:
    """NLL once the scatter that belongs to the fitted mean is there too."""
    index = [d.key for d in data.structure.directed].index(candidate.key)
    value = abs(rival.acting[-1].values[candidate.effect.parameters[0].name])
    sizes = tuple(value if k == index else s for k, s in enumerate(rival.level.size))
    known = precision(data.structure, replace(rival.level, size=sizes))
    return known.negative_log_likelihood(rival.error)


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
        if s.at:
            continue
        columns = np.nan_to_num(s.columns)
        own = np.sqrt(np.maximum(np.diag(inner(columns, model.precision.solve(columns))), 0.0))
        slopes_of = s.candidate.effect.slopes()
        names = [p.name for k, p in enumerate(slopes_of) if p.high * own[k] < 3.0]
        if names:
            which = "" if len(names) == len(slopes_of) else f": {', '.join(names)}"
            name, sensor, _ = s.candidate.label
            hidden.append(f"{name} ({sensor}){which}")
    return tuple(hidden)
