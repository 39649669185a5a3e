"""The recorder's clock, from what all its streams show at once: set, or slewed into place.

Receipts of all streams come from one clock, stamps from many.  A course of receipt minus stamp that
one stream shows and the others confirm, each besides a drift of its own, is the recorder's; it is
taken out of all receipts, and every stream is examined again without it.  Transport that all share
is no clock (`shared_transport`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.auditing.clock_shapes import Shape, straddling
from syncline_design.auditing.levels import SURE
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, Array, in_words, seconds, spread
from syncline_design.auditing.shared_transport import lasting
from syncline_design.auditing.stream import Examined, examined
from syncline_design.logs.readers.stream import UNSET, Nanoseconds
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_digits

_SHARE: Final = 0.6  # of the streams that could show a shape
_ALIKE: Final = 0.25  # of a size
_EDGE_S: Final = 0.02
_BESIDE: Final = 30  # messages that tell a level
_LEFT: Final = 0.03  # of a course: what may be left of it
_NEXT_TO: Final = 12  # messages on each side that show a jump by themselves
_NEAR_S: Final = 1.0
_MOST_NEAR: Final = 4000
_CALM: Final = 0.4  # of a jump: how far delays beside it may scatter
_TOLD: Final = 0.1  # and so that how late a message is tells its side
_KEPT: Final = 0.35  # and how near stamps keep to their rhythm
_OWN: Final = 0.5  # of a size: what stamps show themselves by so much is theirs


@dataclass(frozen=True, slots=True)
class _Course:
    """What the recorder's clock does, as receipt minus stamp; among: streams that show it."""

    shapes: tuple[Shape, ...]
    among: int


def without_recorder_clock(streams: Sequence[Examined], start: int | None) -> list[Examined]:
    """All streams examined again without what their recorder's clock did."""
    told = [one for one in streams if one.series.receive is not None]
    if len(told) < 2:
        return list(streams)
    found = _shared(told)
    if found is None:
        said = _said(told)
        return [_as_said(one, said, start) for one in streams]
    return [_again(one, found, start) if one.series.receive is not None else one for one in streams]


def _said(streams: Sequence[Examined]) -> list[StampFault]:
    """Times that receipts of most streams were seen to go back, or their levels to jump so."""
    every = [f for one in streams for f in one.faults if f.fault == "recorder_clock"]
    quiet = [one for one in streams if not any(f.fault == "recorder_clock" for f in one.faults)]
    return [
        f for f in every
        if 1 + sum(_same(f, g) for g in every) + sum(_shows(one, f) is not None for one in quiet)
        > _SHARE * len(streams)
    ]  # fmt: skip


def _shows(one: Examined, fault: StampFault) -> Shape | None:
    """The jump of a stream's levels that a clock that was set back makes."""
    size, at = -float(fault.parameters["seconds"]), fault.from_s or 0.0
    for shape in one.seen:
        near = abs(shape.begin_s - at) < 2.0 + abs(size)
        if shape.kind == "step" and near and abs(shape.size_s - size) < _ALIKE * abs(size):
            return shape
    return None


def _allows(one: Examined, fault: StampFault) -> Shape | None:
    """The jump of a clock that was set back where the stream has too few messages for its level to
    show it: they seem to be received before they were measured, from then on and by less."""
    size, at = float(fault.parameters["seconds"]), fault.from_s or 0.0
    for early in one.faults:
        if early.fault != "ahead_of_receipt" or early.from_s is None:
            continue
        near = abs(early.from_s - at) < _NEAR_S + abs(size)
        if near and 0.0 < float(early.parameters["seconds"]) <= size:
            return Shape("step", -size, begin_s=at, end_s=early.to_s or at)
    return None


def _same(one: StampFault, other: StampFault) -> bool:
    size = float(one.parameters["seconds"])
    return one is not other and (
        abs(float(other.parameters["seconds"]) - size) < _ALIKE * abs(size)
        and abs((other.from_s or 0.0) - (one.from_s or 0.0)) < 1.0 + abs(size)
    )


def _as_said(one: Examined, said: Sequence[StampFault], start: int | None) -> Examined:
    """A stream too slow for its receipts to fall, whose level shows the same jump or allows it."""
    if one.series.receive is None or any(f.fault == "recorder_clock" for f in one.faults):
        return one
    for fault in said:
        shape = _shows(one, fault) or _allows(one, fault)
        if shape is not None:
            return _again(one, _Course((shape,), 1 + len(said)), start)
    return one


