"""The paper, table by table and figure by figure: what it prints beside what comes out."""

from __future__ import annotations

from typing import Any, Final

from syncline_design.report import numbers, page
from syncline_design.report.figures import SynclineCurve, syncline
from syncline_design.report.figures_curves import LabelledCurve, letters, synclines
from syncline_design.report.svg import InlineFigure
from syncline_design.report.table import Cell, Table, Tone, table
from syncline_design.report.text import harmless
from syncline_design.report.verdict_words import OUTCOMES, Json, items, part

_MARKS: Final[dict[str, tuple[str, Tone]]] = {
    "agrees": ("\u2713", "good"),
    "erratum": ("\u2020", "warn"),
    "differs": ("\u2717", "bad"),
}
_TITLES: Final = {
    "tau_crit_georeferencing": "\u03c4_crit, direct georeferencing",
    "tau_crit_survey": "\u03c4_crit, subsea survey",
    "text": "Figures in the text",
    "platforms": "Robot platforms",
    "position": "Sensor noise, position",
    "attitude": "Sensor noise, attitude",
    "ranging": "Sensor noise, ranging",
}
# What the paper says of its own figures, paraphrased (arXiv:2209.01136v2, sections V and VI).
_SAYS: Final = {
    1: "Accuracy approaches 10 per metre, the inverse of the sensors' 0.1 m; left of 1/\u03c4_crit "
    "the system is sync-bound, right of it sensor-bound.",
    2: "Roofs differ because the platforms look at objects at different distances; the shorter the "
    "roof, the more sensitive the platform is to timestamp errors.",
    3: "The worst simulated error at each \u03c4 is set beside the Syncline; the paper finds the "
    "model fit for direct georeferencing.",
    4: "Other payloads raise or lower the roof and change how far it reaches.",
    5: "Both roofs at about 1.67 m (an erratum, see below); \u03c4_crit 16 ms with the large "
    "vessel, 4 ms with the small one.",
    6: "A better GNSS receiver changes little; a better INS or USBL changes much.",
    7: "No significant deviation between Syncline and simulation.",
}


def render_reproduction(data: Json) -> str:
    """The HTML page of `reproduce` (schema syncline-design/reproduction/v1)."""
    data = harmless(data)
    ok = bool(data.get("ok"))
    result = OUTCOMES["meets" if ok else "fails"]
    return page.render_page(
        "reproduction.html.j2",
        kind="Reproduction of arXiv:2209.01136v2",
        contents=[
            ("tables", "Tables"),
            ("figures", "Figures"),
            ("errata", "Errata"),
            ("inputs", "Inputs"),
        ],
        outcome=result,
        word="Every printed figure is accounted for" if ok else "Some printed figures differ",
        counts=_counts(data),
        tables=[_matrix(data, "cells", name) for name in _names(data, "cells")],
        inputs=[_matrix(data, "inputs", name) for name in _names(data, "inputs")],
        figures=[_figure(entry) for entry in items(data, "figures")],
        errata=_errata(data),
        version=str(data.get("version") or ""),
    )


def _names(data: Json, key: str) -> list[str]:
    return list(dict.fromkeys(str(entry.get("table")) for entry in items(data, key)))


def _counts(data: Json) -> list[tuple[str, str]]:
    labels = {"tau_crit": "\u03c4_crit cells", "text": "Figures in the text",
              "inputs": "Platform and sensor figures"}  # fmt: skip
    facts = []
    for key, count in part(data, "counts").items():
        agree, erratum = count.get("agrees"), count.get("erratum")
        text = f"{agree} of {count.get('printed')} agree"
        text += f", {erratum} documented errata" if erratum else ""
        text += f", {count['differs']} differ" if count.get("differs") else ""
        facts.append((labels.get(str(key), str(key)), text))
    return facts


