"""Results as a notebook shows them: the same documents as on a page, as a fragment of HTML."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from syncline_design.report import numbers
from syncline_design.report.document import Chart, Document, Node, Outcome, section, show
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.verdict_words import with_waived
from syncline_design.report.words import OUTCOMES

if TYPE_CHECKING:
    from syncline_design.diagnosis.result import Finding
    from syncline_design.report.svg import InlineChart
    from syncline_design.verdict.named import FrontDesign, NamedDesign, RankedDesign
    from syncline_design.verdict.optimization import Optimization

_HERE: Final = __name__
_REPORT: Final = "syncline_design.report"
# By class, where the function is that makes its document; loaded when one is shown.
_MAKERS: Final = {
    "Acceptance": (f"{_REPORT}.on_acceptance", "on_acceptance"),
    "Audit": (f"{_REPORT}.on_audit", "on_audit"),
    "FrontDesign": (_HERE, "on_front_design"),
    "RankedDesign": (_HERE, "on_front_design"),
    "DiagnosisAndDesign": (f"{_REPORT}.on_diagnosis", "on_diagnosis"),
    "Diff": (f"{_REPORT}.on_diff", "on_diff"),
    "Finding": (_HERE, "on_finding"),
    "Optimization": (_HERE, "on_optimization"),
    "PlanRun": (f"{_REPORT}.on_plan", "on_plan"),
    "Reproduction": (f"{_REPORT}.on_paper", "on_paper"),
    "Simulation": (f"{_REPORT}.on_simulation", "on_simulation"),
    "StudyResult": (f"{_REPORT}.on_study", "on_study"),
    "TimingAndSpec": (f"{_REPORT}.on_timing", "on_timing"),
    "Verdict": (f"{_REPORT}.on_verdict", "on_verdict"),
    "Watch": (f"{_REPORT}.on_watch", "on_watch"),
}


def shown(result: object) -> str | None:
    """The HTML of a result; None of one that only its `repr` tells."""
    names = (kind.__name__ for kind in type(result).__mro__)
    place = next((_MAKERS[name] for name in names if name in _MAKERS), None)
    if place is None:
        return None
    from syncline_design.report.render_html import fragment

    module, name = place
    made: Callable[[Any], Document] = getattr(import_module(module), name)
    return fragment(made(result))


def on_finding(found: Finding) -> Document:
    """One finding of a diagnosis by itself."""
    from syncline_design.diagnosis.one_of_several import class_words, is_one_of_several
    from syncline_design.report.on_findings import finding_node, headline

    several = is_one_of_several(found)
    named = class_words(found) if several else found.effect.replace("_", " ")
    said = headline(found) if several else found.sentence
    outcome = Outcome("warn", "!", named)
    name = f"{found.sensor}, {found.stage}"
    nodes = section("finding", "What is known of it", [finding_node(found)])
    return Document("Finding", outcome, name, (said,), (), tuple(nodes))


def on_front_design(one: RankedDesign | FrontDesign) -> Document:
    """One of the best designs, or of those on a front, by itself."""
    takes = [
        ("Price", one.cost, numbers.money(one.cost, one.design.currency)),
        ("Mass", one.mass, numbers.in_unit(one.mass, "kg")),
        ("Power", one.power, numbers.in_unit(one.power, "W")),
        ("Error", one.error_m, numbers.length(one.error_m)),
    ]
    shown = [(label, words) for label, value, words in takes if value is not None]
    rows = [(f"{stage.name} {role}", entry.name, entry.timestamping_name)
            for stage, role, entry in one.design.roles]  # fmt: skip
    payload = show(table("Payload", ("Role", "Sensor", "Timestamping"), rows), silent=True)
    outcome = Outcome("", "", ", ".join(words for _, words in shown))
    name = ", ".join(entry.name for _, _, entry in one.design.roles)
    return Document("Design", outcome, name, (), (), tuple(section("payload", "Payload", payload)))


def on_optimization(result: Optimization) -> Document:
    """An optimization by its data alone: the best designs, and the front where it was asked for."""
    currency = result.designs[0].design.currency if result.designs else ""
    designs = _designs("Best designs", result.designs, currency)
    front = _designs("Exact front", result.front or (), currency)
    drawn = _front_chart(result, currency)
    exact = section("front", "Exact front, all requirements met but accuracy",
                    [*drawn, *show(front, silent=True)])  # fmt: skip
    said = () if result.message is None else (result.message,)
    return Document(
        family="Optimization",
        outcome=with_waived(OUTCOMES[result.verdict], result.waived or ()),
        name=result.spec.name,
        sentences=said,
        facts=(),
        sections=(
            *(exact if drawn else []),  # a notebook opens what comes first
            *section("designs", "Best designs", show(designs, silent=True)),
            *([] if drawn else exact),
        ),
        source=result.spec.file,
    )  # fmt: skip


def _designs(
    caption: str, designs: Sequence[RankedDesign | FrontDesign], currency: str
) -> Table | None:
    weighed = any(one.mass is not None for one in designs)
    rows = [
        (
            Cell(str(place), float(place)),
            Cell("-" if one.cost is None else numbers.money(one.cost, currency), one.cost),
            *(_weights(one) if weighed else ()),
            Cell(numbers.length(one.error_m), one.error_m),
            _payload(one.design),
        )
        for place, one in enumerate(designs, 1)
    ]
    weights = ("Mass #", "Power #") if weighed else ()
    heads = ("Place #", "Cost #", *weights, "Error #", "Payload")
    return table(caption, heads, rows) if rows else None


def _weights(one: RankedDesign | FrontDesign) -> tuple[Cell, Cell]:
    mass, power = numbers.in_unit(one.mass, "kg"), numbers.in_unit(one.power, "W")
    return Cell(mass, one.mass), Cell(power, one.power)


def _front_chart(result: Optimization, currency: str) -> list[Node]:
    """The exact front as a staircase, the best design on it; nothing of a single price."""
    best = result.designs[0] if result.designs else None
    marks = [
        (
            one.cost,
            one.error_m,
            best is not None and one.design == best.design,
            _payload(one.design),
        )
        for one in result.front or ()
        if one.cost is not None and one.error_m
    ]
    if len(marks) < 2:
        return []

    def draw() -> InlineChart:
        from syncline_design.report.charts_front import FrontMark, pareto_front

        drawn = [FrontMark(*mark) for mark in sorted(marks, key=lambda mark: mark[0])]
        over = result.front_figure or "error"
        return pareto_front(drawn, currency, None, None, over=over)

    caption = "Every design on the line is the cheapest with that error; nothing lies below it."
    return [Chart("front", draw, caption)]


def _payload(design: NamedDesign) -> str:
    return "; ".join(
        f"{stage.name} {role}: {entry.name}, {entry.timestamping_name}"
        for stage, role, entry in design.roles
    )
