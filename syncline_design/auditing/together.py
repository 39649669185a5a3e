"""Streams of one recorder against each other: its clock, and how it writes.

What moves all streams at once is not a stream's own: their receipts come from one clock.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, Array, Series, in_words
from syncline_design.auditing.shifts import Shift, common
from syncline_design.auditing.stream import Examined, without_clock_step
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import signed, to_digits

_ALIKE: Final = 0.25  # of a size, among streams
_SHARE: Final = 0.6  # of the streams that could show a shift
_DRIFT_ALIKE: Final = 0.1
_TOGETHER: Final = 0.05  # of a stream's mean interval: messages written at once
_BATCHED: Final = 0.5  # share of messages that come with the one before
_LEAST_FLUSH_S: Final = 0.05
_ALONE_FLUSH_S: Final = 0.1
_ALONE_MESSAGES: Final = 4.0


def held_together(streams: Sequence[Examined]) -> list[Examined]:
    """Streams of one recording, what they share said as the recorder's."""
    found = _clock_steps(list(streams))
    found = _clock_drift(found)
    return _batches(found)


# ---- the recorder's clock -------------------------------------------------------------------


def _clock_steps(streams: list[Examined]) -> list[Examined]:
    """A shift that most streams show at one time, and none by its stamps' own rhythm."""
    if len(streams) < 2:
        return streams
    pool = [(k, s) for k, one in enumerate(streams) for s in one.shifts if s.to_s is None]
    for group in _groups(pool):
        who = {k for k, _ in group}
        if any(_is_said(streams[k], group[0][1].at_s) for k in who):
            continue
        size = common([s for _, s in group])
        at = float(np.median([s.at_s for _, s in group]))
        able = [k for k, one in enumerate(streams) if _could_show(one, size, at)]
        sides = [s.side for _, s in group]
        if len(who) < 2 or len(who) < _SHARE * len(set(able) | who) or "stamp" in sides:
            continue
        for k, shift in dict(group).items():
            streams[k] = without_clock_step(_with_clock_step(streams[k], at, size, len(who)), shift)
    return streams


def _is_said(one: Examined, at_s: float) -> bool:
    """Whether its receipts were seen to go back there already."""
    return any(f.fault == "recorder_clock" and f.from_s is not None
               and abs(f.from_s - at_s) < 5.0 for f in one.faults)  # fmt: skip


def _groups(pool: list[tuple[int, Shift]]) -> list[list[tuple[int, Shift]]]:
    """Shifts of one time and size."""
    groups: list[list[tuple[int, Shift]]] = []
    for k, shift in sorted(pool, key=lambda one: one[1].at_s):
        for group in groups:
            if _same(group[0][1], shift):
                group.append((k, shift))
                break
        else:
            groups.append([(k, shift)])
    return groups


def _same(one: Shift, other: Shift) -> bool:
    # receipts on both sides of a jump are so far apart by the clock that jumped
    jump = min(abs(one.size_s), abs(other.size_s))
    close = abs(one.at_s - other.at_s) < 2.0 * (one.window_s + other.window_s) + 0.2 + jump
    alike = abs(one.size_s - other.size_s) < _ALIKE * max(abs(one.size_s), abs(other.size_s))
    return close and alike


def _could_show(one: Examined, size_s: float, at_s: float) -> bool:
    times = one.series.seconds[one.series.good]
    there = times.size > 20 and times[0] < at_s < times[-1]
    least = one.smallest.step_s
    return bool(there and least is not None and least < abs(size_s))


def _with_clock_step(one: Examined, at_s: float, size_s: float, among: int) -> Examined:
    """Its own step at that time, if it was called one, is the recorder's."""
    kept = tuple(
        f for f in one.faults
        if not (f.fault in ("step", "whole_second_slip") and f.from_s is not None
                and abs(f.from_s - at_s) < 3.0)
    )  # fmt: skip
    end = float(one.series.seconds[-1])
    fault = StampFault(
        "recorder_clock", {"seconds": -size_s, "kind": "step"}, at_s, end,
        f"receipts of {among} streams shift by {in_words(size_s)} at the same time, while "
        "stamps keep their rhythm: the recorder's clock was set",
    )  # fmt: skip
    return replace(one, faults=(*kept, fault))


