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

from syncline_design.campaign.pool import Index, Term, inverted
from syncline_design.campaign.run_records import Change, SameSize
from syncline_design.campaign.scatter import EffectInRuns, RunScatter, explained
from syncline_design.campaign.trends import Trend
from syncline_design.effects.record import Array

SHORTEST: Final = 2  # runs that have it; one alone is an odd one


def passing_change(
    terms: Sequence[Term], groups: Sequence[SameSize], scatters: Sequence[RunScatter]
) -> Change | None:
    """Of any effect the change that went back which takes most of the scatter; None of few runs."""
    best: Change | None = None
    for g, scatter in zip(groups, scatters, strict=True):
        if len(scatter.runs.normal) < SHORTEST + 2:
            return None
        taken, begun, ended = taken_by_passing(scatter.runs)
        tried = g.index.shape[1] + math.log(len(terms) * len(begun))
        factors = 0.5 * taken / scatter.runs.inside - tried
        row, place = np.unravel_index(int(np.argmax(factors)), factors.shape)
        if best is None or factors[row, place] > best.log_factor:
            span = int(begun[row]), int(ended[row])
            one = _fitted(terms[g.terms[place]], scatter.runs, int(place), *span)
            best = replace(one, log_factor=float(factors[row, place]))
    return best


def taken_by_passing(runs: EffectInRuns) -> tuple[Array, Index, Index]:
    """What each takes of Q (B, G), its first run and the first that has it no more (B,)."""
    count = len(runs.normal)
    spans = [(a, b) for a in range(1, count) for b in range(a + SHORTEST, count)]
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


def _fitted(term: Term, runs: EffectInRuns, place: int, begun: int, ended: int) -> Change:
    """What the runs from one to before another have of it beside the others."""
    inside = (np.arange(len(runs.normal)) >= begun) & (np.arange(len(runs.normal)) < ended)
    both = [(inverted(runs.normal[rows, place].sum(axis=0)), runs.score[rows, place].sum(axis=0))
            for rows in (inside, ~inside)]  # fmt: skip
    (here, own), (there, other) = both
    return Change(term, Trend("step", begun, ended), here @ own - there @ other, here + there, 0.0)
