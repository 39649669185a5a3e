"""Records of runs side by side, of what changes among them and of what differs (`changes`)."""

from __future__ import annotations

import numpy as np

from syncline_design.campaign.pool import Index, Term
from syncline_design.campaign.scatter import RunScatter
from syncline_design.campaign.trends import Trend
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass


@dataclass(frozen=True, eq=False)
class Change:
    """One effect from one run on: d (of a drift by run) with its covariance, and log of the Bayes
    factor."""

    term: Term
    trend: Trend
    values: Array
    covariance: Array
    log_factor: float

    @property
    def k(self) -> int:
        """Place of the first run that has it."""
        return self.trend.k

    def made(self, normal: Array) -> Array:
        """Scores (L, P) that it makes in runs of information (L, P, P)."""
        own: Array = normal[:, :, self.term.index] @ self.values
        return self.trend.over(len(normal))[:, None] * own


@dataclass(frozen=True, slots=True)
class SameSize:
    """Terms of one size: where they stand among all, and their parameters (G, p)."""

    terms: Index
    index: Index

    @property
    def blocks(self) -> tuple[Index, Index]:
        """Index of their own blocks in matrices (..., P, P)."""
        return self.index[:, :, None], self.index[:, None, :]


@dataclass(frozen=True, eq=False)
class Differing:
    """An effect that differs from run to run, and the covariance (p, p) by which it does beyond
    noise; named, named_covariance: the same of the commonest that differs as clearly.  log_p: log
    of the chance that the named one differs so much by noise alone, all effects counted.  others:
    what would explain most of that as well."""

    term: Term
    covariance: Array
    named: Term
    named_covariance: Array
    log_p: float
    others: tuple[Term, ...] = ()

    @property
    def spread(self) -> Array:
        """Standard deviation of the named effect by parameter, (p,)."""
        found: Array = np.sqrt(np.maximum(np.diag(self.named_covariance), 0.0))
        return found


@dataclass(frozen=True, slots=True)
class Freed:
    """N (2 (look - 1), G, p, p) and s (2 (look - 1), G, p) of every course, by group of terms."""

    normals: tuple[Array, ...]
    scores: tuple[Array, ...]


@dataclass(frozen=True, slots=True)
class Runs:
    """Information and score of runs, their sum with the prior and its inverse, and the scatter of
    each effect.

    freed: what clearly differs from run to run.  parts: the scatter of each effect, and then of
    single parameters.
    """

    normal: Array
    score: Array
    total: Array
    inverse: Array
    scatters: tuple[RunScatter, ...]
    parts: tuple[RunScatter, ...]
    freed: tuple[Differing, ...] = ()
