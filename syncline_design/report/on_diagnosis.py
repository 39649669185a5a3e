"""The page of `diagnose`: what is missing, how sure, what it explains, what remains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from syncline_design.model.quantity import split_suffix
from syncline_design.report import figures_diagnosis as drawings
from syncline_design.report import numbers, page
from syncline_design.report.document import Outcome
from syncline_design.report.svg import InlineFigure
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import harmless, sentence_list
from syncline_design.report.verdict_words import Json, items, named, part

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


def render_diagnosis(data: Json) -> str:
    """The HTML page of one diagnosis (schema syncline-design/diagnosis/v1)."""
    data = harmless(data)
    drawn = _figures(data)
    sections: dict[str, Any] = {
        "findings": [finding_words(entry) for entry in items(data, "findings")],
        "gap": [t for t in (gap_table(data), _steps(data)) if t is not None],
        "residuals": "residuals" in drawn,
        "where": where_lines(data),
        "design": design_lines(data),
        "log": _log_facts(data),
        "provenance": _provenance(data),
    }
    return page.render_page(
        "diagnosis.html.j2",
        kind="Diagnosis",
        name=str(part(data, "spec").get("name") or "Measured log against simulation"),
        outcome=outcome_of(data),
        sentence=sentence_text(data),
        facts=_facts(data),
        contents=[(key, label) for key, label in _CONTENTS if sections[key]],
        sections=sections,
        figures={key: None if key not in drawn else page.trusted_svg(drawn[key].svg)
                 for key in ("residuals", "gap", "where", "coverage")},
        coverage=_coverage(data),
        meaning=meaning_table(data),
        unseen=[plain_text(entry) for entry in data.get("unseen") or ()],
        rejected=_rejected(data),
        remaining=remaining_text(data),
    )  # fmt: skip


def parameter_text(entry: Json) -> str:
    """`87.1 ± 0.3 ms`: an estimate with its standard uncertainty, both in one unit."""
    value, unit = numbers.finite(entry.get("value")), str(entry.get("unit") or "")
    if entry.get("seen") is False:
        return "not seen in this log"
    if value is None:
        return plain_text(entry.get("value"))
    return numbers.with_uncertainty(value, numbers.finite(entry.get("standard_uncertainty")), unit)


def _length(value_m: object) -> str:
    """Metres as the console prints them: 12.3 cm there is 12.3 cm here."""
    known = numbers.finite(value_m)
    return numbers.MISSING if known is None else numbers.with_uncertainty(known, None, "m")


def plain_text(value: object) -> str:
    """Any JSON value as words: lists joined, mappings as `key value`."""
    if value is None:
        return ""
    if isinstance(value, Mapping):
        return ", ".join(
            f"{key.replace('_', ' ')} {plain_text(entry)}" for key, entry in value.items()
        )
    if isinstance(value, list | tuple):
        return sentence_list([plain_text(entry) for entry in value])
    if isinstance(value, bool):
        return "yes" if value else "no"
    return numbers.number(value) if isinstance(value, int | float) else str(value)


def finding_words(entry: Json) -> dict[str, Any]:
    parameters = [
        (split_suffix(name)[0].replace("_", " "), parameter_text(value))
        for name, value in named(entry, "parameters")
    ]
    return {
        "title": str(entry.get("effect")).replace("_", " "),
        "code": str(entry.get("effect")),
        "place": " ".join(str(entry.get(key) or "") for key in ("stage", "sensor")).strip(),
        "sentence": _full_stop(str(entry.get("sentence") or "")),
        "parameters": parameters,
        "aliases": sentence_list([_effect_text(e) for e in entry.get("aliases") or ()]),
        "lookalikes": sentence_list([_excluded_text(e) for e in items(entry, "lookalikes")]),
        "excluded": sentence_list([_excluded_text(e) for e in items(entry, "excluded")]),
        "separated_by": plain_text(entry.get("separated_by")),
        "evidence": plain_text(entry.get("evidence")),
    }


def _full_stop(text: str) -> str:
    return text if not text or text.endswith(".") else text + "."


def _effect_text(entry: object) -> str:
    """`lever arm (position)`, from a record or from text."""
    if not isinstance(entry, Mapping):
        return str(entry)
    name = str(entry.get("effect")).replace("_", " ")
    return f"{name} ({entry.get('sensor')})" if entry.get("sensor") else name


def _excluded_text(entry: Json) -> str:
    """Name and how much worse it fits; one that fits better says why it is not the name."""
    worse = numbers.finite(entry.get("nats_worse"))
    if worse is None:
        return _effect_text(entry)
    if worse >= 0.0:
        kept = " with the noise kept" if entry.get("refitted") is False else ""
        return f"{_effect_text(entry)}, {worse:.3g} nat worse{kept}"
    if entry.get("possible") is False:
        return f"{_effect_text(entry)}, {-worse:.3g} nat better, but only with impossible values"
    return f"{_effect_text(entry)}, as well in its place"


def outcome_of(data: Json) -> Outcome:
    """The verdict's words; a log that contradicts itself is said to, whatever was named."""
    if data.get("sound") is False:
        return _UNSOUND
    return DIAGNOSES.get(str(data.get("verdict")), DIAGNOSES["unexplained"])


