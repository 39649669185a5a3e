"""Rows that are late at random, or in bursts: any share of a log whose device has two delays.

Row i of a device that is late by d_0 or by d_1 (with the chance p) leaves
    e_i = X_i b + c_i(d_k) + w_i,   k = 0 or 1,
X what a build can be wrong by, c_i(d) what the motion between t and t - d makes of that row, and w
noise of the spec's shape, s times as loud.  Of this mixture
    sum_i log((1 - p) N(r_i(d_0); s) + p N(r_i(d_1); s)),   r_i whitened,
is made largest (expectation and maximization), from the delays that the rows show by themselves
    t_i = a_i' r_i / (a_i' a_i),   a_i what a second of delay does to r_i,
on.  Noise that scatters along the motion (a delay that has any value) is the rival:
    r_i ~ N(a_i m, s^2 I + v a_i a_i').
It is two delays where that leaves clearly less of the log's likelihood, the two lie apart beyond
what rows scatter, rows of either take turns, and those that are late scatter no more than the rest.
Source: Dempster, Laird and Rubin, J. R. Stat. Soc. B 39 (1977).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.special import expit

from syncline_design.diagnosis.candidates import (
    Candidate,
    candidates,
    plain_signatures,
    signature,
)
from syncline_design.diagnosis.judged import log_f
from syncline_design.diagnosis.late_rows import AS_GOOD_NATS, Late, acting_late
from syncline_design.diagnosis.looked_up import Index, Mask, Weighed
from syncline_design.diagnosis.reading_parts import readings_late
from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.two_delays import TwoDelays
from syncline_design.diagnosis.undone import BUILD
from syncline_design.diagnosis.whiles import gained_in_whiles, runs_of
from syncline_design.effects import plain_delay
from syncline_design.effects.record import ActsOn, Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import chi_square_limit, student_limit
from syncline_design.model.normal import NORMAL_95

CLEARLY_NATS: Final = 15.0  # by which two delays have to be likelier than any
APART: Final = 1.0  # standard deviations of the median row, between the two
NEARLY_APART: Final = 0.7  # before all of the motion is asked
LOUDEST: Final = 2.0  # times the spec's noise, that the two may leave
CHANCE: Final = 1e-4  # that late rows scatter so much more than the rest
LEAST_ROWS: Final = 20  # of either kind
LEAST_RUNS: Final = 5  # of late rows: fewer are whiles that come and go
MOST_RUNS: Final = 200
LEAST_S, MOST_S = 2e-3, 2.0  # of a delay
ASIDE: Final = 0.1  # of a row's square over noise, from which it is left out
BLOCKS: Final = 16  # stretches that are left out, one after the other
STEPS, TIMES = 60, 12  # of expectation and maximization by slopes, and by all of the motion
REWEIGHTED: Final = 5  # times that rows far off are made to count less
NEAR_S: Final = 1e-3  # by which a delay is moved for a slope
# quantiles of the rows' own delays that the two start from
ENDS: Final = ((0.1, 0.9), (0.02, 0.6), (0.4, 0.98), (0.25, 0.97), (0.03, 0.75))


@dataclass(frozen=True, slots=True)
class _Asked:
    """A log of one vehicle (n rows, those that count) and a device of it.

    columns (n, 3, P): whitened, of what else a build can be wrong by, in units of BUILD; delays:
    which of them are delays of other devices; along (n, 3): a_i [1/s].  louder: variance of
    what is taken for noise in `root`, over the spec's.
    """

    view: Scene
    sensor: ActsOn
    root: Array
    counts: Mask
    freedom: Array
    columns: Array
    along: Array
    delays: tuple[bool, ...]
    louder: float

    @classmethod
    def of(cls, view: Scene, weighed: Weighed, held: Mask, sensor: ActsOn) -> _Asked:
        delay = plain_delay()
        asked = [
            s for s in plain_signatures(view, candidates(view))
            if s.asked_jointly and s.candidate.label[:2] != (delay.name, sensor)
        ]  # fmt: skip
        built = [s.columns * [BUILD[p.unit] for p in s.candidate.effect.slopes()] for s in asked]
        apart = BUILD["s"] * readings_late(view)
        columns = np.nan_to_num(np.concatenate([*built, apart], axis=2))
        own = np.nan_to_num(signature(view, Candidate(delay, sensor, 0), {}))
        root = weighed.root * ~held[:, None, None]
        return cls(
            view, sensor, root, ~held & np.any(weighed.root, axis=(1, 2)), weighed.freedom,
            root @ columns, np.einsum("nij,nj->ni", root, own[:, :, 0]),
            (*(s.candidate.effect.delays for s in asked for _ in s.candidate.effect.slopes()),
             *(True,) * apart.shape[2]),
            weighed.louder,
        )  # fmt: skip

    def left(self, delay_s: float) -> Array:
        """Whitened error with a delay undone by the motion (n, 3)."""
        undone = (acting_late(self.sensor, delay_s),) if delay_s else ()
        error = np.nan_to_num(self.view.error(undone))
        found: Array = np.einsum("nij,nj->ni", self.root, error)
        return found

    @property
    def weight(self) -> Array:
        found: Array = np.sum(self.along**2, axis=1)
        return found

    @property
    def components(self) -> float:
        return float(np.sum(self.freedom[self.counts]))

    def two(self) -> TwoDelays | None:
        """The likeliest two delays; None where rows tell of none."""
        built = self._built()
        plain = self.left(0.0) - self.columns @ built
        own = np.sum(self.along * plain, axis=1) / np.maximum(self.weight, 1e-300)
        told = self.counts & (self.weight >= np.median(self.weight[self.counts]))
        starts = [np.quantile(own[told], ends) for ends in ENDS]
        tries = [self._linear(plain, float(a), float(b)) for a, b in starts]
        best = max(tries, key=lambda two: two.log_l)
        return self._polished(best, built) if self.is_apart(best, NEARLY_APART) else None

    def _with_own(self) -> Array:
        """What else a build can be wrong by, and the device's own delay (n, 3, P + 1)."""
        return np.concatenate([self.columns, BUILD["s"] * self.along[:, :, None]], axis=2)

    def _built(self) -> Array:
        """What else the log is off by, with single rows far off counting little (Huber)."""
        left, weight = self.left(0.0), self.counts.astype(float)
        every = self._with_own()
        values = np.zeros(every.shape[2])
        for _ in range(REWEIGHTED):
            values = _solved(every, left, weight)
            size = np.linalg.norm(left - every @ values, axis=1)
            usual = 2.0 * float(np.median(size[self.counts]))
            weight = self.counts / np.maximum(size / max(usual, 1e-300), 1.0)
        found: Array = values[:-1]
        return found

    def _linear(self, plain: Array, first_s: float, second_s: float) -> TwoDelays:
        """Two delays by the rows' slopes alone, all else as it is."""
        weight = np.where(self.counts, self.weight, 0.0)
        dot = np.sum(self.along * plain, axis=1)
        two = self._weighed(plain, (first_s, second_s), 0.5, self._loud2(plain))
        for _ in range(STEPS):
            share = np.stack([1.0 - two.second, two.second]) * self.counts
            sums = np.maximum(share @ weight, 1e-300)
            a, b = (share @ dot) / sums
            chance = float(np.sum(share[1]) / max(np.sum(share), 1e-300))
            two = self._weighed(plain, (float(a), float(b)), chance, two.loud2)
        return two

    def _loud2(self, plain: Array) -> float:
        """The variance across the motion by its median, or that along it where it has no other."""
        weight = np.maximum(self.weight, 1e-300)
        across = np.sum(plain**2, axis=1) - np.sum(self.along * plain, axis=1) ** 2 / weight
        freedom = np.maximum(self.freedom - 1.0, 1.0)
        over = across[self.counts] / chi_square_limit(0.5, freedom[self.counts])
        return max(float(np.median(over)), 1e-2)

    def _weighed(
        self, plain: Array, delays: tuple[float, float], chance: float, loud2: float
    ) -> TwoDelays:
        """By slopes: errors of delays a and b are plain - along a and b."""
        both = [np.sum((plain - self.along * d) ** 2, axis=1) for d in delays]
        return self._mixed(both, delays, chance, loud2)

    def _mixed(
        self, both: Sequence[Array], delays: tuple[float, float], chance: float, loud2: float
    ) -> TwoDelays:
        """How likely rows are of either, by their squares; the noise by these."""
        chance = min(max(chance, 1e-3), 1.0 - 1e-3)
        odds = math.log(chance / (1.0 - chance)) - 0.5 * (both[1] - both[0]) / loud2
        second = expit(odds)
        square = (1.0 - second) * both[0] + second * both[1]
        new2 = float(np.sum(square[self.counts])) / self.components
        return TwoDelays(delays, chance, new2, second, self._log_l(both, chance, new2))

    def _log_l(self, both: Sequence[Array], chance: float, loud2: float) -> float:
        logs = np.logaddexp(
            math.log1p(-chance) - 0.5 * both[0] / loud2, math.log(chance) - 0.5 * both[1] / loud2
        )
        return float(np.sum(logs[self.counts])) - 0.5 * self.components * math.log(loud2)

    def _polished(self, two: TwoDelays, built: Array) -> TwoDelays | None:
        """The same by all of the motion, with all else free."""
        for _ in range(TIMES):
            if not max(abs(d) for d in two.delays) <= MOST_S:
                return None
            lefts, slopes = zip(*(self._at(d) for d in two.delays), strict=True)
            both = [np.sum((left - self.columns @ built) ** 2, axis=1) for left in lefts]
            two = self._mixed(both, two.delays, two.chance, two.loud2)
            step, built = self._step(two, lefts, slopes)
            delays = (two.delays[0] + float(step[0]), two.delays[1] + float(step[1]))
            chance = float(np.mean(two.second[self.counts]))
            two = TwoDelays(delays, chance, two.loud2, two.second, two.log_l)
            if np.max(np.abs(step)) < 1e-6:
                break
        return two

    def _at(self, delay_s: float) -> tuple[Array, Array]:
        """What is left with a delay undone, and its slope by it (n, 3)."""
        left = self.left(delay_s)
        return left, (self.left(delay_s + NEAR_S) - left) / NEAR_S

    def _step(
        self,
        two: TwoDelays,
        lefts: Sequence[Array],
        slopes: Sequence[Array],
        but: Mask | None = None,
    ) -> tuple[Array, Array]:
        """Steps of both delays, and all else, by least squares over rows (but some)."""
        used = self.counts if but is None else self.counts & ~but
        shares = (np.where(used, 1.0 - two.second, 0.0), np.where(used, two.second, 0.0))
        width = self.columns.shape[2]
        normal, score = np.zeros((width + 2, width + 2)), np.zeros(width + 2)
        for k, (share, left, slope) in enumerate(zip(shares, lefts, slopes, strict=True)):
            own = np.zeros((*left.shape, 2))
            own[:, :, k] = -slope
            every = np.concatenate([self.columns, own], axis=2)
            normal += np.einsum("n,nik,nil->kl", share, every, every, optimize=True)
            score += np.einsum("n,nik,ni->k", share, every, left)
        usual = 1.0 / BUILD["s"] ** 2  # of a delay, as of all else that a build can be wrong by
        score[width:] -= usual * np.array(two.delays)
        eye = np.diag(np.r_[np.ones(width), np.full(2, usual)])
        values = np.linalg.solve(normal + eye, score)
        return values[width:], values[:width]

    def with_these(self, two: TwoDelays, delays: tuple[float, float]) -> float:
        """The log-likelihood with two delays as they are, and none of another device."""
        alone = replace(self, columns=self.columns[:, :, ~np.array(self.delays, bool)])
        lefts = [alone.left(d) for d in delays]
        mean = (1.0 - two.second)[:, None] * lefts[0] + two.second[:, None] * lefts[1]
        beside = alone.columns @ _solved(alone.columns, mean, self.counts.astype(float))
        both = [np.sum((left - beside) ** 2, axis=1) for left in lefts]
        return self._log_l(both, two.chance, two.loud2)

    def spread_s(self, two: TwoDelays) -> float:
        """Standard uncertainty of how far the delays lie apart, by leaving out one stretch after
        the other and by the rows' noise, as wide as its 95 % interval asks."""
        lefts, slopes = zip(*(self._at(d) for d in two.delays), strict=True)
        parts = np.array_split(np.arange(len(self.counts)), BLOCKS)
        apart = []
        for part in parts:
            but = np.isin(np.arange(len(self.counts)), part)
            step, _ = self._step(two, lefts, slopes, but)
            apart.append(float(step[1] - step[0]))
        spread2 = (BLOCKS - 1) / BLOCKS * float(np.sum((np.array(apart) - np.mean(apart)) ** 2))
        weight = np.where(self.counts, self.weight, 0.0)
        own2 = sum(two.loud2 / max(float(share @ weight), 1e-300)
                   for share in (two.second, 1.0 - two.second))  # fmt: skip
        reach = student_limit(0.025, BLOCKS - 1) / NORMAL_95
        return max(reach * math.sqrt(spread2), math.sqrt(own2))

    def changed_once(self) -> float:
        """The log-likelihood where all that a build can be wrong by has changed once."""
        left, every = self.left(0.0), self._with_own()
        ends = [round(k * len(left) / BLOCKS) for k in range(1, BLOCKS)]
        return max(self._of_parts(left, every, end) for end in ends)

    def _of_parts(self, left: Array, every: Array, end: int) -> float:
        """Of one value before a row and another from it on."""
        square = 0.0
        for part in (slice(None, end), slice(end, None)):
            values = _solved(every[part], left[part], self.counts[part].astype(float))
            square += float(np.sum((left[part] - every[part] @ values)[self.counts[part]] ** 2))
        loud2 = max(square / self.components, 1e-300)
        return -0.5 * self.components * (1.0 + math.log(loud2))

    def in_whiles(self, two: TwoDelays, most: int) -> float:
        """The log-likelihood where rows of one of both come in at most so many whiles."""
        both = [0.5 * each[self.counts] / two.loud2 for each in self._squares(two)]
        own = max(gained_in_whiles(both[k] - both[1 - k], most) - float(np.sum(both[k]))
                  for k in (0, 1))  # fmt: skip
        return own - 0.5 * self.components * math.log(two.loud2)

    def any_value(self) -> float:
        """The log-likelihood of a delay that has any value in each row, as noise has."""
        plain = self.left(0.0) - self.columns @ self._built()
        return max(self._scattered(plain, size) for size in np.geomspace(0.1, 1e5, 37))

    def _scattered(self, plain: Array, size: float) -> float:
        """Of v = size s^2 over the usual weight, its mean and s at their best."""
        weight = np.where(self.counts, self.weight, 0.0)
        usual = max(float(np.median(weight[self.counts])), 1e-300)
        more = 1.0 + size * weight / usual
        dot = np.sum(self.along * plain, axis=1)
        mean = float(np.sum(dot / more * self.counts)) / max(float(np.sum(weight / more)), 1e-300)
        left = plain - self.along * mean
        along = np.sum(self.along * left, axis=1) ** 2 / np.maximum(weight, 1e-300)
        square = np.sum(left**2, axis=1) - along * (1.0 - 1.0 / more)
        loud2 = float(np.sum(square[self.counts])) / self.components
        logs = -0.5 * float(np.sum(np.log(more[self.counts])))
        return logs - 0.5 * self.components * (1.0 + math.log(max(loud2, 1e-300)))

    def holds(self, two: TwoDelays) -> bool:
        """Whether rows are clearly of two delays, of which either is noise."""
        spec2 = two.loud2 * self.louder
        return self.is_apart(two, APART) and spec2 <= LOUDEST**2 and self._alike(two)

    def is_apart(self, two: TwoDelays, times: float) -> bool:
        """Whether two delays differ by so many standard deviations of the median row, and there
        are rows enough of either that take turns."""
        rows = (two.second > 0.5) & self.counts
        count = int(np.sum(rows))
        if min(count, int(np.sum(self.counts)) - count) < LEAST_ROWS or runs_of(rows) < LEAST_RUNS:
            return False
        apart = abs(two.delays[1] - two.delays[0])
        usual = math.sqrt(float(np.median(self.weight[self.counts])) / two.loud2)
        return apart >= LEAST_S and apart * usual >= times

    def _squares(self, two: TwoDelays) -> list[Array]:
        """Of every row, with either delay (n,), all else at its best."""
        lefts, slopes = zip(*(self._at(d) for d in two.delays), strict=True)
        step, built = self._step(two, lefts, slopes)
        return [np.sum((left + slope * own - self.columns @ built) ** 2, axis=1)
                for left, slope, own in zip(lefts, slopes, step, strict=True)]  # fmt: skip

    def _alike(self, two: TwoDelays) -> bool:
        """Whether rows of either delay scatter alike (F test)."""
        late = two.second > 0.5
        means, counts = [], []
        squares = self._squares(two)
        for own, each in zip((self.counts & ~late, self.counts & late), squares, strict=True):
            square = np.sum(each[own])
            counts.append(int(np.sum(self.freedom[own])))
            means.append(float(square) / counts[-1])
        larger = int(means[1] > means[0])
        share = means[larger] / max(means[1 - larger], 1e-300)
        return log_f(share, counts[larger], counts[1 - larger]) > math.log(CHANCE)