def _shared(streams: Sequence[Examined]) -> _Course | None:
    """The confirmed shapes of the stream that shows most of them, the quietest first."""
    anchors = [one for one in streams if one.blocks is not None and one.seen]
    anchors.sort(key=lambda one: one.blocks.noise_s if one.blocks is not None else 0.0)
    best: _Course | None = None
    for anchor in anchors:
        others = [one for one in streams if one is not anchor]
        mine = tuple(s for s in anchor.seen if s.kind not in ("drift", "bend"))
        mine = tuple(s for s in mine if not _of_stamps(anchor, s))
        rest = tuple(s for s in anchor.seen if s.kind == "drift")
        votes = [_confirms(one, mine) for one in others]
        kept, among = [], 0
        for k, shape in enumerate(mine):
            able = [vote[k] for vote in votes if vote is not None and vote[k] is not None]
            yes = sum(bool(v) for v in able)
            if yes and 1 + yes >= _SHARE * (1 + len(able)):
                kept.append(shape)
                among = max(among, 1 + yes)
        kept = lasting(anchor.blocks, kept) if anchor.blocks is not None else kept
        if kept and (best is None or len(kept) > len(best.shapes)):
            best = _Course(tuple(kept), among)
        if best is not None and len(best.shapes) == len(mine) and not rest:
            break
    return best


def _of_stamps(one: Examined, shape: Shape) -> bool:
    """Whether the stream's stamps show the shape against their own rhythm."""
    return any(s.side == "stamp" and s.window_s > 0.0 and abs(s.at_s - shape.begin_s) < 3.0
               and abs(s.size_s) > _OWN * abs(shape.size_s) for s in one.shifts)  # fmt: skip


def _confirms(one: Examined, shapes: tuple[Shape, ...]) -> list[bool | None] | None:
    """Whether a stream shows shapes with the sizes given; None where it could not.

    Least squares of its levels by the shapes, besides a drift of its own.
    """
    blocks = one.blocks
    if blocks is None or not shapes:
        return None
    keep = blocks.usable & ~straddling(shapes, blocks.time_s, blocks.length_s)
    time_s, low = blocks.time_s[keep], blocks.low_s[keep]
    if time_s.size < len(shapes) + 6:
        return None
    line = (time_s - time_s.mean()) / float(np.ptp(time_s))
    columns = np.stack([np.ones(time_s.size), line, *(s.at(time_s) for s in shapes)], axis=1)
    sizes, sigma = _fit(columns, low, blocks.noise_s)
    votes: list[bool | None] = []
    for k, shape in enumerate(shapes):
        seen = _seen_beside(one, shape) if shape.kind == "step" else None
        if seen is not None:
            votes.append(seen)
            continue
        size, sure = float(sizes[k + 2]), float(sigma[k + 2])
        there = float(time_s[0]) < shape.begin_s < float(time_s[-1])
        if not there or sure * SURE > abs(shape.size_s) or sure <= 0.0:
            votes.append(None)
        elif _of_stamps(one, shape):
            votes.append(False)
        else:
            votes.append(abs(size - shape.size_s) < _ALIKE * abs(shape.size_s) + 3.0 * sure)
    return votes


def _seen_beside(one: Examined, shape: Shape) -> bool | None:
    """Whether the messages next to a jump show it in their receipts while stamps keep their rhythm,
    whatever else the stream has elsewhere; None where they do not tell.

    Medians of some messages on each side, so that neither their order nor one of them matters.
    """
    whole, side = one.whole, _NEXT_TO
    places = whole.places()
    if whole.receive is None or places.size < 8 * side:
        return None
    stamp, receive = (
        seconds(whole.stamp[places] - whole.start),
        seconds(whole.receive[places] - whole.start),
    )
    late = receive - stamp
    near = np.flatnonzero(np.abs(receive - shape.begin_s) <= abs(shape.size_s) + _NEAR_S)
    near = near[(near >= 3 * side) & (near < places.size - side)]
    if not near.size or near.size > _MOST_NEAR:
        return None
    moved = [float(np.median(late[k : k + side]) - np.median(late[k - side : k])) for k in near]
    at = int(near[int(np.argmax(np.abs(moved)))])
    before, after = slice(at - side, at), slice(at, at + side)
    if max(spread(late[before]), spread(late[after])) > _CALM * abs(shape.size_s):
        return None
    middle = [
        float(np.median(stamp[part])) for part in (slice(at - 2 * side, at - side), before, after)
    ]
    jumped = (middle[2] - middle[1]) - (middle[1] - middle[0])
    alike = abs(float(moved[int(at - near[0])]) - shape.size_s) < _ALIKE * abs(shape.size_s)
    if not alike:
        return None
    if abs(jumped) < _KEPT * abs(shape.size_s):
        return True
    return False if abs(jumped + shape.size_s) < _KEPT * abs(shape.size_s) else None


def _fit(columns: Array, low: Array, noise_s: float) -> tuple[Array, Array]:
    """Sizes and what they are uncertain by; levels far off weigh less (three rounds of Huber)."""
    weight: Array = np.ones(low.size)
    sizes: Array = np.zeros(columns.shape[1])
    for _ in range(4):
        root = np.sqrt(weight)
        sizes = np.asarray(np.linalg.lstsq(columns * root[:, None], low * root, rcond=None)[0])
        rest = np.abs(low - columns @ sizes)
        scale = 2.0 * max(noise_s, 1.48 * float(np.median(rest)))
        weight = np.asarray(np.minimum(1.0, scale / np.maximum(rest, 1e-12)))
    inverse = np.linalg.pinv((columns * weight[:, None]).T @ columns)
    width = max(noise_s, 1.48 * float(np.median(np.abs(low - columns @ sizes))))
    return sizes, np.sqrt(np.maximum(np.diag(inverse), 0.0)) * width


