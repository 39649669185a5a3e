"""Stamps that say when a message came instead of when it was measured; stamps of the future."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.auditing.alternations import turns_of
from syncline_design.auditing.cadence import Cadence, about_rhythm, without_losses
from syncline_design.auditing.frames import FRAMES_S, FULL_SPEED_S, Framed, framed
from syncline_design.auditing.grains import grain_of, may_be_cut
from syncline_design.auditing.late_scatter import Waits, long_waits_of, waits_of
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, Array, Mask, Series, in_words, seconds, spread
from syncline_design.auditing.tick_words import Paced
from syncline_design.machine.quick_dataclass import dataclass

_TIGHT: Final = 0.2  # scatter of receipt minus stamp against that of the stamps' rhythm
_LEAST_JITTER_S: Final = 5e-6
_PART: Final = 100  # messages of a part of the log
_LEAST_PARTS, _MOST_PARTS = 4, 12
_EVENER: Final = 0.3  # how much more even stamps of the sensor's own are
_ONE_TICK: Final = 0.9  # of an interval
_CLOCKS: Final = 1e-4  # that a sensor's clock and a timer's differ by
_OUTER: Final = 5.0  # per cent of the messages beyond either end of a scatter's reach
_OUTERS: Final = (25.0, _OUTER)
_SKEWED: Final = 0.2  # how much further the late half of the rhythm's scatter reaches
_OF_ARRIVALS: Final = 0.39  # of gamma delays of shape 2; of n of them
_FEW: Final = 120  # messages: no rhythm of those around is known
_CHANCE: Final = 2.7  # over sqrt(n): three times what that differs by


def stamped_on_arrival(series: Series, pace: Cadence) -> StampFault | None:
    """Stamps that scatter as arrivals do while receipts follow them closely.

    A sensor that stamps itself keeps an even rhythm, and receipts scatter by transport.  Here the
    rhythm has transport's scatter, one-sided (nothing comes before it was sent), and hardly any is
    left between stamp and receipt.  Irregular sensors have no rhythm to show it.
    """
    if series.receive is None or pace.places.size < 40:
        return None
    late = seconds((series.receive - series.stamp)[pace.places])
    when = _when(series, pace)
    about = about_rhythm(when)
    if not late.any():
        if copied(about):
            return None
        return StampFault("stamped_on_arrival", {}, None, None,
                          "every stamp equals its receipt")  # fmt: skip
    transport = _width(late)
    late_ones = _scattered(about, late) or _waited(waits_of(without_losses(when, pace)), late)
    late_ones = late_ones or _waited(long_waits_of(when), late)
    return late_ones or _in_frames(when, transport)


def _when(series: Series, pace: Cadence) -> Array:
    """Stamps since the first [s]."""
    return seconds(series.stamp[pace.places] - series.stamp[pace.places[0]])


def _scattered(about: Array | None, late: Array) -> StampFault | None:
    """By a scatter about the rhythm that is late rather than early."""
    if about is None or not _one_sided(about):
        return None
    own = spread(about)
    if own < _LEAST_JITTER_S or not _follow(late, about):
        return None
    return StampFault(
        "stamped_on_arrival", {"seconds": own}, None, None,
        f"stamps scatter by {in_words(own)} about the sensor's rhythm, late rather than early, "
        f"while receipts follow within {in_words(_width(late))}: they say when messages came",
    )  # fmt: skip


def _waited(waits: Waits | None, late: Array) -> StampFault | None:
    """By delays as long as the sensor's interval: none before its turn, many after."""
    if waits is None or not waits.late:
        return None
    own = spread(waits.about_s)
    if own < _LEAST_JITTER_S or not _follow(late, waits.about_s):
        return None
    return StampFault(
        "stamped_on_arrival", {"seconds": own}, None, None,
        f"stamps come up to {in_words(waits.reach_s)} after the sensor's turn, never before it, "
        f"and receipts follow within {in_words(_width(late))}: they say when messages came",
    )  # fmt: skip


