"""The paper, table by table and figure by figure: what it prints beside what comes out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from syncline_design.paper.errata import Erratum
from syncline_design.paper.plots import PlottedFigure, SimulatedPoint
from syncline_design.paper.reproduce import TAU_CRIT_TABLES, CellCounts, Reproduction
from syncline_design.paper.reproduce import PrintedCell as Printed
from syncline_design.report import numbers
from syncline_design.report.charts import SynclineCurve, syncline
from syncline_design.report.charts_curves import LabelledCurve, letters, synclines
from syncline_design.report.document import (
    Chart,
    Document,
    Facts,
    Group,
    Heading,
    Items,
    Node,
    Outcome,
    Text,
    section,
    show,
    strong,
)
from syncline_design.report.simulated import span
from syncline_design.report.svg import InlineChart
from syncline_design.report.table import Cell, Table, Tone, table

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
    "sensors": "Sensors",
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


def on_paper(result: Reproduction) -> Document:
    """A reproduction as a document: every table, figure and erratum."""
    authors = "E. R. Jellum, T. H. Bryne, T. A. Johansen, M. Orlandi\u0107"
    word = "Every printed figure is accounted for" if result.ok else "Some printed figures differ"
    return Document(
        family="Reproduction of arXiv:2209.01136v2",
        outcome=Outcome("good", "\u2713", word) if result.ok else Outcome("bad", "\u2717", word),
        name="The Syncline model, reproduced",
        sentences=(f"{authors}: every table and figure computed from the catalog, beside what the "
                   "paper prints.",),
        facts=tuple(_facts(result.counts)),
        sections=(
            *section("tables", "Tables", _tables(result)),
            *section("figures", "Figures", _figures(result)),
            *section("errata", "Errata of the paper", [_errata(result.errata)], "Errata"),
            *section("inputs", "Inputs", _inputs(result)),
        ),
        title=f"Reproduction of the Syncline paper: {word}",
    )  # fmt: skip


def _facts(counts: CellCounts) -> Iterable[tuple[str, str]]:
    for name, count in (
        ("\u03c4_crit cells", counts.tau_crit),
        ("Figures in the text", counts.text),
        ("Platform and sensor figures", counts.inputs),
    ):
        text = f"{count.agrees} of {count.printed} agree"
        text += f", {count.erratum} documented errata" if count.erratum else ""
        text += f", {count.differs} differ" if count.differs else ""
        yield name, text


def _tables(result: Reproduction) -> list[Node]:
    legend = Text(
        ("\u2713 agrees within one unit of the last printed digit, \u2020 documented erratum, "
         "\u2717 differs."),
    )  # fmt: skip
    nodes: list[Node] = [legend]
    for name in (*TAU_CRIT_TABLES, "text"):
        cells = [cell for cell in result.cells if cell.table == name]
        nodes += show(_matrix(name, cells), reach="page")
        nodes += show(_list(_title(name), cells), reach="text")
    return nodes


def _title(name: str) -> str:
    return _TITLES.get(name, name.replace("_", " "))


def _matrix(name: str, cells: list[Printed]) -> Table:
    """One printed table with rows and columns as in the paper, computed figures in the cells."""
    columns = list(dict.fromkeys(cell.column for cell in cells))
    rows = []
    for row in dict.fromkeys(cell.row for cell in cells):
        found = {cell.column: cell for cell in cells if cell.row == row}
        rows.append((Cell(row, code=True), *(_matrix_cell(found.get(c)) for c in columns)))
    notes = [f"{cell.row}, {cell.column}: {cell.note}" for cell in cells if cell.note]
    return table(_title(name), ("Row", *(f"{c} #" for c in columns)), rows, "; ".join(notes))


def _matrix_cell(cell: Printed | None) -> Cell:
    if cell is None:
        return Cell(numbers.MISSING)
    mark, tone = _MARKS[cell.status]
    sub = f"printed {numbers.typeset(cell.printed_text)}"
    return Cell(_computed(cell), cell.computed, tone, mark, sub=sub)


def _computed(cell: Printed) -> str:
    """The computed figure: five digits, or one decimal more than printed if that is more."""
    decimals = len(cell.printed_text.split(" ")[0].partition(".")[2])
    five, one_more = numbers.number(cell.computed, 5), numbers.places(cell.computed, decimals + 1)
    return numbers.typeset(f"{max(five, one_more, key=len)} {cell.unit}")


def _list(caption: str, cells: list[Printed]) -> Table:
    """The same row by row, narrow enough for a terminal."""
    rows: list[list[Cell | str]] = []
    for cell in cells:
        mark, tone = _MARKS[cell.status]
        told = cell.note.partition(":")[0] if cell.status == "erratum" else cell.note
        said = f"{cell.status}, {told}" if told else cell.status
        printed = Cell(numbers.typeset(cell.printed_text), cell.printed, written=True)
        computed = Cell(_computed(cell), cell.computed)
        rows.append([cell.row, cell.column, printed, computed, Cell(said, tone=tone, mark=mark)])
    return table(caption, ("Row", "Column", "Printed #", "Computed #", "Status"), rows)


def _figures(result: Reproduction) -> list[Node]:
    words = (
        "The paper's figures are not in its source; what it says of them stands beside the "
        "computed ones. The upright mark on a curve is its \u03c4_crit."
    )
    articles = [_article(figure) for figure in result.figures]
    beside = tuple(
        f"Figure {figure.number}: {_simulated(points)} \u03c4 from "
        f"{numbers.time(points[0].tau_s, 2)} to {numbers.time(points[-1].tau_s, 2)}."
        for figure in result.figures
        if (points := figure.simulated)
    )
    return [
        Text(words, reach="page"),
        Group(tuple(articles), "flow", reach="page"),
        *([Items(beside, reach="text")] if beside else []),
    ]


def _article(figure: PlottedFigure) -> Node:
    said: list[Node] = []
    if figure.number in _SAYS:
        said.append(Text((strong("The paper says:"), " ", _SAYS[figure.number])))
    if figure.simulated:
        said.append(Text((strong("Here:"), " ", _simulated(figure.simulated))))
    if figure.note:
        said.append(Text(figure.note, quiet=True))
    title = f"Figure {figure.number}: {figure.title}"
    chart = Chart(f"paper-{figure.number}", lambda: _drawn(figure, title), "")
    nodes = (Heading(title), chart, *said, *show(_curves(figure)))
    return Group(nodes, "article", f"figure-{figure.number}", reach="page")


def _simulated(points: tuple[SimulatedPoint, ...]) -> str:
    ratios = [point.ratio_to_syncline for point in points]
    ends = span(numbers.percent(min(ratios), 4), numbers.percent(max(ratios), 4))
    return f"{len(points)} simulated worst cases reach {ends} of the Syncline."


def _drawn(figure: PlottedFigure, title: str) -> InlineChart:
    """A single Syncline with roof, slope and both regions named, as in the paper's figure 1."""
    name, first = f"fig-paper-{figure.number}", figure.curves[0]
    if len(figure.curves) == 1 and not figure.simulated:
        shape = SynclineCurve(
            first.sensor_error_m, first.sync_rate_mps, first.tau_crit_s, None, None, None
        )
        return syncline(shape, name, title)
    beside = [(p.tau_s, p.worst_case_m) for p in figure.simulated]
    return synclines(_labelled(figure), beside, name, title)


