"""Which of several sources the figures rest on, and what a chain of two adds up to."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.clocks.chrony import TRACKING, UNSET, is_refclock
from syncline_design.clocks.disagreement import disagreeing
from syncline_design.clocks.files import refused
from syncline_design.clocks.linuxptp import FOLLOWS_SYSTEM, SYSTEM
from syncline_design.clocks.ntpd import LOOPSTATS
from syncline_design.clocks.peers import bounded_by_peers, unlike_their_peers
from syncline_design.clocks.result import ClockEntryKind
from syncline_design.clocks.series import Array, ClockSeries
from syncline_design.clocks.sessions import sessions_of
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import percent

SIGNS: Final = {
    "chrony tracking": "local - reference in the log",
    "chrony statistics": "local - reference in the log",
    "chrony measurements": "reference - local in the log, turned",
    "chrony refclock": "reference - local in the log, turned",
    "ntpd loopstats": "reference - local in the log, turned",
    "ntpd peerstats": "reference - local in the log, turned",
    "gpsd": "clock - real in the log",
    "ppstest": "clock - whole second in the log",
    "CSV": "local - reference by the column's name",
}
MOST_NAMED: Final = 4  # of masters
COVERED: Final = 0.99  # of a refclock's rows, that a tracking log has to be about
LONGEST_POLL_S: Final = 2048.0  # twice chrony's default maxpoll of 10
_LINUXPTP_SIGN: Final = "local - reference in the log"


@dataclass(frozen=True, slots=True)
class SourceSelection:
    """Series of the source that is used, all others, and what has to be said of the choice.

    doubts: where what is used and what it was made from disagree.  reservations: where others
    disagree.
    """

    used: tuple[ClockSeries, ...]
    others: tuple[ClockSeries, ...]
    notes: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    reservations: tuple[str, ...] = ()


def sign_of(name: str) -> str:
    """In which sign the source writes its offsets."""
    return next((sign for start, sign in SIGNS.items() if name.startswith(start)), _LINUXPTP_SIGN)


def select(
    series: Sequence[ClockSeries], wanted: str | None, kind: ClockEntryKind, first: Path
) -> SourceSelection:
    """The source asked for, or the one that says most of the clock; refused where none does."""
    series = [*bounded_by_peers(series), *_chained(series)]
    names = list(dict.fromkeys(one.kind.name for one in series))
    if wanted is not None:
        chosen = [name for name in names if name == wanted] or [
            name for name in names if wanted.lower() in name.lower()
        ]
        if len(chosen) != 1:
            found = "no such source" if not chosen else "several sources of that name"
            raise refused(first, f"--source {wanted}: {found}", expected="one of the sources",
                          found=", ".join(names))  # fmt: skip
        return _split(series, chosen[0], _what_phc2sys_compares(chosen[0]))
    usable = [one for one in series if kind == "timestamping" or not _is_serial(one)]
    if not usable:
        raise refused(
            first, "gpsd TOFF alone holds the latency of the serial line: no evidence of the clock",
            expected="PPS messages too",
            hint="--entry timestamping makes a method of it: stamping on arrival",
        )  # fmt: skip
    usable = [one for one in usable if kind == "timestamping" or not _follows_system(one)]
    if not usable:
        raise refused(
            first, "phc2sys `sys offset` tells how well a card follows the system clock: no "
            "evidence of the system clock itself",
            expected="what disciplines the system clock (chrony, ntpd, phc2sys `phc offset`)",
            found=", ".join(names),
            hint="`timing --source NAME` takes it for a clock all the same; "
            "--entry timestamping makes a method of it",
        )  # fmt: skip
    families = sorted({one.kind.family for one in usable})
    if len(families) > 1:
        raise refused(first, "several kinds of logs that say different things of a clock",
                      found=", ".join(names), expected="logs of one kind",
                      hint="give those of one kind, or `timing --source NAME`")  # fmt: skip
    if kind == "clock":
        usable = _of_one_clock(usable, first)
    return _ranked(usable, series)


def _of_one_clock(usable: Sequence[ClockSeries], first: Path) -> list[ClockSeries]:
    """Of several clocks that phc2sys steers the host's own: others are no evidence of that."""
    steered = list(dict.fromkeys(one.kind.name for one in usable if _is_steered(one)))
    if SYSTEM not in steered and len(steered) > 1:
        raise refused(first, "phc2sys steers several cards, and which clock is meant is not said",
                      found=", ".join(steered), expected="one clock",
                      hint="`timing --source NAME` takes one of them")  # fmt: skip
    cards = [name for name in steered if name != SYSTEM and SYSTEM in steered]
    return [one for one in usable if one.kind.name not in cards]


def _is_steered(one: ClockSeries) -> bool:
    return one.kind.name.startswith("phc2sys")


def _is_serial(one: ClockSeries) -> bool:
    return one.kind.family == "gpsd" and one.kind.reference == "TOFF"


def _follows_system(one: ClockSeries) -> bool:
    """A card that is steered by the system clock, as where the host is the grandmaster."""
    return one.kind.name.startswith("phc2sys") and one.kind.name.endswith(FOLLOWS_SYSTEM)


