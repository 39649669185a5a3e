"""Readings of a device of which some are late and the others are not: a heading of two antennas
beside an inertial level, a height of another receiver or a barometer.

A device's delay moves all of its readings at once.  Where the heading alone is late by L,
    yaw(t + L) = what it was at t,
is in the log, so that the column is put back by looking it up, and what is left is asked for
everything else.  With e the error, X what a build can be wrong by (delays of whole sensors, arms,
turns, a range's bias) and Z = -d reading/dt de/d reading of some readings,
    e = X b + Z L + w,
Gauss-Newton with the columns looked up anew each time.  It is those readings where the whole device
and those of another leave clearly more, over all of the log (leaving out one of sixteen stretches
after the other), and a filter of the device, which delays quick motion less than slow one, leaves
more as well.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import candidates, plain_signatures
from syncline_design.diagnosis.fitting import inner
from syncline_design.diagnosis.frozen_channels import euler_rates
from syncline_design.diagnosis.gross import Gross
from syncline_design.diagnosis.gross_trials import expected_size, usual_size
from syncline_design.diagnosis.judged import log_f
from syncline_design.diagnosis.late_rows import acting_late
from syncline_design.diagnosis.looked_up import Mask, Weighed
from syncline_design.diagnosis.reading_parts import (
    PARTS,
    WHOLES,
    ReadingPart,
    put_back,
    readings_late,
)
from syncline_design.diagnosis.scene import Scene, scene
from syncline_design.diagnosis.system import Measured
from syncline_design.diagnosis.undone import BUILD
from syncline_design.effects import plain_delay
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import ActsOn, Array
from syncline_design.logs.log import Log
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import student_limit
from syncline_design.model.normal import NORMAL_95
from syncline_design.model.system import System

FAR: Final = 1.5  # times the usual error of the spec's noise
BLOCKS: Final = 16
LEAST_ROWS: Final = 200
ALL_FREE: Final = ("position", "attitude", "ranging")
CHANCE: Final = 1e-6  # that readings of one delay differ so much, over all parts
CLEARLY_NATS: Final = 15.0  # by which some readings have to be likelier than all, in any 15 of 16
LEAST_S, MOST_S = 2e-3, 2.0  # of a delay
STEPS: Final = 8
MEMORIES_S: Final = (0.03, 0.06, 0.12, 0.25, 0.5, 1.0, 2.0)


@dataclass(frozen=True, slots=True)
class LatePart:
    """Readings that are late by themselves, and the log with them put back."""

    fault: Gross
    log: Log


def is_far_off(inputs: Measured, few: Log) -> bool:
    """Whether a log is clearly off its noise, before anything is looked for in it."""
    view = scene(inputs.system, few, inputs.known)
    return usual_size(view.error()) > FAR * expected_size(view)


def late_part(inputs: Measured, log: Log, few: Log, exclude: Sequence[str] = ()) -> LatePart | None:
    """Readings of a device of a log of one vehicle that are late alone; few: the rows that are
    worked on, of a long log some."""
    looking = _Looking.of(inputs.system, few, inputs.known, exclude)
    told = None if looking is None else looking.clearest()
    if looking is None or told is None:
        return None
    part, delay_s, spread_s = told
    acting = acting_late(part.sensor, delay_s)
    back, known_rows = put_back(log, part, delay_s)
    after = looking.left(part, delay_s)
    falls_by = usual_size(looking.view.error()) / max(usual_size(after), 1e-300)
    fault = Gross(acting, falls_by, spread_s, part.name)
    return LatePart(fault, back.rows(known_rows))


@dataclass(frozen=True, slots=True)
class _Sums:
    """Normal matrices, scores and squares of BLOCKS stretches of a log."""

    normal: Array
    score: Array
    square: Array
    rows: int

    def without(self, freed: Sequence[int]) -> _Sums:
        """The same with some columns free in every stretch by itself: noise that is slower than a
        stretch is turned into these."""
        own = list(freed)
        normal, score, square = self.normal.copy(), self.score.copy(), self.square.copy()
        for k in range(BLOCKS):
            cross = self.normal[k][:, own]
            inverse = np.linalg.inv(cross[own] + np.eye(len(own)))
            normal[k] -= cross @ inverse @ cross.T
            score[k] -= cross @ inverse @ self.score[k, own]
            square[k] -= float(self.score[k, own] @ inverse @ self.score[k, own])
        return _Sums(normal, score, square, self.rows)

    def solved(self, keep: Sequence[int]) -> tuple[Array, Array]:
        """Values of some columns, of all stretches and without each (1 + BLOCKS, k)."""
        own = list(keep)
        normal, score = self.normal[:, own][:, :, own], self.score[:, own]
        whole, every = normal.sum(0), score.sum(0)
        without = [np.zeros_like(whole), *normal]
        less = [np.zeros_like(every), *score]
        eye = np.eye(len(every))
        values = np.array([np.linalg.solve(whole - a + eye, every - b)
                           for a, b in zip(without, less, strict=True)])  # fmt: skip
        return values, whole

    def left(self, keep: Sequence[int]) -> Array:
        """Squares that are left of every stretch, with the values of all of them (BLOCKS,)."""
        values, _ = self.solved(keep)
        b, own = values[0], list(keep)
        normal, score = self.normal[:, own][:, :, own], self.score[:, own]
        left: Array = self.square - 2.0 * score @ b + np.einsum("i,bij,j->b", b, normal, b)
        return left


@dataclass(frozen=True, slots=True)
class _Looking:
    """A log, what else it may be off by (n, 3, P) in units of a build, and what readings do.

    swept (n, 3, 6): what a second of delay of every reading does (`readings_late`).
    whose: of each column of X the sensor that it delays; "" of one that is no delay.
    slow: the columns of X that slow noise makes: turns of the attitude, and places that are off.
    """

    system: System
    view: Scene
    weighed: Weighed
    columns: Array
    swept: Array
    whose: tuple[str, ...]
    slow: tuple[int, ...]

    @classmethod
    def of(
        cls, system: System, log: Log, known: Sequence[Acting], exclude: Sequence[str]
    ) -> _Looking | None:
        delay = plain_delay()
        first = log.stages[0]
        ranged = log.kind == "georeference" and first.antenna_m is not None
        if len(system.stages) != 1 or not ranged or len(log) < LEAST_ROWS:
            return None
        if delay.name in exclude:
            return None
        view = scene(system, log, known)
        asked = [s for s in plain_signatures(view, candidates(view, exclude)) if s.asked_jointly]
        whose = tuple(
            s.candidate.sensor if s.candidate.effect.delays else ""
            for s in asked for _ in s.candidate.effect.slopes()
        )  # fmt: skip
        turned = [s.candidate.sensor == "attitude" and not s.candidate.effect.delays
                  for s in asked for _ in s.candidate.effect.slopes()]  # fmt: skip
        if "attitude" not in whose:
            return None
        built = [s.columns * [BUILD[p.unit] for p in s.candidate.effect.slopes()] for s in asked]
        off = np.broadcast_to(BUILD["m"] * np.eye(3), (len(view), 3, 3))
        slow = (*np.flatnonzero(turned), *range(len(whose), len(whose) + 3))
        return cls(
            system, view, Weighed.of(view), np.concatenate([*built, off], axis=2),
            readings_late(view), (*whose, "", "", ""), tuple(map(int, slow)),
        )  # fmt: skip

    def left(self, part: ReadingPart, delay_s: float) -> Array:
        """The error (n, 3) [m] with some readings put back; as it was where that is not known."""
        return self._put_back(part, delay_s)[0]

    def _put_back(self, part: ReadingPart, delay_s: float) -> tuple[Array, Mask]:
        log, found = put_back(self.view.log, part, delay_s)
        return scene(self.system, log, self.view.known).error(), found

    def clearest(self) -> tuple[ReadingPart, float, float] | None:
        """The readings that are late alone, by how much [s], and its standard uncertainty."""
        start = self._sums(self.view.error(), np.ones(len(self.view), bool))
        single = [part for part in PARTS if len(part.readings) == 1]
        if not any(self._differs(start, part) for part in single):
            return None
        fits = [(part, self._fitted(part)) for part in (*PARTS, *WHOLES)]
        found = [(part, delay) for part, delay in fits if delay is not None]
        if not found:
            return None
        best, delay_s = min(found, key=lambda one: self._square(*one))
        if best in WHOLES or not LEAST_S <= abs(delay_s) <= MOST_S:
            return None
        others = [one for one in found if one[0] in WHOLES or one[0].sensor != best.sensor]
        if not self._is_clear(best, delay_s, others):
            return None
        return self._judged(best, delay_s)

    def _differs(self, sums: _Sums, part: ReadingPart) -> bool:
        """Whether readings are late by something else than the whole device is, by the
        variance of leaving out one stretch after the other."""
        value, spread = self._of_part(sums, part, ALL_FREE)
        share = (value / max(spread, 1e-300)) ** 2
        return log_f(share, 1, BLOCKS - 1) < math.log(CHANCE / len(PARTS))

    def _fitted(self, part: ReadingPart) -> float | None:
        """The delay [s] of some readings that leaves least, without one of the whole device."""
        delay_s = 0.0
        for _ in range(STEPS):
            error, found = self._put_back(part, delay_s)
            if np.mean(found) < 0.5:
                return None
            value, spread = self._of_part(self._sums(error, found), part)
            delay_s += value
            if not abs(delay_s) <= MOST_S:
                return None
            if abs(value) < 0.05 * spread:
                break
        return delay_s

    def _judged(self, part: ReadingPart, delay_s: float) -> tuple[ReadingPart, float, float]:
        error, found = self._put_back(part, delay_s)
        value, spread = self._of_part(self._sums(error, found), part)
        reach = student_limit(0.025, BLOCKS - 1) / NORMAL_95
        return part, delay_s + value, reach * spread

    def _kept(self, late: Sequence[str]) -> list[int]:
        """Columns that are no delays, and the delays of some sensors."""
        return [k for k, sensor in enumerate(self.whose) if not sensor or sensor in late]

    def _of_part(
        self, sums: _Sums, part: ReadingPart, late: Sequence[str] = ()
    ) -> tuple[float, float]:
        """The delay [s] of some readings beside all else, and its standard uncertainty.

        late: whole sensors that may be as well.
        """
        width, kept = self.columns.shape[2], self._kept(late)
        together = np.zeros((width + self.swept.shape[2], len(kept) + 1))
        together[kept, range(len(kept))] = 1.0
        together[[width + k for k in part.columns], -1] = 1.0
        own = _Sums(
            together.T @ sums.normal @ together, sums.score @ together, sums.square, sums.rows
        )
        values, normal = own.solved(range(len(kept) + 1))
        less = values[1:, -1]
        apart = less - np.mean(less)
        pairs = apart[0::2] + apart[1::2]  # noise goes on from one stretch to the next
        spread2 = (BLOCKS - 1) / BLOCKS * float(max(np.sum(apart**2), np.sum(pairs**2)))
        left = float(np.sum(own.left(range(len(kept) + 1))))
        noise2 = left / max(sums.rows * float(np.mean(self.weighed.freedom)), 1.0)
        at_best = noise2 * float(np.linalg.inv(normal + np.eye(len(normal)))[-1, -1])
        unit = BUILD["s"]
        return unit * float(values[0, -1]), unit * math.sqrt(max(spread2, at_best))

    def _square(self, part: ReadingPart, delay_s: float) -> float:
        return float(np.sum(self._blocks(part, delay_s)))

    def _blocks(self, part: ReadingPart, delay_s: float) -> Array:
        """What is left of every stretch, a row, with all else free (BLOCKS,)."""
        error, found = self._put_back(part, delay_s)
        return self._left_of(error, found)

    def _left_of(self, error: Array, found: Mask) -> Array:
        sums = self._sums(error, found)
        left: Array = sums.left(self._kept(())) / max(sums.rows, 1)
        return left

    def _is_clear(
        self, part: ReadingPart, delay_s: float, others: Sequence[tuple[ReadingPart, float]]
    ) -> bool:
        """Whether other readings, and every filter of the device, leave clearly more."""
        own = self._blocks(part, delay_s)
        rivals = [self._blocks(*each) for each in others]
        every = np.ones(len(self.view), bool)
        rivals += [self._left_of(error, every) for error in self._unfiltered(part.sensor)]
        rows = len(self.view)
        noise2 = float(np.sum(own)) / np.mean(self.weighed.freedom)  # as loud as what is left
        gained = [0.5 * rows * (each - own) / noise2 for each in rivals]
        return all(np.sum(nats) - np.max(nats) > CLEARLY_NATS for nats in gained)

    def _unfiltered(self, sensor: ActsOn) -> Iterator[Array]:
        """Errors of the log with what a low pass of a device leaves behind put back."""
        log = self.view.log
        first = log.stages[0]
        for memory_s in MEMORIES_S:
            if sensor == "attitude":
                behind = _behind(log.time_s, euler_rates(first), memory_s)
                own = replace(first, euler_rad=first.euler_rad + behind)
            else:
                assert first.antenna_m is not None
                moving = -np.einsum("nkk->nk", self.swept[:, :, 3:])
                behind = _behind(log.time_s, moving, memory_s)
                own = replace(first, antenna_m=first.antenna_m + behind)
            back = replace(log, stages=(own, *log.stages[1:]))
            yield scene(self.system, back, self.view.known).error()

    def _sums(self, error: Array, found: Mask) -> _Sums:
        """Whitened, of X and the delays of every reading beside one another."""
        root = self.weighed.root * found[:, None, None]
        every = np.concatenate([self.columns, BUILD["s"] * self.swept], axis=2)
        columns = root @ np.nan_to_num(every)
        left = np.einsum("nij,nj->ni", root, np.nan_to_num(error))
        parts = np.array_split(np.arange(len(error)), BLOCKS)
        normal = np.array([inner(columns[p], columns[p]) for p in parts])
        score = np.array([np.einsum("nik,ni->k", columns[p], left[p]) for p in parts])
        square = np.array([float(np.sum(left[p] ** 2)) for p in parts])
        whole = _Sums(normal, score, square, int(np.sum(found)))
        return whole.without(self.slow)


def _behind(time_s: Array, rates: Array, memory_s: float) -> Array:
    """By how much a first-order low pass of angles is behind them, from their rates (n, 3).

    With y' = (x - y) / T the rest d = x - y follows d' = x' - d / T, from d = T x' on.
    """
    kept = np.exp(-np.diff(time_s) / memory_s)
    behind = np.empty_like(rates)
    behind[0] = memory_s * rates[0]
    for k, keep in enumerate(kept):
        behind[k + 1] = keep * behind[k] + (1.0 - keep) * memory_s * rates[k]
    return behind
