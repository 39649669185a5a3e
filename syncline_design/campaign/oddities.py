"""What is odd in the runs of a store and is no change of an effect."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np

from syncline_design.campaign.changes import Change, Changes
from syncline_design.campaign.store import Entry
from syncline_design.model.figure_text import format_estimate, to_digits

DIFFERS: Final = 0.01  # chance, over all looks, that runs of one value are said to differ
NOISIER: Final = 1.5  # times the median of the runs before
KNOWN: Final = 2  # runs from which a date long before theirs is odd
LONG_BEFORE_S: Final = 30 * 86_400.0  # that an older log may be added late by without a word
DAY_S: Final = 86_400.0


def cautions(
    runs: Sequence[Entry],
    doubted: int | None,
    changes: Changes,
    seen: Sequence[Change],
    stage: Callable[[int], str],
) -> Iterator[str]:
    """In sentences without their full stop.

    runs: of the last baseline, in the order in which they are compared, as in `changes`; doubted:
    the place of the run after which a kept look says what its runs do not; seen: changes that are
    alarms; stage: names of stages.
    """
    if not runs:
        return
    if doubted is not None:
        yield (
            f"what the store kept of the look after run {runs[doubted].number} is not what its "
            "runs say: all looks were computed anew from the runs"
        )
    yield from _of_the_last(runs)
    yield from _dated_long_before(runs)
    yield from _differing(changes, seen, len(runs), stage)


def _of_the_last(runs: Sequence[Entry]) -> Iterator[str]:
    """What its diagnosis could not explain, and noise that grew."""
    *earlier, last = runs
    run = last.run
    if run.left_material:
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
                "is taken for what came first: is its clock right? If not: `watch STORE "
                f"--leave-out {entry.number} --reason TEXT`"
            )


def _share(look: int) -> float:
    """Share of the false words that a look may have: 2 / (n (n - 1)), which sums to 1 from 3 on."""
    return 2.0 / (look * (look - 1.0))


def _differing(
    changes: Changes, seen: Sequence[Change], look: int, stage: Callable[[int], str]
) -> Iterator[str]:
    """Effects that have another value in every run: no change, and nothing to count on."""
    for one in seen:  # what moves along with a change is told by it
        changes = changes.without(one)
    told = {one.term.label for one in seen}
    for found in changes.differing(look):
        term = found.named
        if term.label in told or found.log_p > math.log(DIFFERS * _share(look)):
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