def _again(one: Examined, found: _Course, start: int | None) -> Examined:
    """The stream examined with receipts of a clock that was never touched."""
    stamps = one.stream.stamps
    assert stamps is not None
    assert stamps.secondary_ns is not None
    receive = stamps.secondary_ns
    known = (receive != UNSET) & (stamps.primary_ns != UNSET)
    moved: Array = np.zeros(receive.size)
    times = (receive[known] - one.raw.start) / NS
    late = (receive[known] - _continuous(one)[known]) / NS
    total: Array = np.zeros(times.size)
    for shape in found.shapes:
        total = total + _moved(shape, times, late)
    moved[known] = np.round(total * NS)
    put_back = replace(
        stamps, secondary_ns=np.where(known, receive - moved.astype(np.int64), receive)
    )
    new = examined(replace(one.stream, stamps=put_back), start)
    residual = new.residual
    if residual.as_recorded is not None and one.residual.as_recorded is not None:
        most = max(residual.as_recorded, one.residual.as_recorded)
        residual = replace(residual, as_recorded=most)
    end = float(one.raw.seconds[one.raw.good][-1]) if one.raw.good.any() else 0.0
    kept = tuple(f for f in new.faults if not _is_left(f, found.shapes))
    faults = (*kept, *(_fault(shape, found.among, end) for shape in found.shapes))
    return replace(new, stream=one.stream, raw=one.raw, trace=one.trace, offset_s=one.offset_s,
                   residual=residual, faults=faults)  # fmt: skip


def _continuous(one: Examined) -> Nanoseconds:
    """Stamps of one unit whose counters never begin anew, in the order of the file."""
    stamps = one.stream.stamps
    assert stamps is not None
    assert stamps.secondary_ns is not None
    assert one.raw.receive is not None
    of_file = np.lexsort((stamps.primary_ns, stamps.secondary_ns))
    of_raw = np.lexsort((one.raw.stamp, one.raw.receive))
    found = np.empty_like(stamps.primary_ns)
    found[of_file] = one.whole.stamp[of_raw]
    return found


def _moved(shape: Shape, times: Array, late: Array) -> Array:
    """By how much each receipt is moved [s]; a step begins with the message that parts them best.

    A clock that is set back tells some times twice, one that is set forward leaves some out.
    """
    if shape.kind != "step":
        return shape.size_s * shape.at(times)
    usual = float(np.median(np.diff(times))) if times.size > 1 else 0.0
    width = abs(shape.size_s) + 3.0 * usual + _EDGE_S
    near = np.flatnonzero(np.abs(times - shape.begin_s) <= width)
    if near.size < 2:
        return shape.size_s * shape.at(times)
    first, last = int(near[0]), int(near[-1]) + 1
    around = late[max(0, first - _BESIDE) : first]
    level = float(np.median(around if around.size else late[last : last + _BESIDE] - shape.size_s))
    part = late[first:last] - level
    before, after = np.abs(part), np.abs(part - shape.size_s)
    cost = np.concatenate([[0.0], np.cumsum(before)])
    cost += np.concatenate([np.cumsum(after[::-1])[::-1], [0.0]])
    new = np.arange(times.size) >= first + int(np.argmin(cost))
    if around.size and spread(around) < _TOLD * abs(shape.size_s):  # each message by itself
        sure = np.minimum(before, after) < 2.0 * _TOLD * abs(shape.size_s)
        new[first:last] = np.where(sure, after < before, new[first:last])
    return np.where(new, shape.size_s, 0.0)


def _is_left(fault: StampFault, shapes: Sequence[Shape]) -> bool:
    """Whether a small shift is what the recorder's course was not followed by."""
    if fault.fault not in ("step", "relock") or fault.from_s is None:
        return False
    size = abs(float(fault.parameters["seconds"]))
    return any(s.begin_s - 3.0 < fault.from_s < s.end_s + 3.0 and size < _LEFT * abs(s.size_s)
               for s in shapes if s.kind != "step")  # fmt: skip


def _fault(shape: Shape, among: int, end_s: float) -> StampFault:
    size = -shape.size_s
    by = f"receipts of {among} streams shift by {in_words(abs(size))} "
    keep = "while stamps keep their rhythm: the recorder's clock was "
    if shape.kind == "ramp":
        length = shape.end_s - shape.begin_s
        ppm = 1e6 * size / length
        return StampFault(
            "recorder_clock", {"seconds": size, "ppm": ppm, "kind": "slew"}, shape.begin_s,
            shape.end_s, f"{by}within {to_digits(length, 3)} s ({to_digits(abs(ppm), 4)} ppm), "
                         f"{keep}slewed",
        )  # fmt: skip
    kind = "step" if shape.kind in ("step", "episode") else "slew"
    stop = shape.end_s if shape.kind == "episode" else end_s
    return StampFault(
        "recorder_clock", {"seconds": size, "kind": kind}, shape.begin_s, stop,
        f"{by}at the same time, {keep}{'set' if kind == 'step' else 'slewed'}",
    )  # fmt: skip
