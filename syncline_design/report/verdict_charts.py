"""The charts a verdict has data for; each is drawn only when a page asks for it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from syncline_design.model.quantity import Dimension, parse_quantity
from syncline_design.report import axes as scales
from syncline_design.report import choice_tables, numbers, verdict_tables, verdict_words
from syncline_design.report.document import Chart, ExploredLimit, Explorer, Node
from syncline_design.report.text import shortened
from syncline_design.report.words import PRIMITIVES

if TYPE_CHECKING:
    from syncline_design.comparison.meaning import Summary
    from syncline_design.report.svg import InlineChart
    from syncline_design.verdict.named import CloudDesign
    from syncline_design.verdict.syncline_figures import SynclineFigures
    from syncline_design.verdict.tree import MissionVerdict, RequirementResult, Verdict

# What draws is imported where it draws: ElementTree and matplotlib hide behind it.


def tightest_limit(
    verdict: Verdict | Summary | MissionVerdict, kind: str
) -> RequirementResult | None:
    """The requirement with the tightest limit of a kind, of those that are waived the last; of
    several missions of the one whose figures are shown."""
    shown = shown_mission(verdict)
    judged = verdict if shown is None else shown
    rows = (row for row in judged.requirements if row.kind == kind)
    return min(rows, key=lambda row: (row.is_waived, row.limit), default=None)


def shown_mission(verdict: Verdict | Summary | MissionVerdict) -> MissionVerdict | None:
    """Of several missions the one whose ledger and figures a verdict has for its own."""
    missions: tuple[MissionVerdict, ...] = getattr(verdict, "missions", None) or ()
    own = getattr(verdict, "syncline", None)
    return next((one for one in missions if own is not None and one.syncline == own), None)


def of_mission(verdict: Verdict) -> str:
    """What a figure of one of several missions says below it, ` Of mission low.`"""
    shown = shown_mission(verdict)
    return "" if shown is None else f" Of mission {shown.name}."


def front_limit(verdict: Verdict) -> RequirementResult | None:
    """The accuracy limit that a front of errors is drawn with; none where missions differ in it."""
    rows = [row for one in verdict.missions or () for row in one.requirements]
    if len({row.limit for row in rows if row.kind == "accuracy"}) > 1:
        return None
    return tightest_limit(verdict, "accuracy")


def lowest_limit(verdict: Verdict, kind: str) -> float | None:
    """The tightest limit of a kind."""
    row = tightest_limit(verdict, kind)
    return None if row is None else row.limit


def syncline_chart(verdict: Verdict) -> list[Node]:
    """The verdict's Syncline with its operating point; nothing where it has no roof."""
    syncline = verdict.syncline
    if syncline is None or not syncline.sensor_error_m:
        return []

    def draw() -> InlineChart:
        from syncline_design.report import charts

        return charts.syncline(
            charts.SynclineCurve(
                floor_m=_floor_m(syncline),
                rate_mps=syncline.sync_rate_mps,
                tau_crit_s=syncline.tau_crit_s,
                tau_s=syncline.tau_s,
                total_m=syncline.total_m,
                limit=tightest_limit(verdict, "accuracy"),
                lever_arm_rate_mps=syncline.lever_arm.sync_rate_mps,
            )
        )

    caption = (
        "Accuracy against synchronisation accuracy. Roof: sensor noise and known effects alone. "
        "Slope: motion during the timestamp error. Marker: this design. Dotted, where drawn: with "
        "the lever arm's rotation."
    )
    return [Chart("syncline", draw, caption + of_mission(verdict))]


def _floor_m(syncline: SynclineFigures) -> float:
    """The error at tau 0 [m]: sensor noise and known effects."""
    return syncline.sensor_error_m + syncline.systematic_error_m