def _clock_drift(streams: list[Examined]) -> list[Examined]:
    """One drift in all streams: one clock, and receipts are what they share."""
    drifts = {
        k: float(f.parameters["ppm"])
        for k, one in enumerate(streams) for f in one.faults
        if f.fault == "drift" and f.from_s is None
    }  # fmt: skip
    if len(drifts) < 2:
        return streams
    ppm = float(np.median(list(drifts.values())))
    if any(k not in drifts and _would_drift(one, ppm) for k, one in enumerate(streams)):
        return streams
    if any(abs(one - ppm) > _DRIFT_ALIKE * abs(ppm) + 1.0 for one in drifts.values()):
        return streams
    for k in drifts:
        fault = StampFault(
            "recorder_clock", {"ppm": ppm, "kind": "drift"}, None, None,
            f"all {len(drifts)} streams drift alike, {signed(ppm, 4)} ppm: one clock for all of "
            f"them, "
            "the recorder's or the one that stamps them",
        )  # fmt: skip
        others = tuple(f for f in streams[k].faults if f.fault != "drift")
        streams[k] = replace(streams[k], faults=(*others, fault))
    return streams


def _would_drift(one: Examined, ppm: float) -> bool:
    """Whether a stream that drifts so would have shown it."""
    least = one.smallest.drift_ppm
    return one.series.receive is not None and least is not None and least < 0.7 * abs(ppm)


# ---- how it writes --------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class _Flushes:
    """When messages were written, how many at once."""

    times: Array
    size: float
    interval_s: float


def _batches(streams: list[Examined]) -> list[Examined]:
    """Receipts in bunches that all streams share, or of one stream alone in long ones."""
    found = {k: f for k, one in enumerate(streams) if (f := _flushes(one.raw)) is not None}
    said = _shared(found) if len(found) > 1 else {}
    for k, flush in found.items():
        alone = flush.interval_s >= _ALONE_FLUSH_S and flush.size >= _ALONE_MESSAGES
        if k in said or alone:
            streams[k] = _with_batches(streams[k], flush, len(said) if k in said else 1)
    return streams


def _flushes(series: Series) -> _Flushes | None:
    if series.receive is None:
        return None
    receive = np.sort(series.receive[series.good])
    if receive.size < 40:
        return None
    when = (receive - receive[0]) / NS
    stamp = np.sort(series.stamp[series.good])
    mean = float(when[-1]) / (when.size - 1)
    together = np.diff(when) < _TOGETHER * mean
    even = float(np.mean(np.diff(stamp) / NS < _TOGETHER * mean))
    if mean <= 0.0 or float(np.mean(together)) < _BATCHED or even > 0.5 * float(np.mean(together)):
        return None
    heads = when[np.concatenate([[True], ~together])] + float(receive[0] - series.start) / NS
    if heads.size < 8:
        return None
    return _Flushes(heads, when.size / heads.size, float(np.median(np.diff(heads))))


def _shared(found: dict[int, _Flushes]) -> dict[int, bool]:
    """Streams whose bunches come when those of another do."""
    said = {}
    for k, one in found.items():
        for other_k, other in found.items():
            if k == other_k or one.interval_s < _LEAST_FLUSH_S:
                continue
            place = np.clip(np.searchsorted(other.times, one.times), 1, other.times.size - 1)
            near = np.minimum(
                np.abs(other.times[place] - one.times), np.abs(other.times[place - 1] - one.times)
            )
            if float(np.mean(near < 0.1 * one.interval_s)) > 0.8:
                said[k] = True
    return said


def _with_batches(one: Examined, flush: _Flushes, among: int) -> Examined:
    shared = f", {among} streams at the same moments" if among > 1 else ""
    fault = StampFault(
        "batched_by_recorder", {"interval_s": flush.interval_s, "messages": flush.size}, None, None,
        f"receipts come {to_digits(flush.size, 3)} at once every "
        f"{to_digits(flush.interval_s, 3)} s{shared}; stamps "
        "keep their rhythm: how the recorder writes, no fault of the stream", counts=False,
    )  # fmt: skip
    return replace(one, faults=(*one.faults, fault))
