"""The page of `diagnose`: what is missing, how sure, what it explains, what remains."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from syncline_design.comparison.meaning import DesignMeaning, DiagnosisAndDesign
from syncline_design.diagnosis.result import (
    CovariateMap,
    Coverage,
    Diagnosis,
    Estimate,
    Finding,
    Fit,
    Gap,
    LogRead,
    Regime,
    Rival,
    WholeGap,
)
from syncline_design.machine.records import with_texts
from syncline_design.model.quantity import split_suffix
from syncline_design.report import figures_diagnosis as drawings
from syncline_design.report import numbers, page
from syncline_design.report.document import Outcome
from syncline_design.report.svg import InlineFigure
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import sentence_list, visible

DIAGNOSES: Final[dict[str, Outcome]] = {
    "agrees": Outcome("good", "\u2713", "Log and simulation agree"),
    "explained": Outcome("warn", "!", "Something was missing, and it has a name"),
    "unexplained": Outcome("bad", "?", "Something remains unexplained"),
}
_UNSOUND: Final = Outcome("bad", "!", "The log contradicts itself or the platform's limits")
_CONTENTS: Final = (
    ("findings", "Findings"),
    ("gap", "Gap"),
    ("residuals", "Residuals"),
    ("where", "Where"),
    ("design", "Design"),
    ("log", "Log"),
    ("provenance", "Provenance"),
)


def render_diagnosis(found: DiagnosisAndDesign) -> str:
    """The HTML page of one diagnosis."""
    found = with_texts(found, visible)
    drawn = _figures(found)
    sections: dict[str, Any] = {
        "findings": [finding_words(entry) for entry in found.findings],
        "gap": [t for t in (gap_table(found.gap), _steps(found.steps)) if t is not None],
        "residuals": "residuals" in drawn,
        "where": where_lines(found),
        "design": design_lines(found.design),
        "log": _log_facts(found),
        "provenance": _provenance(found),
    }
    return page.render_page(
        "diagnosis.html.j2",
        kind="Diagnosis",
        name=name_of(found),
        outcome=outcome_of(found),
        sentence=sentence_text(found),
        facts=_facts(found),
        contents=[(key, label) for key, label in _CONTENTS if sections[key]],
        sections=sections,
        figures={key: None if key not in drawn else page.trusted_svg(drawn[key].svg)
                 for key in ("residuals", "gap", "where", "coverage")},
        coverage=_coverage(found.plots.coverage),
        meaning=meaning_table(found.design),
        unseen=list(found.unseen),
        rejected=_rejected(found.log),
        remaining=remaining_text(found),
    )  # fmt: skip


def name_of(found: Diagnosis) -> str:
    """The spec's name; of a system in memory, what was done."""
    return found.spec.name if found.spec is not None else "Measured log against simulation"


def _parameter_text(shown: Estimate) -> str:
    """`87.1 \u00b1 0.3 ms`: an estimate with its standard uncertainty, both in one unit."""
    if not shown.seen:
        return "not seen in this log"
    if isinstance(shown.value, str):
        return shown.value
    spread = numbers.finite(shown.standard_uncertainty)
    return numbers.with_uncertainty(shown.value, spread, shown.unit)


def _length(value_m: float) -> str:
    """Metres as the console prints them: 12.3 cm there is 12.3 cm here."""
    return numbers.with_uncertainty(value_m, None, "m")


@dataclass(frozen=True, slots=True)
class FindingWords:
    """A finding as pages and Markdown say it."""

    title: str
    place: str
    sentence: str
    parameters: tuple[tuple[str, str], ...]
    aliases: str
    lookalikes: str
    excluded: str
    separated_by: str
    evidence: str


def finding_words(found: Finding) -> FindingWords:
    """A finding's parts, lists joined."""
    return FindingWords(
        title=_spaced(found.effect),
        place=f"{found.stage} {found.sensor}",
        sentence=_full_stop(found.sentence),
        parameters=tuple(
            (_spaced(split_suffix(name)[0]), _parameter_text(one))
            for name, one in found.parameters.items()
        ),
        aliases=sentence_list([_effect_text(one) for one in found.aliases]),
        lookalikes=sentence_list([_excluded_text(one) for one in found.lookalikes]),
        excluded=sentence_list([_excluded_text(one) for one in found.excluded]),
        separated_by=found.separated_by,
        evidence=found.evidence,
    )


def _spaced(name: str) -> str:
    return name.replace("_", " ")


def _full_stop(text: str) -> str:
    return text if not text or text.endswith(".") else text + "."


def _effect_text(one: Rival) -> str:
    """`lever arm (position)`."""
    return f"{_spaced(one.effect)} ({one.sensor})"


