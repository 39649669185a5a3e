"""Whether an effect of a system changed from one run to a later one, however often it is asked.

Until a change every parameter b is one value in all runs; from run k on one effect c has b_c + d.
With S_n the sum of all information, T that of the runs from k on, both freed of b (prior as wide
as an effect can be),
    N = I_T[c, c] - I_T[c, :] S_n^-1 I_T[:, c],   s = g_T[c] - I_T[c, :] S_n^-1 g,
and with d ~ N(0, D), D of REACH bounds of one run, the Bayes factor for the change is
    B_ck = |1 + N D|^-1/2 exp(s' (N + D^-1)^-1 s / 2).
Mixed over all effects alike and over k with weights w_k that sum to one (changes that did not
happen yet count one), E_n = sum_k w_k mean_c B_ck is an e-process: without a change it reaches
1 / alpha at any look, of however many, with a chance of at most alpha (Ville's inequality).
Noise that is not the model's: the variance of an effect grows by what the scatter of the parts of
runs, and of the runs before k among themselves, has beyond it.
Sources: Ville (1939); Ramdas, Gruenwald, Vovk, Shafer, Statistical Science 38 (2023), on
e-processes; Shin, Ramdas, Rinaldo, New England J. Stat. Data Sci. 2 (2024), on changes.
"""

from __future__ import annotations

from functools import cached_property
from typing import Final

import numpy as np

from syncline_design.campaign.pool import Index, Pool, Term, inverted
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

REACH: Final = 5.0  # bounds of one run: the change that is looked for
SOON: Final = 100  # runs since the baseline in any of which a change is as likely
SOON_SHARE: Final = 0.9
RUNS_KNOWN: Final = 10.0  # runs that the noise fitted counts for, against the scatter of runs
MOST_LOG: Final = 690.0


def weight_of(k: int) -> float:
    """Share of the false alarms that a change at the run k (from 2) may have."""
    if k <= SOON + 1:
        return SOON_SHARE / SOON
    j = k - SOON - 1
    return (1.0 - SOON_SHARE) / (j * (j + 1.0))


@dataclass(frozen=True, eq=False)
class Change:
    """One effect from one run on: d with its covariance, and log of the Bayes factor."""

    term: Term
    k: int  # index of the first run that has it
    values: Array
    covariance: Array
    log_factor: float


