"""Whether an effect of a system changed from one run to a later one, however often it is asked.

Until a change every parameter b is one value in all runs; from run k on one effect c has b_c + h d,
of a step with h = 1, of a drift with h = 1, 2, 3, ... (`trends`).  With S_n the sum of all
information and of the prior of b, and with J = sum h I[c, :],
    N = sum h^2 I[c, c] - J S_n^-1 J',   s = sum h g[c] - J S_n^-1 g,
and with d ~ N(0, D), D of REACH bounds of one run (of a drift of DRIFT from run to run), the Bayes
factor for the change is
    B_ck = |1 + N D|^-1/2 exp(s' (N + D^-1)^-1 s / 2),
mixed over SIZES of D: what differs from run to run may do so by as much.
What the build has all along is no alarm: effects that all runs together show as constants may have
any value that they can have.  Those that they do not show are small: 0 to within PLAUSIBLE of their
own standard deviations by all these runs.  Were every one of them free, a day that is driven
otherwise than the days before would say next to nothing: some sum of constants that those days did
not show would do for any change.
An effect that differs from run to run while nothing is moved would pass for a change of it, or of a
commoner one that moves the runs alike.  So the runs are held against that, too: L_a is how much
likelier they are where effect a, or one parameter of it alone, has a value of its own in every run,
normal about the common one, and p_a the odds of it (`parts`).  What clearly differs (Q of its runs,
beside any trend of it and the likeliest change of all) is freed in each run to the extent that it
does, for all others too.
Mixed over effects with weights w_c (the common ones have more) and over trends from any k with
weights w_k, each of sum one (changes that did not happen yet count one),
    E_n = (sum w_k w_c B_ck + p_m L_m sum w_k w_c B_ck|m) / (1 + sum p_a L_a)
with m what most likely differs, free in every run for the second sum (a change beside it), is an
e-process: with one value of every effect, or with values that differ as the mixture has it,
it reaches 1 / alpha at any look, of however many, with a chance of at most alpha (Ville's
inequality; docs/joint.md has what single sizes of scatter come to).
Noise inside runs that is not the model's: the variance grows by what the scatter of the parts of
runs has beyond it.
Sources: Ville (1939); Ramdas, Gruenwald, Vovk, Shafer, Statistical Science 38 (2023), on
e-processes; Shin, Ramdas, Rinaldo, New England J. Stat. Data Sci. 2 (2024), on changes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Final

import numpy as np

from syncline_design.campaign.differing import clearly_differing, may_be_freed
from syncline_design.campaign.differing_odds import likeliest_of, log_of_any, log_of_sizes
from syncline_design.campaign.freed_runs import (
    freed_by_trends,
    pseudo_inverse,
    with_beside,
    with_own_free,
)
from syncline_design.campaign.parts import EffectPart
from syncline_design.campaign.passing import passing_change
from syncline_design.campaign.pool import Pool, inverted
from syncline_design.campaign.run_records import Change, Differing, Freed, Runs
from syncline_design.campaign.run_sums import RunSums
from syncline_design.campaign.scatter import RunScatter, freed_of, log_bayes
from syncline_design.campaign.trends import Trend, later, log_weights, trends
from syncline_design.diagnosis.candidates import commonness
from syncline_design.effects.record import Array

REACH: Final = 5.0  # bounds of one run: the change that is looked for
DRIFT: Final = 1.0  # bounds of one run: the change from run to run of the drift that is looked for
SIZES: Final = ((1.0, 0.7), (4.0, 0.3))  # times as large, and how often
DIFFERS_NATS: Final = 1.0  # odds from which something may differ, and changes beside it count


class Changes(RunSums):
    """All changes that runs could show, in their order."""

    @cached_property
    def log_weights(self) -> Array:
        """log w_c: in inverse ratio to how seldom an effect is met, (C,)."""
        share = np.array([1.0 / commonness(term.label)[0] for term in self.terms])
        found: Array = np.log(share / np.sum(share))
        return found

    def log_evidence(self, look: int) -> tuple[float, Array]:
        """log E_n of the first `look` runs, and log w_k w_c B_ck of every course and effect."""
        mixed, table = self.mixed(look)

        def beside(free: Runs) -> float:
            found = self._weighted(look, freed_by_trends(free, self.groups), free)
            return self._summed(look, found)

        return self._held(look, mixed, beside), table

    def _held(self, look: int, alike: float, beside: Callable[[Runs], float]) -> float:
        """log of a sum of evidence where nothing differs and where what most likely does is free in
        every run, by their odds, over all odds that anything differs."""
        odds = self.log_odds(look)
        if odds.size and odds.max() > DIFFERS_NATS:
            runs = self.compared(look)
            one = likeliest_of(runs, self.parts, odds)
            own = freed_of(runs.normal, runs.score, one.term.index, one.covariance)
            more = beside(self._compared(look, *own))
            alike = float(np.logaddexp(alike, odds.max() + more))
        return alike - log_of_any(odds)

    def _summed(self, look: int, table: Array) -> float:
        return float(np.logaddexp.reduce([*table.ravel(), math.log(later(look + 1))]))

    def mixed(self, look: int) -> tuple[float, Array]:
        """The same where no effect may differ from run to run: log sum w_k w_c B_ck."""
        table = self._weighted(look, self._freed(look), self.compared(look))
        return self._summed(look, table), table

    def _weighted(self, look: int, freed: Freed, runs: Runs) -> Array:
        """log w_k w_c B_ck of every course and effect, (2 (look - 1), C)."""
        found: Array = log_weights(look)[:, None] + self._factors(freed, runs, self.inside(look))
        return found + self.log_weights

    def noise(self, look: int) -> float:
        """Variance inside runs by the effect that is likeliest by the noise fitted."""
        first = self._factors(self._free(look), self.compared(look), np.ones(len(self.terms)))
        return float(self.inside(look)[int(np.argmax(first)) % len(self.terms)])

    def likelihoods(self, look: int) -> Array:
        """log w_k w_c B_ck by one noise for all effects, that of the likeliest, so that they
        compare, each free to have any value besides, (2 (look - 1), C)."""
        runs, freed, noise = self.compared(look), self._free(look), self.noise(look)
        found: Array = log_weights(look)[:, None] + self.log_weights
        return found + self._factors(freed, runs, np.full(len(self.terms), noise))

    def gains(self, look: int) -> Array:
        """What every course and effect explains by one noise for all, less a nat a value, and the
        logs of their weights, (2 (look - 1), C).  By its width a prior prefers fewer values, so
        that of a boresight about one axis the azimuth's bias alone would be told: 3 nat for every
        angle that stayed where it was.
        """
        freed, noise = self._free(look), self.noise(look)
        found = np.zeros((2 * (look - 1), len(self.terms)))
        for group, normal, score in zip(self.groups, freed.normals, freed.scores, strict=True):
            square = np.einsum("kga,kgab,kgb->kg", score, inverted(normal), score)
            found[:, group.terms] = 0.5 * square / noise - group.index.shape[1]
        return np.asarray(found + log_weights(look)[:, None] + self.log_weights)

    def of_one_day(self, look: int, rows: Sequence[int]) -> float:
        """log of the mean Bayes factor of any effect by some courses, which a change has that was
        told: that something happened then is known, and no date is held against it."""

        def likeliest(freed: Freed, runs: Runs) -> float:
            factors = self._factors(freed, runs, self.inside(look))[list(rows)] + self.log_weights
            return float(np.max(np.logaddexp.reduce(factors, axis=1)))

        alike = likeliest(self._freed(look), self.compared(look))
        return self._held(
            look, alike, lambda free: likeliest(freed_by_trends(free, self.groups), free)
        )

    def doubt(self, look: int) -> float:
        """log (1 + sum p_a L_a): how much likelier the first runs are where some effect may differ
        from run to run than where none does."""
        return log_of_any(self.log_odds(look))

    def log_odds(self, look: int) -> Array:
        """log p_a L_a of every part, by each of APART, (U, S)."""
        return self._log_odds(look, self.compared(look), self.parts)

    def log_odds_of_any(self, look: int) -> float:
        """log of the odds that some part differs by one of APART, clearly or not, against none."""
        runs = self._compared(look, *with_beside(self.pool, look, self.beside))
        return log_of_any(self._log_odds(look, runs, self.parts))

    def explained(self, look: int, ones: Sequence[Change]) -> float:
        """How much likelier [nat] runs are with changes than without, by the noise fitted, with one
        value of everything else:
            sum (g' m - m' I m / 2) + (G - W)' S^-1 (G - W) / 2 - G' S^-1 G / 2,
        m of a run what the changes make of its parameters, W = sum I m, G the sum of its scores."""
        normal, score = self.pool.normal[:look], self.pool.score[:look]
        moved = sum(one.made(normal) for one in ones)
        away = np.zeros_like(score)
        for one in ones:
            away[:, one.term.index] += one.trend.over(look)[:, None] * one.values
        inverse = pseudo_inverse(self.total(look, normal, score - moved))
        whole = score.sum(axis=0)
        left = whole - np.sum(moved, axis=0)
        own = float(np.sum(away * (score - 0.5 * moved)))
        return own + 0.5 * float(left @ inverse @ left - whole @ inverse @ whole)

    def log_of_sizes(self, one: Change, noise: float, look: int) -> float:
        """log of how much less likely a change is, its size (of a drift that by run) one of all by
        APART as what differs has them, than it is at its best."""
        usual = self.pool.normal[:look].mean(axis=0)[np.ix_(one.term.index, one.term.index)]
        return log_of_sizes(one.values, noise * one.covariance, inverted(usual))

    def passed(self, look: int) -> Change | None:
        """A change that went back, where over all its sizes it is likelier than what differs from
        run to run, and leaves nothing that rather differs than not."""
        runs = self._compared(look, *with_beside(self.pool, look, self.beside))
        one = passing_change(self.parts, self.part_groups, runs.parts)
        if one is None:
            return None
        moved = np.flatnonzero(one.values)
        own = one.values[moved], one.covariance[np.ix_(moved, moved)]
        usual = runs.normal.mean(axis=0)[np.ix_(*2 * [one.term.index[moved]])]
        log_factor = one.log_factor + len(moved) + log_of_sizes(*own, inverted(usual))
        if log_factor <= self._log_odds(look, runs, self.parts).max():
            return None
        left = self._log_odds(look, runs, self.parts, one).max()
        return None if left > DIFFERS_NATS else replace(one, log_factor=log_factor)

    def differs_rather(self, look: int) -> Differing | None:
        """What has another value in every run where that is likelier than any change is, whether
        clearly or not; None where it is not."""
        odds = self.log_odds(look)
        if not odds.size or odds.max() <= max(0.0, self.mixed(look)[0]):
            return None
        return likeliest_of(self.compared(look), self.parts, odds)

    @cached_property
    def course(self) -> Array:
        """log E_n after each look, from the first run on, after which nothing can have changed."""
        known = [look.log_evidence for look in self.kept[: self.pool.count]]
        rest = range(len(known) + 1, self.pool.count + 1)
        return np.array([*known, *(0.0 if n < 2 else self.log_evidence(n)[0] for n in rest)])

    def found_by(self, look: int) -> tuple[float, Array, Array]:
        """What is kept of a look: log E_n, scatter within its last run, scatter of its runs."""
        return float(self.course[look - 1]), self.within[look - 1], self.between[look - 1]

    def found_anew(self, look: int) -> tuple[float, Array, Array]:
        """The same, by the runs and by what is kept of the looks before it."""
        evidence = self.log_evidence(look)[0] if look > 1 else 0.0
        return evidence, self.within_of(look - 1), self.between_of(look)

    def _factors(self, freed: Freed, runs: Runs, noise: Array) -> Array:
        """log B_ck of every course and effect, (2 (look - 1), C), by their variances (C,)."""
        steps = len(runs.normal) - 1
        found = np.zeros((2 * steps, len(self.terms)))
        for group, normal, score in zip(self.groups, freed.normals, freed.scores, strict=True):
            inside = noise[group.terms]
            usual = inverted(runs.normal.mean(axis=0)[group.blocks])
            for rows, reach in ((slice(steps), REACH), (slice(steps, None), DRIFT)):
                own = normal[rows] / inside[:, None, None], score[rows] / inside[:, None]
                found[rows, group.terms] = np.logaddexp.reduce(
                    [math.log(share) + log_bayes(*own, (times * reach) ** 2 * usual)
                     for times, share in SIZES]
                )  # fmt: skip
        return found

    def change(self, look: int, row: int, c: int) -> Change:
        """Effect c by one of the courses of the first `look` runs."""
        runs, freed = self.compared(look), self._free(look)
        log_factor = float(self._factors(freed, runs, self.inside(look))[row, c])
        one = self._fitted(look, freed, row, c)
        covariance = float(self.temper(look)[row, c]) * one.covariance
        return replace(one, covariance=covariance, log_factor=log_factor)

    def single(self, look: int, c: int, trend: Trend) -> Change:
        """Effect c with a trend, no other change, by the first `look` runs and the noise fitted."""
        return self._fitted(look, self._free(look), trends(look).index(trend), c)

    def _fitted(self, look: int, freed: Freed, row: int, c: int) -> Change:
        """The same by the noise fitted."""
        group, at = next(
            (g, int(np.flatnonzero(own.terms == c)[0]))
            for g, own in enumerate(self.groups)
            if c in own.terms
        )
        inverse = inverted(freed.normals[group][row, at])
        values = inverse @ freed.scores[group][row, at]
        return Change(self.terms[c], trends(look)[row], values, inverse, 0.0)

    def tells(self, look: int) -> list[Array]:
        """Of every effect the information (p, p) that `look` runs have about a step with the
        last of them, by the scatter of runs and of their parts."""
        found: list[Array] = [np.zeros((term.size, term.size)) for term in self.terms]
        last = trends(look).index(Trend("step", look - 1))
        factor = self.temper(look)[last]
        for group, normal in zip(self.groups, self._freed(look).normals, strict=True):
            for place, own in zip(group.terms, normal[last], strict=True):
                found[int(place)] = own / factor[place]
        return found

    def _free(self, look: int) -> Freed:
        """N and s of every course, where every effect may have any value besides."""
        return with_own_free(self.compared(look), self.groups, self._freed(look))

    @cached_property
    def _last(self) -> dict[int, Freed]:
        return {}

    def _freed(self, look: int) -> Freed:
        """N and s of every course, by the first `look` runs."""
        if look not in self._last:
            found = freed_by_trends(self.compared(look), self.groups)
            self._last.clear()
            self._last[look] = found
        return self._last[look]

    def temper(self, look: int) -> Array:
        """Variance over that fitted, of every course and effect: inside runs, and between them."""
        found = np.zeros((2 * (look - 1), len(self.terms)))
        for group, scatter in zip(self.groups, self.compared(look).scatters, strict=True):
            found[:, group.terms] = scatter.factor[:-1]
        return np.asarray(self.inside(look) * found)

    @cached_property
    def between(self) -> Array:
        """Scatter of the first k runs over what it is by chance, of k from 1 and c, (L, C)."""
        known = [np.array(look.between) for look in self.kept[: self.pool.count]]
        rest = [self.between_of(k) for k in range(len(known) + 1, self.pool.count + 1)]
        return np.array([*known, *rest]).reshape(self.pool.count, len(self.terms))

    def between_of(self, k: int) -> Array:
        """The same of one k, (C,)."""
        found = np.ones(len(self.terms))
        for group, scatter in zip(self.groups, self.compared(k).scatters, strict=True):
            found[group.terms] = scatter.factor[-1]
        return found

    @cached_property
    def _latest(self) -> dict[int, Runs]:
        return {}

    def compared(self, look: int) -> Runs:
        """The first `look` runs, what clearly differs from one to the next freed in each.

        What the likeliest change makes is no scatter, of its own effect or of one that moves the
        runs alike; nor what that and one that went back make together, or such a one alone.
        """
        if look not in self._latest:
            first = self._compared(look, *with_beside(self.pool, look, self.beside))
            likely = self._likeliest_of(look, first) if look > 2 else None
            off = () if likely is None else (likely,)
            found = self._compared(look, first.normal, first.score, *off) if off else first
            one = self._clear(look, found, whole := first.parts, off)
            if one is not None:
                passing = self._beside_passing(look, first, found, off)
                found, one = next(((runs, None) for runs in passing), (found, one))
            while one is not None and may_be_freed(one, found.freed):
                freed = (*found.freed, one)
                own = freed_of(found.normal, found.score, one.term.index, one.covariance)
                found = replace(self._compared(look, *own, *off), freed=freed)
                one = self._clear(look, found, whole, off)
            self._latest.clear()
            self._latest[look] = found
        return self._latest[look]

    def _clear(
        self, look: int, runs: Runs, whole: Sequence[RunScatter], off: tuple[Change, ...] = ()
    ) -> Differing | None:
        def likelier(parts: Sequence[EffectPart]) -> Array:
            return np.asarray(np.max(self._log_odds(look, runs, parts, *off), axis=1))

        own = self.parts, self.part_groups, runs.normal, runs.parts
        return clearly_differing(*own, whole, likelier)

    def _beside_passing(
        self, look: int, first: Runs, found: Runs, off: tuple[Change, ...]
    ) -> Iterator[Runs]:
        """Runs that do not differ beside a change that went back, beside the likeliest or alone,
        where that is likelier than any effect that differs from run to run."""
        for known, runs in ((off, found), ((), first)) if off else (((), first),):
            one = passing_change(self.parts, self.part_groups, runs.parts)
            if one is None:
                continue
            if one.log_factor > self._log_odds(look, first, self.parts, *known).max():
                less = self._compared(look, first.normal, first.score, *known, one)
                if self._clear(look, less, first.parts, (*known, one)) is None:
                    yield less

    def apart(self, look: int) -> Differing | None:
        """The effect in which the first `look` runs most clearly are not all alike, by whatever
        change or scatter; None where noise would do."""
        runs = self._compared(look, *with_beside(self.pool, look, self.beside))
        every = tuple(one.of_all for one in runs.parts)
        return self._clear(look, replace(runs, parts=every), every)

    def likeliest(self, look: int) -> Change | None:
        """The likeliest change by the noise fitted; None where none is likelier."""
        return self._likeliest_of(look, self.compared(look))

    def _likeliest_of(self, look: int, runs: Runs) -> Change | None:
        freed = with_own_free(runs, self.groups, freed_by_trends(runs, self.groups))
        table = self._weighted(look, freed, runs)
        row, c = np.unravel_index(int(np.argmax(table)), table.shape)
        return self._fitted(look, freed, int(row), int(c)) if table[row, c] > 0.0 else None

    def differing(self, look: int) -> tuple[Differing, ...]:
        """Effects that clearly differ from run to run, of the first `look` runs."""
        return self.compared(look).freed

    def without(self, *ones: Change) -> Changes:
        """The same runs with changes taken off those that have them."""
        score = self.pool.score.copy()
        for one in ones:
            score -= one.made(self.pool.normal)
        return self._of(replace(self.pool, score=score), self.beside)

    def taking(self, one: Change) -> Changes:
        """The same, what is left of the change free beside all others."""
        return self._of(self.without(one).pool, (*self.beside, one))

    def _of(self, pool: Pool, beside: tuple[Change, ...]) -> Changes:
        found = Changes(pool, (), beside)
        found.__dict__["within"] = self.within  # the scatter inside runs is what it was
        return found
