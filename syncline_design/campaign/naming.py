"""Which effects many logs of one system share, and which of them are another in every log.

Forward and backward search over whole effects on the pooled statistics.  An effect is named where
noise alone would not show it: its chance by the noise fitted and by the scatter of the logs' parts,
the larger, times the tries that looking for it in so many effects (`tries`) and scopes comes to, is
below the false-alarm rate.  Whether it is one value (of the build), one a start, or one a log is
tested by the likelihood ratio of separate against common values (for one parameter Cochran's Q);
the simplest that is not refuted is said.
Source: Cochran, Biometrics 10 (1954); Wilks (1938) for the ratio's chi-square.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from typing import Final

import numpy as np

from syncline_design.campaign.constants import ANOTHER
from syncline_design.campaign.pool import Fitted, Pool, Scoped, Term, fitted
from syncline_design.campaign.tries import tries_of
from syncline_design.diagnosis.candidates import AS_GOOD_NATS, commonness
from syncline_design.diagnosis.judged import Judged
from syncline_design.diagnosis.result import Scope
from syncline_design.diagnosis.scores import log_p_of
from syncline_design.diagnosis.unusual import unusual_nats
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import chi_square_beyond

LEAST_GAIN: Final = 3.0  # nat, below which a candidate is not looked at
RIVAL_NATS: Final = 3.0  # a rival that fits worse by less than this is not excluded by the data
RIVAL_COSINE: Final = 0.7  # ... where it looks at least so much alike
SHARE: Final = {"build": 0.8, "start": 0.1, "log": 0.1}  # of the false alarms, by scope
ONE_VALUE: Final = 0.01  # chance below which values are not one
ROUNDS: Final = 4


@dataclass(frozen=True, slots=True)
class WorseFit:
    """Another effect in a named one's place: how much worse it fits [nat], freedom counted."""

    term: Term
    worse: float
    cosine: float
    possible: bool


@dataclass(frozen=True, slots=True)
class Tested:
    """Chances that separate values of an effect differ by noise alone; None where not tested.

    starts: of one a start against one for all; logs: of one a log against one a start.
    """

    starts: float | None
    logs: float | None


@dataclass(frozen=True, slots=True)
class NamedTerm:
    """An effect that was named, with its evidence.

    judged: mean over its values.  gain: nat lost without it; log_p: log of the chance that noise
    alone gains as much.
    """

    scoped: Scoped
    judged: Judged
    gain: float
    log_p: float
    tested: Tested
    rivals: tuple[WorseFit, ...]


@dataclass(frozen=True, eq=False)
class NamedTogether:
    """All that was named, with the fit of it."""

    fit: Fitted
    terms: tuple[NamedTerm, ...]


