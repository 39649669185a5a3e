"""What is odd in the runs of a store and is no change of an effect."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.run_records import Change
from syncline_design.campaign.store import Entry
from syncline_design.campaign.strangers import share_of
from syncline_design.diagnosis.finding import texts_of
from syncline_design.diagnosis.result import UnlikeOthers
from syncline_design.machine.sentences import sentence_list
from syncline_design.model.figure_text import (
    format_chance,
    format_estimate,
    to_digits,
)
from syncline_design.model.quantity import split_suffix

DIFFERS: Final = 0.01  # chance, over all looks, that runs of one value are said to differ
NOISIER: Final = 1.5  # times the median of the runs before
KNOWN: Final = 2  # runs from which a date long before theirs is odd
LONG_BEFORE_S: Final = 30 * 86_400.0  # that an older log may be added late by without a word
DAY_S: Final = 86_400.0
MOST_LOST: Final = 0.1  # share of the rows of a run
MOST_BARE: Final = 5  # runs without a date that are named


def cautions(
    runs: Sequence[Entry],
    doubted: Entry | None,
    unlike: Sequence[UnlikeOthers],
    changes: Changes,
    seen: Sequence[Change],
    stage: Callable[[int], str],
) -> Iterator[str]:
    """In sentences without their full stop.

    runs: of the last baseline, in the order in which they are compared; doubted: the run after
    which a kept look says what its runs do not; unlike: runs that are unlike the others; changes:
    of those that are compared; seen: changes that are alarms; stage: names of stages.
    """
    if not runs:
        return
    if doubted is not None:
        yield (
            f"what the store kept of the look after run {doubted.number} is not what its "
            "runs say: all looks were computed anew from the runs"
        )
    yield from _contradicted(runs)
    yield from _unlike(unlike, (runs[0].number, runs[-1].number))
    yield from _of_the_last(runs)
    yield from _undated(runs)
    yield from _dated_long_before(runs)
    yield from _differing(changes, seen, changes.pool.count, stage)


def _contradicted(runs: Sequence[Entry]) -> Iterator[str]:
    """Runs beyond the platform's limits, or whose columns are not of one motion."""
    for entry in runs:
        if entry.run.checks:
            said = "; ".join(check.message for check in entry.run.checks)
            yield (
                f"run {entry.number} ({', '.join(entry.run.files)}): {said}; if it is another "
                f"vehicle's log: {_leave_out(entry.number)}"
            )


def _unlike(unlike: Sequence[UnlikeOthers], ends: tuple[int, int]) -> Iterator[str]:
    """Runs that are unlike all the others, with every effect in which they are; ends: numbers of
    the first run and of the last, of which a change says as much."""
    for number in dict.fromkeys(one.number for one in unlike):
        own = [one for one in unlike if one.number == number]
        effects = "; ".join(map(departure_words, own))
        change = ("a change after it, ", "a change since then, as the next run will tell, ")
        since = change[ends.index(number)] if number in ends else ""
        yield (
            f"run {number} ({', '.join(own[0].files)}) is unlike the others: {effects}, all runs "
            f"and effects counted; that is {since}another vehicle's log or one odd day: "
            f"{_leave_out(number)}"
        )


def departure_words(one: UnlikeOthers) -> str:
    """`latency (position) by 7.4 ± 0.6 ms (chance by noise alone 1e-12)`."""
    texts = texts_of(one.differs)
    alone = len(one.differs) == 1
    parts = [("" if alone else f"{split_suffix(name)[0].replace('_', ' ')} ") + f"by {texts[name]}"
             for name, own in one.differs.items() if own.seen]  # fmt: skip
    return (
        f"{one.effect.replace('_', ' ')} ({one.sensor}){' ' if alone else ', '}"
        f"{sentence_list(parts)} (chance by noise alone {format_chance(one.log10_chance)})"
    )


def _leave_out(number: int) -> str:
    return f"`watch STORE --leave-out {number} --reason TEXT` counts it no more"


def _undated(runs: Sequence[Entry]) -> Iterator[str]:
    """Runs without a date among dated ones, for which the order of adding counts."""
    bare = [entry for entry in runs if entry.run.date is None]
    if not bare or len(bare) == len(runs):
        return
    names = sentence_list(
        [f"{one.number} ({', '.join(one.run.files)})" for one in bare[:MOST_BARE]]
    )
    more = f" and {len(bare) - MOST_BARE} more" if len(bare) > MOST_BARE else ""
    yield (
        f"run{'s'[: len(bare) != 1]} {names}{more} has no date, and the others have one: all are "
        "compared in the order of adding, which is a guess where a log came in late; give the "
        "log calendar times (UTC), or leave it out"
    )


def _of_the_last(runs: Sequence[Entry]) -> Iterator[str]:
    """What its diagnosis could not explain, and noise that grew."""
    *earlier, last = runs
    run = last.run
    lost = sum(run.rejected.values())
    if lost > MOST_LOST * run.rows:
        why = ", ".join(f"{reason}: {count}" for reason, count in run.rejected.items())
        yield (
            f"of {run.rows} rows of run {last.number} ({', '.join(run.files)}) {lost} were left "
            f"out ({why}): it tells of the others alone"
        )
    if run.left_material and not run.checks:
        yield (
            f"run {last.number} ({run.files[0]}) is unexplained alone: something in it is not "
            "in the dictionary, or the log contradicts itself; see `diagnose`"
        )
    for sensor, factor in run.white_factor.items():
        own = [e.run.white_factor[sensor] for e in earlier if sensor in e.run.white_factor]
        if own and factor > NOISIER * float(np.median(own)):
            yield (
                f"noise of {sensor.replace('/', ', ')} in run {last.number} is "
                f"{to_digits(factor / float(np.median(own)), 2)} times that of the runs before"
            )


def _dated_long_before(runs: Sequence[Entry]) -> Iterator[str]:
    """Runs that were added after others and are dated long before all of them.

    A clock that is not set yet puts them first, and what they differ by seems to be a change of
    all the others.
    """
    if any(entry.run.date is None for entry in runs):
        return
    for entry in runs:
        known = [one.run.first_s for one in runs if one.number < entry.number]
        if len(known) < KNOWN:
            continue
        early_s = min(known) - entry.run.first_s
        if early_s > max(LONG_BEFORE_S, max(known) - min(known)):
            yield (
                f"run {entry.number} ({entry.run.files[0]}) is dated {entry.run.date}, "
                f"{to_digits(early_s / DAY_S, 3)} days before all that were added before it, and "
                "is taken for what came first: is its clock right? If not: "
                f"{_leave_out(entry.number)}"
            )


def _differing(
    changes: Changes, seen: Sequence[Change], look: int, stage: Callable[[int], str]
) -> Iterator[str]:
    """Effects that have another value in every run: no change, and nothing to count on."""
    changes = changes.without(*seen)  # what moves along with a change is told by it
    told = {one.term.label for one in seen}
    for found in changes.differing(look):
        term = found.named
        if term.label in told or found.log_p > math.log(DIFFERS * share_of(look)):
            continue
        sizes = " and ".join(
            format_estimate(float(to_digits(float(size), 2)), None, one.unit)
            for size, one in zip(found.spread, term.effect.slopes(), strict=True)
        )
        words = f"{term.effect.name.replace('_', ' ')} ({term.sensor})"
        yield (
            f"{words} of {stage(term.stage)} "
            f"has another value in every run: they differ by {sizes} (standard deviation) more "
            "than noise, which is no change since a run, and no one value of the build"
        )
