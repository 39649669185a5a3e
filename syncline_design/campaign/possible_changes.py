"""Changes that may be told of runs, held against one another (`what_changed`).

Every effect with every trend has columns of its own: of trend h the column of parameter p is h
times that of the effect.  What runs have in common free,
    N_ij = sum h_i h_j I[p_i, p_j] - J_i S^-1 J_j',   s_i = sum h_i g[p_i] - J_i S^-1 g,
with J_i = sum h_i I[p_i, :].  A set M of changes explains s_M' N_MM^-1 s_M / 2 [nat]; another
beside it what is left of its own, of directions that are another thing than M.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Final

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.constants import AloneOfSize, blocks_of
from syncline_design.campaign.freed_runs import pseudo_inverse
from syncline_design.campaign.pool import Index, inverted
from syncline_design.campaign.run_records import Change, Differing
from syncline_design.campaign.scatter import freed_of
from syncline_design.campaign.trends import Trend, log_weights, trends
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

RIVAL_NATS: Final = 3.0
MOST_RIVALS: Final = 6
TOLD: Final = 3.0  # standard uncertainties from which a parameter is told
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
    which the constants of the runs are told.  needed: trends that are among them; only: no others.
    """

    changes: Changes
    look: int
    freed: tuple[Differing, ...] = ()
    off: tuple[Change, ...] = ()
    needed: tuple[Trend, ...] = ()
    only: bool = False

    @cached_property
    def trends(self) -> tuple[Trend, ...]:
        if self.only:
            return tuple(dict.fromkeys(self.needed))
        every = trends(self.look)
        if len(every) > MOST_TRENDS:
            best = np.max(self.changes.gains(self.look), axis=1)
            every = tuple(every[k] for k in sorted(np.argsort(-best)[:MOST_TRENDS]))
        return tuple(dict.fromkeys((*every, *self.needed)))

    def knowing(self, ones: Sequence[PossibleChange]) -> PossibleChanges:
        """The same with the trends that some have."""
        missing = [one.trend for one in ones if one.trend not in self.trends]
        return replace(self, needed=(*self.needed, *missing)) if missing else self

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
            left -= change.made(normal)
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

    @cached_property
    def _alone(self) -> tuple[tuple[Index, AloneOfSize], ...]:
        """By size of effects: columns with every trend (R G, p), and what each tells alone."""
        normal, found = self._sums[0], []
        places = np.arange(len(self.trends))[:, None, None] * len(self.changes.pool.labels)
        for group in self.changes.groups:
            columns = (places + group.index).reshape(-1, group.index.shape[1])
            own = normal[columns[:, :, None], columns[:, None, :]]
            found.append((columns, blocks_of(own)))
        return tuple(found)

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

    @cached_property
    def _gains(self) -> dict[tuple[PossibleChange, ...], Array]:
        return {}

    def gains(self, beside: Sequence[PossibleChange]) -> Array:
        """What every trend and effect (R, C) explains beside others, less a nat a value, with the
        log of the effect's weight, and that of the trend where no other has it.  A search asks for
        the same more than once."""
        key = tuple(beside)
        if key not in self._gains:
            self._gains[key] = self._beside(key)
        return self._gains[key].copy()

    def _beside(self, beside: tuple[PossibleChange, ...]) -> Array:
        normal, score = self._sums
        at = self._columns(beside)
        across = normal[:, at]
        kept = across @ inverted(across[at])
        left = score - kept @ score[at]
        count = len(self.trends)
        found = np.zeros((count, len(self.changes.terms)))
        for group, (columns, own) in zip(self.changes.groups, self._alone, strict=True):
            taken = np.einsum("kpm,kmq->kpq", kept[columns], np.swapaxes(across[columns], 1, 2))
            apart = own.apart(own.information - taken)
            along = np.einsum("kap,ka->kp", apart.turn, left[columns])
            square = np.sum(along**2 * apart.another, axis=1).reshape(count, -1)
            found[:, group.terms] = 0.5 * square / self.noise - group.index.shape[1]
        found += self._weights(beside)[:, None] + self.changes.log_weights
        for one in beside:
            found[self.trends.index(one.trend), one.effect] = -np.inf
        return found

    def rivals(self, found: Sequence[PossibleChange], k: int) -> list[tuple[int, float]]:
        """Effects that explain as well what one of a set does, with its trend, and by how many nats
        less: in its place, or in that of one of its parameters, a nat a value counted."""
        one, rest = found[k], [other for at, other in enumerate(found) if at != k]
        gains = self.gains(rest)[self.trends.index(one.trend)]
        worse = {i: float(gains[one.effect] - gains[i]) for i in range(len(gains))}
        if self.changes.terms[one.effect].size > 1:
            for i in set(worse) - {other.effect for other in found}:
                worse[i] = min(worse[i], self._in_place_of_one(found, k, i))
        near = [(i, by) for i, by in worse.items() if i != one.effect and by < RIVAL_NATS]
        return sorted(near, key=lambda pair: pair[1])[:MOST_RIVALS]

    def _in_place_of_one(self, found: Sequence[PossibleChange], k: int, effect: int) -> float:
        """How much less [nat] a set explains with an effect in the place of a parameter of another
        that is told, of all these the least."""
        change = self.values(found)[k]
        spread = np.sqrt(self.noise * np.maximum(np.diag(change.covariance), 0.0))
        told = np.flatnonzero(np.abs(change.values) > TOLD * spread)
        if len(told) < 2:  # a single one is the whole effect
            return np.inf
        first = len(self._columns(found[:k]))
        own = self._columns([*found, PossibleChange(effect, found[k].trend)])
        less = [self._explained(np.delete(own, first + int(p))) for p in told]
        more = self.changes.terms[effect].size - 1
        return self._explained(self._columns(found)) - max(less) + more

    def _explained(self, columns: Index) -> float:
        """s_M' N_MM^-1 s_M / 2 [nat] by the noise."""
        normal, score = self._sums
        inverse = inverted(normal[np.ix_(columns, columns)])
        return 0.5 * float(score[columns] @ inverse @ score[columns]) / self.noise

    def _weights(self, beside: Sequence[PossibleChange]) -> Array:
        """log of the trends' weights, 0 of those that a change beside has; any end is as likely."""
        had = {one.trend for one in beside}
        return np.array([0.0 if one in had else self.weight_of(one) for one in self.trends])

    def weight_of(self, trend: Trend) -> float:
        """log of a trend's weight; that of a single run is known to be the odd one."""
        if trend.is_of_one_run:
            return 0.0
        ends = 0.0 if trend.until is None else math.log(self.look)
        return self._known[trend.begun] - ends

    @cached_property
    def _known(self) -> dict[Trend, float]:
        pairs = zip(trends(self.look), log_weights(self.look), strict=True)
        return {trend: float(weight) for trend, weight in pairs}
