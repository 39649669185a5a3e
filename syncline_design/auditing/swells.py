"""Later for a while: whether stamps without a rhythm went back, or messages took longer.

Receipt minus stamp is higher between two moments in both cases, and intervals that follow no rhythm
do not tell them apart.  A stream beside it does that keeps one: where its receipts take the same
course while its stamps go on evenly, the host or the link delayed both (transport that streams of
one recorder share).  Where it could show that course and does not, the stamps are to blame.  With
no such stream only stamps that fall say that a clock was set back; else nothing does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing.residual import residual_of
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import (
    MEDIAN_SIGMA,
    NS,
    Array,
    Mask,
    Series,
    in_words,
    seconds,
    spread,
)
from syncline_design.auditing.stream import Examined
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

_ALIKE: Final = 0.35  # of a size: what may be left of it
_BESIDE_S: Final = (2.0, 6.0)  # least and most before and after it
_LEAST: Final = 5  # messages in each part of it
_AROUND: Final = 2  # messages on each side that tell a level
_JITTER: Final = 6.0  # times: what stamps scatter by is below what they would have to show
_SURE: Final = 3.0
_EDGE: Final = 6  # messages about the moment at which stamps may fall


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Between which moments [s] receipts are later, or sooner, by so much; lasts: to the end."""

    begin_s: float
    end_s: float
    size_s: float
    lasts: bool

    def inside(self, time_s: Array) -> Mask:
        after = time_s >= self.begin_s
        return after if self.lasts else after & (time_s < self.end_s)

    def parts(self) -> list[tuple[float, float]]:
        """Before it, its first and its second half, after it."""
        least, most = _BESIDE_S
        length = self.end_s - self.begin_s
        length = min(length, 2.0 * most) if self.lasts else length
        beside = min(max(length, least), most)
        middle, end = self.begin_s + 0.5 * length, self.begin_s + length
        found = [(self.begin_s - beside, self.begin_s), (self.begin_s, middle), (middle, end)]
        return found if self.lasts else [*found, (end, end + beside)]


def without_swells(streams: Sequence[Examined]) -> list[Examined]:
    """Streams whose steps are not those of transport that others share, or that may be its."""
    return [_without(one, [o for o in streams if o is not one]) for one in streams]


def _without(one: Examined, others: Sequence[Examined]) -> Examined:
    for fault in one.faults:
        stretch = _stretch(one, fault)
        if stretch is None:
            continue
        told = [_shares(one, other, stretch) for other in others]
        if any(told):
            one = _taken_back(one, fault, stretch)
        elif not any(t is False for t in told) and _may_be_transport(one, stretch):
            one = _taken_back(one, fault, stretch)
            one = replace(one, undecided=(*one.undecided, _undecided(stretch)))
    return one


def _stretch(one: Examined, fault: StampFault) -> _Stretch | None:
    """Of a step that the stream's own rhythm does not show."""
    if fault.fault != "step" or fault.from_s is None or one.series.receive is None:
        return None
    if "interval_s" in fault.parameters or one.pace.regular:
        return None
    if any(s.side == "stamp" and s.at_s == fault.from_s for s in one.shifts):
        return None
    last = float(one.series.seconds[one.series.good][-1])
    end = last if fault.to_s is None else min(fault.to_s, last)
    return _Stretch(fault.from_s, end, -float(fault.parameters["seconds"]), end >= last)


def _undecided(stretch: _Stretch) -> str:
    span = f"from {to_digits(stretch.begin_s, 4)} to {to_digits(stretch.end_s, 4)} s"
    return (f"whether its stamps went back by {in_words(stretch.size_s)} {span}, or its messages "
            "took longer: it has no rhythm, and no stream beside it tells")  # fmt: skip


def _taken_back(one: Examined, fault: StampFault, stretch: _Stretch) -> Examined:
    """The stream without a step, and stamps as they were with it."""
    series = _with_step(one.series, stretch)
    faults = tuple(f for f in one.faults if f is not fault)
    constant = one.constant_s
    if constant is not None:
        constant += float(_late(series).min() - _late(one.series).min())
    return replace(one, series=series, faults=faults, constant_s=constant,
                   residual=residual_of(one.raw, series, faults))  # fmt: skip


def _with_step(series: Series, stretch: _Stretch) -> Series:
    back = round(stretch.size_s * NS)
    inside = stretch.inside(series.seconds)
    return replace(series, stamp=np.where(inside & series.good, series.stamp - back, series.stamp))


def _late(series: Series) -> Array:
    """Receipt minus stamp of the good messages [s]."""
    assert series.receive is not None
    return seconds((series.receive - series.stamp)[series.places()])


def _times(series: Series) -> Array:
    return series.seconds[series.places()]


def _shares(one: Examined, other: Examined, stretch: _Stretch) -> bool | None:
    """Whether receipts of another take the same course while its stamps keep their rhythm; None
    where it could not show it."""
    if not _keeps_rhythm(other, stretch):
        return None
    shown, levels = _times(other.series), _late(other.series)
    parts = [slice(*np.searchsorted(shown, part)) for part in stretch.parts()]
    about = slice(max(0, parts[0].start - _AROUND), parts[-1].stop + _AROUND)
    if min(part.stop - part.start for part in parts) < _LEAST:
        return None
    blur = max(_uncertainty(levels[part]) for part in parts)
    if _SURE * blur > _ALIKE * abs(stretch.size_s):
        return None
    when, course = _times(one.series), _smooth(levels[about])
    late = _late(_with_step(one.series, stretch)) - np.interp(when, shown[about], course)
    left = list(_medians(when, late, stretch))
    return bool(np.ptp(left) < _ALIKE * abs(stretch.size_s)) if left else None


def _keeps_rhythm(other: Examined, stretch: _Stretch) -> bool:
    """Whether its stamps tell by their rhythm that they did not move so."""
    pace, size = other.pace, abs(stretch.size_s)
    late = any(f.fault == "stamped_on_arrival" for f in other.faults)
    if other.series.receive is None or not pace.regular or late or other.copied:
        return False
    if _JITTER * pace.jitter_s > size:
        return False
    apart = np.cumsum(np.concatenate([[0.0], pace.interval - pace.steps * pace.period_s]))
    when = other.series.seconds[pace.places]
    levels = list(_medians(when, apart, stretch))
    return bool(levels) and float(np.ptp(levels)) < _ALIKE * size


def _medians(time_s: Array, values: Array, stretch: _Stretch) -> Iterator[float]:
    """Of the parts of a stretch and beside it that have messages."""
    for begin, end in stretch.parts():
        a, b = np.searchsorted(time_s, (begin, end))
        if b > a:
            yield float(np.median(values[a:b]))


def _uncertainty(values: Array) -> float:
    """Of their median, slow changes apart."""
    return MEDIAN_SIGMA * spread(np.diff(values)) / float(np.sqrt(2.0 * values.size))


def _smooth(values: Array) -> Array:
    """Running medians."""
    padded = np.pad(values, _AROUND, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _AROUND + 1)
    return np.asarray(np.median(windows, axis=1))


def _may_be_transport(one: Examined, stretch: _Stretch) -> bool:
    """Whether receipts are later and come back, and stamps do not fall where this begins."""
    if stretch.lasts or stretch.size_s < 0.0:
        return False
    whole = one.whole
    places = whole.places()
    at = int(np.searchsorted(whole.seconds[places], stretch.begin_s))
    near = whole.stamp[places[max(0, at - _EDGE) : at + _EDGE]]
    return bool(np.all(np.diff(near) >= 0))