def _ranked(usable: Sequence[ClockSeries], series: Sequence[ClockSeries]) -> SourceSelection:
    usable, notes = _independent_refclocks(usable)
    by_hand = {one.kind.name: one for one in usable}
    best = min(one.kind.rank for one in by_hand.values())
    names = [name for name, one in by_hand.items() if one.kind.rank == best]
    steering = [n for n in names if any(n.endswith(" " + r) for s in usable for r in s.references)]
    if steering and len(names) > 1:
        names = steering
    if len(names) > 1:
        largest = {name: _level([s for s in usable if s.kind.name == name]) for name in names}
        names.sort(key=lambda name: -largest[name])
        notes.append(f"of {len(names)} sources alike, {names[0]} has the largest offsets and is "
                     "used; `timing --source NAME` takes another")  # fmt: skip
    notes += _what_phc2sys_compares(names[0])
    kept = {s.kind.name: s for s in usable}
    series = [replace(s, kind=kept[s.kind.name].kind) if s.kind.name in kept else s for s in series]
    return _split(series, names[0], tuple(notes))


def _what_phc2sys_compares(name: str) -> tuple[str, ...]:
    """What has to be said of it where it is used."""
    if not name.startswith("phc2sys"):
        return ()
    if name == SYSTEM:
        return ("phc2sys compares the system clock with the card: how far the card is from the "
                "reference (ptp4l, ts2phc) is not in these logs",)  # fmt: skip
    with_what = "the system clock" if name.endswith(FOLLOWS_SYSTEM) else "another clock"
    return (f"{name}: a card that is compared with {with_what}; how far either is from the "
            "reference, and the host's clock from either, is not in these logs",)  # fmt: skip


def _level(series: Sequence[ClockSeries]) -> float:
    offsets = np.concatenate([one.offset_s[one.locked] for one in series])
    offsets = offsets[np.isfinite(offsets)]
    return float(np.quantile(np.abs(offsets), 0.95)) if offsets.shape[0] else 0.0


def _independent_refclocks(series: Sequence[ClockSeries]) -> tuple[list[ClockSeries], list[str]]:
    """Reference clocks that the tracking log never names: marked `noselect`, they steer nothing.

    Only where the tracking log is of their whole time: before or after it, they may have steered.
    """
    tracked = [one for one in series if one.kind.name == "chrony tracking"]
    references = frozenset[str]().union(*(one.references for one in tracked))
    found, notes = [], []
    for one in series:
        unnamed = one.kind.name.startswith("chrony refclock") and (
            one.kind.reference not in references
        )
        if tracked and unnamed:
            covered = _covered(one, tracked)
            if covered >= COVERED and (more := _combined(tracked, series)):
                notes.append(f"{one.kind.name}: the tracking log combines up to {more} sources "
                             "(Co), more than the servers that these logs name: it may be one of "
                             "them, and steer (statistics.log names them all)")  # fmt: skip
                one = replace(one, kind=replace(one.kind, steering="unknown"))
            elif covered >= COVERED:
                notes.append(f"{one.kind.name} steers nothing by the tracking log: independent")
                kind = replace(one.kind, steering="independent", rank=0, whole_way=True)
                one = replace(one, kind=kind)
            else:
                share = percent(covered, 2)
                notes.append(f"{one.kind.name}: the tracking log is of {share} of its rows; what "
                             "steered the clock else is not in these logs")  # fmt: skip
        found.append(one)
    return found, list(dict.fromkeys(notes))


def _combined(tracked: Sequence[ClockSeries], series: Sequence[ClockSeries]) -> int:
    """How many sources the tracking log combines, where that is more than are named; else 0."""
    servers = {r for one in tracked for r in one.references if not is_refclock(r)} - {UNSET}
    servers |= {one.kind.reference for one in series
                if one.kind.name.startswith(("chrony statistics", "chrony measurements"))
                and not is_refclock(one.kind.reference)}  # fmt: skip
    counts = np.concatenate([one.combined[one.locked] for one in tracked])
    most = int(np.max(counts, initial=0.0))
    return most if most > max(1, len(servers)) else 0


def _covered(one: ClockSeries, tracked: Sequence[ClockSeries]) -> float:
    """The share of rows that have a row of the tracking log about them."""
    times = np.sort(np.concatenate([log.time_s for log in tracked]))
    if times.shape[0] < 2 or not len(one):
        return 0.0
    reach = max(10.0 * float(np.median(np.diff(times))), LONGEST_POLL_S)
    return float(np.mean(_apart_s(one.time_s, times, _after(one.time_s, times)) <= reach))


def _after(asked_s: Array, known_s: Array) -> NDArray[np.int64]:
    """Of each moment the known one that follows it; known_s: two or more, in order."""
    return np.clip(np.searchsorted(known_s, asked_s), 1, known_s.shape[0] - 1)


def _apart_s(asked_s: Array, known_s: Array, after: NDArray[np.int64]) -> Array:
    """How far the nearest known moment is [s], of that after and the one before it."""
    nearest: Array = np.minimum(
        np.abs(asked_s - known_s[after - 1]), np.abs(known_s[after] - asked_s)
    )
    return nearest


