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
from syncline_design.auditing.series import NS, Array, Mask, in_words, seconds, spread
from syncline_design.auditing.set_back import (
    SetBack,
    received,
    shared_set_backs,
    times_and_lateness,
)
from syncline_design.auditing.shared_transport import lasting
from syncline_design.auditing.stream import Examined, examined
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
    """What the recorder's clock does, as receipt minus stamp; among: streams that show it.

    backs: times that it was set back, in receipts as they are; shapes: what it does besides, in
    receipts that were put forward by these.
    """

    backs: tuple[SetBack, ...]
    shapes: tuple[Shape, ...]
    among: int = 0


def without_recorder_clock(streams: Sequence[Examined], start: int | None) -> list[Examined]:
    """All streams examined again without what their recorder's clock did.

    A time that it was set back shows in the receipts of quick streams alone, and is taken out of
    all before anything else that they share is looked for.
    """
    told = [one for one in streams if one.series.receive is not None]
    if len(told) < 2:
        return list(streams)
    backs = shared_set_backs(told)
    once = _all_again(streams, _Course(backs, ()), start) if backs else list(streams)
    shapes, among = _shared([one for one in once if one.series.receive is not None])
    return _all_again(streams, _Course(backs, shapes, among), start) if shapes else once


def _all_again(streams: Sequence[Examined], found: _Course, start: int | None) -> list[Examined]:
    return [_again(one, found, start) if one.series.receive is not None else one for one in streams]


def _shared(streams: Sequence[Examined]) -> tuple[tuple[Shape, ...], int]:
    """The confirmed shapes of the stream that shows most of them, the quietest first, and how many
    streams show one."""
    anchors = [one for one in streams if one.blocks is not None and one.seen]
    anchors.sort(key=lambda one: one.blocks.noise_s if one.blocks is not None else 0.0)
    best: tuple[tuple[Shape, ...], int] = (), 0
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
        if anchor.blocks is not None:
            kept = lasting(anchor.blocks, kept, [s for s in kept if _is_sharp(streams, s)])
        if len(kept) > len(best[0]):
            best = tuple(kept), among
        if best[0] and len(best[0]) == len(mine) and not rest:
            break
    return best


def _is_sharp(streams: Sequence[Examined], shape: Shape) -> bool:
    """Whether receipts jump from one message to the next, in a stream that tells it."""
    return shape.kind == "step" and any(_seen_beside(one, shape) is True for one in streams)


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
    receive, known = stamps.secondary_ns, received(one)
    moved: Array = np.zeros(receive.size)
    moved[known], faults = _course_of(one, found, known)
    put_back = replace(
        stamps,
        secondary_ns=np.where(known, receive - np.round(moved * NS).astype(np.int64), receive),
    )
    new = examined(replace(one.stream, stamps=put_back), start)
    residual = new.residual
    if residual.as_recorded is not None and one.residual.as_recorded is not None:
        most = max(residual.as_recorded, one.residual.as_recorded)
        residual = replace(residual, as_recorded=most)
    kept = tuple(f for f in new.faults if not _is_left(f, found.shapes))
    return replace(new, stream=one.stream, raw=one.raw, trace=one.trace, offset_s=one.offset_s,
                   residual=residual, faults=(*kept, *faults))  # fmt: skip


def _course_of(one: Examined, found: _Course, known: Mask) -> tuple[Array, list[StampFault]]:
    """By how much each receipt is moved [s], and what of it lies within the stream's time."""
    times, late = times_and_lateness(one, known)
    total: Array = np.zeros(times.size)
    backs = []
    for back in found.backs:
        moved = _moved(back.shape, times, late - total)
        backs += [back] if np.any(moved == 0.0) and np.any(moved != 0.0) else []
        total = total + moved
    forward, behind = times - total, late - total
    end = float(forward.max()) if forward.size else 0.0
    faults = [back.fault(end) for back in backs]
    for shape in found.shapes:
        total = total + _moved(shape, forward, behind)
        faults.append(_fault(shape, found.among, end))
    return total, faults


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
    around, level = _beside(late, first, last, shape.size_s)
    part = late[first:last] - level
    before, after = np.abs(part), np.abs(part - shape.size_s)
    cost = np.concatenate([[0.0], np.cumsum(before)])
    cost += np.concatenate([np.cumsum(after[::-1])[::-1], [0.0]])
    new = np.arange(times.size) >= first + int(np.argmin(cost))
    if around.size and spread(around) < _TOLD * abs(shape.size_s):  # each message by itself
        sure = np.minimum(before, after) < 2.0 * _TOLD * abs(shape.size_s)
        new[first:last] = np.where(sure, after < before, new[first:last])
    return np.where(new, shape.size_s, 0.0)


def _beside(late: Array, first: int, last: int, size_s: float) -> tuple[Array, float]:
    """Messages that tell the level before a jump between these places, and that level."""
    if first:
        around = late[max(0, first - _BESIDE) : first]
        return around, float(np.median(around))
    if last < late.size:
        around = late[last : last + _BESIDE] - size_s
        return around, float(np.median(around))
    around = late[:_BESIDE]  # of which side is told by all
    one, part = float(np.median(around)), late[:, None]
    left = [
        np.abs(part - (level, level + size_s)).min(axis=1).sum() for level in (one, one - size_s)
    ]
    level = one if left[0] <= left[1] else one - size_s
    return around, level


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
