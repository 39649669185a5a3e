"""Logs that are unlike all the others: another vehicle's, or one of a day on which something moved.

Of each log and effect the likelihood ratio of a value of its own in that log against one value in
all logs, the others common to all; over the scatter of parts, chi-square where there is none.  A
log is unlike where the chance of that, times logs and effects (Bonferroni), is below `RATE`.  What
is left has to agree: where it does not, an effect differs from log to log, and none is unlike.  Nor
is any by an effect that is likelier to have another value in every log (`odd_or_scattering`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.campaign.naming import ratio
from syncline_design.campaign.odd_or_scattering import rather_scatters
from syncline_design.campaign.pool import Fitted, Pool, Scoped, Term, fitted
from syncline_design.diagnosis.candidates import AS_GOOD_NATS, commonness
from syncline_design.diagnosis.judged import Judged
from syncline_design.diagnosis.scores import log_p_of
from syncline_design.machine.quick_dataclass import dataclass

RATE: Final = 0.01  # chance that any of several alike logs is said to be unlike
FEWEST: Final = 3  # logs: of two that differ neither is the odd one
LEAST_GAIN: Final = 3.0  # nat, below which no chance is worked out


@dataclass(frozen=True, eq=False)
class UnlikeLog:
    """A log, by its place, and the effect in which it differs most clearly: by how much from what
    the others together say, and log of the chance, logs and effects counted."""

    run: int
    term: Term
    judged: Judged
    log_p: float


@dataclass(frozen=True, slots=True)
class Beside:
    """Effects that have one value in all logs, and those that have another in every log."""

    common: tuple[Term, ...]
    scattering: tuple[Term, ...] = ()

    def may_be_odd(self, term: Term) -> bool:
        return all(one.label != term.label for one in self.scattering)

    def without(self, term: Term) -> list[Scoped]:
        labels = {term.label, *(one.label for one in self.scattering)}
        common = [Scoped(one, "build") for one in self.common if one.label not in labels]
        return [*common, *(Scoped(one, "log") for one in self.scattering)]


def unlike_logs(pool: Pool, named: Sequence[Term]) -> tuple[UnlikeLog, ...]:
    """All that are, fewer than half; none where starts are shared, for then starts may differ.

    named: effects that the logs together show.
    """
    if len(set(pool.starts.tolist())) < pool.count:
        return ()
    scattering: list[Term] = []
    while True:
        found = _apart(pool, Beside(tuple(named), tuple(scattering)))
        more = [term for term in _terms(found) if _rather_scatters(pool, named, found, term)]
        if not more:
            return found
        scattering += more


def _terms(found: Sequence[UnlikeLog]) -> list[Term]:
    return list({one.term.label: one.term for one in found}.values())


def _rather_scatters(
    pool: Pool, named: Sequence[Term], found: Sequence[UnlikeLog], term: Term
) -> bool:
    odd = np.array([one.run for one in found if one.term.label == term.label])
    beside = [one for one in named if one.label != term.label]
    return rather_scatters(pool, beside, odd, term)


def _apart(pool: Pool, named: Beside) -> tuple[UnlikeLog, ...]:
    """Logs that are unlike what is left."""
    rows = np.arange(pool.count)
    found: list[UnlikeLog] = []
    while True:
        one = _most_unlike(pool.part(rows), named) if len(rows) >= FEWEST else None
        if one is None:
            return tuple(found)
        if 2 * (len(found) + 1) >= pool.count:
            return ()
        found.append(replace(one, run=int(rows[one.run])))
        rows = np.delete(rows, one.run)
        if len(rows) < FEWEST and not _agree(pool.part(rows), named):
            return ()


def _agree(pool: Pool, named: Beside) -> bool:
    """Whether two logs that are left are alike."""
    return _unlike(pool, named, 0) is None


def _most_unlike(pool: Pool, named: Beside) -> UnlikeLog | None:
    every = [_unlike(pool, named, run) for run in range(pool.count)]
    known = [one for one in every if one is not None]
    return min(known, key=lambda one: one.log_p, default=None)


def _unlike(pool: Pool, named: Beside, run: int) -> UnlikeLog | None:
    """A log held against the others; None where noise would do."""
    starts = np.zeros(pool.count, dtype=np.int64)
    starts[run] = 1
    parted = replace(pool, starts=starts)
    charge = math.log(pool.count * max(len(pool.terms), 1))
    tried = [_held(parted, named, t, run, charge) for t in pool.terms if named.may_be_odd(t)]
    found = [one for one in tried if one is not None and one[0].log_p < math.log(RATE)]
    most = max((explained for _, explained in found), default=0.0)
    close = [one for one, explained in found if explained >= most - AS_GOOD_NATS]
    return min(close, key=lambda one: commonness(one.term.label), default=None)


def _held(
    parted: Pool, named: Beside, term: Term, run: int, charge: float
) -> tuple[UnlikeLog, float] | None:
    """One effect of one log, and what all that is free then explains, less its freedom [nat].

    Beside a latency that is common a lag of one log's own does nearly what another latency would,
    with a parameter more.  parted: that log as a start of its own.
    """
    beside = named.without(term)
    common = fitted(parted, [*beside, Scoped(term, "build")])
    apart = fitted(parted, [*beside, Scoped(term, "start")])
    gain = apart.gain - common.gain
    if gain < LEAST_GAIN:
        return None
    others, own = (apart.judged(apart.place[-1][k]) for k in (0, 1))
    temper = max(ratio(own), ratio(others))
    seen = int(np.sum(np.diag(parted.normal[run][np.ix_(term.index, term.index)]) > 0.0))
    log_p = log_p_of(2.0 * gain / temper, max(seen, 1)) + charge
    unlike = UnlikeLog(run, term, _difference(apart), log_p)
    return unlike, apart.gain - apart.values.size


def _difference(apart: Fitted) -> Judged:
    """d = t_own - t_others of the last effect, with D C D', D = (1, -1): what is common to both
    (a lag beside a latency) is uncertain in each and not in what they differ by."""
    others, own = apart.place[-1]
    both = apart.judged(np.concatenate([own, others]))
    less = np.hstack([np.eye(own.size), -np.eye(own.size)])
    return Judged(
        less @ both.values,
        less @ both.model @ less.T,
        tuple((less @ one @ less.T, count) for one, count in both.jackknives),
    )