@dataclass(frozen=True, eq=False)
class Naming:
    """One search over a pool.

    excluded: effects that must not be used.  whole: the scopes that are looked for.
    """

    pool: Pool
    rate: float
    most: int
    excluded: tuple[str, ...] = ()
    whole: tuple[Scope, ...] = ("build", "start", "log")

    @property
    def terms(self) -> tuple[Term, ...]:
        return tuple(t for t in self.pool.terms if t.effect.name not in self.excluded)

    @property
    def scopes(self) -> tuple[Scope, ...]:
        """Scopes that differ in this pool."""
        starts = int(self.pool.starts.max()) + 1
        found: list[Scope] = ["build"]
        if 1 < starts < self.pool.count:
            found.append("start")
        if self.pool.count > 1:
            found.append("log")
        return tuple(one for one in found if one in self.whole)

    @cached_property
    def tries(self) -> float:
        """As how many independent tries all effects count, each one value in all logs."""
        return tries_of(self.pool, self.terms, self.rate)

    def charge(self, scope: Scope) -> float:
        """log of how often chance was given a try."""
        total = sum(SHARE[one] for one in self.scopes)
        tries = self.tries if scope == "build" else len(self.terms)
        return math.log(tries * total / SHARE[scope])

    def named(self) -> NamedTogether:
        """The search."""
        model = fitted(self.pool, ())
        while len(model.scoped) < self.most:
            found = self._best(model)
            if found is None:
                break
            model = self._exchanged(self._scoped(found))
        model = self._pruned(model)
        return NamedTogether(model, tuple(self._told(model, k) for k in range(len(model.scoped))))

    def _free(self, model: Fitted) -> Iterator[Scoped]:
        taken = {one.term.label for one in model.scoped}
        for term in self.terms:
            if term.label not in taken:
                yield from (Scoped(term, scope) for scope in self.scopes)

    def _best(self, model: Fitted) -> Fitted | None:
        """The model with the effect that is least likely by chance; None where noise does as well.

        Among those that are as good, the commonest in practice.
        """
        trials = []
        for one in self._free(model):
            trial = fitted(self.pool, (*model.scoped, one))
            gain = trial.gain - model.gain
            log_p = log_p_of(2.0 * gain, freedom(trial, -1)) + self.charge(one.scope)
            if gain > LEAST_GAIN and log_p < math.log(self.rate) and plausible(trial):
                trials.append((log_p + unusual_of(trial, -1), one, trial))
        kept = [t for t in trials if self.stands(t[2], len(model.scoped))]
        if not kept:
            return None
        least = min(log_p for log_p, *_ in kept)
        close = [t for t in kept if t[0] <= least + AS_GOOD_NATS]
        return min(close, key=lambda t: (commonness(t[1].term.label), t[0], t[1].term.label))[2]

    def stands(self, model: Fitted, k: int) -> bool:
        """Whether noise of another kind would not show an effect of the model either."""
        one = model.scoped[k]
        return self.chance(model, k) + self.charge(one.scope) < math.log(self.rate)

    def chance(self, model: Fitted, k: int) -> float:
        """log of the chance that noise alone makes an effect's values: of one, or of any."""
        place = model.place[k]
        if len(place) == 1:
            return model.judged(place[0]).log_p
        within = [model.judged(own).log_p for own in place]
        together = log_p_of(2.0 * self._gain_of(model, k) / self._temper(model, k),
                            freedom(model, k))  # fmt: skip
        return max(together, min(within) + math.log(len(place)) if within else 0.0, -1e6)

    def _gain_of(self, model: Fitted, k: int) -> float:
        return model.gain - self._without(model, k).gain

    def _without(self, model: Fitted, k: int) -> Fitted:
        return fitted(self.pool, tuple(o for i, o in enumerate(model.scoped) if i != k))

    def _temper(self, model: Fitted, k: int) -> float:
        """By how much the scatter of parts is larger than the noise fitted says, in variance."""
        one = Scoped(model.scoped[k].term, "build")
        found = fitted(self.pool, (*self._without(model, k).scoped, one))
        return ratio(found.judged(found.place[-1][0]))

    def _with_scope(self, model: Fitted, k: int, scope: Scope) -> Fitted:
        scoped = list(model.scoped)
        scoped[k] = Scoped(scoped[k].term, scope)
        return fitted(self.pool, tuple(scoped))

    def tested(self, model: Fitted, k: int) -> Tested:
        """Whether the values of one effect are one, the others as in the model."""
        temper = self._temper(model, k)
        fits = {scope: self._with_scope(model, k, scope) for scope in self.scopes}
        if len(fits) < 2:
            return Tested(None, None)
        if "start" not in fits:
            return Tested(None, _unlike(fits["build"], fits["log"], k, temper))
        starts = _unlike(fits["build"], fits["start"], k, temper)
        return Tested(starts, _unlike(fits["start"], fits["log"], k, temper))

    def _scoped(self, model: Fitted) -> Fitted:
        """The model with every effect in the simplest scope that is not refuted."""
        for k in range(len(model.scoped)):
            tested = self.tested(model, k)
            if tested.logs is None:
                continue
            scope: Scope = "build"
            if tested.starts is not None and tested.starts < ONE_VALUE:
                scope = "start"
            if tested.logs < ONE_VALUE:
                scope = "log"
            if scope != model.scoped[k].scope:
                model = self._with_scope(model, k, scope)
        return model

    def _exchanged(self, model: Fitted) -> Fitted:
        """The model with a better effect in the place of each, as far as there is one."""
        for _ in range(ROUNDS):
            before = model
            for k in range(len(model.scoped) - 1):
                beside = [b for b in self.rivals(model, k) if b.possible]
                best = min(beside, key=lambda b: b.worse, default=None)
                if best is not None and best.worse < -RIVAL_NATS:
                    model = self._replaced(model, k, best.term)
            if model is before:
                break
        return model

    def _replaced(self, model: Fitted, k: int, term: Term) -> Fitted:
        scoped = list(model.scoped)
        scoped[k] = replace(scoped[k], term=term)
        return fitted(self.pool, tuple(scoped))

    def rivals(self, model: Fitted, k: int) -> list[WorseFit]:
        """Every other effect in the place of one, the rest fitted again."""
        taken = {one.term.label for one in model.scoped}
        own = freedom(model, k)
        found = []
        for term in self.terms:
            if term.label in taken:
                continue
            trial = self._replaced(model, k, term)
            worse = model.gain - own - (trial.gain - freedom(trial, k))
            worse += unusual_of(trial, k) - unusual_of(model, k)
            found.append(WorseFit(term, worse, self._cosine(model, k, term), plausible(trial)))
        return sorted(found, key=lambda b: b.worse)

    def _cosine(self, model: Fitted, k: int, term: Term) -> float:
        """How much of one effect's signal, as it was found, another one makes: |cos| in the noise.

        The share of the gain of the named effect that is lost when the other is fitted to its
        signal alone: |S_other|^2 / |S|^2, all others free.
        """
        signal = self._signal(model, k)
        rest = self._without(model, k)
        total = _explained(rest, signal, None)
        own = _explained(rest, signal, Scoped(model.scoped[k].term, model.scoped[k].scope)) - total
        other = _explained(rest, signal, Scoped(term, model.scoped[k].scope)) - total
        return math.sqrt(min(max(other / own, 0.0), 1.0)) if own > 0.0 else 0.0

    def _signal(self, model: Fitted, k: int) -> Pool:
        """The pool as it would be were an effect all that is in it, without noise."""
        one, values = model.scoped[k], model.of(k)[self.pool.group_of(model.scoped[k].scope)]
        score = np.einsum("lpq,lq->lp", self.pool.normal[:, :, one.term.index], values)
        return replace(self.pool, score=score, less=tuple(() for _ in range(self.pool.count)))

    def _pruned(self, model: Fitted) -> Fitted:
        """The model without what no longer stands, the weakest first."""
        while model.scoped:
            weak = [(self.chance(model, k), k) for k in range(len(model.scoped))
                    if not self.stands(model, k)]  # fmt: skip
            if not weak:
                break
            model = self._scoped(self._without(model, max(weak)[1]))
        return self._commonest(model)

    def _commonest(self, model: Fitted) -> Fitted:
        """Of effects that fit as well, the commonest in practice."""
        for k in range(len(model.scoped)):
            as_good = [b for b in self.rivals(model, k) if b.possible and b.worse < AS_GOOD_NATS]
            best = min(as_good, key=lambda b: commonness(b.term.label), default=None)
            own = commonness(model.scoped[k].term.label)
            if best is not None and (commonness(best.term.label), best.worse) < (own, 0.0):
                model = self._replaced(model, k, best.term)
        return model

    def _told(self, model: Fitted, k: int) -> NamedTerm:
        gain = self._gain_of(model, k)
        mean = self._with_scope(model, k, "build")
        judged = mean.judged(mean.place[k][0])
        beside = [b for b in self.rivals(model, k) if b.worse < RIVAL_NATS or b.cosine > 0.99]
        rivals = tuple(b for b in beside if b.possible and b.cosine > RIVAL_COSINE)
        return NamedTerm(model.scoped[k], judged, gain, self.chance(model, k),
                         self.tested(model, k), rivals)  # fmt: skip


