"""How intervals of stamps on a grid alternate: of a sensor that the grid cuts, and of others."""

from __future__ import annotations

from typing import Final

import numpy as np

from syncline_design.auditing.blocks import LEAST_MESSAGES, blocks_of
from syncline_design.auditing.cadence import Cadence
from syncline_design.auditing.coarse_rhythm import evenly
from syncline_design.auditing.series import Array, Series, spread
from syncline_design.machine.quick_dataclass import dataclass

FINE: Final = 5 * 10**7  # ns; coarser steps may be the epochs of a sensor
_LEAST_STEPS: Final = 5  # of a coarse stamp; one that hardly moves is stuck
_LEAST_TURNS: Final = 2  # grains left out, to know that they are
_TURN: Final = 1.3  # grains that such a course may begin or end with
_STRAIGHT: Final = 0.4  # of a grain: delays about the course
_BACK: Final = 0.35  # of a grain
_AS_FAR: Final = 0.5  # of the usual interval
_MOST_TURNS: Final = 8  # of a sensor that hardly leaves the grid's rhythm; of others more show it
_SURE: Final = 2.0  # sigma
_CHANCE: Final = 0.1  # grains: what creeps by less hardly turns
_HALF: Final = 0.5  # way between what is measured and what is cut off
_NEXT: Final = 8  # messages on each side
_MOST_LOST: Final = 0.15  # of all messages
_OF_TWO: Final = 0.96  # of the intervals: one tick or two; among others messages may be lost


def alternates(series: Series, pace: Cadence, grain: int) -> bool:
    """Whether intervals of neighbours lie on both sides of a rhythm that is not the grid's."""
    counts = np.round(np.diff(series.stamp[pace.places]) / grain)
    counts = counts[np.diff(pace.places) == 1]  # over messages that were left out none is odd
    if np.count_nonzero(counts) < _LEAST_STEPS:
        return False
    values, often = np.unique(counts, return_counts=True)
    usual = values[int(np.argmax(often))]
    if usual == 0:
        return True
    near = (np.abs(counts - usual) <= 1) & (counts != usual)
    if usual == 1:  # of 0 and 2 grains beside 1: duplicates and losses, unless they come evenly
        slower = skips_evenly(counts) and not _lost(series, pace, counts, grain)
        slower = slower or _sawtooth(series, pace, counts, grain)
        return slower or (evenly(np.flatnonzero(counts == 0)) and _apart(series, pace, grain))
    if int(np.sum(near & (counts % usual != 0))) >= 3:
        return True
    turns = turns_of(series, pace, grain)
    return turns is not None and turns.count >= _LEAST_TURNS and turns.shown


@dataclass(frozen=True, slots=True, eq=False)
class Turns:
    """Intervals of one grain more (or less) than all others, a few.

    creep: by how many grains receipts run away from the others' rhythm over the log, to the side
    that the turns make good for; off: what that is unsure by.  course: of receipts minus stamps
    with both [grains].  followed: messages come later by what a turn adds, so that it was measured.
    """

    count: int
    creep: float
    off: float
    course: Array
    followed: bool

    @property
    def explained(self) -> bool:
        """Whether a sensor off the grid's rhythm may have made them: no clock need have moved."""
        fits = abs(self.creep - self.count) < _TURN + _SURE * self.off
        return fits and not self.followed and self.creep + _SURE * self.off > _CHANCE

    @property
    def shown(self) -> bool:
        fits = abs(self.creep - self.count) < _TURN and not self.followed
        return fits and self.creep > 2.0 * _SURE * self.off


def turns_of(series: Series, pace: Cadence, grain: int) -> Turns | None:
    """The turns of stamps on a grid of which an interval is nearly several grains, all to one
    side; None without them."""
    places = pace.places
    if series.receive is None or not grain or places.size < LEAST_MESSAGES:
        return None
    counts = np.round(np.diff(series.stamp[places]) / grain)
    usual = float(np.median(counts))
    turned = counts[counts != usual] - usual
    count = abs(float(turned.sum()))
    if usual < 2.0 or not turned.size or count != turned.size or turned.size > _MOST_TURNS:
        return None
    extra = np.concatenate([[0.0], np.cumsum(counts - usual)])
    whole = (series.receive - series.stamp)[places] / grain + extra
    blocks = blocks_of(series.seconds[places], np.asarray(whole - whole[0]))
    if blocks is None or blocks.usable.sum() < LEAST_MESSAGES:
        return None
    when, level = blocks.time_s[blocks.usable], blocks.low_s[blocks.usable]
    slope = float(np.polynomial.polynomial.polyfit(when, level, 1)[1])
    span = float(np.ptp(series.seconds[places]))
    off = blocks.noise_s / (float(np.std(when)) * float(np.sqrt(when.size)))
    creep = float(np.sign(turned[0])) * slope * span
    course = slope * series.seconds[places] - extra
    turned_by = np.interp(when, series.seconds[places], extra)
    followed = _followed(when, level, turned_by, blocks.noise_s)
    return Turns(int(count), creep, off * span, np.asarray(course), followed)