def _in_frames(when: Array, transport_s: float) -> StampFault | None:
    """By the frames of a bus on which they lie, now one more and now one less apart."""
    found = framed(when)
    if found is None or not found.varied or transport_s > _TIGHT * found.frame_s:
        return None
    frame = in_words(found.frame_s)
    return StampFault(
        "stamped_on_arrival", {"seconds": 0.5 * found.frame_s, "interval_s": found.frame_s}, None,
        None,
        f"stamps lie on a comb of {frame}, as the frames of USB are, by turns a frame more and "
        f"less apart, {in_words(found.noise_s)} late on it, and receipts follow within "
        f"{in_words(transport_s)}: they say when messages came",
    )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Hidden:
    """What stamps on arrival could hide in a stream that looks sound: by how much [s], and why."""

    seconds: float
    words: str


def hidden_in(series: Series, pace: Cadence, ticks: Paced | None = None) -> Hidden | None:
    """What stamps of a stream without faults of its own cannot tell from arrivals, if anything;
    ticks: that they follow one another by."""
    if ticks is not None:
        return Hidden(ticks.hidden_s(series), ticks.words)
    if series.receive is None or pace.places.size < 40:
        return None
    when = _when(series, pace)
    late = seconds((series.receive - series.stamp)[pace.places])
    found = framed(when)
    if found is not None:
        return _hidden_frame(found)
    told = _hidden_turn(series, pace) or _hidden_wait(when, _width(late), pace)
    told = told or _hidden_arrivals(_about(when, pace), late)
    return told or _hidden_grid(may_be_cut(series, pace))


def _hidden_wait(when: Array, transport: float, pace: Cadence) -> Hidden | None:
    waits = waits_of(without_losses(when, pace))
    if waits is None or not waits.edged:
        return None
    own, reach = spread(waits.about_s), waits.reach_s
    if own < _LEAST_JITTER_S or transport > _TIGHT * own:
        return None
    return Hidden(reach, f"whether it was stamped on arrival: its stamps scatter over "
                  f"{in_words(reach)} from a sharp edge and receipts follow within "
                  f"{in_words(transport)}, which waits for a host's turn do as well as a sensor "
                  "that is triggered so")  # fmt: skip


def _hidden_turn(series: Series, pace: Cadence) -> Hidden | None:
    """What receipts follow by one grain was measured there, or waited for a tick of that length."""
    grain = grain_of(series.stamp[pace.places])
    turns = turns_of(series, pace, grain)
    if turns is None or not turns.followed:
        return None
    few = f"{turns.count} of its intervals {'differs' if turns.count == 1 else 'differ'}"
    return Hidden(grain / NS, f"whether a timer of {in_words(grain / NS)} stamped it: {few} from "
                  "the others by one such tick, as where a sensor's clock drifts over its edge, "
                  "and receipts follow, as they do what was measured there")  # fmt: skip


def _about(when: Array, pace: Cadence) -> Array | None:
    """How far stamps lie about the rhythm of those around them, of few about a line [s]."""
    about = about_rhythm(when)
    if about is not None or not pace.regular or when.size > _FEW:
        return about
    count = np.concatenate([[0.0], np.cumsum(pace.steps)])
    line = np.stack([np.ones(count.size), count], axis=1)
    return np.asarray(when - line @ np.linalg.lstsq(line, when, rcond=None)[0])


def _hidden_arrivals(about: Array | None, late: Array) -> Hidden | None:
    """Of few messages, whose scatter may be as little one-sided by chance."""
    if about is None or spread(about) < _LEAST_JITTER_S or not _follow(late, about):
        return None
    if _skewness(about) < _OF_ARRIVALS - _CHANCE / float(np.sqrt(about.size)):
        return None
    reach = float(np.ptp(about))
    return Hidden(reach, f"whether it was stamped on arrival: its stamps scatter over "
                  f"{in_words(reach)} about its rhythm, receipts follow them, and its messages are "
                  "too few to say whether late rather than early")  # fmt: skip


def _hidden_grid(grain_s: float) -> Hidden | None:
    if not grain_s:
        return None
    return Hidden(grain_s, f"whether its stamps are cut off to {in_words(grain_s)}: its interval "
                  "changes, it may measure at such moments, and receipts do not say "
                  "which")  # fmt: skip