def explorer(verdict: Verdict) -> list[Node]:
    """Values for the sliders; the total follows the model that decides, in proportion to tau.

    So does each sensor's share of its own tau_crit, of which the requirement holds the largest.
    """
    syncline = verdict.syncline
    if syncline is None or not syncline.sensor_error_m or not syncline.tau_s:
        return []
    floor, tau, total = _floor_m(syncline), syncline.tau_s, syncline.total_m
    crit, limit = syncline.tau_crit_s, tightest_limit(verdict, "accuracy")
    fixed = [row for row in verdict.requirements if row.kind not in ("accuracy", "sync")]
    sync = tightest_limit(verdict, "sync")
    centre, middle = crit or tau, total if limit is None else limit.limit
    return [
        Explorer(
            chart="syncline",
            floor_m=floor,
            rate_mps=(total - floor) / tau,
            tau_s=tau,
            tau_crit_s=crit if sync is None or not sync.value else tau / sync.value,
            limit=None if limit is None else explored(limit),
            sync_limit=1.0 if sync is None else sync.limit,
            others_pass=all(verdict_words.status_of(r).word in ("pass", "waived") for r in fixed),
            tau_span=(min(centre / 1e3, tau / 2), max(centre * 1e2, tau * 2)),
            limit_span=(min(middle, floor) / 4, max(middle, total) * 10),
        )
    ]


def explored(limit: RequirementResult) -> ExploredLimit:
    """A limit as the page's script moves it: in the unit that it is shown in."""
    shown = numbers.limit(limit)
    unit = shown.split()[1]
    size_m = float(parse_quantity(f"1 {unit}", Dimension.LENGTH))
    return ExploredLimit(limit.limit, shown, unit, size_m)


def timing_chart(verdict: Verdict) -> list[Node]:
    """Each sensor's tau against its tau_crit."""
    roles = [] if verdict.design is None else list(verdict.design.roles)

    def draw() -> InlineChart:
        from syncline_design.report import charts

        bars = []
        for stage, role, entry in roles:
            tau, crit = entry.tau_s, entry.tau_crit_s
            label = f"{shortened(stage.name, 18)} \u00b7 {role}"
            bars.append(charts.TauBar(label, tau, crit, crit is None or tau < crit))
        return charts.tau_bars(bars)

    caption = (
        "Bar: timestamp error of the chosen timestamping. Mark: the sensor's \u03c4_crit. "
        "Logarithmic."
    )
    return [Chart("timing", draw, caption + of_mission(verdict))] if roles else []


def clocks_chart(verdict: Verdict) -> list[Node]:
    """Who stamps whom."""
    design = verdict.design
    if design is None:
        return []

    def draw() -> InlineChart:
        from syncline_design.report import charts_clocks as clocks

        kept = {clock.vehicle: clock for clock in design.clocks}
        drawn = []
        for vehicle in dict.fromkeys(stage.vehicle for stage in design.stages):
            sensors = tuple(
                clocks.Stamped(
                    f"{stage.name} \u00b7 {role}", one.name,
                    PRIMITIVES.get(one.primitive, one.primitive), one.timestamping_name,
                    one.timeline == "utc", one.tau_s, one.tau_crit_s,
                    one.tau_crit_s is None or one.tau_s < one.tau_crit_s,
                )
                for stage, role, one in design.roles if stage.vehicle == vehicle
            )  # fmt: skip
            clock = kept.get(vehicle)
            name = "no clock of its own named" if clock is None else clock.name
            offset = None if clock is None else clock.offset_bound_s
            drawn.append(clocks.ClockedVehicle(vehicle, sensors, name, offset))
        return clocks.clocks(drawn)

    caption = (
        "Each arrow leads from a sensor to the clock whose time its stamps are in. Above it: what "
        "stamps; below it: the signal, and \u03c4, what the stamp may be wrong by."
    )
    return [Chart("clocks", draw, caption)]


def ledger_chart(verdict: Verdict) -> list[Node]:
    """The terms of the total error."""
    entries = () if verdict.syncline is None else verdict.syncline.ledger
    many = len({entry.stage for entry in entries if entry.stage}) > 1

    def draw() -> InlineChart:
        from syncline_design.report import charts

        terms = []
        for entry in verdict_words.larger(entries):
            stage = f"{shortened(entry.stage, 14)}: " if many and entry.stage else ""
            label = stage + shortened(verdict_words.term_text(entry))
            terms.append(charts.LedgerBar(label, entry.value_m, entry.kind))
        total = math.fsum(entry.value_m for entry in entries)
        return charts.ledger(terms, tightest_limit(verdict, "accuracy"), total_m=total)

    caption = (
        "Terms add up to the total. Plain: sensor noise. Hatched: synchronisation. Crossed: known "
        "effects. Dotted: between samples."
    )
    return [Chart("ledger", draw, caption + of_mission(verdict))] if entries else []