def late_at_random(view: Scene, held: Mask) -> tuple[Late, ...]:
    """Devices of which rows of a log of one vehicle are late at random or in bursts, the likeliest
    first; held: rows that are not asked."""
    if len(view.system.stages) != 1 or view.log.stages[0].antenna_m is None:
        return ()
    weighed = Weighed.of(view)
    ranged = view.log.kind == "georeference"
    devices: tuple[ActsOn, ...] = ("position", "attitude", "ranging") if ranged else ("position",)
    found = [pair for sensor in devices for pair in _clear(view, weighed, held, sensor)]
    found.sort(key=lambda pair: -pair[1].log_l)
    good = [pair for pair in found if pair[1].log_l > found[0][1].log_l - AS_GOOD_NATS]
    return tuple(_late(asked, _later(asked, two)) for asked, two in good)


def _clear(
    view: Scene, weighed: Weighed, held: Mask, sensor: ActsOn
) -> Iterator[tuple[_Asked, TwoDelays]]:
    asked = _Asked.of(view, weighed, held, sensor)
    if int(np.sum(asked.counts)) < 2 * LEAST_ROWS or not np.any(asked.along):
        return
    two = asked.two()
    if two is None or not asked.holds(two):
        return
    few, many = (asked.in_whiles(two, most) for most in (LEAST_RUNS - 1, MOST_RUNS))
    rivals = (asked.any_value(), asked.changed_once(), few)
    if max(two.log_l, many) - max(rivals) > CLEARLY_NATS:
        yield asked, two


