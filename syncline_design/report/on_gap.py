"""How much of the gap between log and simulation a diagnosis closes: charts and tables."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from syncline_design.diagnosis.gap_result import Fit, Gap, HeldOut, UnseenBlock, WholeGap
from syncline_design.diagnosis.plotted import (
    Plots,
)
from syncline_design.diagnosis.result import Diagnosis
from syncline_design.machine.sentences import sentence_list
from syncline_design.report import charts_diagnosis as drawings
from syncline_design.report import numbers
from syncline_design.report.document import (
    Chart,
    Node,
    Text,
    show,
)
from syncline_design.report.table import Cell, Table, table

NOTHING: Final = 1e-4  # nat a sample that are shown as none
PLACEBO: Final = (
    "A placebo is an effect that was not chosen, added to see that more parameters alone do not "
    "shrink the gap."
)
GAP_CAPTION: Final = (
    "RMS of the residual on held-out data as effects are added. Floor (dashed): the better of what "
    "the spec's noise expects and of what these effects reach when all rows are fitted."
)
_SCORES: Final = ("RMS #", "Reduced \u03c7\u00b2 #", "NLL per sample #", "95 % coverage #")


def rms_length(value_m: float) -> str:
    """Metres as the console prints them: 12.3 cm there is 12.3 cm here."""
    return numbers.with_uncertainty(value_m, None, "m")


def closed_text(gap: Gap, scores: HeldOut) -> str:
    """Which share of the gap is closed; in words where there is none to speak of."""
    if gap.closed_fraction is not None:
        return numbers.percent(gap.closed_fraction) if gap.closed_fraction > 0.0 else "nothing"
    return "less than 2 % of it could be, too little for a share" if scores.slight else ""


def gap_nodes(found: Diagnosis) -> list[Node]:
    lead = (
        "Judged on data that the fit did not see. At best is what the same effects reach when all "
        "rows are fitted; RMS alone cannot show an effect on the noise itself, the likelihood "
        "(NLL, its negative logarithm, in nat a sample: 0.1 nat lower is 1.1 times as likely) and "
        "the coverage do."
    )
    if found.gap.placebo.held_out is not None:
        lead += f" {PLACEBO}"
    tables = [*show(gap_table(found.gap)), *show(_steps(found.steps), reach="page")]
    placebo = _placebo_text(found.gap)
    unseen = _unseen_text(found.gap.unseen)
    return [
        *([Text(lead)] if tables else []),
        *_gap_chart(found),
        *tables,
        *([Text(unseen)] if unseen else []),
        *([Text(placebo)] if placebo else []),
        *_coverage_chart(found.plots),
    ]


def _unseen_text(block: UnseenBlock | None) -> str:
    """What was found without a block, and how the block looks with it."""
    if block is None:
        return ""
    ends = numbers.from_to(block.from_s, block.to_s)
    found = sentence_list(list(block.found)) or "nothing"
    closed = block.closed_fraction
    share = (
        "" if closed is None else f", which closes {numbers.percent(max(closed, 0.0))} of its gap"
    )
    return (
        f"The block from {ends} was kept from the choice of effects, their values and the noise: "
        f"without it the search names {found}. On it the RMS is {rms_length(block.before.rms_m)} "
        f"before and {rms_length(block.after.rms_m)} after, where the spec's noise expects "
        f"{rms_length(block.expected_rms_m)}{share}."
    )


def _placebo_text(gap: WholeGap) -> str:
    """What an effect saves that was not chosen: next to nothing, if the choice is right."""
    saved, placebo = gap.nll_saved_per_sample, gap.placebo
    if placebo.nll_saved_per_sample is None or saved is None:
        return ""
    change = placebo.nll_saved_per_sample.value - saved.value
    told = f"{numbers.places(change, 4, sign=True)} nat"
    if abs(change) < NOTHING:
        told = f"less than {numbers.number(NOTHING, 1)} nat"
    told = numbers.typeset(told)
    return f"Adding {_spaced(placebo)} as well, which was not chosen: {told} per sample."


def _spaced(step: Gap) -> str:
    """`azimuth bias (ranging)` of what was added."""
    return (step.added or "").replace("_", " ")


def _gap_chart(found: Diagnosis) -> list[Node]:
    held_out = found.gap.held_out
    steps = [drawings.Step(label, scores.rms_m) for label, scores in gap_steps(found.steps)]
    if not steps or held_out is None:
        return []
    draw = partial(drawings.gap_staircase, steps, held_out.floor.rms_m)
    return [Chart("gap", draw, GAP_CAPTION)]


def _coverage_chart(plots: Plots) -> list[Node]:
    rows = [(one.nominal, one.before, one.after) for one in plots.coverage]
    caption = (
        "Share of residuals inside the expected interval; on the dashed line the noise is as "
        "stated."
    )
    return [Chart("coverage", partial(drawings.coverage, rows), caption)] if rows else []


def _score_cells(scores: Fit) -> list[Cell]:
    return [
        Cell(rms_length(scores.rms_m), scores.rms_m),
        Cell(numbers.number(scores.reduced_chi2), scores.reduced_chi2),
        Cell(numbers.number(scores.nll_per_sample), scores.nll_per_sample),
        Cell(numbers.percent(scores.coverage_95), scores.coverage_95),
    ]


def gap_table(gap: WholeGap) -> Table | None:
    """Before, after and floor on blocks and on a regime that the fit did not see; the placebo."""
    rows = []
    if gap.held_out is not None:
        blocks = gap.held_out
        rows += [
            (Cell("held-out blocks, before"), *_score_cells(blocks.before)),
            (Cell("held-out blocks, after"), *_score_cells(blocks.after)),
            (Cell("held-out blocks, at best (fitted to all rows)"), *_score_cells(blocks.fitted)),
        ]
    if gap.regime.held_out is not None:
        regime, part = gap.regime.held_out, f"held-out regime ({gap.regime.held_rows})"
        rows += [
            (Cell(f"{part}, before"), *_score_cells(regime.before)),
            (Cell(f"{part}, after"), *_score_cells(regime.after)),
        ]
    if gap.placebo.held_out is not None:
        label = f"after, plus a placebo: {_spaced(gap.placebo)}"
        rows.append((Cell(label), *_score_cells(gap.placebo.held_out.after)))
    return table("Gap on data not used for the fit", ("Model", *_SCORES), rows) if rows else None


def gap_steps(steps: Sequence[Gap]) -> list[tuple[str, Fit]]:
    """(label, scores on held-out data), the spec as it is first, then each addition."""
    found = [(step.added, step.held_out) for step in steps if step.held_out is not None]
    first = [("spec as it is", scores.before) for _, scores in found[:1]]
    return [*first, *((f"+ {added}", scores.after) for added, scores in found)]


def _steps(steps: Sequence[Gap]) -> Table | None:
    rows = [(Cell(label), *_score_cells(scores)) for label, scores in gap_steps(steps)]
    heads = ("Step", *_SCORES)
    return table("Gap after each addition", heads, rows) if len(rows) > 2 else None
