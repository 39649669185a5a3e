"""What a log cannot tell apart: other effects whose signature lies along the named one's."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from syncline_design.diagnose.candidates import Candidate, Signature, slopes
from syncline_design.diagnose.fitting import Data, Model, inner, inverse_scaled
from syncline_design.diagnose.simulation import Acting
from syncline_design.effects.base import Array

SAME = 0.99  # |cos| of the whitened angle above which two effects are one class
RIVAL_NATS = 4.5  # a rival that fits worse by less than this is not excluded by the data


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
    best: dict[tuple[str, str, int], Alias] = {}
    at = 1
    for s in free:
        group = slice(at, at + s.columns.shape[2])
        at = group.stop
        inverse = inverse_scaled(normal[group, group])
        cross = normal[0, group]
        cosine = float(np.sqrt(max(cross @ inverse @ cross, 0.0) / max(length, 1e-300)))
        gain = 0.5 * float(score[group] @ inverse @ score[group])
        alias = Alias(s.candidate, min(cosine, 1.0), _gain_of_named(score, normal) - gain)
        if s.candidate.label not in best or best[s.candidate.label].loss > alias.loss:
            best[s.candidate.label] = alias
    ranked = sorted(best.values(), key=lambda a: (-a.cosine, a.candidate.label))
    same = tuple(a for a in ranked if a.cosine > SAME or a.loss < RIVAL_NATS)
    return Comparison(same, tuple(a for a in ranked if a not in same))


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


def unseen(data: Data, model: Model, others: Sequence[Signature]) -> tuple[Acting, ...]:
    """Effects that this log could not show: at the plausible most, not 3 standard errors."""
    hidden = []
    for s in others:
        if s.at:
            continue
        columns = np.nan_to_num(s.columns)
        normal = inner(columns, model.precision.solve(columns))
        for k, p in enumerate(s.candidate.effect.slopes()):
            if p.high * np.sqrt(max(normal[k, k], 0.0)) < 3.0:
                hidden.append(s.candidate.acting({p.name: p.high}))
                break
    return tuple(hidden)
