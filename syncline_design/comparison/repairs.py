"""The cheapest repairs after a diagnosis: what to do about its findings, and at what price."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace

from syncline_design.choice.chosen_system import system_of
from syncline_design.choice.effect_tables import NoBudget, problem_of
from syncline_design.choice.evaluate import evaluate
from syncline_design.choice.problem import selection_of, sole_design
from syncline_design.comparison.repair_options import (
    Remedy,
    RepairKind,
    applied,
    bought,
    compatible,
    remedies,
)
from syncline_design.diagnosis.one_of_several import is_one_of_several, members
from syncline_design.diagnosis.result import Finding
from syncline_design.effects.acting import known_of
from syncline_design.machine.deadline import in_force
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record
from syncline_design.spec.case import Case
from syncline_design.verdict.admitted import with_whole_catalog
from syncline_design.verdict.bill import bill_of_materials
from syncline_design.verdict.recheck import recheck
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import Word
from syncline_design.verdict.verify import check_loaded

MOST_COMBINED = 200  # ways to put several findings right that are worked out
MOST_SHOWN = 8


@dataclass(frozen=True, slots=True)
class RepairStep(Record):
    """What is done about one finding; assumes: what has to be so for it to help."""

    kind: RepairKind
    effect: str
    sensor: str
    stage: str
    text: str
    assumes: str


@dataclass(frozen=True, slots=True)
class Repair(Record):
    """One way to put the system right.

    price: of what is bought; error_m: total afterwards; verdict: that of `check`; misses: ids of
    requirements that fail or stay open.  cheapest: the cheapest of those that meet every
    requirement; beaten: another one costs no more and errs no more.
    """

    price: float
    currency: str
    error_m: float
    verdict: Word
    misses: tuple[str, ...]
    steps: tuple[RepairStep, ...]
    cheapest: bool
    beaten: bool


def repairs(case: Case, found: Sequence[Finding], seed: int) -> tuple[Repair, ...]:
    """Of each kind of repair the cheapest that keeps every sum, else the one that errs least.

    case: the system as built, with nothing open.  Of several findings every combination of their
    remedies is worked out, as far as there are not too many.  By rising price.
    """
    findings = [one for one in found if _counts(one)]
    if not findings or sole_design(problem_of(case)) is None:
        return ()
    whole = with_whole_catalog(case)
    each = [list(remedies(case, whole, one)) for one in findings]
    possible = filter(compatible, itertools.product(*each))
    combined = itertools.islice(possible, MOST_COMBINED)
    scored = [one for chosen in combined for one in _scored(case, whole, chosen)]
    best = sorted(_best_of_each_kind(scored), key=_order)[:MOST_SHOWN]
    shown = [_repair(whole, one, seed) for one in best]
    first = next((i for i, one in enumerate(shown) if one.verdict == "meets"), None)
    return tuple(
        replace(one, cheapest=i == first, beaten=any(_beats(other, one) for other in shown))
        for i, one in enumerate(shown)
    )


def _beats(one: Repair, other: Repair) -> bool:
    """Whether one is no dearer and errs no more, and not alike in both."""
    no_worse = one.price <= other.price and one.error_m <= other.error_m
    return no_worse and (one.price, one.error_m) != (other.price, other.error_m)


def _counts(one: Finding) -> bool:
    """Causes, and what the noise does otherwise, that matter and that a spec can hold."""
    return one.material and one.kind != "stand_in" and one.fits_a_spec


@dataclass(frozen=True, slots=True)
class _Scored:
    """What is done together, at what price, how large the error is then, whether all sums hold."""

    price: float
    error_m: float
    keeps: bool
    chosen: tuple[Remedy, ...]


def _scored(case: Case, whole: Case, chosen: tuple[Remedy, ...]) -> Iterator[_Scored]:
    """Nothing where no budget can hold what is left, or a price is not told."""
    in_force().check()
    now = sole_design(problem_of(case))
    assert now is not None
    then = applied(whole, chosen)
    try:
        sole = sole_design(problem_of(then))
    except NoBudget:
        return
    if sole is None:
        return
    price = bought(bill_of_materials(case, *now), bill_of_materials(then, *sole))
    if price is not None:
        known = known_of(system_of(then, *sole))
        exact = recheck(then, selection_of(*sole), known)
        yield _Scored(price, evaluate(*sole).error_m, exact.passed, chosen)


def _best_of_each_kind(scored: Sequence[_Scored]) -> Iterator[_Scored]:
    kinds: dict[tuple[RepairKind, ...], list[_Scored]] = {}
    for one in scored:
        kinds.setdefault(tuple(remedy.kind for remedy in one.chosen), []).append(one)
    for alike in kinds.values():
        good = [one for one in alike if one.keeps]
        yield (
            min(good, key=_order) if good else min(alike, key=lambda one: (one.error_m, one.price))
        )


def _order(one: _Scored) -> tuple[float, float, int]:
    """The cheapest first, of equals the better, then the least work."""
    return one.price, one.error_m, sum(remedy.kind != "nothing" for remedy in one.chosen)


def _repair(whole: Case, one: _Scored, seed: int) -> Repair:
    chosen = one.chosen
    simulated = any(r.kind == "monte_carlo" for r in whole.spec.requirements)
    verdict = check_loaded(applied(whole, chosen), CheckSettings(seed=seed, monte_carlo=simulated))
    misses = tuple(row.id for row in verdict.requirements if row.status != "pass")
    steps = tuple(
        RepairStep(r.kind, r.finding.effect, r.finding.sensor, r.finding.stage, r.text, _assumed(r))
        for r in chosen
    )
    return Repair(
        one.price, whole.spec.currency, one.error_m, verdict.verdict, misses, steps,
        cheapest=False, beaten=False,
    )  # fmt: skip


def _assumed(one: Remedy) -> str:
    """What has to be so; of one of several effects that a log leaves, that it is that one."""
    if not is_one_of_several(one.finding) or one.kind == "nothing":
        return one.assumes
    named = f"it is indeed {members(one.finding)[0]}"
    return f"{one.assumes}; {named}" if one.assumes else named