def _cloud_words(
    cloud: Sequence[CloudDesign], shown: Sequence[CloudDesign], combinations: str | None
) -> str:
    """What the dots around the front are; shown: those that are near enough to be drawn."""
    if not shown:
        return ""
    every = combinations is not None and str(len(cloud)) == combinations
    number = numbers.count(len(cloud))
    which = f"all {number} designs" if every else f"{number} designs drawn at random"
    broken = any(one.breaks for one in shown)
    crosses = "; a cross breaks a requirement other than accuracy" if broken else ""
    dearest = max(one.cost for one in shown) or 1.0
    places = len({  # as far apart as the eye tells them: half a percent
        (round(200.0 * one.cost / dearest), round(200.0 * math.log(one.error_m))) for one in shown
    })  # fmt: skip
    drawn = f", at {places} places" if 2 * places < len(shown) else ""
    far = len(cloud) - len(shown)
    left_out = f", but for {far} far dearer or less accurate" if far else ""
    return f" Dots: {which}{left_out}{drawn}{crosses}."


def choice_chart(verdict: Verdict) -> list[Node]:
    """The exact front of cost against error, the chosen design on it."""
    choice = verdict.choice
    if choice is None:
        return []
    front = choice.front or ()
    points = [
        (entry.cost, entry.error_m, choice_tables.is_chosen(verdict, entry),
         choice_tables.sensors(entry.design))
        for entry in front
        if entry.cost is not None and entry.error_m
    ]  # fmt: skip

    price, cloud = lowest_limit(verdict, "cost"), choice.cloud or ()
    costs, worst_m = [point[0] for point in points], max((p[1] for p in points), default=0.0)
    near = scales.in_view(cloud, costs, worst_m, price) if points else []

    def draw() -> InlineChart:
        from syncline_design.report.charts_front import FrontMark, pareto_front

        limit = front_limit(verdict)
        drawn = [FrontMark(*point) for point in sorted(points, key=lambda point: point[0])]
        around = [
            FrontMark(one.cost, one.error_m, False, one.payload, bool(one.breaks)) for one in near
        ]
        currency = verdict_tables.currency_of(verdict)
        return pareto_front(drawn, currency, limit, price, cloud=around)

    caption = (
        "Every design on the line is the cheapest with that error; nothing that keeps the other "
        "requirements exists below and left of it."
    ) + _cloud_words(cloud, near, verdict.spec.combinations)
    return [Chart("choice", draw, caption)] if len(points) > 1 else []


def figure_chart(verdict: Verdict) -> list[Node]:
    """The designs of the front by the figure of the error that a requirement limits."""
    found = None if verdict.choice is None else verdict.choice.by_figure
    if found is None or len(found.designs) < 2:
        return []
    chosen = None if verdict.design is None else verdict.design.cost
    marks = [
        (one.cost, one.figure_m, one.cost == chosen, choice_tables.sensors(one.design), one.beaten)
        for one in found.designs
    ]

    row = next((row for row in verdict.requirements if row.id == found.requirement), None)

    def draw() -> InlineChart:
        from syncline_design.report.charts_front import FrontMark, pareto_front

        drawn = [FrontMark(*mark[:4]) for mark in marks if not mark[4]]
        around = [FrontMark(*mark[:2], False, mark[3]) for mark in marks if mark[4]]
        return pareto_front(
            drawn, verdict_tables.currency_of(verdict), row,
            lowest_limit(verdict, "cost"), "fig-by-figure", cloud=around, over=found.figure,
        )  # fmt: skip

    kind = "" if row is None else row.kind
    caption = (
        f"The designs of that front by the {found.figure} that {found.requirement} limits, each at "
        "its worst situation. Others may lie between them: optimize --pareto --against "
        f"{kind} draws the exact front over this figure."
    )
    return [Chart("by-figure", draw, caption)]
