"""Rows that are late by far more than their motion can be carried on, found in other rows.

A delay is undone elsewhere by carrying a pose on by its rates and velocities.  Where the attitude
is late by half a second or a second its rates mostly are as well, and what turned during the last
of that time is in no row at all: neither way of reading the rates fits, and noise of a sound sensor
fits as well as anything.  Single late rows among sound ones are noise to a fit of any kind.  But
the readings themselves are in the log (`looked_up`).  Of rows far beyond noise, in a run or single,
    Q(L) = sum e' C^-1 e
is asked of every device on a grid of L, then by Gauss-Newton; of a run that no constant fits, of a
delay that grows or falls evenly as well.  What is left has to be noise, Q <= chi-square of 1 in
10 000, the noise as loud as the median row of the log shows it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.diagnosis.in_turn import in_turn, than_the_others
from syncline_design.diagnosis.late_rows import AS_GOOD_NATS, Late, acting_late
from syncline_design.diagnosis.looked_up import (
    LEAST_ROWS,
    LateRows,
    LookedUp,
    Mask,
    Weighed,
)
from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.stretches import is_inside
from syncline_design.effects.record import ActsOn, Array
from syncline_design.model.distributions import chi_square_limit

FAR: Final = 1e-9  # chance of a row's square, beyond which it is no noise
APART_S, APART_ROWS = 1.0, 3  # of two such rows of one run, at most
DENSE: Final = 0.5  # of the rows of a run, that are far off
MOST_RUNS: Final = 8  # the longest ones
MOST_OF_LOG: Final = 0.6  # in runs: beyond that it is no while
MOST_SINGLE: Final = 0.3  # of a log
LEAST_S, MOST_S = 0.1, 10.0  # of a delay: a shorter one is carried on by its motion
LEAST_SINGLE_S: Final = 0.02  # of single rows, which no motion carries on
LEAST_BY_TURNS_S: Final = 2e-3  # of as many as take turns
GRID_S: Final = 0.05
FINER, TIMES = 10, 2  # delays to either side of the best, and how often
ONE: Final = (1.0,)  # a delay of one value
GROWING: Final = ((0.0, 1.0), (1.0, 0.0))  # or falling
MOST_GROWN_S: Final = 2.0
NEAR_S: Final = 1e-3  # to either side, over which errors are straight lines in a delay
POLISHED: Final = 4  # steps
CHANCE: Final = 1e-4  # that noise is louder than what is taken for noise
BETTER_NATS: Final = 5.0  # by which a single row has to be late rather than sound
WIDENED: Final = 3  # times that rows are added to those that are late
_Told = tuple[Array, Array]  # delays and their spreads


def late_runs(view: Scene, held: Mask) -> list[tuple[Late, ...]]:
    """Of every run of a log of one vehicle, and of the single rows, each device that fits, what is
    late before what is early.  held: rows of which more is known already.

    A run at either end of the log is none that comes and goes: stamps that step or run off, or what
    is built in and changed once, are looked for there by the search.
    """
    log = view.log
    if len(view.system.stages) != 1 or log.stages[0].antenna_m is None:
        return []
    weighed = Weighed.of(view)
    far = (weighed.square > chi_square_limit(FAR, weighed.freedom)) & ~held
    if np.mean(far) > MOST_OF_LOG or np.sum(far) < LEAST_ROWS:
        return []
    runs = [one for one in _runs(weighed.time_s, far, held) if _comes_and_goes(weighed, one)]
    in_runs = _any_of(runs, far)
    told: list[Mask] = []
    found: list[tuple[Late, ...]] = []
    for run in runs[:MOST_RUNS]:
        if fits := _fits(LateRows(weighed, run, held | (in_runs & ~run))):
            told.append(run)
            found.append(fits)
    return [*found, *_single(weighed, far, held, (_any_of(told, far), in_runs))]


def late_by_turns(view: Scene, held: Mask) -> tuple[Late, ...]:
    """Devices of which every second, third, ... row is late, where what is left is noise."""
    if len(view.system.stages) != 1 or view.log.stages[0].antenna_m is None:
        return ()
    rows = in_turn(view, Weighed.of(view).root, held)
    if rows is None:
        return ()
    sound = Weighed.of(view, ~rows & ~held)
    every = _fits(LateRows(sound, rows & ~held, held, single=True, by_turns=True))
    fits = [_than_the_others(sound, held, one) for one in every]
    fits = [one for one in fits if abs(one.delay_s) >= LEAST_BY_TURNS_S]
    return tuple(_as_good(sound, fits))


def _than_the_others(weighed: Weighed, held: Mask, one: Late) -> Late:
    """Ranges and bearings are held against targets, and not against those before and after: as
    late as they are beside these."""
    if one.sensor != "ranging":
        return one
    rows = np.isin(np.arange(len(held)), one.rows)
    more_s, spread_s = than_the_others(
        weighed.view, weighed.root, held, rows, acting_late(one.sensor, one.delay_s)
    )
    return replace(one, delay_s=one.delay_s + more_s, spread_s=spread_s)


def _as_good(weighed: Weighed, fits: Sequence[Late]) -> Sequence[Late]:
    """The devices that leave least of their rows."""
    if len(fits) < 2:
        return fits
    left = [_left_of_rows(weighed, one) for one in fits]
    own2 = min(left) / max(float(np.sum(weighed.freedom[fits[0].rows])), 1.0)
    return [
        one for one, square in zip(fits, left, strict=True)
        if 0.5 * (square - min(left)) / own2 < AS_GOOD_NATS
    ]  # fmt: skip


def _left_of_rows(weighed: Weighed, one: Late) -> float:
    """Squares of the rows that are late with their delay undone by their motion."""
    error = np.nan_to_num(weighed.view.error((acting_late(one.sensor, one.delay_s),))[one.rows])
    return float(np.sum(np.einsum("nij,nj->ni", weighed.root[one.rows], error) ** 2))


def _single(
    weighed: Weighed, far: Mask, held: Mask, left_out: Sequence[Mask]
) -> Iterator[tuple[Late, ...]]:
    """Rows that are late here and there: of all that no run explains, as chance puts some of them
    side by side, or else of those that lie in no run at all."""
    for runs in left_out:
        single = far & ~runs
        if not LEAST_ROWS <= np.sum(single) <= MOST_SINGLE * len(far):
            continue
        if fits := _fits(LateRows(weighed, single, held | runs, single=True)):
            yield fits
            return


def _any_of(runs: Sequence[Mask], like: Mask) -> Mask:
    inside = np.zeros(len(like), bool)
    for run in runs:
        inside |= run
    return inside


def _runs(time_s: Array, far: Mask, held: Mask) -> Iterator[Mask]:
    """What lies far off side by side, the longest first."""
    at = np.flatnonzero(far)
    apart = (np.diff(time_s[at]) > APART_S) & (np.diff(at) > APART_ROWS)
    parts = np.split(at, np.flatnonzero(apart) + 1)
    for part in sorted(parts, key=len, reverse=True):
        rows = np.zeros(len(far), bool)
        rows[part[0] : part[-1] + 1] = True
        dense = len(part) >= max(LEAST_ROWS, DENSE * np.sum(rows)) and not np.any(held & rows)
        if dense:
            yield rows


def _comes_and_goes(weighed: Weighed, run: Mask) -> bool:
    """Whether it begins and ends within the log."""
    inside_s = weighed.time_s[run]
    return is_inside(float(inside_s[0]), float(inside_s[-1]), weighed.view.log.ends_s)


def _fits(asked: LateRows) -> tuple[Late, ...]:
    ranged = asked.of.view.log.kind == "georeference"
    devices: tuple[ActsOn, ...] = ("position", "attitude", "ranging") if ranged else ("position",)
    found = [one for sensor in devices if (one := _late(asked, sensor)) is not None]
    return tuple(sorted(found, key=lambda one: one.delay_s < 0.0))


def _late(asked: LateRows, sensor: ActsOn) -> Late | None:
    """By how much a device is late, where that leaves nothing but noise."""
    looked = LookedUp.of(asked, sensor)
    if looked is None:
        return None
    most_s = min(MOST_S, 0.5 * asked.of.view.log.duration_s)
    for shape in (ONE,) if asked.single else (ONE, *GROWING):
        start = _on_a_grid(looked, np.array(shape), most_s if shape == ONE else MOST_GROWN_S)
        told = None if start is None else _at_least(looked, start)
        if told is not None and asked.single and not asked.by_turns:
            looked, told = _with_all_single(looked, told)
        elif told is not None and shape != ONE:
            looked, told = _from_nothing_on(looked, told)
        if told is not None and np.max(np.abs(told[0])) >= _least_s(asked):
            return _told(looked, *told)
    return None


def _least_s(asked: LateRows) -> float:
    if asked.by_turns:
        return LEAST_BY_TURNS_S
    return LEAST_SINGLE_S if asked.single else LEAST_S


def _told(looked: LookedUp, delays: Array, spreads: Array) -> Late:
    asked = looked.late
    largest = int(np.argmax(np.abs(delays)))
    rows = np.flatnonzero(asked.inside)
    off_m = np.linalg.norm(np.nan_to_num(asked.of.view.error())[rows], axis=1)
    ends_s = None if len(delays) < 2 else (float(delays[0]), float(delays[1]))
    return Late(looked.sensor, rows, float(delays[largest]), float(spreads[largest]), off_m, ends_s,
                asked.single)  # fmt: skip


def _from_nothing_on(looked: LookedUp, told: _Told) -> tuple[LookedUp, _Told]:
    """A delay that grows (or falls) with the rows in which it is too small to be far off."""
    late, (delays, _) = looked.late, told
    a, b = late.ends_s
    grown_s = float(delays[-1] - delays[0])
    if not abs(grown_s) > 0.0:
        return looked, told
    nothing_s = a - float(delays[0]) * (b - a) / grown_s
    time_s = late.of.time_s
    low, high = min(a, nothing_s), max(b, nothing_s)
    rows = (time_s >= low) & (time_s <= high)
    if np.any(rows & late.elsewhere) or np.sum(rows) > 2 * np.sum(late.inside):
        return looked, told
    wider = LookedUp.of(replace(late, inside=rows), looked.sensor)
    rate = grown_s / (b - a)
    ends = float(delays[0]) + rate * (time_s[rows][[0, -1]] - a)
    more = None if wider is None else _at_least(wider, ends)
    return (looked, told) if wider is None or more is None else (wider, more)


def _with_all_single(looked: LookedUp, told: _Told) -> tuple[LookedUp, _Told]:
    """Single rows that are late with those that are late rather than sound and not far off.

    Taken for sound, these would be what the others are held against, and so would those of which
    either may be: they are no witness.
    """
    unknown = looked.late.elsewhere
    for _ in range(WIDENED):
        late, (delays, _) = looked.late, told
        anywhere = looked.known(delays, ~unknown)
        square = np.sum(looked.left(delays, anywhere) ** 2, axis=1)
        better = 0.5 * (late.of.square[anywhere] - square)
        own, elsewhere = late.inside.copy(), unknown.copy()
        own[anywhere[better > BETTER_NATS]] = True
        elsewhere[anywhere[better > 0.0]] = True
        wider = LookedUp.of(replace(late, inside=own, elsewhere=elsewhere & ~own), looked.sensor)
        more = None if wider is None else _at_least(wider, delays)
        if wider is None or more is None or np.array_equal(own, late.inside):
            break
        looked, told = wider, more
    return looked, told


def _on_a_grid(looked: LookedUp, shape: Array, most_s: float) -> Array | None:
    """The delays of a shape times one size that leave least; None where none has its readings."""
    grid, step_s, best_s = np.arange(-most_s, most_s + GRID_S, GRID_S), GRID_S, 0.0
    for _ in range(TIMES):
        means = [looked.mean_square(float(size) * shape) for size in grid]
        if not np.isfinite(means).any():
            return None
        best_s = float(grid[int(np.argmin(means))])
        grid = best_s + step_s * np.linspace(-1.0, 1.0, 2 * FINER + 1)
        step_s /= FINER
    return best_s * shape


def _at_least(looked: LookedUp, delays: Array) -> _Told | None:
    """The delays of least Q nearby and their spreads (Gauss-Newton); None where more than noise is
    left."""
    rows = looked.rows(delays)
    for _ in range(POLISHED):
        if rows is None:
            return None
        left = looked.left(delays, rows)
        steps = NEAR_S * np.eye(len(delays))
        slopes = [looked.left(delays + d, rows) - looked.left(delays - d, rows) for d in steps]
        columns = np.stack([slope.ravel() for slope in slopes], axis=1) / (2.0 * NEAR_S)
        normal = columns.T @ columns
        if not float(np.min(np.linalg.eigvalsh(normal))) > 0.0:
            return None
        delays = delays - np.linalg.solve(normal, columns.T @ left.ravel())
        rows = looked.rows(delays)
    if rows is None:
        return None
    freedom = looked.components(rows) - len(delays)
    square = float(np.sum(looked.left(delays, rows) ** 2))
    if freedom < 1 or square > chi_square_limit(CHANCE, freedom):
        return None
    spread2 = max(square / freedom, 1.0) * np.diag(np.linalg.inv(normal))
    return delays, np.sqrt(spread2)
