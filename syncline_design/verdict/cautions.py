"""What a reader of a verdict has to know besides it: lever arms, clocks, assumptions, effects."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from syncline_design.choice.outcome import Proof
from syncline_design.effects import registry
from syncline_design.model.budget import differs
from syncline_design.model.figure_text import format_quantity, percent, to_digits
from syncline_design.model.quantity import Dimension
from syncline_design.model.system import UTC
from syncline_design.model.timing import Normal
from syncline_design.model.written import beside, limit_as_written
from syncline_design.simulation.ensemble import outside_words
from syncline_design.spec.case import Case, figures_due
from syncline_design.spec.gnss import has_gnss
from syncline_design.verdict.cautions_of_facts import fact_cautions
from syncline_design.verdict.cautions_of_owned import owned_cautions
from syncline_design.verdict.cautions_of_waivers import waiver_cautions
from syncline_design.verdict.tree import (
    Assumption,
    Caution,
    ErrorFigures,
    RequirementResult,
)
from syncline_design.verdict.verified import Verified

if TYPE_CHECKING:
    pass

LEAST_COVERAGE = 2.0  # below, more than 4.6 % of normal timestamp errors exceed their bound


def cautions(
    case: Case,
    verified: Verified,
    figures: ErrorFigures,
    assumed: Sequence[Assumption],
    copied: Mapping[str, Sequence[str]],
) -> tuple[Caution, ...]:
    """The `warnings` of a verdict: a code to filter by, a sentence to read, what it is about."""
    return (
        *design_cautions(case, verified, figures),
        *waiver_cautions(case, verified.requirements),
        *_simulation(verified),
        *assumption_cautions(assumed),
        *_transcripts(copied),
        *_incomplete(case),
    )


def design_cautions(case: Case, verified: Verified, figures: ErrorFigures) -> tuple[Caution, ...]:
    """What a reader has to know of the design itself, whatever command speaks of it."""
    return (
        *_worst_case(verified),
        *_quantile(verified, figures),
        *_lever_arm(verified),
        *_clocks(case, verified),
        *_coverage(verified),
        *_untyped(case, verified),
        *fact_cautions(case, verified),
        *owned_cautions(case, verified),
    )


def _time(value: float) -> str:
    return format_quantity(value, Dimension.TIME)


def _length(value: float) -> str:
    return format_quantity(value, Dimension.LENGTH)


def _limit(row: RequirementResult) -> str:
    written = limit_as_written(row.limit_written, row.limit, row.unit)
    return _length(row.limit) if written is None else written


def _held(value: float, row: RequirementResult) -> str:
    """A length in the unit of the limit beside it."""
    written = limit_as_written(row.limit_written, row.limit, row.unit)
    return _length(value) if written is None else beside(written, value, row.unit)


def _tightest_kept(verified: Verified) -> RequirementResult | None:
    """The tightest accuracy limit that is kept: a failed one says enough itself."""
    kept = (r for r in verified.requirements if r.kind == "accuracy" and r.status == "pass")
    return min(kept, key=lambda row: row.limit, default=None)


def _worst_case(verified: Verified) -> Iterator[Caution]:
    """A design that keeps an accuracy limit which its certified worst case exceeds."""
    worst, tightest = verified.worst_case_1sigma_m, _tightest_kept(verified)
    if worst is not None and tightest is not None and not worst <= tightest.limit:
        yield Caution(
            "worst-case-above-limit",
            f"{tightest.id}: the Syncline keeps {_limit(tightest)}, yet with every sensor "
            "at one sigma and every timestamp within its own bound the certified worst case is "
            f"{_held(worst, tightest)}: the Syncline leaves out what lever arms, tilt and scatter "
            "add",
            requirement=tightest.id,
        )


def _quantile(verified: Verified, figures: ErrorFigures) -> Iterator[Caution]:
    """A design that keeps an accuracy limit which 95 % of its errors do not, at its worst."""
    quantile, tightest = figures.quantile95_3d_m, _tightest_kept(verified)
    if quantile is not None and tightest is not None and not quantile <= tightest.limit:
        yield Caution(
            "quantile-above-limit",
            f"{tightest.id}: the Syncline keeps {_limit(tightest)}, yet in the worst "
            f"situation only errors up to {_held(quantile, tightest)} make up 95 %: the Syncline "
            "adds one-sigma figures, which normal noise exceeds",
            requirement=tightest.id,
        )


def _lever_arm(verified: Verified) -> Iterator[Caution]:
    """Where leaving the lever arm out, as the paper does, is optimistic by more than 10 %."""
    figures = verified.figures
    for row in figures.sensors:
        if differs(row.tau_crit_s, row.tau_crit_lever_arm_s):
            ratio = row.tau_crit_s / row.tau_crit_lever_arm_s
            broken = " and is exceeded" if not row.tau_s < row.tau_crit_lever_arm_s else ""
            yield Caution(
                "lever-arm",
                f"{row.stage}.{row.role}: with the lever arm, tau_crit is "
                f"{_time(row.tau_crit_lever_arm_s)} instead of {_time(row.tau_crit_s)} "
                f"(the paper's figure is optimistic by a factor of {to_digits(ratio, 3)}){broken}",
            )
    lever = figures.lever_arm
    if differs(figures.total_m, lever.total_m):
        yield Caution(
            "lever-arm",
            f"with lever arms the total error is {_length(lever.total_m)} instead of "
            f"{_length(figures.total_m)}",
        )


def _clocks(case: Case, verified: Verified) -> Iterator[Caution]:
    """Vehicles whose clocks are taken as common because the spec says nothing."""
    stages = verified.system.stages
    vehicles = {stage.vehicle for stage in stages}
    timed = {stage.vehicle_name for stage in case.spec.stages if stage.clock is not None}
    stamping = {s.vehicle for s in stages if any(one.timeline != UTC for one in s.sensors())}
    silent = sorted(stamping - timed)  # what UTC alone stamps needs no clock of the host
    if len(vehicles) > 1 and silent:
        yield Caution(
            "common-clock",
            f"the clocks of {', '.join(sorted(vehicles))} are taken as common because "
            f"{', '.join(silent)} gives no `clock`; across vehicles without a common clock "
            "holdover drift is the honest figure",
        )
        return
    if silent:  # one vehicle, whose stages share one host clock
        yield from _one_clock(verified)


def _one_clock(verified: Verified) -> Iterator[Caution]:
    """One vehicle without a named clock: what of it is held against UTC."""
    stages = verified.system.stages
    first, names = stages[0], " and ".join(stage.name for stage in stages)
    if first.ranging is None:
        if first.position is not None and first.position.timeline != UTC:
            yield Caution(
                "common-clock",
                f"{first.name} is stamped on the host clock and held against true time, and "
                "no `clock` says how far these are apart: the offset is taken as 0",
            )
        return
    if len({s.timeline == UTC for stage in stages for s in stage.sensors()}) > 1:
        has = "has" if len(stages) == 1 else "have"
        yield Caution(
            "common-clock",
            f"{names} {has} sensors on the host clock and on UTC, and no `clock` says how "
            "far these are apart: the offset is taken as 0",
        )


def _coverage(verified: Verified) -> Iterator[Caution]:
    """A small coverage factor bounds a normal timestamp error by what it often exceeds."""
    system = verified.system
    errors = [s.timing for stage in system.stages for s in stage.sensors()]
    errors += [offset for _, offset in system.clock_offsets]
    normal = any(isinstance(e.distribution, Normal) and e.distribution.std_s > 0.0 for e in errors)
    jitter = any(registry()[entry.effect].bounded_by_k for entry in system.effects)
    k = system.coverage_factor
    if k < LEAST_COVERAGE and (normal or jitter):
        yield Caution(
            "coverage-factor",
            f"coverage_factor {to_digits(k)}: "
            f"{percent(math.erfc(k / math.sqrt(2.0)), 3)} of normal "
            "timestamp errors lie beyond the bound that tau is made of; with 3 it is 0.27 %",
        )


def _untyped(case: Case, verified: Verified) -> Iterator[Caution]:
    """Without GNSS only its type tells whether a position sensor works."""
    for stage, choice in zip(verified.system.stages, case.spec.stages, strict=True):
        sensor = stage.position
        if sensor is not None and not sensor.type.strip() and not has_gnss(case.spec, choice):
            yield Caution(
                "unknown-fact",
                f"{sensor.id} does not say its `type`, and {stage.name} has no GNSS: "
                "if it is a GNSS receiver it does not work there",
                sensor.id,
                "type",
            )


def _simulation(verified: Verified) -> Iterator[Caution]:
    if verified.monte_carlo is None:
        yield Caution("no-monte-carlo", f"no Monte Carlo cross-check: {verified.trouble}")
        return
    outside = verified.monte_carlo.ensemble.outside
    if outside:
        yield Caution(
            "trajectory-outside",
            f"{outside_words(outside)}; beyond, their figures do not hold and the simulated "
            "errors may exceed them",
        )


def assumption_cautions(assumed: Sequence[Assumption]) -> Iterator[Caution]:
    """Figures without a public source, one line an entry."""
    by_entry: dict[str, list[str]] = {}
    for one in assumed:
        by_entry.setdefault(one.entry, []).append(one.figure)
    for entry, figures in by_entry.items():
        message = f"assumption, no public source: {', '.join(figures)} of {entry}"
        yield Caution("assumption", message, entry=entry, key=", ".join(figures))


def _transcripts(copied: Mapping[str, Sequence[str]]) -> Iterator[Caution]:
    """Figures that nobody here read in the maker's own document, one line an entry."""
    for entry, figures in copied.items():
        named = ", ".join(figures)
        message = f"read in another's copy of the maker's figures: {named} of {entry}"
        yield Caution("transcript", message, entry=entry, key=named)


def _incomplete(case: Case) -> Iterator[Caution]:
    """Entries that answer a query but lack a figure that is due, one line a role."""
    due = figures_due(case.spec, True)
    for stage in case.stages:
        for role in stage.roles:
            lacking: dict[str, list[str]] = {}
            for identity, figure in role.incomplete:
                lacking.setdefault(figure, []).append(identity)
            for figure, entries in lacking.items():
                yield Caution(
                    "incomplete-entry",
                    f"{stage.choice.name}.{role.role}: left out of the query for want of a "
                    f"{figure}, needed by {due[figure]}: {', '.join(entries)}",
                    entry=", ".join(entries),
                    key=figure,
                )


def unproven(proof: Proof) -> Iterator[Caution]:
    """What the time limit left open about a design that meets."""
    if not proof.optimal:
        gap = "" if proof.gap is None else f" (by {percent(proof.gap, 3)} at most)"
        message = f"the time limit ended the search: a better design than this may exist{gap}"
        yield Caution("not-proven-optimal", message)
