"""What `check` says of one spec: the answer, the design, its errors, what they rest on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.choice.outcome import ROADS
from syncline_design.report import (
    choice_tables,
    errata,
    numbers,
    verdict_charts,
    verdict_tables,
    verdict_words,
)
from syncline_design.report.columns import errors
from syncline_design.report.document import (
    Document,
    Facts,
    Group,
    Heading,
    Inline,
    Items,
    Node,
    Section,
    Text,
    code,
    folded,
    given,
    provenance,
    section,
    show,
)
from syncline_design.report.error_figures import error_figures
from syncline_design.report.explained import explained
from syncline_design.report.on_alternatives import bargain_nodes
from syncline_design.report.on_infeasibility import infeasibility_nodes
from syncline_design.report.on_missions import missions, robustness
from syncline_design.report.on_nearest import nearest_nodes
from syncline_design.report.simulated import (
    BEYOND,
    along_chart,
    certificate,
    ensemble,
    histogram_chart,
    quantiles,
    simulation_facts,
)
from syncline_design.report.table import Table

if TYPE_CHECKING:
    from syncline_design.verdict.tree import Checked, MissionVerdict, Refused, Verdict

OPEN = ("infeasibility", "requirements", "missions", "baseline", "explained", "warnings")
MOST_OPEN = 12  # rows of a table of the choice that is not folded away


def on_verdict(verdict: Checked, more: Sequence[Node] = ()) -> Document:
    """A verdict as a document; parts that it does not have are left out.

    more: what else is known of the choice, as `optimize` does.
    """
    if verdict.verdict == "refused":
        return _on_refused(verdict)
    return folded(Document(
        family="Design report",
        outcome=verdict_words.outcome(verdict),
        name=verdict.name,
        sentences=(verdict_words.design_sentence(verdict),),
        facts=tuple(_key_facts(verdict)),
        sections=(
            *section("infeasibility", "Why no design meets the requirements", _why_not(verdict),
                     "Why not"),
            *section("requirements", "Requirements",
                     _at_a_glance(verdict)),
            *section("missions", "Missions", missions(verdict), "Missions"),
            *section("robustness", "What robustness costs", robustness(verdict), "Robustness"),
            *section("baseline", "Against the baseline", _since(verdict), "Baseline"),
            *section("explained", "Worked out", explained(verdict), "Worked out"),
            *section("figures", "Three figures", error_figures(verdict), "Figures"),
            *section("warnings", "Warnings", verdict_words.warning_nodes(verdict.warnings)),
            *section("payload", "Payload and timestamping", _payload(verdict), "Payload"),
            *section("bill", "Bill of materials", _bill(verdict), "Bill"),
            *section("timing", "Timestamp error of each sensor", _timing(verdict), "Timing"),
            *section("syncline", "Syncline", _syncline(verdict)),
            *section("ledger", "Where the error comes from", _ledger(verdict), "Ledger"),
            *section("simulation", "Simulated with the nonlinear chain", _simulation(verdict),
                     "Simulation"),
            *section("choice", "The choice", [*_choice(verdict), *more], "Choice"),
            *section("effects", "Known systematic effects taken into account", _effects(verdict),
                     "Known effects"),
            *section("basis", "Assumptions, sources, errata", _basis(verdict), "Basis", "page"),
            *_provenance(verdict),
        ),
        source=verdict.file,
    ), OPEN)  # fmt: skip


def _at_a_glance(verdict: Verdict) -> list[Node]:
    """Requirements, and in three figures where the error comes from, its timing, its spread."""
    total = None if verdict.syncline is None else verdict.syncline.total_m
    simulated, mission = verdict.monte_carlo, verdict_charts.of_mission(verdict)
    spread = [] if simulated is None else histogram_chart(simulated, total, mission)
    figures = (
        *verdict_charts.ledger_chart(verdict), *verdict_charts.timing_chart(verdict), *spread,
    )  # fmt: skip
    table = show(verdict_tables.requirements(verdict), silent=True)
    return [*table, *([Group(figures, "trio", reach="page")] if figures else [])]


def _since(verdict: Verdict) -> list[Node]:
    """What became of the verdict since an earlier one."""
    baseline = verdict.baseline
    if baseline is None:
        return []
    return [
        Text((verdict_words.since_sentence(baseline, verdict),)),
        *show(verdict_tables.since(verdict), silent=True),
    ]


def _on_refused(refused: Refused) -> Document:
    """A file that could not be read, among several that could."""
    return Document(
        family="Design report",
        outcome=verdict_words.outcome(refused),
        name=refused.name,
        sentences=(verdict_words.design_sentence(refused),),
        facts=(),
        sections=(*section("problems", "Problems in the file", problems(refused), "Problems"),),
    )


def _key_facts(verdict: Verdict) -> list[tuple[str, str]]:
    """Price, error, tightest margin: the answer in figures."""
    design = verdict.design
    facts = []
    if design is not None and design.cost is not None:
        currency = verdict_tables.currency_of(verdict)
        facts.append(("Price", numbers.money(design.cost, currency)))
    judged, where = _hardest(verdict)
    limit = verdict_charts.tightest_limit(judged, "accuracy")
    if judged.syncline is not None:
        error = numbers.error(judged.syncline.total_m, limit)
        asked = "" if limit is None else f" of {numbers.limit(limit)}"
        facts.append((f"Syncline error{where}", error + asked))
    figures = judged.figures
    if figures is not None and figures.quantile95_3d_m is not None:
        facts.append(
            (f"95 % of errors within{where}", numbers.error(figures.quantile95_3d_m, limit))
        )
    if figures is not None and figures.worst_case_m is not None:
        at = f"Worst case at {numbers.number(figures.worst_case_k, 6)} \u03c3{where}"
        facts.append((at, numbers.error(figures.worst_case_m, limit)))
    failing = verdict_words.failing_text(verdict.requirements)
    if failing:
        facts.append(("Failing", failing))
    row = verdict_words.tightest(verdict.requirements)
    if row is not None:
        facts.append(("Tightest margin", f"{row.id}: {verdict_words.margin_text(row)}"))
    within = judged.monte_carlo and judged.monte_carlo.probability_within_target
    if within:
        facts.append((f"Simulated within limit{where}", numbers.percent(within.value, 4)))
    if design is not None and design.mass is not None:
        facts.append(("Mass", numbers.mass(design.mass)))
    if design is not None and design.power is not None:
        facts.append(("Power", numbers.power(design.power)))
    return facts


def _hardest(verdict: Verdict) -> tuple[Verdict | MissionVerdict, str]:
    """Whose error leads: of several missions, that which comes nearest to its accuracy limit, of
    equally near ones, or where none has a limit, the largest; and its name for the labels."""
    missions = [one for one in verdict.missions or () if one.syncline is not None]
    if not missions:
        return verdict, ""

    def used(one: MissionVerdict) -> tuple[float, float]:
        limit = verdict_charts.tightest_limit(one, "accuracy")
        total = 0.0 if one.syncline is None else one.syncline.total_m
        return (0.0 if limit is None else total / limit.limit), total

    hardest = max(missions, key=used)
    return hardest, f", {hardest.name}"


def problems(refused: Refused) -> list[Node]:
    """What is wrong with a file that was refused, each with its place."""
    entries: tuple[Inline, ...] = tuple(
        (code(f"{entry.file}:{entry.line}:{entry.column}"), " ", given(entry.path), ": ",
         given(entry.message))
        for entry in refused.problems
    )  # fmt: skip
    return [Items(entries)] if entries else []


def _why_not(verdict: Verdict) -> list[Node]:
    why = verdict.infeasibility
    if why is None:
        return []
    limits = (
        verdict_charts.tightest_limit(verdict, "accuracy"),
        verdict_charts.lowest_limit(verdict, "cost"),
    )
    currency = verdict_tables.currency_of(verdict)
    return [*infeasibility_nodes(why), *nearest_nodes(verdict.nearest, currency, *limits)]


def _payload(verdict: Verdict) -> list[Node]:
    design = verdict.design
    if design is None:
        return []
    return [
        *show(verdict_tables.payload(verdict, design), silent=True),
        *show(verdict_tables.shared(verdict, design)),
    ]


def _bill(verdict: Verdict) -> list[Node]:
    lines = verdict.bill_of_materials
    return show(verdict_tables.bill(verdict, lines), silent=True) if lines else []


def _timing(verdict: Verdict) -> list[Node]:
    if verdict.design is None:
        return []
    limit = verdict_charts.tightest_limit(verdict, "accuracy")
    table = verdict_tables.taus(verdict.design, limit)
    lead = ("A sensor whose \u03c4 stays below its \u03c4_crit is limited by its own noise, not by "
            "its timestamps.")  # fmt: skip
    return [
        Text(lead), *verdict_charts.clocks_chart(verdict), *show(table, silent=True),
        *show(verdict_tables.measured(verdict)),
    ]  # fmt: skip


def _syncline(verdict: Verdict) -> list[Node]:
    syncline, chart = verdict.syncline, verdict_charts.syncline_chart(verdict)
    if syncline is None or not chart:
        return []
    limit = verdict_charts.tightest_limit(verdict, "accuracy")
    tau, crit = syncline.tau_s, syncline.tau_crit_s
    bound = "synchronisation" if crit is not None and tau >= crit else "sensor noise"
    more = [
        (label, math.fsum(beside))
        for kind, label in (("systematic", "Known effects"), ("underway", "Between samples"))
        if (beside := [term.value_m for term in syncline.ledger if term.kind == kind])
    ]
    sensor, sync, *beside_m, total = errors(
        [syncline.sensor_error_m, syncline.sync_error_m, *(size for _, size in more),
         syncline.total_m], limit,
    )  # fmt: skip
    facts = [
        ("Sensor error (roof)", sensor),
        ("Synchronisation rate (slope)", numbers.speed(syncline.sync_rate_mps)),
        ("\u03c4 of the system", numbers.time(tau)),
        ("\u03c4_crit of the system", numbers.time_limit(crit)),
        ("Bound by", bound),
        ("Synchronisation error", sync),
        *zip((label for label, _ in more), beside_m, strict=True),
        ("Total error", total),
        ("Drifts, grids, heave charged for", numbers.horizon(verdict.horizon)),
    ]
    column = Group((Facts(tuple(facts)), *verdict_charts.explorer(verdict)))
    return [Group((*chart, column), "split"), *show(verdict_tables.models(syncline, limit))]


def _ledger(verdict: Verdict) -> list[Node]:
    if verdict.syncline is None:
        return []
    limit = verdict_charts.tightest_limit(verdict, "accuracy")
    table = verdict_tables.ledger(verdict.syncline, limit)
    return show(table, silent=True)


def _simulation(verdict: Verdict) -> list[Node]:
    monte_carlo = verdict.monte_carlo
    if monte_carlo is None:
        return []
    told = (certificate(monte_carlo), _own_reach(verdict), ensemble(monte_carlo), BEYOND)
    return [
        Facts(tuple(simulation_facts(monte_carlo))),
        *(Text(text, quiet=True) for text in told if text),
        *along_chart(monte_carlo),
        *show(quantiles(monte_carlo)),
    ]


def _own_reach(verdict: Verdict) -> str:
    """Why the certified worst case may be smaller than the worst case that was found."""
    figures, found = verdict.figures, verdict.monte_carlo
    certified = None if figures is None else figures.worst_case_1sigma_m
    if certified is None or found is None or certified >= found.worst_case.value_m:
        return ""
    limit = verdict_charts.tightest_limit(verdict, "accuracy")
    return (
        "Here any two stamps differ by as much as the Syncline allows; the certified worst case "
        f"({numbers.error(certified, limit)}) lets each pair differ by what its own timestamps can."
    )


def _choice(verdict: Verdict) -> list[Node]:
    proof = _proof(verdict)
    nodes: list[Node] = [Text(proof)] if proof else []
    nodes += verdict_charts.choice_chart(verdict)
    nodes += verdict_charts.figure_chart(verdict)
    found = verdict.choice.bargains if verdict.choice is not None else None
    limit = verdict_charts.front_limit(verdict)
    nodes += bargain_nodes(found or (), verdict_tables.currency_of(verdict), limit)
    for table in choice_tables.choice_tables(verdict, limit):
        nodes += _folded(table)
    return nodes


def _folded(table: Table) -> list[Node]:
    """A table of the choice, on the page only; a long one is opened when it is asked for."""
    if len(table.rows) <= MOST_OPEN:
        return show(table, reach="page")
    summary = f"{table.caption} ({numbers.count(len(table.rows))} rows)"
    return [Group(tuple(show(table)), "fold", summary=summary, reach="page")]


def _proof(verdict: Verdict) -> str:
    """How it is known that nothing better exists."""
    proof = None if verdict.choice is None else verdict.choice.proof
    if proof is None:
        return ""
    method = ROADS.get(proof.method, proof.method)
    combinations = verdict.spec.combinations
    among = f" among {_grouped(combinations)} combinations" if combinations else ""
    optimal = "proven optimal" if proof.optimal else "not proven optimal"
    checked = ", recomputed exactly afterwards" if proof.rechecked else ""
    return f"Found by {method}{among}: {optimal}{checked}."


def _grouped(digits: str) -> str:
    """Digits of a whole number of any size, in groups of three; rounded beyond 15 of them."""
    if len(digits) > 15:
        return f"{digits[0]}.{digits[1:3]}e{len(digits) - 1}"
    return numbers.count(int(digits))


def _effects(verdict: Verdict) -> list[Node]:
    entries: list[Inline] = [
        (given(f"{entry.sentence} "), "(", code(entry.effect), ", ",
         given(f"{entry.stage} {entry.sensor}"), ")")
        for entry in verdict.effects or ()
    ]  # fmt: skip
    return [Items(tuple(entries))] if entries else []


def _basis(verdict: Verdict) -> list[Node]:
    notes = tuple(errata.relevant(verdict))
    title = Heading("Errata of the paper that bear on this design")
    nodes = [*show(verdict_tables.assumptions(verdict)), *show(verdict_tables.sources(verdict))]
    return [*nodes, title, Items(notes)] if notes else nodes


def _provenance(verdict: Verdict) -> list[Section]:
    """In full on the page; in one line elsewhere."""
    found = verdict.provenance
    full = [("Spec file", verdict.file), *verdict_words.pinned_by(found)]
    line = (
        f"syncline-design {found.version}, spec {found.spec_sha256[:12]}, "
        f"catalogs {found.catalogs_sha256[:12]}, seed {found.seed}"
    )
    if found.judged_on:
        line = f"{line}, waivers judged on {found.judged_on}"
    short = section("made-by", "Provenance", [Text(line)], reach="text")
    return [*provenance(full), *short]