def _matrix(data: Json, key: str, name: str) -> Table:
    """One printed table with rows and columns as in the paper, computed figures in the cells."""
    cells = [entry for entry in items(data, key) if entry.get("table") == name]
    columns = list(dict.fromkeys(str(entry.get("column")) for entry in cells))
    rows = []
    for row in dict.fromkeys(str(entry.get("row")) for entry in cells):
        found = {str(e.get("column")): e for e in cells if str(e.get("row")) == row}
        rows.append((Cell(row, code=True), *(_matrix_cell(found.get(c)) for c in columns)))
    notes = [
        f"{entry.get('row')}, {entry.get('column')}: {entry.get('note')}"
        for entry in cells
        if entry.get("note")
    ]
    title = _TITLES.get(name, name.replace("_", " "))
    heads = ("", *(f"{column} #" for column in columns))
    return table(title, ("Row", *heads[1:]), rows, "; ".join(notes))


def _matrix_cell(entry: Json | None) -> Cell:
    if entry is None:
        return Cell(numbers.MISSING)
    mark, tone = _MARKS.get(str(entry.get("status")), _MARKS["differs"])
    computed = numbers.finite(entry.get("computed"))
    shown = numbers.MISSING if computed is None else f"{computed:.6g}"
    printed = entry.get("printed_text") or entry.get("printed")
    unit = str(entry.get("unit") or "").replace("us", "\u00b5s")
    return Cell(f"{shown} {unit}".strip(), computed, tone, mark, sub=f"printed {printed}")


def _figure(entry: Json) -> dict[str, Any]:
    number = int(entry.get("number") or 0)
    tau = tuple(float(value) for value in entry.get("tau_s") or ())
    curves = [
        LabelledCurve(
            str(curve.get("label")),
            float(curve["sensor_error_m"]),
            numbers.finite(curve.get("tau_crit_s")),
            tau,
            tuple(float(value) for value in curve.get("error_m") or ()),
        )
        for curve in items(entry, "curves")
    ]
    simulated = [(float(p["tau_s"]), float(p["worst_case_m"])) for p in items(entry, "simulated")]
    title = f"Figure {number}: {entry.get('title')}"
    name = f"fig-paper-{number}"
    drawn = (
        _annotated(curves[0], items(entry, "curves")[0], name, title)
        if len(curves) == 1 and not simulated
        else synclines(curves, simulated, name, title)
    )
    return {
        "id": f"figure-{number}",
        "title": title,
        "svg": page.trusted_svg(drawn.svg),
        "says": _SAYS.get(number, ""),
        "note": str(entry.get("note") or ""),
        "curves": _curve_table(number, curves, items(entry, "curves")),
        "simulated": _simulated_sentence(items(entry, "simulated")),
    }


def _annotated(curve: LabelledCurve, entry: Json, name: str, title: str) -> InlineFigure:
    """A single Syncline with roof, slope and both regions named, as in the paper's figure 1."""
    rate = numbers.finite(entry.get("sync_rate_mps")) or 0.0
    shape = SynclineCurve(curve.roof_m, rate, curve.tau_crit_s, None, None, None)
    return syncline(shape, name, title)


def _curve_table(number: int, curves: list[LabelledCurve], entries: list[Json]) -> Table:
    rows = [
        (
            Cell(f"{letter} \u00b7 {curve.label}" if letter else curve.label),
            Cell(numbers.length(curve.roof_m), curve.roof_m),
            Cell(numbers.speed(entry.get("sync_rate_mps")), entry.get("sync_rate_mps")),
            Cell(numbers.time_limit(curve.tau_crit_s), curve.tau_crit_s),
        )
        for curve, entry, letter in zip(curves, entries, letters(curves), strict=True)
    ]
    heads = ("System", "Roof #", "Slope #", "\u03c4_crit #")
    return table(f"Figure {number}, computed", heads, rows)


def _simulated_sentence(points: list[Json]) -> str:
    ratios = [r for p in points if (r := numbers.finite(p.get("ratio_to_syncline"))) is not None]
    if not ratios:
        return ""
    return (
        f"{len(ratios)} simulated worst cases reach {numbers.percent(min(ratios), 4)} to "
        f"{numbers.percent(max(ratios), 4)} of the Syncline."
    )


def _errata(data: Json) -> list[tuple[str, str]]:
    return [(str(e.get("where")), str(e.get("reason"))) for e in items(data, "errata")]