def check_sentences(data: Json) -> list[str]:
    """What is wrong with the log itself, or beyond the platform's limits."""
    said = [_full_stop(str(entry.get("message"))) for entry in items(data, "checks")]
    return [text[0].upper() + text[1:] for text in said]


def sentence_text(data: Json) -> str:
    """What is wrong with the log first, then what was found in it."""
    return " ".join([*check_sentences(data), _found_text(data)])


def _found_text(data: Json) -> str:
    found = items(data, "findings")
    if not found:
        return (
            "No effect of the dictionary explains what differs."
            if _left(data)
            else "Nothing beyond the spec's own noise was found."
        )
    return " ".join(_full_stop(str(e.get("sentence") or _effect_text(e))) for e in found)


def _facts(data: Json) -> list[tuple[str, str]]:
    held_out, log = part(part(data, "gap"), "held_out"), part(data, "log")
    facts = []
    closed = part(data, "gap").get("closed_fraction")
    if numbers.finite(closed) is not None:
        facts.append(("Gap closed on held-out data", numbers.percent(closed)))
    for key, label in (("before", "RMS before"), ("after", "RMS after"), ("fitted", "RMS at best")):
        rms = part(held_out, key).get("rms_m")
        if numbers.finite(rms) is not None:
            facts.append((label, _length(rms)))
    expected = numbers.finite(part(data, "gap").get("expected_rms_m"))
    if expected is not None:
        facts.append(("The spec's noise expects", _length(expected)))
    if log.get("rows") is not None:
        facts.append(("Rows used", f"{numbers.count(log.get('used'))} of "
                                   f"{numbers.count(log.get('rows'))}"))  # fmt: skip
    return facts


def design_lines(data: Json) -> list[str]:
    """What the findings mean for the design, in words; the horizon last."""
    design = part(data, "design")
    lines = [plain_text(line) for line in design.get("text") or ()]
    horizon = part(design, "horizon").get("text")
    return [*lines, str(horizon)] if horizon else lines


def meaning_table(data: Json) -> Table | None:
    """The error without and with the findings, by model and simulated."""
    rows: list[tuple[Cell | str, ...]] = [
        (
            str(entry.get("label")),
            *(Cell(numbers.length(entry.get(f"{side}_m")), numbers.finite(entry.get(f"{side}_m")))
              for side in ("before", "after")),
            _interval(entry.get("after_interval_m")),
        )
        for entry in items(part(data, "design"), "figures")
    ]  # fmt: skip
    heads = ("Error of the design", "Without #", "With the findings #", "95 % interval, with")
    return table("The error without and with the findings", heads, rows) if rows else None


def _interval(ends: object) -> str:
    found = [numbers.length(end) for end in ends] if isinstance(ends, list | tuple) else []
    return " to ".join(found)


def _score_cells(entry: Json) -> list[Cell]:
    return [
        Cell(_length(entry.get("rms_m")), numbers.finite(entry.get("rms_m"))),
        Cell(numbers.number(entry.get("reduced_chi2")), numbers.finite(entry.get("reduced_chi2"))),
        Cell(numbers.number(entry.get("nll_per_sample")),
             numbers.finite(entry.get("nll_per_sample"))),
        Cell(numbers.percent(entry.get("coverage_95")), numbers.finite(entry.get("coverage_95"))),
    ]  # fmt: skip


