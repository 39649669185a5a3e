"""A change that went back, which would pass for an effect that differs from run to run (`changes`).

What some runs on end have beside the others, from the run a to before the run b,
    d = N_in^-1 s_in - N_out^-1 s_out,
N and s the sums of an effect's information and score over the runs inside and outside.  It takes
s_in' N_in^-1 s_in + s_out' N_out^-1 s_out - s' N^-1 s of the scatter of all of them (Cochran's Q):
half of that, by the variance inside runs, less a nat a value and the log of how many are tried, is
its log factor, to be held against the odds of an effect that differs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.campaign.parts import EffectPart
from syncline_design.campaign.pool import Index, inverted
from syncline_design.campaign.run_records import Change, SameSize
from syncline_design.campaign.scatter import EffectInRuns, RunScatter, explained
from syncline_design.campaign.trends import Trend
from syncline_design.diagnosis.candidates import AS_GOOD_NATS, commonness
from syncline_design.effects.record import Array

FEWEST_OTHERS: Final = 3  # runs beside the one that is odd


def passing_change(
    parts: Sequence[EffectPart], groups: Sequence[SameSize], scatters: Sequence[RunScatter]
) -> Change | None:
    """Of any effect or parameter the change that went back which takes most of the scatter, the
    commonest of those that do as well; None of few runs."""
    tried: list[tuple[float, EffectPart, Change]] = []
    for g, scatter in zip(groups, scatters, strict=True):
        if len(scatter.runs.normal) < FEWEST_OTHERS + 1:
            return None
        taken, begun, ended = taken_by_passing(scatter.runs)
        charge = g.index.shape[1] + math.log(len(parts) * len(begun))
        factors = 0.5 * taken / scatter.runs.inside - charge
        for place, row in enumerate(np.argmax(factors, axis=0)):
            part, span = parts[g.terms[place]], (int(begun[row]), int(ended[row]))
            factor = float(factors[row, place])
            tried.append((factor, part, _fitted(part, scatter.runs, place, *span)))
    most = max(factor for factor, _, _ in tried)
    close = [one for one in tried if one[0] >= most - AS_GOOD_NATS]
    factor, _, best = min(close, key=lambda one: (commonness(one[1].term.label), -one[0]))
    return replace(best, log_factor=factor)


def taken_by_passing(runs: EffectInRuns) -> tuple[Array, Index, Index]:
    """What each takes of Q (B, G), its first run and the first that has it no more (B,)."""
    count = len(runs.normal)
    spans = [(a, b) for a in range(1, count) for b in range(a + 1, count)]
    begun, ended = np.array(spans, dtype=np.int64).T
    normal, score = (_between(of, begun, ended) for of in (runs.normal, runs.score))
    whole, scores = runs.normal.sum(axis=0), runs.score.sum(axis=0)
    taken = explained(normal, score) + explained(whole - normal, scores - score)
    return taken - explained(whole, scores), begun, ended


def _between(values: Array, begun: Index, ended: Index) -> Array:
    """Sums over the runs from one to before another, (B, ...)."""
    before = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
    found: Array = before[ended] - before[begun]
    return found


def _fitted(part: EffectPart, runs: EffectInRuns, place: int, begun: int, ended: int) -> Change:
    """What the runs from one to before another have of it beside the others."""
    inside = (np.arange(len(runs.normal)) >= begun) & (np.arange(len(runs.normal)) < ended)
    both = [(inverted(runs.normal[rows, place].sum(axis=0)), runs.score[rows, place].sum(axis=0))
            for rows in (inside, ~inside)]  # fmt: skip
    (here, own), (there, other) = both
    values, known = part.values(here @ own - there @ other), part.covariance(here + there)
    return Change(part.term, Trend("step", begun, ended), values, known, 0.0)