def _explained(rest: Fitted, signal: Pool, one: Scoped | None) -> float:
    scoped = rest.scoped if one is None else (*rest.scoped, one)
    return fitted(signal, scoped).gain


def freedom(model: Fitted, k: int) -> int:
    """How many values of an effect are seen."""
    size = np.diag(model.normal)[model.place[k]]
    return max(int(np.sum(size > 0.0)), 1)


def unusual_of(model: Fitted, k: int) -> float:
    """What is charged where a value of an effect is hardly ever met [nat]."""
    place = model.place[k]
    spreads = np.sqrt(np.maximum(np.diag(model.inverse)[place], 0.0))
    return unusual_nats(model.scoped[k].term.effect, model.values[place], spreads)


def ratio(judged: Judged) -> float:
    """Variance by the scatter of parts over that by the noise fitted, the largest mean; >= 1."""
    size = np.sqrt(np.maximum(np.diag(judged.model), 1e-300))
    seen = np.diag(judged.model) > 0.0
    if not np.any(seen):
        return 1.0
    scaled = (judged.model / size[:, None] / size)[np.ix_(seen, seen)]
    inverse = np.linalg.pinv(scaled, rcond=1e-9, hermitian=True)
    found = [1.0]
    for covariance, _ in judged.jackknives:
        own = (covariance / size[:, None] / size)[np.ix_(seen, seen)]
        found.append(float(np.trace(inverse @ own)) / int(np.sum(seen)))
    return max(found)


def _unlike(common: Fitted, separate: Fitted, k: int, temper: float) -> float:
    """Chance that separate values fit so much better by noise alone."""
    more = freedom(separate, k) - freedom(common, k)
    if more <= 0:
        return 1.0
    return chi_square_beyond(2.0 * max(separate.gain - common.gain, 0.0) / temper, more)


def plausible(model: Fitted) -> bool:
    """Whether every value is one that its effect can have, and one that the logs tell of it.

    What has next to no information apart from the others is told of by noise in the readings that
    the slopes are made of: at rest on one heading an arm and a datum undo one another by metres.
    """
    own = np.diag(model.normal)
    apart = 1.0 / np.maximum(np.diag(model.inverse) * own, 1.0)
    if any(np.max(apart[place]) < ANOTHER for place in model.place):
        return False
    for one, place in zip(model.scoped, model.place, strict=True):
        for k, p in enumerate(one.term.effect.slopes()):
            values: Array = model.values[place[:, k]]
            if np.any(np.abs(values) > p.high) or (not p.signed and np.any(values < 0.0)):
                return False
    return True
