"""Times that the recorder's clock was set back, which its streams show by how quick they are.

Receipts of a stream go back where its messages come more often than the clock was set by, and say
so of themselves (`receipts`).  Receipts of all streams come from one clock: how late the others'
messages are beside that moment confirms it or speaks against it, a few of them are enough.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from syncline_design.auditing.clock_shapes import Shape
from syncline_design.auditing.result import StampFault
from syncline_design.auditing.series import NS, Array, Mask, in_words, spread
from syncline_design.auditing.stream import Examined
from syncline_design.logs.readers.stream import UNSET, Nanoseconds
from syncline_design.machine.quick_dataclass import dataclass

_SHARE: Final = 0.6  # of the streams that could show it
_ALIKE: Final = 0.25  # of a size
_NEAR_S: Final = 1.0
_BESIDE: Final = 30  # messages that tell a level
_FEWEST: Final = 4
_SURE: Final = 5.0  # sigma
_MEDIAN: Final = 1.25  # sigma of a median over that of a mean
_LEAST_S: Final = 1e-6


@dataclass(frozen=True, slots=True)
class SetBack:
    """at_s: the last receipt before it; size_s: by how much; among: streams that show it."""

    at_s: float
    size_s: float
    among: int

    @property
    def shape(self) -> Shape:
        return Shape("step", -self.size_s, begin_s=self.at_s, end_s=self.at_s)

    def fault(self, end_s: float) -> StampFault:
        return StampFault(
            "recorder_clock", {"seconds": self.size_s, "kind": "step"}, self.at_s, end_s,
            f"receipts of {self.among} streams go back and stay behind by "
            f"{in_words(self.size_s)}, while stamps keep their rhythm: the recorder's clock was "
            "set",
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class _Said:
    """A stream whose receipts go back, and by how much."""

    stream: int
    at_s: float
    size_s: float


def shared_set_backs(streams: Sequence[Examined]) -> tuple[SetBack, ...]:
    """Times that receipts of a stream go back and that those which could show it show as well."""
    groups = _groups(
        _Said(k, fault.from_s, float(fault.parameters["seconds"]))
        for k, one in enumerate(streams) for fault in one.faults
        if fault.fault == "recorder_clock" and fault.from_s is not None
    )  # fmt: skip
    known = [times_and_lateness(one, received(one)) for one in streams] if groups else []
    backs = (_confirmed(group, known) for group in groups)
    return tuple(back for back in backs if back is not None)


def _groups(said: Iterator[_Said]) -> list[list[_Said]]:
    """What several streams say of one moment, in the order of time."""
    groups: list[list[_Said]] = []
    for one in sorted(said, key=lambda one: one.at_s):
        for group in groups:
            if _same(group[0], one) and all(one.stream != other.stream for other in group):
                group.append(one)
                break
        else:
            groups.append([one])
    return groups


def _same(one: _Said, other: _Said) -> bool:
    return abs(one.size_s - other.size_s) < _ALIKE * abs(one.size_s) and (
        abs(one.at_s - other.at_s) < _NEAR_S + abs(one.size_s)
    )


def _confirmed(group: Sequence[_Said], known: Sequence[tuple[Array, Array]]) -> SetBack | None:
    """One size and moment for all: of the surest stream, and of the last receipt before it."""
    at = max(one.at_s for one in group)
    sized = {one.stream: one for one in group}
    levels = {k: _levels(*known[k], at, group[0].size_s) for k in range(len(known))}
    surest = min(sized.values(), key=lambda one: _sigma(levels[one.stream]))
    size = surest.size_s
    votes = [True if k in sized else _agrees(levels[k], size) for k in range(len(known))]
    yes = sum(vote is True for vote in votes)
    able = sum(vote is not None for vote in votes)
    return SetBack(at, size, yes) if yes >= _SHARE * able and len(known) > 1 else None


def _levels(times: Array, late: Array, at_s: float, size_s: float) -> tuple[Array, Array]:
    """How late messages are before and after; receipts between are told twice."""
    before = late[times < at_s - size_s - _LEAST_S][-_BESIDE:]
    after = late[times > at_s + _LEAST_S][:_BESIDE]
    return before, after


def _sigma(levels: tuple[Array, Array]) -> float:
    """How sure a stream is of the jump between two levels [s]."""
    if min(side.size for side in levels) < _FEWEST:
        return np.inf
    wide = [max(spread(side), _LEAST_S) / np.sqrt(side.size) for side in levels]
    return float(_MEDIAN * np.hypot(*wide))


def _agrees(levels: tuple[Array, Array], size_s: float) -> bool | None:
    """Whether how late messages are shows the jump; None where it could not."""
    sigma = _sigma(levels)
    if _SURE * sigma > size_s:
        return None
    before, after = levels
    moved = float(np.median(before) - np.median(after))
    return abs(moved - size_s) < _ALIKE * size_s + 3.0 * sigma


def received(one: Examined) -> Mask:
    """Messages with both times, in the order of the file."""
    stamps = one.stream.stamps
    assert stamps is not None
    assert stamps.secondary_ns is not None
    found: Mask = (stamps.secondary_ns != UNSET) & (stamps.primary_ns != UNSET)
    return found


def times_and_lateness(one: Examined, known: Mask) -> tuple[Array, Array]:
    """When messages were received, and how long after their stamps [s], in the file's order."""
    stamps = one.stream.stamps
    assert stamps is not None
    assert stamps.secondary_ns is not None
    receive = stamps.secondary_ns
    times = (receive[known] - one.raw.start) / NS
    return times, (receive[known] - _continuous(one)[known]) / NS


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