@dataclass(frozen=True, eq=False)
class Changes:
    """All changes that runs could show, in their order."""

    pool: Pool

    @cached_property
    def terms(self) -> tuple[Term, ...]:
        return self.pool.terms

    @cached_property
    def prior(self) -> Array:
        """Prior information of the values before: as large as each can be, (P,)."""
        found = np.zeros(len(self.pool.labels))
        for term in self.terms:
            found[term.index] = [p.high**-2.0 for p in term.effect.slopes()]
        return found

    @cached_property
    def within(self) -> Array:
        """Variance by the scatter of parts over that fitted, of every run and effect, (L, C).

        Of each effect alone, the others where the run itself puts them: what acts all along would
        else be taken for scatter.
        """
        found = np.ones((self.pool.count, len(self.terms)))
        for run, less in enumerate(self.pool.less):
            values = _values(self.pool.normal[run] + np.diag(self.prior), self.pool.score[run])
            for part in less:
                left = part.score - part.normal @ values
                for c, term in enumerate(self.terms):
                    own = _scatter(self.pool.normal[run], part.normal, left, term.index)
                    found[run, c] = own if part is less[0] else max(found[run, c], own)
        return found

    def log_evidence(self, look: int) -> tuple[float, Array]:
        """log E_n of the first `look` runs, and log w_k B_ck / C of every k from 1 and c."""
        weights = np.array([weight_of(k + 1) for k in range(1, look)])
        factors = [self._factors(look, c) for c in range(len(self.terms))]
        table = np.log(weights)[:, None] + np.stack(factors, axis=1) - np.log(len(self.terms))
        rest = max(1.0 - float(np.sum(weights)), 1e-300)
        return float(np.logaddexp.reduce([*table.ravel(), np.log(rest)])), table

    def _factors(self, look: int, c: int) -> Array:
        """log B_ck of every k from 1."""
        term = self.terms[c]
        whole, score = self._freed(look)
        temper = self.temper(look, c)
        normal = whole[:, term.index[:, None], term.index] / temper[:, None, None]
        return _log_bayes(normal, score[:, term.index] / temper[:, None], self._reach(look, term))

    def change(self, look: int, k: int, c: int) -> Change:
        """Effect c from run k on, by the first `look` runs."""
        term = self.terms[c]
        whole, score = self._freed(look)
        inverse = inverted(whole[k - 1][term.index[:, None], term.index])
        covariance = float(self.temper(look, c)[k - 1]) * inverse
        log_factor = float(self._factors(look, c)[k - 1])
        return Change(term, k, inverse @ score[k - 1][term.index], covariance, log_factor)

    @cached_property
    def _kept(self) -> dict[int, tuple[Array, Array]]:
        return {}

    def _freed(self, look: int) -> tuple[Array, Array]:
        """N (look - 1, P, P) and s (look - 1, P) of all parameters, of every k from 1."""
        if look not in self._kept:
            self._kept.clear()
            normal, score = self.pool.normal[:look], self.pool.score[:look]
            total = normal.sum(axis=0) + np.diag(self.prior)
            scale = np.sqrt(np.where(np.diag(total) > 0.0, np.diag(total), 1.0))
            inverse = np.linalg.pinv(total / scale[:, None] / scale, hermitian=True, rcond=1e-13)
            inverse = inverse / scale[:, None] / scale
            later = np.cumsum(normal[::-1], axis=0)[::-1][1:]
            scores = np.cumsum(score[::-1], axis=0)[::-1][1:]
            cross = later @ inverse
            self._kept[look] = later - cross @ later, scores - cross @ score.sum(axis=0)
        return self._kept[look]

    def _reach(self, look: int, term: Term) -> Array:
        """D: REACH^2 times the covariance that one run has, by how the runs were driven."""
        index = term.index[:, None], term.index
        return REACH**2 * inverted(self.pool.normal[:look].mean(axis=0)[index])

    def temper(self, look: int, c: int) -> Array:
        """Variance over that fitted: within runs, and between those before each k from 1."""
        inside = max(1.0, float(np.mean(self.within[:look, c])))
        return inside * np.maximum(1.0, self._between[: look - 1, c])

    @cached_property
    def _between(self) -> Array:
        """Scatter of the runs before k over what it is by chance, of k from 1 and c.

        Cochran's Q of each effect alone, the values of all others those of these runs together.
        """
        count, found = self.pool.count, np.ones((max(self.pool.count - 1, 1), len(self.terms)))
        inverses = [inverted(self.pool.normal[:, t.index[:, None], t.index]) for t in self.terms]
        for k in range(2, count):
            normal, score = self.pool.normal[:k], self.pool.score[:k]
            values = _values(normal.sum(axis=0) + np.diag(self.prior), score.sum(axis=0))
            left = score - normal @ values
            for c, term in enumerate(self.terms):
                own = left[:, term.index]
                square = float(np.einsum("ra,rab,rb->", own, inverses[c][:k], own))
                free = term.size * (k - 1.0)
                known = term.size * RUNS_KNOWN
                inside = max(1.0, float(np.mean(self.within[:k, c])))
                found[k - 1, c] = (square / inside + known) / (free + known)
        return found

    def without(self, one: Change) -> Changes:
        """The same runs with a change taken off those that have it."""
        score = self.pool.score.copy()
        score[one.k :] -= self.pool.normal[one.k :][:, :, one.term.index] @ one.values
        pool = Pool(self.pool.labels, self.pool.normal, score, self.pool.gram, self.pool.less,
                    self.pool.starts)  # fmt: skip
        found = Changes(pool)
        found.__dict__["within"] = self.within  # the scatter inside runs is what it was
        return found


def _values(total: Array, score: Array) -> Array:
    """total^-1 score, columns scaled alike first."""
    scale = np.sqrt(np.where(np.diag(total) > 0.0, np.diag(total), 1.0))
    scaled = total / scale[:, None] / scale
    found: Array = np.linalg.lstsq(scaled, score / scale, rcond=1e-13)[0] / scale
    return found


def _scatter(normal: Array, normals: Array, scores: Array, index: Index) -> float:
    """Mean over an effect's parameters of the jackknife's variance over the fitted one."""
    own = normals[:, index[:, None], index]
    values = np.einsum("gab,gb->ga", inverted(own), scores[:, index])
    count = len(values)
    off = values - values.mean(axis=0)
    seen = int(np.sum(np.diag(normal)[index] > 0.0))
    if not seen:
        return 1.0
    spread = (count - 1) / count * np.einsum("ga,ab,gb->", off, normal[index[:, None], index], off)
    return float(spread) / seen


def _log_bayes(normal: Array, score: Array, reach: Array) -> Array:
    """log |1 + N D|^-1/2 exp(s' (N + D^-1)^-1 s / 2) of several N and s; D may have no inverse."""
    values, vectors = np.linalg.eigh(reach)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    inner = np.eye(len(reach)) + root.T @ normal @ root
    turned = score @ root
    size = np.linalg.slogdet(inner)[1]
    solved = np.linalg.solve(inner, turned[:, :, None])[:, :, 0]
    found: Array = np.minimum(0.5 * np.sum(turned * solved, axis=1) - 0.5 * size, MOST_LOG)
    return found