def _excluded_text(one: Rival) -> str:
    """Name and how much worse it fits; one that fits better says why it is not the name."""
    if one.nats_worse >= 0.0:
        kept = "" if one.refitted else " with the noise kept"
        return f"{_effect_text(one)}, {one.nats_worse:.3g} nat worse{kept}"
    if not one.possible:
        better = f"{-one.nats_worse:.3g} nat better"
        return f"{_effect_text(one)}, {better}, but only with impossible values"
    return f"{_effect_text(one)}, as well in its place"


def outcome_of(found: Diagnosis) -> Outcome:
    """The verdict's words; a log that contradicts itself is said to, whatever was named."""
    return DIAGNOSES[found.verdict] if found.sound else _UNSOUND


def check_sentences(found: Diagnosis) -> list[str]:
    """What is wrong with the log itself, or beyond the platform's limits."""
    said = [_full_stop(check.message) for check in found.checks]
    return [text[0].upper() + text[1:] for text in said]


def sentence_text(found: Diagnosis) -> str:
    """What is wrong with the log first, then what was found in it."""
    return " ".join([*check_sentences(found), _found_text(found)])


def _found_text(found: Diagnosis) -> str:
    if found.findings:
        return " ".join(_full_stop(one.sentence) for one in found.findings)
    if found.remaining.beyond_noise:
        return "No effect of the dictionary explains what differs."
    return "Nothing beyond the spec's own noise was found."


def _facts(found: Diagnosis) -> list[tuple[str, str]]:
    gap, log, facts = found.gap, found.log, []
    if gap.closed_fraction is not None:
        facts.append(("Gap closed on held-out data", numbers.percent(gap.closed_fraction)))
    if gap.held_out is not None:
        scores = gap.held_out
        facts.append(("RMS before", _length(scores.before.rms_m)))
        facts.append(("RMS after", _length(scores.after.rms_m)))
        facts.append(("RMS at best", _length(scores.fitted.rms_m)))
    if gap.expected_rms_m is not None:
        facts.append(("The spec's noise expects", _length(gap.expected_rms_m)))
    rows = f"{numbers.count(log.used)} of {numbers.count(log.rows)}"
    return [*facts, ("Rows used", rows)]


def design_lines(design: DesignMeaning | None) -> list[str]:
    """What the findings mean for the design, in words; the horizon last."""
    return [] if design is None else [*design.text, design.horizon.text]


def meaning_table(design: DesignMeaning | None) -> Table | None:
    """The error without and with the findings, by model and simulated."""
    if design is None:
        return None
    rows: list[tuple[Cell | str, ...]] = [
        (
            one.label,
            *(Cell(numbers.length(value), value) for value in (one.before_m, one.after_m)),
            _interval(one.after_interval_m),
        )
        for one in design.figures
    ]
    heads = ("Error of the design", "Without #", "With the findings #", "95 % interval, with")
    return table("The error without and with the findings", heads, rows)


def _interval(ends: tuple[float | None, float | None] | None) -> str:
    return " to ".join(numbers.length(end) for end in ends or ())


def _score_cells(scores: Fit) -> list[Cell]:
    return [
        Cell(_length(scores.rms_m), scores.rms_m),
        Cell(numbers.number(scores.reduced_chi2), scores.reduced_chi2),
        Cell(numbers.number(scores.nll_per_sample), scores.nll_per_sample),
        Cell(numbers.percent(scores.coverage_95), scores.coverage_95),
    ]


_SCORES: Final = ("RMS #", "Reduced \u03c7\u00b2 #", "NLL per sample #", "95 % coverage #")


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
        regime = gap.regime.held_out
        rows += [
            (Cell("held-out regime, before"), *_score_cells(regime.before)),
            (Cell("held-out regime, after"), *_score_cells(regime.after)),
        ]
    if gap.placebo.held_out is not None:
        label = f"after, plus a placebo: {gap.placebo.added}"
        rows.append((Cell(label), *_score_cells(gap.placebo.held_out.after)))
    return table("Gap on data not used for the fit", ("Model", *_SCORES), rows) if rows else None


def gap_lines(gap: Gap) -> list[str]:
    """What the spec's noise expects on the held-out blocks, and the share of the gap closed."""
    lines = []
    if gap.expected_rms_m is not None:
        lines.append(f"The spec's noise expects {_length(gap.expected_rms_m)}.")
    if gap.closed_fraction is not None:
        lines.append(f"Gap closed on held-out data: {numbers.percent(gap.closed_fraction)}.")
    return lines


def log_lines(log: LogRead) -> list[str]:
    """How many rows were read, used, fitted and left out, and how the log was read."""
    used, rows = numbers.count(log.used), numbers.count(log.rows)
    lines = [f"Log: {used} of {rows} rows used, {numbers.count(log.fitted)} fitted."]
    if log.thinned:
        lines.append(f"Too long to hold: {numbers.count(log.thinned)} rows are between windows.")
    lines += [f"Left out: {numbers.count(n)} ({why})" for why, n in log.rejected.items()]
    return [*lines, *log.notes]