def _split(series: Sequence[ClockSeries], name: str, notes: tuple[str, ...]) -> SourceSelection:
    used = tuple(_by_own_reference(one) for one in series if one.kind.name == name)
    notes = (*notes, *_follows(used))
    others = tuple(one for one in series if one.kind.name != name)
    loops = [one for one in used if one.kind == LOOPSTATS]
    apart = dict(disagreeing((*used, *others)))
    doubted = (*unlike_their_peers(loops, others), *(s for n, s in apart.items() if n == name))
    reserved = tuple(said for other, said in apart.items() if other != name)
    return SourceSelection(used, others, notes, doubted, reserved)


def _by_own_reference(one: ClockSeries) -> ClockSeries:
    """A tracking log of a clock that follows a pulse: no path bounds the pulse's cable or edge."""
    if one.kind != TRACKING or not any(map(is_refclock, one.references)):
        return one
    return replace(one, kind=replace(one.kind, whole_way=False))


def _follows(used: Sequence[ClockSeries]) -> Iterator[str]:
    own = sorted({r for one in used if one.kind.name == TRACKING.name for r in one.references
                  if is_refclock(r)})  # fmt: skip
    if own:
        yield (f"the clock follows its own reference ({', '.join(own)}): an error of that one (its "
               "cable, edge or receiver) shows in none of its offsets")  # fmt: skip
    masters = sorted({r for one in used if one.kind.family == "linuxptp" for r in one.references})
    if len(masters) > 1:
        yield (f"the master changes ({', '.join(masters[:MOST_NAMED])}"
               f"{', ...' if len(masters) > MOST_NAMED else ''}): offsets are against whichever "
               "it was, and how far these are from one another is none of the claim")  # fmt: skip
    cards = [one for one in used if one.kind.family == "linuxptp" and not one.kind.of_host]
    if cards and cards[0].kind.name.startswith(("ptp4l", "ts2phc")):
        yield (f"{cards[0].kind.name} tells of a card, or does not say of what: how far the "
               "host's clock is from it is phc2sys' to say")  # fmt: skip


def _chained(series: Sequence[ClockSeries]) -> list[ClockSeries]:
    """The system clock against the reference: phc2sys (system - card) + ptp4l or ts2phc (card -
    reference), where both are there."""
    system = [s for s in series if s.kind.name == SYSTEM]
    for program in ("ptp4l", "ts2phc"):
        cards = [s for s in series if s.kind.name.startswith(program)]
        names = {s.kind.name for s in cards}
        if system and names:
            busiest = max(names, key=lambda n: sum(len(s) for s in cards if s.kind.name == n))
            pairs = _pairs(system, [s for s in cards if s.kind.name == busiest])
            sums = [_sum(one, card) for one, card in pairs]
            return [one for one in sums if one is not None]
    return []


def _pairs(
    system: Sequence[ClockSeries], cards: Sequence[ClockSeries]
) -> list[tuple[ClockSeries, ClockSeries]]:
    """Runs of both that belong together: of one file, or in the order of the files."""
    found = []
    for index, one in enumerate(system):
        same = [card for card in cards if card.files == one.files]
        card = same[0] if same else cards[index] if len(cards) == len(system) else None
        if card is None:
            continue
        halves = [[x.series for x in sessions_of(s, np.inf)] for s in (one, card)]
        if len(halves[0]) == len(halves[1]):
            found += list(zip(halves[0], halves[1], strict=True))
    return found


def _sum(system: ClockSeries, card: ClockSeries) -> ClockSeries | None:
    """Offsets and hard bounds added; in lock only where both are, and where the card was heard.

    Where either tells a size alone, sizes are added: signs that are not known may be the same.
    """
    known = card.part(np.isfinite(card.offset_s))
    if len(known) < 2:
        return None
    after = _after(system.time_s, known.time_s)
    apart = _apart_s(system.time_s, known.time_s, after)
    locked = known.locked[after] & known.locked[after - 1]
    reach = max(10.0 * float(np.median(np.diff(known.time_s))), 1.0)
    kind = replace(system.kind, name=f"CLOCK_REALTIME by phc2sys and {card.kind.name}", rank=0,
                   steering=card.kind.steering, whole_way=card.kind.whole_way)  # fmt: skip
    own, others = system.offset_s, np.interp(system.time_s, known.time_s, known.offset_s)
    unsigned = system.unsigned | known.unsigned[after] | known.unsigned[after - 1]
    begin = np.zeros(len(system), dtype=bool)
    begin[:1] = True
    files = tuple(dict.fromkeys((*system.files, *card.files)))
    return replace(
        system, kind=kind, files=files, restart=begin, references=card.references,
        locked=system.locked & locked & (apart <= reach),
        offset_s=np.where(unsigned, np.abs(own) + np.abs(others), own + others),
        unsigned=unsigned,
        hard_s=system.hard_s + np.interp(system.time_s, known.time_s, known.hard_s),
    )  # fmt: skip