def frame_of(series: Series) -> float:
    """The frames of USB that stamps lie on [s], 0 of none: where a sensor's clock drifts over a
    frame's edge its stamps move by one, as in no step of a clock."""
    places = series.places()
    if series.receive is None or places.size < 2:
        return 0.0
    found = framed(seconds(series.stamp[places] - series.stamp[places[0]]))
    if found is None:
        return 0.0
    return found.frame_s if found.frame_s <= max(FRAMES_S) else FULL_SPEED_S  # or of longer ticks


def _hidden_frame(found: Framed) -> Hidden:
    frame = in_words(found.frame_s)
    late = f"{in_words(found.noise_s)} late"
    if found.frame_s > FULL_SPEED_S and not found.varied:
        return Hidden(found.frame_s, "whether it was stamped on arrival through a serial chip: "
                      f"its stamps lie on ticks of {frame}, {late}, as its interval is a whole "
                      "number of these, and of shorter ones that they hold")  # fmt: skip
    why = ("by turns a frame more and less apart, as arrivals do and ticks of its own task"
           if found.varied else "its interval is a whole number of them")  # fmt: skip
    return Hidden(found.frame_s, f"whether it was stamped on arrival over USB: its stamps lie on "
                  f"frames of {frame}, {late}, {why}")  # fmt: skip


def but_for_left_out(
    found: list[StampFault], hidden: Hidden | None, pace: Cadence
) -> tuple[list[StampFault], Hidden | None]:
    """Without losses that are as few as the ticks which a sensor leaves out that measures a little
    less often than the timer that may hide here; said instead."""
    lost = [f for f in found if f.fault == "lost_messages"]
    if hidden is None or not lost or hidden.seconds < _ONE_TICK * pace.period_s:
        return found, hidden
    apart = 1.0 + _CLOCKS * float(pace.interval.sum()) / hidden.seconds
    count = float(lost[0].parameters["count"])
    if count > apart:
        return found, hidden
    words = f"{hidden.words}; and whether what left {round(count)} of them empty was a lost message"
    return [f for f in found if f is not lost[0]], replace(hidden, words=words)


@dataclass(frozen=True, slots=True, eq=False)
class ArrivedInPart:
    """Stamps on arrival from some message on, or up to one; places: of these messages."""

    fault: StampFault
    places: NDArray[np.intp]