def _labelled(figure: PlottedFigure) -> list[LabelledCurve]:
    return [
        LabelledCurve(c.label, c.sensor_error_m, c.tau_crit_s, figure.tau_s, c.error_m)
        for c in figure.curves
    ]


def _curves(figure: PlottedFigure) -> Table:
    named = letters(_labelled(figure))
    rows = [
        (
            f"{letter} \u00b7 {curve.label}" if letter else curve.label,
            Cell(numbers.length(curve.sensor_error_m), curve.sensor_error_m),
            Cell(numbers.speed(curve.sync_rate_mps), curve.sync_rate_mps),
            Cell(numbers.time_limit(curve.tau_crit_s), curve.tau_crit_s),
        )
        for curve, letter in zip(figure.curves, named, strict=True)
    ]
    heads = ("System", "Roof #", "Slope #", "\u03c4_crit #")
    return table(f"Figure {figure.number}, computed", heads, rows)


def _errata(errata: tuple[Erratum, ...]) -> Facts:
    return Facts(tuple((f"{e.where} ({e.id})", e.reason) for e in errata), "terms")


def _inputs(result: Reproduction) -> list[Node]:
    lead = "The catalog's platform and sensor figures against the printed ones."
    nodes: list[Node] = [Text(lead, reach="page")]
    for name in dict.fromkeys(cell.table for cell in result.inputs):
        shown = _matrix(name, [cell for cell in result.inputs if cell.table == name])
        nodes.append(Group(tuple(show(shown)), "fold", summary=shown.caption, reach="page"))
    disputed = [cell for cell in result.inputs if cell.status != "agrees"]
    nodes += show(_list("Inputs that are not as printed", disputed), reach="text")
    return [*nodes, Text(f"Computed by syncline-design {result.version}.", quiet=True)]