_SCORES: Final = ("RMS #", "Reduced \u03c7\u00b2 #", "NLL per sample #", "95 % coverage #")


def gap_table(data: Json) -> Table | None:
    """Before, after and floor on blocks and on a regime that the fit did not see; the placebo."""
    gap = part(data, "gap")
    sources = (
        ("held-out blocks, before", part(gap, "held_out"), "before"),
        ("held-out blocks, after", part(gap, "held_out"), "after"),
        ("held-out blocks, at best (fitted to all rows)", part(gap, "held_out"), "fitted"),
        ("held-out regime, before", part(part(gap, "regime"), "held_out"), "before"),
        ("held-out regime, after", part(part(gap, "regime"), "held_out"), "after"),
    )
    rows = [(Cell(label), *_score_cells(part(source, key))) for label, source, key in sources
            if part(source, key)]  # fmt: skip
    placebo = part(gap, "placebo")
    if part(part(placebo, "held_out"), "after"):
        label = f"after, plus a placebo: {plain_text(placebo.get('added'))}"
        rows.append((Cell(label), *_score_cells(part(part(placebo, "held_out"), "after"))))
    return table("Gap on data not used for the fit", ("Model", *_SCORES), rows) if rows else None


def gap_lines(data: Json) -> list[str]:
    """What the spec's noise expects on the held-out blocks, and the share of the gap closed."""
    gap = part(data, "gap")
    expected, closed = (numbers.finite(gap.get(k)) for k in ("expected_rms_m", "closed_fraction"))
    lines = [] if expected is None else [f"The spec's noise expects {_length(expected)}."]
    if closed is not None:
        lines.append(f"Gap closed on held-out data: {numbers.percent(closed)}.")
    return lines


def log_lines(data: Json) -> list[str]:
    """How many rows were read, used, fitted and left out, and how the log was read."""
    log = part(data, "log")
    if log.get("rows") is None:
        return []
    used, rows = numbers.count(log.get("used")), numbers.count(log.get("rows"))
    lines = [f"Log: {used} of {rows} rows used, {numbers.count(log.get('fitted'))} fitted."]
    if log.get("thinned"):
        lines.append(f"Too long to hold: {numbers.count(log['thinned'])} rows are between windows.")
    lines += [f"Left out: {numbers.count(n)} ({why})" for why, n in part(log, "rejected").items()]
    return [*lines, *map(str, log.get("notes") or ())]


def gap_steps(data: Json) -> list[tuple[str, Json]]:
    """(label, scores on held-out data), the spec as it is first, then each addition."""
    found: list[tuple[str, Json]] = []
    for entry in items(data, "steps"):
        held_out = part(entry, "held_out")
        if not found:
            found.append(("spec as it is", part(held_out, "before")))
        found.append((f"+ {plain_text(entry.get('added'))}", part(held_out, "after")))
    return [(label, scores) for label, scores in found if scores]


def _steps(data: Json) -> Table | None:
    rows = [(Cell(label), *_score_cells(scores)) for label, scores in gap_steps(data)]
    heads = ("Step", *_SCORES)
    return table("Gap after each addition", heads, rows) if len(rows) > 2 else None


def where_lines(data: Json) -> list[str]:
    found = data.get("where") or part(data, "remaining").get("where") or ()
    return [_cell_text(entry) for entry in found] if isinstance(found, Sequence) else []


def _cell_text(entry: object) -> str:
    """`along track at speed 6.3 m/s to 9 m/s: mean -652 mm, 508 standard errors`."""
    if not isinstance(entry, Mapping) or "covariate" not in entry:
        return plain_text(entry)
    unit = str(entry.get("unit") or "")
    low, high = (numbers.si_quantity(entry.get(key), unit, 3) for key in ("low", "high"))
    axis = str(entry.get("axis") or "all axes")
    text = f"{axis}, {str(entry['covariate']).replace('_', ' ')} {low} to {high}"
    mean, score = numbers.finite(entry.get("mean_m")), numbers.finite(entry.get("score"))
    if mean is not None:
        text += f": mean {_length(mean)}"
    return text + (f", {abs(score):.3g} standard errors" if score is not None else "")