def arrived_in_part(series: Series, pace: Cadence) -> ArrivedInPart | None:
    """Where a stream's stamps become those of arrivals, or cease to be: its driver lost the
    sensor's own, or found it."""
    size = pace.places.size
    if series.receive is None or size < _LEAST_PARTS * _PART:
        return None
    late = seconds((series.receive - series.stamp)[pace.places])
    stamp = series.stamp[pace.places]
    parts = np.array_split(np.arange(size), min(_MOST_PARTS, size // _PART))
    told = [_scatter_of(seconds(stamp[part] - stamp[part[0]])) for part in parts]
    own = np.asarray([np.inf if one is None else spread(one.about_s) for one in told])
    transport = np.asarray([_width(late[part]) for part in parts])
    arrived = (own > _LEAST_JITTER_S) & (transport < _TIGHT * own)  # or of no rhythm
    sure = arrived & np.isfinite(own)
    scattered = [one for one, k in zip(told, sure, strict=True) if k]
    if len(scattered) < 2 or arrived.all() or not _late_in_most(scattered):
        return None
    usual = float(np.median(own[sure]))
    even = ~arrived & (own < _EVENER * usual) & (transport > float(np.max(transport[sure])))
    last = bool(arrived[-1])
    edge = int(np.argmax(arrived)) if last else int(np.argmin(arrived))  # of arrivals, or after
    sides = (even[: edge - 1], arrived[edge:]) if last else (arrived[:edge], even[edge + 1 :])
    if not all(side.size and side.all() for side in sides):
        return None
    parted = np.asarray([[float(late[part].min()), float(late[part].max())] for part in parts])
    mixed = np.arange(len(parts)) == (edge if last else edge - 1)  # may hold both kinds
    high, low = float(parted[sure & ~mixed, 1].max(initial=0.0)), float(parted[even, 0].min())
    turn = _turn(late > max(high, 0.5 * (low + high)), last=last)
    inside = pace.places[turn:] if last else pace.places[:turn]
    times = series.seconds[inside]
    fault = StampFault(
        "stamped_on_arrival", {"seconds": usual}, float(times[0]), float(times[-1]),
        f"{'from there' if last else 'so far'} stamps scatter by {in_words(usual)} about the "
        f"sensor's rhythm while receipts follow them closely ({inside.size} messages), and the "
        "others keep it: these say when messages came",
    )  # fmt: skip
    return ArrivedInPart(fault, inside)


def _scatter_of(when: Array) -> Waits | None:
    """How far stamps are from their rhythm, and whether late rather than early."""
    about = about_rhythm(when)
    if about is not None and _one_sided(about):
        return Waits(about, spread(about), late=True, edged=False)
    waits = waits_of(when)
    if about is None or (waits is not None and waits.late):
        return waits
    return Waits(about, spread(about), late=False, edged=False)


def _late_in_most(parts: Sequence[Waits | None]) -> bool:
    """Whether parts of a log scatter late rather than early, each or all of them together."""
    known = [part for part in parts if part is not None]
    each = sum(part.late for part in known) > 0.5 * len(known)
    return each or _one_sided(np.concatenate([part.about_s for part in known]))


def _turn(above: Mask, *, last: bool) -> int:
    """Where to part messages so that most before it are above a bound and most after it are not
    (last), or the other way round."""
    signs = np.where(above == last, 1, -1)
    return int(np.argmax(np.cumsum(signs))) + 1


def copied(about: Array | None) -> bool:
    """Whether times that are alike keep a rhythm that no arrivals keep: receipts made of stamps."""
    return about is not None and float(np.ptp(np.percentile(about, [1.0, 99.0]))) < _LEAST_JITTER_S


def _width(late: Array) -> float:
    """Interquartile range, blind to slow changes of the level."""
    return float(min(spread(late), spread(np.diff(late))))


def _follow(late: Array, about: Array) -> bool:
    """Whether receipts follow stamps far more closely than these follow the rhythm.

    Over the middle half of the messages, or over the reach of more of them: delays of a heavy tail
    have a narrow middle, against which the noise of receipts is not small.
    """
    return any(_range(late, outer) <= _TIGHT * _range(about, outer) for outer in _OUTERS)


def _range(values: Array, outer: float) -> float:
    """Between the percentiles outer and 100 - outer, blind to slow changes of the level."""
    ranges = (np.subtract(*np.percentile(v, [100.0 - outer, outer])) for v in
              (values, np.diff(values)))  # fmt: skip
    return float(min(ranges))


def _one_sided(about: Array) -> bool:
    """Whether the late half of a scatter reaches further than the early one."""
    return _skewness(about) > _SKEWED


def _skewness(about: Array) -> float:
    """By how much the late half of a scatter reaches further than the early one, of its reach."""
    low, middle, high = np.percentile(about, [_OUTER, 50.0, 100.0 - _OUTER])
    reach = float(high - low)
    return float((high - middle) - (middle - low)) / reach if reach > 0.0 else 0.0


def ahead(series: Series, known_s: float, resolution_s: float) -> StampFault | None:
    """Messages whose stamp lies after their receipt: two clocks that do not agree.

    known_s: a constant offset that already has a name; resolution_s: of either time.
    """
    if series.receive is None:
        return None
    places = series.places()
    late = seconds((series.receive - series.stamp)[places]) + known_s
    before = late < -(1e-6 + resolution_s)
    count = int(before.sum())
    if count < max(3, 0.002 * late.size):
        return None
    largest = -float(late.min())
    whole = count > 0.9 * late.size
    times = series.seconds[places[before]]
    return StampFault(
        "ahead_of_receipt", {"seconds": largest, "count": float(count)},
        None if whole else float(times[0]), None if whole else float(times[-1]),
        f"{count} of {late.size} stamps lie after their receipt, by up to {in_words(largest)}: "
        "no message comes before it was measured",
    )  # fmt: skip