def gap_steps(steps: Sequence[Gap]) -> list[tuple[str, Fit]]:
    """(label, scores on held-out data), the spec as it is first, then each addition."""
    found = [(step.added, step.held_out) for step in steps if step.held_out is not None]
    first = [("spec as it is", scores.before) for _, scores in found[:1]]
    return [*first, *((f"+ {added}", scores.after) for added, scores in found)]


def _steps(steps: Sequence[Gap]) -> Table | None:
    rows = [(Cell(label), *_score_cells(scores)) for label, scores in gap_steps(steps)]
    heads = ("Step", *_SCORES)
    return table("Gap after each addition", heads, rows) if len(rows) > 2 else None


def where_lines(found: Diagnosis) -> list[str]:
    """Where they disagreed most; of a log that agrees on average, where it still does."""
    return [_regime_text(one) for one in found.where or found.remaining.where]


def _regime_text(one: Regime) -> str:
    """`along track at speed 6.3 m/s to 9 m/s: mean -652 mm, 508 standard errors`."""
    low, high = (numbers.si_quantity(end, one.unit, 3) for end in (one.low, one.high))
    place = f"{one.axis}, {_spaced(one.covariate)} {low} to {high}"
    return f"{place}: mean {_length(one.mean_m)}, {abs(one.score):.3g} standard errors"


def remaining_text(found: Diagnosis) -> str:
    """What is more than noise; a log can be unexplained by what it contradicts alone."""
    if not found.remaining.beyond_noise:
        return ""
    where = "; ".join(_regime_text(one) for one in found.remaining.where)
    return "Unexplained and still there" + (f": {where}." if where else ".")


def _log_facts(found: Diagnosis) -> list[tuple[str, str]]:
    log = found.log
    motion = ", ".join(
        f"{_spaced(name)} low {numbers.number(m.low)}, high {numbers.number(m.high)}, unit {m.unit}"
        for name, m in log.motion.items()
    )
    facts = [
        ("files", sentence_list(list(found.log_files))),
        ("rows", numbers.count(log.rows)),
        ("used", numbers.count(log.used)),
        ("kind", log.kind),
        ("thinned", numbers.number(log.thinned)),
        ("notes", sentence_list(list(log.notes))),
        ("duration s", numbers.number(log.duration_s)),
        ("interval s", numbers.number(log.interval_s)),
        ("fitted", numbers.number(log.fitted)),
        ("motion", motion),
    ]
    return [(label, text) for label, text in facts if text]


def _rejected(log: LogRead) -> Table | None:
    rows = [(reason, Cell(numbers.count(n), n)) for reason, n in log.rejected.items()]
    return table("Rows left out", ("Reason", "Rows #"), rows) if rows else None


def _coverage(found: Sequence[Coverage]) -> Table | None:
    rows = [
        tuple(Cell(numbers.percent(share), share) for share in (one.nominal, one.before, one.after))
        for one in found
    ]
    caption = "Share of residuals inside the spec's own intervals"
    return table(caption, ("Nominal #", "Before #", "After #"), rows) if rows else None


def _provenance(found: Diagnosis) -> list[tuple[str, str]]:
    file = [] if found.spec is None else [("Spec file", found.spec.file)]
    known = found.provenance.to_json().items()
    return [*file, *((_spaced(key), str(value)) for key, value in known)]


def _floats(values: Sequence[float | None]) -> tuple[float, ...]:
    return tuple(math.nan if v is None else v for v in values)


def _figures(found: Diagnosis) -> dict[str, InlineFigure]:
    drawn: dict[str, InlineFigure] = {}
    plots = found.plots
    axes = [
        drawings.ResidualAxis(name, _floats(one.before), _floats(one.after), _floats(one.signature))
        for name, one in plots.residuals.axes.items()
    ]
    if len(plots.residuals.time_s) > 1:
        drawn["residuals"] = drawings.residuals(plots.residuals.time_s, axes)
    steps = [drawings.Step(label, scores.rms_m) for label, scores in gap_steps(found.steps)]
    if steps and found.gap.held_out is not None:
        drawn["gap"] = drawings.gap_staircase(steps, found.gap.held_out.floor.rms_m)
    maps = [_where_cells(one) for one in plots.where_map]
    if maps:
        drawn["where"] = drawings.where_map(maps[:6])
    rows = [(one.nominal, one.before, one.after) for one in plots.coverage]
    if rows:
        drawn["coverage"] = drawings.coverage(rows)
    return drawn


def _where_cells(one: CovariateMap) -> drawings.WhereCells:
    cells = tuple((cell.low, cell.high, abs(cell.score)) for cell in one.cells)
    return drawings.WhereCells(one.covariate, one.unit, cells)
