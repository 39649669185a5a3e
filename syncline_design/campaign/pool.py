"""Statistics of many logs side by side, and effects fitted to all of them at once.

Of log r the parameters b_r have the information I_r and the score g_r (`diagnosis.sufficient`).  An
effect of the build has one value in all logs, one of a start has one in all logs of a start, one of
a log has its own in each: b_r = A_r t with A_r of zeros and ones, so that
    M = sum_r A_r' I_r A_r,   v = sum_r A_r' g_r,   t = M^-1 v,   gain = v' t / 2  [nat].
Sums do not depend on the order in which logs are added.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.campaign.hermitian import pseudo_inverses
from syncline_design.diagnosis.judged import Judged
from syncline_design.diagnosis.result import Scope
from syncline_design.diagnosis.slow_sums import LOST
from syncline_design.diagnosis.sufficient import Less, Sufficient
from syncline_design.effects import registry
from syncline_design.effects.record import Array, Effect
from syncline_design.machine.quick_dataclass import dataclass

Index = NDArray[np.int64]
KNOWN: Final = 30  # freedom for which the noise fitted counts against the scatter of parts
EXACT: Final = 60  # parameters up to which every part left out is solved for itself


@dataclass(frozen=True, slots=True)
class Term:
    """One effect at one place: where its parameters stand among all of the pool."""

    effect: Effect
    sensor: str
    stage: int
    index: Index

    @property
    def label(self) -> tuple[str, str, int]:
        return self.effect.name, self.sensor, self.stage

    @property
    def size(self) -> int:
        return int(self.index.size)


@dataclass(frozen=True, slots=True)
class Scoped:
    """An effect with what its value is common to."""

    term: Term
    scope: Scope


@dataclass(frozen=True, eq=False)
class Pool:
    """All logs with one list of parameters; what a log does not know of has no information.

    starts (L,): which start of the system a log belongs to.
    """

    labels: tuple[tuple[str, str, int, str], ...]
    normal: Array  # (L, P, P)
    score: Array  # (L, P)
    gram: Array  # (L, P, P)
    less: tuple[tuple[Less, ...], ...]  # of every log
    starts: Index

    @property
    def count(self) -> int:
        return int(self.normal.shape[0])

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        """Every effect that some log knows of."""
        return tuple(term for term in self._listed if np.any(self.seen[:, term.index]))

    @cached_property
    def untold(self) -> tuple[Term, ...]:
        """Every effect that the logs could have told of and none does, as of a vehicle at rest."""
        return tuple(term for term in self._listed if not np.any(self.seen[:, term.index]))

    @cached_property
    def _listed(self) -> tuple[Term, ...]:
        """All effects, their parameters in the order of their slopes."""
        found: dict[tuple[str, str, int], dict[str, int]] = {}
        for k, (name, sensor, stage, parameter) in enumerate(self.labels):
            found.setdefault((name, sensor, stage), {})[parameter] = k
        known = registry()
        return tuple(
            Term(
                known[name],
                sensor,
                stage,
                np.array(
                    [at[p.name] for p in known[name].slopes() if p.name in at], dtype=np.int64
                ),
            )
            for (name, sensor, stage), at in sorted(found.items())
            if name in known
        )

    @cached_property
    def seen(self) -> NDArray[np.bool_]:
        """Which log says anything of which parameter, (L, P)."""
        found: NDArray[np.bool_] = np.einsum("lpp->lp", self.normal) > 0.0
        return found

    def group_of(self, scope: Scope) -> Index:
        """The value that each log has, (L,)."""
        if scope == "build":
            return np.zeros(self.count, dtype=np.int64)
        return self.starts if scope == "start" else np.arange(self.count)

    def silent(self, places: Sequence[int]) -> Pool:
        """The same, some of the logs saying nothing."""
        heard = np.ones(self.count)
        heard[list(places)] = 0.0
        whole = heard[:, None, None]
        less = tuple(() if k in places else own for k, own in enumerate(self.less))
        return Pool(self.labels, self.normal * whole, self.score * heard[:, None],
                    self.gram * whole, less, self.starts)  # fmt: skip

    def part(self, rows: Index) -> Pool:
        """Some of the logs."""
        return Pool(
            self.labels,
            self.normal[rows],
            self.score[rows],
            self.gram[rows],
            tuple(self.less[k] for k in rows),
            self.starts[rows],
        )


def pool_of(found: Sequence[Sufficient], starts: Sequence[object]) -> Pool:
    """Logs side by side."""
    labels = tuple(sorted({label for one in found for label in one.labels}))
    place = {label: k for k, label in enumerate(labels)}
    size = len(labels)
    normal, score, gram, less = [], [], [], []
    for one in found:
        at = np.array([place[label] for label in one.labels], dtype=np.int64)
        normal.append(_spread(one.normal, at, size))
        gram.append(_spread(one.gram, at, size))
        score.append(_spread_vector(one.score, at, size))
        less.append(tuple(_spread_less(part, at, size) for part in one.less))
    order = list(dict.fromkeys(starts))
    index = np.array([order.index(s) for s in starts], dtype=np.int64)
    return Pool(labels, np.array(normal), np.array(score), np.array(gram), tuple(less), index)


def _spread(matrices: Array, at: Index, size: int) -> Array:
    found = np.zeros((*matrices.shape[:-2], size, size))
    found[..., at[:, None], at] = matrices
    return found


def _spread_vector(vectors: Array, at: Index, size: int) -> Array:
    found = np.zeros((*vectors.shape[:-1], size))
    found[..., at] = vectors
    return found


def _spread_less(part: Less, at: Index, size: int) -> Less:
    return Less(_spread(part.normal, at, size), _spread_vector(part.score, at, size), part.square)


@dataclass(frozen=True, eq=False)
class Fitted:
    """Effects fitted to a pool: values t (D,), normal matrix M (D, D), gain [nat].

    place: of every scoped effect, index (groups, p) of its values in t.
    """

    pool: Pool
    scoped: tuple[Scoped, ...]
    place: tuple[Index, ...]
    normal: Array
    score: Array
    values: Array
    gain: float

    @cached_property
    def inverse(self) -> Array:
        return inverted(self.normal)

    def of(self, k: int) -> Array:
        """Values of one effect, (groups, p)."""
        found: Array = self.values[self.place[k]]
        return found

    def columns(self, run: int) -> tuple[Index, Index]:
        """Of one log: where its values stand in t, and of which parameters they are."""
        at, of = [], []
        for one, place in zip(self.scoped, self.place, strict=True):
            at.append(place[self.pool.group_of(one.scope)[run]])
            of.append(one.term.index)
        empty = [np.zeros(0, dtype=np.int64)]
        return np.concatenate(at or empty), np.concatenate(of or empty)

    @cached_property
    def parts(self) -> tuple[tuple[Array, int], ...]:
        """Values less each part of each log, as departures from the mean of a log's parts.

        Of the two ways in which logs are parted (stretches, targets): departures scaled so that
        the sum of their squares is the jackknife's variance, and how many are free.
        """
        ways = max((len(less) for less in self.pool.less), default=0)
        return tuple(self._departures(way) for way in range(ways))

    def _departures(self, way: int) -> tuple[Array, int]:
        found, free = [np.zeros((0, self.values.size))], 0
        for run, less in enumerate(self.pool.less):
            if not less:
                continue
            own = self._without(run, less[min(way, len(less) - 1)])
            count = len(own)
            found.append((own - own.mean(axis=0)) * np.sqrt((count - 1) / count))
            free += count - 1
        return np.concatenate(found), free

    def _without(self, run: int, less: Less) -> Array:
        """t (G, D) less each part of one log."""
        at, of = self.columns(run)
        lost = self.pool.normal[run][of[:, None], of] - less.normal[:, of[:, None], of]
        missed = self.pool.score[run][of] - less.score[:, of]
        if self.values.size > EXACT:  # to first order in what the part brought
            left = missed - np.einsum("gab,b->ga", lost, self.values[at])
            first: Array = self.values - left @ self.inverse[at]
            return first
        normal = np.repeat(self.normal[None], len(lost), axis=0)
        score = np.repeat(self.score[None], len(lost), axis=0)
        normal[:, at[:, None], at] -= lost
        score[:, at] -= missed
        found: Array = np.einsum("gab,gb->ga", inverted(normal), score)
        return found

    def judged(self, index: Index) -> Judged:
        """Some of the values, with their covariance by the noise fitted and by every jackknife.

        Few parts tell a variance badly, so that theirs is moderated by the one fitted, each by its
        freedom (Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004)); of many logs the parts decide.
        """
        model = self.inverse[np.ix_(index, index)]
        jackknives = []
        for departures, free in self.parts:
            if free >= index.size + 4:
                own = departures[:, index]
                spread = (free * own.T @ own + KNOWN * model) / (free + KNOWN)
                jackknives.append((spread, free + KNOWN + 1))
        return Judged(self.values[index], model, tuple(jackknives))


def fitted(pool: Pool, scoped: Sequence[Scoped]) -> Fitted:
    """Fit effects to all logs of a pool."""
    place, width = [], 0
    for one in scoped:
        groups = int(pool.group_of(one.scope).max()) + 1
        place.append(width + np.arange(groups * one.term.size).reshape(groups, one.term.size))
        width += groups * one.term.size
    normal, score = np.zeros((width, width)), np.zeros(width)
    empty = Fitted(pool, tuple(scoped), tuple(place), normal, score, score, 0.0)
    for run in range(pool.count):
        at, of = empty.columns(run)
        normal[at[:, None], at] += pool.normal[run][of[:, None], of]
        score[at] += pool.score[run][of]
    values = inverted(normal) @ score
    gain = 0.5 * float(score @ values)
    return Fitted(pool, tuple(scoped), tuple(place), normal, score, values, gain)


def inverted(normal: Array) -> Array:
    """Inverses of normal matrices, columns scaled alike first; zero for what is not seen."""
    size = np.diagonal(normal, axis1=-2, axis2=-1)
    seen = size > 0.0
    if normal.shape[-1] == 1:
        return np.divide(1.0, normal, out=np.zeros_like(normal), where=seen[..., None])
    scale = np.where(seen, np.sqrt(np.where(seen, size, 1.0)), 1.0)
    squares = scale[..., :, None] * scale[..., None, :]
    if normal.shape[-1] == 0:
        return np.zeros_like(normal)
    inverse: Array = pseudo_inverses(normal / squares, LOST) / squares
    if np.all(seen):
        return inverse
    return np.where(seen[..., :, None] & seen[..., None, :], inverse, 0.0)
