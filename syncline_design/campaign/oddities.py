"""What is odd in the runs of a store and is no change of an effect."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.campaign.changes import Changes
from syncline_design.campaign.pool import Term
from syncline_design.campaign.run_records import Change, Differing
from syncline_design.campaign.store import Entry
from syncline_design.campaign.strangers import share_of
from syncline_design.campaign.watch_result import Unsettled
from syncline_design.diagnosis.finding import texts_of
from syncline_design.diagnosis.result import UnlikeOthers
from syncline_design.effects import registry
from syncline_design.effects.record import Effect
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
    unsettled: Unsettled | None,
) -> Iterator[str]:
    """In sentences without their full stop.

    runs: of the last baseline, in the order in which they are compared; doubted: the run after
    which a kept look says what its runs do not; unlike: runs that are unlike the others; changes:
    of those that are compared; seen: changes that are alarms; stage: names of stages; unsettled:
    where they differ and nobody knows how.
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
    for found in scattering(changes, seen, changes.pool.count):
        yield _differing(found, stage)
    if unsettled is not None:
        yield _not_settled(unsettled)


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
    others = [f"{o.effect.replace('_', ' ')} ({o.sensor})" for o in one.aliases or ()]
    may = f", or as well {sentence_list(others, 'or')}" if others else ""
    return (
        f"{one.effect.replace('_', ' ')} ({one.sensor}){' ' if alone else ', '}"
        f"{sentence_list(parts)} (chance by noise alone {format_chance(one.log10_chance)}{may})"
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


def scattering(changes: Changes, seen: Sequence[Change], look: int) -> Iterator[Differing]:
    """Effects that have another value in every run: no change, and nothing to count on; what
    several parameters of one differ by as one."""
    changes = changes.without(*seen)  # what moves along with a change is told by it
    told = {one.term.label for one in seen}
    every: dict[tuple[str, str, int], list[Differing]] = {}
    for found in changes.differing(look):
        # two that move the runs alike have one name
        if found.named.label not in told and _beyond_noise(found, look):
            every.setdefault(found.named.label, []).append(found)
    for parts in every.values():
        covariance = np.sum([one.named_covariance for one in parts], axis=0)
        yield replace(parts[0], named_covariance=covariance)


def unsettled_in(changes: Changes, look: int, stage: Callable[[int], str]) -> Unsettled | None:
    """Where runs in which nothing rang and nothing is said to scatter are not all alike."""
    found = changes.apart(look)
    if found is None or not _beyond_noise(found, look) or any(scattering(changes, (), look)):
        return None
    name, sensor, place = found.named.label
    names = [p.name for p in found.named.effect.slopes()]
    spread = zip(names, map(float, found.spread), strict=True)
    sizes = {parameter: size for parameter, size in spread if size > 0.0}
    return Unsettled(name, sensor, stage(place), sizes, found.log_p / math.log(10.0))


def _beyond_noise(found: Differing, look: int) -> bool:
    return found.log_p <= math.log(DIFFERS * share_of(look))


def _differing(found: Differing, stage: Callable[[int], str]) -> str:
    term = found.named
    named = dict(zip([p.name for p in term.effect.slopes()], found.spread, strict=True))
    return (
        f"{term.effect.name.replace('_', ' ')} ({term.sensor}) of {stage(term.stage)} "
        f"has another value in every run: they differ by {_sizes(term.effect, named)} (standard "
        "deviation) more than noise, which is no change since a run, and no one value of the build"
        f"{_or_else(found.others)}"
    )


def _or_else(others: Sequence[Term]) -> str:
    """`; it may be lever arm (position) as well, which moves the runs alike`."""
    names = [f"{one.effect.name.replace('_', ' ')} ({one.sensor})" for one in others]
    if not names:
        return ""
    return f"; it may be {sentence_list(names, 'or')} as well, by what the runs tell"


def _not_settled(one: Unsettled) -> str:
    sizes = _sizes(registry()[one.effect], one.spread)
    return (
        f"the runs are not all alike: {one.effect.replace('_', ' ')} ({one.sensor}) of {one.stage} "
        f"differs by {sizes} (standard deviation) more than noise (chance by noise alone "
        f"{format_chance(one.log10_chance)}); whether that is a change, a drift or another value "
        "in every run, the next runs will tell"
    )


def _sizes(effect: Effect, spread: Mapping[str, float]) -> str:
    """`5.2 mm`, of an effect with several parameters `north 5.2 mm and east 6 mm`."""
    units = {p.name: p.unit for p in effect.slopes()}
    texts = {
        name: format_estimate(float(to_digits(float(size), 2)), None, units[name])
        for name, size in spread.items()
        if size > 0.0
    }
    if len(units) == 1:
        return sentence_list(list(texts.values()))
    return sentence_list(
        [f"{split_suffix(name)[0].replace('_', ' ')} {text}" for name, text in texts.items()]
    )