def _later(asked: _Asked, two: TwoDelays) -> TwoDelays:
    """With the rows that are late as the second.

    Which of both is off is told by what a delay of 0 of either leaves with no delay of another
    device; where that is much the same, rows are late, as none is measured after its stamp.
    """
    if two.delays[0] > two.delays[1]:
        two = two.turned()
    apart_s = two.delays[1] - two.delays[0]
    late, early = (asked.with_these(two, ends) for ends in ((0.0, apart_s), (-apart_s, 0.0)))
    return two if early - late < AS_GOOD_NATS else two.turned()


def _late(asked: _Asked, two: TwoDelays) -> Late:
    apart_s = two.delays[1] - two.delays[0]
    off = np.minimum(asked.weight * apart_s**2 / two.loud2, 1.0)
    rows: Index = np.flatnonzero((two.second * off > ASIDE) & asked.counts)
    off_m = np.linalg.norm(np.nan_to_num(asked.view.error())[rows], axis=1)
    share = float(np.mean(two.second[asked.counts]))
    return Late(asked.sensor, rows, apart_s, asked.spread_s(two), off_m, single=True, of_log=share)


def _solved(columns: Array, left: Array, weight: Array) -> Array:
    normal = np.einsum("n,nik,nil->kl", weight, columns, columns, optimize=True)
    score = np.einsum("n,nik,ni->k", weight, columns, left)
    found: Array = np.linalg.solve(normal + np.eye(len(score)), score)
    return found