def _followed(when: Array, level: Array, turned: Array, noise: float) -> bool:
    """Whether receipts turn with the stamps and do not run on evenly, as they do where a grid cuts.

    level = a + b when + c turned: c is 1 of turns that were measured, 0 of those of a grid, and
    has to be known well enough to tell the two.
    """
    straight = np.stack([np.ones_like(when), when - float(when.mean())], axis=1)
    own = turned - straight @ np.linalg.lstsq(straight, turned, rcond=None)[0]
    power = float(own @ own)
    if power <= 0.0 or noise * _SURE > _HALF * float(np.sqrt(power)):
        return False
    return float(own @ level) / power > _HALF


def _apart(series: Series, pace: Cadence, grain: int) -> bool:
    """Whether messages of one coarse stamp were received as far apart as others, which a message
    that was sent twice is not; without receipts coarse grains may be epochs of the sensor."""
    if series.receive is None:
        return grain <= FINE
    passed = np.diff(series.receive[pace.places])
    same = np.diff(series.stamp[pace.places]) == 0
    return bool(np.median(passed[same]) > _AS_FAR * np.median(passed[~same]))


def _sawtooth(series: Series, pace: Cadence, counts: Array, grain: int) -> bool:
    """Whether receipts run away from stamps evenly and come back by a grain where one is left out.

    So does a sensor whose interval is nearly the grain, however seldom its stamps leave one out.
    """
    if series.receive is None or counts.size != pace.places.size - 1:
        return False
    extra = np.concatenate([[0.0], np.cumsum(counts - 1.0)])
    turns = abs(float(extra[-1]))
    skips = np.flatnonzero(counts != 1.0)
    if not _LEAST_TURNS <= skips.size == turns:
        return False
    late = (series.receive - series.stamp)[pace.places].astype(np.float64)
    whole = late - late[0] + grain * extra
    when = series.seconds[pace.places]
    slope, first = np.polynomial.polynomial.polyfit(when, whole, 1)[::-1]
    left = whole - first - slope * when
    ramp = abs(slope) * float(when[-1] - when[0]) / grain
    sides = [(late[max(0, k - _NEXT) : k + 1], late[k + 1 : k + 2 + _NEXT]) for k in skips]
    back = [float(np.median(before) - np.median(after)) for before, after in sides]
    sizes = np.abs(np.asarray(back)) / grain
    return (
        abs(ramp - turns) < _TURN
        and spread(left) < _STRAIGHT * grain
        and abs(float(np.median(sizes)) - 1.0) < _BACK
    )


def _lost(series: Series, pace: Cadence, counts: Array, grain: int) -> bool:
    """Whether ticks are left out because messages are missing, not because the sensor is slower.

    The stamps of a slower sensor lie ever further before its receipts until a tick is left out;
    where messages are lost, those around the hole are as late as all others.
    """
    if series.receive is None or counts.size != pace.places.size - 1:
        return False
    late = (series.receive - series.stamp)[pace.places]
    skips = np.flatnonzero(counts == 2)
    skips = skips[(skips > 1) & (skips < counts.size - 2)]
    if not skips.size or skips.size > _MOST_LOST * counts.size:
        return False
    before = np.minimum(late[skips], late[skips - 1])
    after = np.minimum(late[skips + 1], late[skips + 2])
    return abs(float(np.median(before - after))) < 0.4 * grain


def skips_evenly(counts: Array) -> bool:
    """Whether single ticks are left out at even distances: a beat, and no lost messages."""
    skips = np.flatnonzero(counts == 2)
    if skips.size < 6 or float(np.mean((counts == 1) | (counts == 2))) < _OF_TWO:
        return False
    return evenly(skips)
