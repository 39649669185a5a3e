"""What every run by itself says of each effect, for the course over the runs."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Final

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.naming import Naming
from syncline_design.campaign.pool import Fitted, Index, Pool, Term, fitted, inverted
from syncline_design.campaign.run_records import Change
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

MOST_NAMED: Final = 4


@dataclass(frozen=True, slots=True)
class RunParameter:
    """A parameter of an effect by one run: its place in the effect, value and standard
    uncertainty; None where the run says nothing of it."""

    term: Term
    place: int
    value: float
    spread: float | None


def run_values(
    changes: Changes, seen: Sequence[Change], rate: float, strange: Sequence[int] = ()
) -> tuple[tuple[RunParameter, ...], ...]:
    """Each effect's parameters by every run alone, beside what all runs name together.

    seen: the changes that were seen; one that went back is none by all runs.  They are taken off
    before anything is named, or the mean of a change would pass for what the system has all along
    and shift the runs before it; off what is fitted, too, but for the course of the very effect
    that changed.  strange: places of runs that are unlike the others, which name nothing.
    """
    stays = np.array([k for k in range(changes.pool.count) if k not in strange], dtype=np.int64)
    standing: list[Change] = []
    for one in seen:
        if _stands(reduce(Changes.without, standing, changes).pool, one, stays):
            standing.append(one)
    quiet = reduce(Changes.without, standing, changes).pool
    alike = quiet.part(stays)
    named = Naming(alike, rate, MOST_NAMED, whole=("build",)).named().fit
    found: list[list[RunParameter]] = [[] for _ in range(quiet.count)]
    for c, term in enumerate(quiet.terms):
        rest = tuple(s for s in named.scoped if s.term.label != term.label)
        others = [one for one in standing if one.term.label != term.label]
        pool = reduce(Changes.without, others, changes).pool
        values, inverse = _alone(pool, fitted(alike, rest), term)
        grown = max(1.0, float(np.mean(changes.within[:, c])))
        spread = np.sqrt(grown * np.einsum("rkk->rk", inverse))
        for run, k in np.ndindex(values.shape):
            own = float(spread[run, k])
            told = RunParameter(term, k, float(values[run, k]), own if own > 0.0 else None)
            found[run].append(told)
    return tuple(map(tuple, found))


def _stands(pool: Pool, one: Change, stays: Index) -> bool:
    """Whether runs are likelier with a change than without it, with one value of everything.

    log L(d) = sum (h g_c' d - h^2 d' I_cc d / 2) + (g - w)' S^+ (g - w) / 2,
    with h the course of the change, g and S of all runs together and w = sum h I_c d.
    """
    own, d, over = one.term.index, one.values, one.trend.over(pool.count)[stays]
    normal = pool.normal[stays]
    score, total = pool.score[stays].sum(axis=0), inverted(normal.sum(axis=0))
    left = score - np.tensordot(over, normal[:, :, own], axes=1) @ d
    squares = np.tensordot(np.square(over), normal[:, own[:, None], own], axes=1)
    gained = over @ pool.score[stays][:, own] @ d - 0.5 * d @ squares @ d
    return bool(gained + 0.5 * left @ total @ left > 0.5 * score @ total @ score)


def _alone(pool: Pool, beside: Fitted, term: Term) -> tuple[Array, Array]:
    """An effect's values by every run beside what is fitted, and their covariance."""
    at, of = beside.columns(0)  # one value in all runs: the same columns in every one
    left = pool.score - pool.normal[:, :, of] @ beside.values[at]
    inverse = inverted(pool.normal[:, term.index[:, None], term.index])
    return (inverse @ left[:, term.index, None])[:, :, 0], inverse