def _left(data: Json) -> bool:
    """Whether more than noise remains; a log can be unexplained by what it contradicts alone."""
    remaining = part(data, "remaining")
    return bool(remaining.get("beyond_noise", remaining.get("unexplained")))


def remaining_text(data: Json) -> str:
    remaining = part(data, "remaining")
    if not _left(data):
        return ""
    where = "; ".join(_cell_text(entry) for entry in remaining.get("where") or ())
    return "Unexplained and still there" + (f": {where}." if where else ".")


def _log_facts(data: Json) -> list[tuple[str, str]]:
    log = part(data, "log")
    simple = [
        (str(key).replace("_", " "), plain_text(value))
        for key, value in log.items()
        if key not in ("rejected", "rows", "used") and value not in (None, "", [], {})
    ]
    files = plain_text(data.get("log_files"))
    counted = [("rows", numbers.count(log.get("rows"))), ("used", numbers.count(log.get("used")))]
    return [*([("files", files)] if files else []), *(counted if log else []), *simple]


def _rejected(data: Json) -> Table | None:
    rows = [
        (str(reason), Cell(numbers.count(count), numbers.finite(count)))
        for reason, count in part(part(data, "log"), "rejected").items()
    ]
    return table("Rows left out", ("Reason", "Rows #"), rows) if rows else None


def _coverage(data: Json) -> Table | None:
    rows = [
        tuple(Cell(numbers.percent(entry.get(key)), numbers.finite(entry.get(key)))
              for key in ("nominal", "before", "after"))
        for entry in items(part(data, "plots"), "coverage")
    ]  # fmt: skip
    caption = "Share of residuals inside the spec's own intervals"
    return table(caption, ("Nominal #", "Before #", "After #"), rows) if rows else None


def _provenance(data: Json) -> list[tuple[str, str]]:
    file = part(data, "spec").get("file")
    found = {**part(data, "versions"), **part(data, "provenance")}
    known = [(str(key).replace("_", " "), str(value)) for key, value in found.items()]
    return [*([("Spec file", str(file))] if file else []), *known]


def _floats(values: object) -> tuple[float, ...]:
    found = values if isinstance(values, list | tuple) else ()
    return tuple(float("nan") if numbers.finite(v) is None else float(v) for v in found)


def _figures(data: Json) -> dict[str, InlineFigure]:
    drawn: dict[str, InlineFigure] = {}
    plots = part(data, "plots")
    residuals = part(plots, "residuals")
    time = _floats(residuals.get("time_s"))
    axes = [
        drawings.ResidualAxis(name, _floats(entry.get("before")), _floats(entry.get("after")),
                              _floats(entry.get("signature")))
        for name, entry in named(residuals, "axes")
        if len(_floats(entry.get("before"))) == len(time) > 1
    ]  # fmt: skip
    if axes:
        drawn["residuals"] = drawings.residuals(time, axes)
    steps = [
        drawings.Step(label, rms)
        for label, scores in gap_steps(data)
        if (rms := numbers.finite(scores.get("rms_m"))) is not None
    ]
    if steps:
        floor = part(part(part(data, "gap"), "held_out"), "floor").get("rms_m")
        drawn["gap"] = drawings.gap_staircase(steps, numbers.finite(floor))
    maps = [_where_cells(entry) for entry in items(plots, "where_map")]
    shown = [entry for entry in maps if entry.cells]
    if shown:
        drawn["where"] = drawings.where_map(shown[:6])
    coverage = [
        (nominal, before, after)
        for entry in items(plots, "coverage")
        if (nominal := numbers.finite(entry.get("nominal"))) is not None
        and (before := numbers.finite(entry.get("before"))) is not None
        and (after := numbers.finite(entry.get("after"))) is not None
    ]
    if len(coverage) > 2:
        drawn["coverage"] = drawings.coverage(coverage)
    return drawn


def _where_cells(entry: Json) -> drawings.WhereCells:
    cells = []
    for cell in items(entry, "cells"):
        values = [numbers.finite(cell.get(key)) for key in ("low", "high", "score")]
        known = [value for value in values if value is not None]
        if len(known) == 3:
            cells.append((known[0], known[1], abs(known[2])))
    return drawings.WhereCells(
        str(entry.get("covariate")), str(entry.get("unit") or ""), tuple(cells)
    )
