"""Changes that may be told of runs, held against one another (`what_changed`).

Every effect with every trend has columns of its own: of trend h the column of parameter p is h
times that of the effect.  What runs have in common free,
    N_ij = sum h_i h_j I[p_i, p_j] - J_i S^-1 J_j',   s_i = sum h_i g[p_i] - J_i S^-1 g,
with J_i = sum h_i I[p_i, :].  A set M of changes explains s_M' N_MM^-1 s_M / 2 [nat]; another
beside it what is left of its own, of directions that are another thing than M.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Final

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.constants import apart_of
from syncline_design.campaign.freed_runs import pseudo_inverse
from syncline_design.campaign.pool import Index, inverted
from syncline_design.campaign.run_records import Change, Differing
from syncline_design.campaign.scatter import freed_of
from syncline_design.campaign.trends import Trend, log_weights, trends
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

MOST_TRENDS: Final = 40  # the likeliest of all that so many runs have


@dataclass(frozen=True, slots=True)
class PossibleChange:
    """One effect, by its place among all, with one trend."""

    effect: int
    trend: Trend


@dataclass(frozen=True, eq=False)
class PossibleChanges:
    """All changes that the first `look` runs may have had; freed: effects that differ from run to
    run, which have a value of their own in each.  off: changes that are as good as known, without
    which the constants of the runs are told."""

    changes: Changes
    look: int
    freed: tuple[Differing, ...] = ()
    off: tuple[Change, ...] = ()

    @cached_property
    def trends(self) -> tuple[Trend, ...]:
        every = trends(self.look)
        if len(every) <= MOST_TRENDS:
            return every
        best = np.max(self.changes.gains(self.look), axis=1)
        likely = {every[k] for k in np.argsort(-best)[:MOST_TRENDS]}
        needed = {one.trend for one in self.off}
        return tuple(one for one in every if one in likely or one in needed)

    @cached_property
    def noise(self) -> float:
        return self.changes.noise(self.look)

    @cached_property
    def _sums(self) -> tuple[Array, Array]:
        """N (D, D) and s (D,), trend by trend."""
        normal = self.changes.pool.normal[: self.look]
        score = self.changes.pool.score[: self.look]
        for one in self.freed:
            normal, score = freed_of(normal, score, one.term.index, one.covariance)
        left = score.copy()
        for change in self.off:
            made = normal[:, :, change.term.index] @ change.values
            left -= change.trend.over(self.look)[:, None] * made
        inverse = pseudo_inverse(self.changes.total(self.look, normal, left))
        over = np.array([one.over(self.look) for one in self.trends])
        count, size = len(over), normal.shape[1]
        across = np.tensordot(over, normal, axes=1)
        kept = across @ inverse
        squares = (over[:, None, :] * over[None, :, :]).reshape(count * count, -1)
        both = np.tensordot(squares, normal, axes=1).reshape(count, count, size, size)
        both -= np.einsum("ipq,jqr->ijpr", kept, np.swapaxes(across, 1, 2), optimize=True)
        scores = over @ score - kept @ score.sum(axis=0)
        return both.transpose(0, 2, 1, 3).reshape(count * size, -1), scores.ravel()

    def _columns(self, ones: Sequence[PossibleChange]) -> Index:
        size = len(self.changes.pool.labels)
        known = {trend: k for k, trend in enumerate(self.trends)}
        none = np.zeros(0, dtype=np.int64)
        index = [known[c.trend] * size + self.changes.terms[c.effect].index for c in ones]
        return np.concatenate([none, *index])

    def values(self, ones: Sequence[PossibleChange]) -> list[Change]:
        """Changes fitted together, by the noise fitted."""
        normal, score = self._sums
        at = self._columns(ones)
        inverse = inverted(normal[np.ix_(at, at)])
        found, end = [], 0
        for one in ones:
            term = self.changes.terms[one.effect]
            own = slice(end, end + term.size)
            end += term.size
            values = inverse[own] @ score[at]
            found.append(Change(term, one.trend, values, inverse[own, own], 0.0))
        return found

    def gains(self, beside: Sequence[PossibleChange]) -> Array:
        """What every trend and effect (R, C) explains beside others, less a nat a value, with the
        log of the effect's weight, and that of the trend where no other has it."""
        normal, score = self._sums
        at, size = self._columns(beside), len(self.changes.pool.labels)
        kept = normal[:, at] @ inverted(normal[np.ix_(at, at)])
        left = score - kept @ score[at]
        count = len(self.trends)
        found = np.zeros((count, len(self.changes.terms)))
        for group in self.changes.groups:
            index = np.arange(count)[:, None, None] * size + group.index
            cols = index.reshape(-1, index.shape[2])
            own = normal[cols[:, :, None], cols[:, None, :]]
            taken = np.einsum("kpm,kmq->kpq", kept[cols], np.swapaxes(normal[cols][:, :, at], 1, 2))
            apart = apart_of(own, own - taken)
            along = np.einsum("kap,ka->kp", apart.turn, left[cols])
            square = np.sum(along**2 * apart.another, axis=1).reshape(count, -1)
            found[:, group.terms] = 0.5 * square / self.noise - group.index.shape[1]
        found += self._weights(beside)[:, None] + self.changes.log_weights
        for one in beside:
            found[self.trends.index(one.trend), one.effect] = -np.inf
        return found

    def _weights(self, beside: Sequence[PossibleChange]) -> Array:
        """log of the trends' weights, 0 of those that a change beside has."""
        known = dict(zip(trends(self.look), log_weights(self.look), strict=True))
        had = {one.trend for one in beside}
        return np.array([0.0 if one in had else float(known[one]) for one in self.trends])
