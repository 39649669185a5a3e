"""Several missions with one payload: what each reaches, what it would fly alone, what robust is."""

from __future__ import annotations

from typing import TYPE_CHECKING

from syncline_design.machine.sentences import sentence_list
from syncline_design.report import numbers, verdict_charts
from syncline_design.report.columns import errors
from syncline_design.report.document import Facts, Node, Text, show
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.verdict_words import (
    kind_text,
    margin_text,
    status_of,
    waived_of,
    with_waived,
)
from syncline_design.report.words import OUTCOMES

if TYPE_CHECKING:
    from syncline_design.verdict.named import NamedDesign, RankedDesign
    from syncline_design.verdict.tree import MissionVerdict, RequirementResult, Robustness, Verdict


def missions(verdict: Verdict) -> list[Node]:
    """A table mission by requirement, then the shared payload against each mission's own."""
    found = verdict.missions
    if not found:
        return []
    lead = (
        "One payload for all missions: cost, mass and power are those of everything that is "
        "bought, once."
    )
    return [
        Text(lead),
        *show(_by_requirement(found), silent=True),
        *show(_alone(verdict, found)),
    ]


def _by_requirement(found: tuple[MissionVerdict, ...]) -> Table:
    columns = {row.id: row for mission in found for row in mission.requirements}
    rows = []
    for mission in found:
        own = {row.id: row for row in mission.requirements}
        missed = waived_of(mission.verdict, mission.requirements)
        outcome = with_waived(OUTCOMES[mission.verdict], missed)
        rows.append((
            Cell(mission.name),
            Cell(outcome.word, tone=outcome.tone, mark=outcome.mark),
            *(_kept(own.get(name)) for name in columns),
        ))  # fmt: skip
    heads = [f"{name} ({kind_text(row)})" for name, row in columns.items()]
    return table("Missions by requirement", ("Mission", "Verdict", *heads), rows)


def _kept(row: RequirementResult | None) -> Cell:
    """`111.9 mm of 200 mm`, with its mark."""
    if row is None:
        return Cell(numbers.MISSING)
    state = status_of(row)
    if row.value is None:
        return Cell(state.word, tone=state.tone, mark=state.mark)
    text = f"{numbers.held(row.value, row)} of {numbers.limit(row)}"
    return Cell(text, row.value, state.tone, state.mark, sub=margin_text(row))


def _alone(verdict: Verdict, found: tuple[MissionVerdict, ...]) -> Table | None:
    """What each mission would choose by itself, and what all share."""
    currency = verdict.spec.currency
    known = [one.alone for one in found if one.alone is not None]
    design = verdict.design
    if design is None or len(known) < len(found):
        return None
    of_all = _worst(found)
    *of_each, shown = errors([*(one.error_m for one in known), of_all], _in_unit_of(verdict))
    names = [one.name for one in found]
    rows = [
        _payload_row(name, one, currency, text)
        for name, one, text in zip(names, known, of_each, strict=True)
    ]
    rows.append((
        Cell("all of them"), Cell(numbers.money(design.cost, currency), design.cost),
        Cell(shown, of_all), Cell(_sensors(design, found)),
    ))  # fmt: skip
    costs = [one.cost for one in known if one.cost is not None]
    note = ""
    if len(costs) == len(known) and design.cost is not None:
        each = numbers.money(sum(costs), currency)
        dearest = numbers.money(max(costs), currency)
        note = f"A payload for each mission: {each} together; the dearest of them {dearest}."
    heads = ("Payload for", "Cost #", "Largest error #", "Sensors")
    return table("One payload for all against one for each", heads, rows, note)


def _payload_row(
    name: str, one: RankedDesign, currency: str, error: str
) -> tuple[Cell, Cell, Cell, Cell]:
    return (
        Cell(name),
        Cell(numbers.money(one.cost, currency), one.cost),
        Cell(error, one.error_m),
        Cell(_sensors(one.design)),
    )


def _in_unit_of(verdict: Verdict) -> RequirementResult | None:
    """The limit in whose unit errors of several missions stand, also where their limits differ."""
    return verdict_charts.tightest_limit(verdict, "accuracy")


def _worst(found: tuple[MissionVerdict, ...]) -> float:
    judged = [row.value for one in found for row in one.requirements if row.kind == "accuracy"]
    totals = [one.syncline.total_m for one in found if one.syncline is not None]
    return max(*totals, *(value for value in judged if value is not None))


def _sensors(design: NamedDesign, found: tuple[MissionVerdict, ...] = ()) -> str:
    """The sensors by role; where missions have their own, each one's."""
    named = []
    for stage, role, one in design.roles:
        others = {
            other.name: mission.name
            for mission in found
            if mission.design is not None
            for at, slot, other in mission.design.roles
            if (at.name, slot) == (stage.name, role)
        }
        if len(others) > 1:
            named += [f"{name} ({mission})" for name, mission in others.items()]
        else:
            named.append(one.name)
    return sentence_list(named)


def robustness(verdict: Verdict) -> list[Node]:
    """The design beside the one that would do if every figure were as given."""
    found = verdict.robustness
    if found is None:
        return []
    return [Text(_lead(found)), Facts(tuple(_price(found, verdict)))]


def _lead(found: Robustness) -> str:
    if not found.figures:
        return "No datasheet figure has an interval: what holds as given holds always."
    plural = "figure" if found.figures == 1 else "figures"
    if found.choose_for == "always":
        return (
            f"Chosen to hold wherever {found.figures} datasheet {plural} lie in their intervals: "
            "accuracy with every error at its largest, sync with every error at its smallest."
        )
    return (
        f"Chosen to hold with probability {found.choose_for}, {found.figures} datasheet {plural} "
        "independent and uniform in their intervals, all requirements together."
    )


def _price(found: Robustness, verdict: Verdict) -> list[tuple[str, str]]:
    facts = []
    nominal = found.nominal
    if nominal is None:
        facts.append(("At given figures", "no design meets every requirement"))
    else:
        currency = verdict.spec.currency
        amount = numbers.money(nominal.cost, currency)
        error = numbers.error(nominal.error_m, _in_unit_of(verdict))
        facts.append(("At given figures", f"{_sensors(nominal.design)}: {amount}, {error}"))
    if found.probability is not None:
        one = found.probability
        low, high = numbers.percent(one.low, 4), numbers.percent(one.high, 4)
        samples = numbers.count(one.samples)
        told = f"{numbers.percent(one.value, 4)} ({low} to {high}, {samples} samples)"
        facts.append(("Every requirement holds with", told))
    if found.price is not None:
        facts.append(("Price of robustness", numbers.in_unit(found.price, found.unit)))
    return facts
