"""What `plan` says: the drive leg by leg, what it tells, what it leaves open, what it saves."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Final

from syncline_design.machine.records import with_texts
from syncline_design.planning.legs import speed_words
from syncline_design.planning.path import PathStates
from syncline_design.planning.result import Plan, Separated
from syncline_design.planning.telling import PlanRun
from syncline_design.report import charts_plan as drawings
from syncline_design.report import numbers
from syncline_design.report.document import (
    Chart,
    Document,
    Items,
    Node,
    Text,
    code,
    pins,
    provenance,
    section,
    show,
)
from syncline_design.report.plan_sentences import (
    ONE,
    correlation_words,
    facts,
    figure,
    how_far,
    outcome,
    pair_figure,
    pair_head,
    parameter,
    sentences,
    would_take,
)
from syncline_design.report.table import Cell, Table, table, turned
from syncline_design.report.text import visible
from syncline_design.report.words import effect_words

Row = tuple[Cell | str, ...]
STANDS_MPS: Final = 0.01  # below which a vehicle is at rest
MOST_TARGETS: Final = 12  # told outside the page
MOST_COLUMNS: Final = 6  # of a table that fits a page


def on_plan(run: PlanRun) -> Document:
    """A plan as a document."""
    found: Plan = with_texts(run.result, visible)
    return Document(
        family="Test drive",
        outcome=outcome(found),
        name=found.spec.name,
        sentences=tuple(sentences(found)),
        facts=tuple(facts(found)),
        sections=(
            *section("legs", "Legs", _legs(found, run.path)),
            *section("path", "Path", _path(run), reach="page"),
            *section("after", "What is known after each leg", _after(found), "After"),
            *section("pairs", "Told apart", _pairs(found), "Pairs"),
            *section("standard", "The field's standard line plans", _standard(found), "Standard"),
            *section("flown", "What was flown", _flown(found), "Flown"),
            *section("open", "What stays unseen", _open(found), "Unseen"),
            *section("log", "What the log needs", _log(found), "Log"),
            *section("targets", "Targets", _targets(found)),
            *section("rests", "What it rests on", _rests(found), "Rests on"),
            *provenance(_provenance(found)),
        ),
        source=found.spec.file,
        title=f"Test drive: {found.spec.name}",
    )


def _column_sizes(found: Plan) -> dict[str, float]:
    """What gives each parameter's column its unit: what is asked, else its largest figure."""
    known = [*(one.sigma for one in found.after), found.after[-1].sigma_all]
    sizes = {}
    for key in found.after[-1].sigma:
        values = [one[key] for one in known if math.isfinite(one.get(key, math.inf))]
        sizes[key] = found.tolerance.get(key) or max(values, default=1.0)
    return sizes


def _legs(found: Plan, path: PathStates) -> list[Node]:
    several = len({leg.stage for leg in found.legs}) > 1
    rows = [
        (leg.name, numbers.typeset(f"{_clock(leg.from_s)} to {_clock(leg.to_s)}"),
         f"{leg.heading_deg:03.0f}\u00b0", *([leg.stage] if several else []), leg.words)
        for leg in found.legs
    ]  # fmt: skip
    heads = ("Leg", "From, to", "Heading", *(["Stage"] if several else []), "What to do")
    begun_mps = math.hypot(*path.velocity_mps[0, :2])  # what heaves a ship is no way
    how = f"at {numbers.typeset(speed_words(begun_mps))}" if begun_mps > STANDS_MPS else "at rest"
    every = ", and so does every leg; its turn counts as its time" if len(found.legs) > 1 else ""
    words = f"The drive begins {how}{every}."
    return [*show(table("Legs", heads, rows), silent=True), Text(words, quiet=True)]


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole // 60}:{whole % 60:02d}"


def _path(run: PlanRun) -> list[Node]:
    caption = "The path from above, leg by leg, with the targets to survey (crosses)."
    return [Chart("path", partial(drawings.path, run), caption)]


def _after(found: Plan) -> list[Node]:
    keys, sizes = _shown(found), _column_sizes(found)

    def row(name: str, values: Mapping[str, float], of_pair: str = "") -> Row:
        shown = [Cell(figure(k, values[k], sizes[k]) if k in values else "", _sort(values.get(k)))
                 for k in keys]  # fmt: skip
        return (name, *shown, Cell(of_pair))

    rows = [row(one.leg, one.sigma, pair_figure(one)) for one in found.after]
    rows += [row("asked", found.tolerance)] if found.tolerance else []
    rows.append(row("all effects free", found.after[-1].sigma_all))
    heads = ("After leg", *(f"{parameter(k)} #" for k in keys), f"{pair_head(found)} #")
    note = (
        "Standard uncertainties with what is asked and the noise free; "
        "\u201call effects free\u201d is with every effect free that this system can have, within "
        "its prior. What has a double (the latencies of all sensors together, the two lever arms) "
        "stays at its prior there, whatever is driven."
        f"{_without_rival(found)}"
    )
    nodes = show(_fitting(table("After each leg", heads, rows, note)), silent=True)
    if not found.tolerance or len(found.after) < 2:
        return nodes
    caption = "Standard uncertainty over what is asked, after each leg."
    return [*nodes, Chart("after", partial(drawings.after, found), caption)]


def _fitting(one: Table) -> Table:
    """A table of more parameters than a page is wide has a row for each of them."""
    is_wide = len(one.heads) > MOST_COLUMNS and len(one.heads) > len(one.rows)
    return turned(one, "Parameter") if is_wide else one


def _without_rival(found: Plan) -> str:
    """That a rival which only the size tells is not among what is free."""
    if not found.pairs or any(k.startswith(f"{found.pairs[0].second}.") for k in _shown(found)):
        return ""
    first, second = map(effect_words, (found.pairs[0].first, found.pairs[0].second))
    return (
        f" To first order {first} and {second} are one, and only the size of {first} tells them "
        f"apart: its standard uncertainty is the one without {second}."
    )


def _shown(found: Plan) -> Sequence[str]:
    """The parameters whose standard uncertainty is told."""
    return list(found.after[-1].sigma)


def _sort(value: float | None) -> float:
    return math.inf if value is None else value


def _pairs(found: Plan) -> list[Node]:
    return [Items(tuple(_pair_text(one) for one in found.pairs))] if found.pairs else []


def _pair_text(one: Separated) -> str:
    """`latency(position) of 2 ms from lever_arm(position): told apart; noncentrality ...`."""
    said = "told apart" if one.separated else "not told apart"
    wanted = numbers.number(one.wanted, 3)

    def way(first: str, sizes: Mapping[str, float], noncentrality: float) -> tuple[str, str]:
        size = ", ".join(figure(name, size) for name, size in sizes.items())
        least = " in the direction that shows least" if one.back and len(sizes) > 1 else ""
        return f"{first} of {size}", f"{numbers.number(noncentrality, 3)} of {wanted}{least}"

    size, reached = way(one.first, one.sizes, one.noncentrality)
    if one.back is None:
        return f"{size} from {one.second}: {said}; noncentrality {reached}"
    back_size, back = way(one.second, one.back.sizes, one.back.noncentrality)
    return (
        f"{size} from {one.second}: {said}; correlation {correlation_words(one.correlation)}, "
        f"noncentrality {reached}; the other way about, of {back_size}, {back}"
    )


def _standard(found: Plan) -> list[Node]:
    if not found.standard:
        return []
    own, keys = found.after[-1], _shown(found)
    minutes = [found.duration_s / 60.0 if found.reached else None]
    minutes += [one.minutes for one in found.standard]
    first, *others = map(Cell, numbers.drive_times(minutes), map(_sort, minutes))
    rows = [_standard_row("this drive", found, own.sigma, pair_figure(own), first)]
    rows += [
        _standard_row(one.name, found, one.sigma, pair_figure(one), reached, own.sigma)
        for one, reached in zip(found.standard, others, strict=True)
    ]
    heads = ("Plan", "Until reached #", *(f"{parameter(k)} #" for k in keys),
             f"{pair_head(found)} #")  # fmt: skip
    note = (
        "Until what is asked is reached, and told from every other effect that some drive tells "
        "it from. Line plans are taken line by line in their order; the turns between lines count "
        "as time, and are not logged. Standard uncertainties in the time of this drive."
    )
    return show(_fitting(table("Beside the standard line plans", heads, rows, note)), silent=True)


def _standard_row(
    name: str, found: Plan, sigma: Mapping[str, float], of_pair: str, reached: Cell,
    own: Mapping[str, float] | None = None,
) -> tuple[Cell | str, ...]:  # fmt: skip
    """A plan's row; own: the uncertainties with which this drive reaches what is asked."""
    sizes = _column_sizes(found)
    sharp = own is not None and found.reached and all(sigma[k] <= own[k] for k in _shown(found))
    never = "never told apart" if sharp else "never"
    return (
        name,
        reached if reached.text else replace(reached, text=never),
        *(Cell(figure(k, sigma[k], sizes[k]), _sort(sigma[k])) for k in _shown(found)),
        Cell(of_pair),
    )


def _flown(found: Plan) -> list[Node]:
    flown = found.flown
    if flown is None:
        return []
    lines = [f"{parameter(key)}: {figure(key, value)}" for key, value in flown.sigma.items()]
    if pair_figure(flown):
        lines.append(f"{pair_head(found).lower()} {pair_figure(flown)}")
    said = "reaches what is asked" if flown.reached else "does not reach what is asked"
    files = ", ".join(flown.files)
    words = f"{files}: {numbers.count(flown.rows)} rows, {numbers.time(flown.duration_s)}; {said}."
    if flown.confused:
        words = f"{words} {would_take(flown.confused)}"
    odd = [Items(flown.cautions, "!", "warn")] if flown.cautions else []
    return [Text(words), *odd, Items(tuple(lines))]


def _open(found: Plan) -> list[Node]:
    nodes: list[Node] = []
    if found.inseparable:
        nodes.append(
            Items(
                tuple(
                    f"{one}: no drive can tell them apart, {ONE}"
                    if one in (found.alike or ())
                    else f"{one}: no drive tells them apart, {how_far(found)}"
                    for one in found.inseparable
                )
            )
        )
    if found.unseen:
        words = (
            "With what is asked free beside them, this drive leaves these above what is asked of "
            "them, or else about as uncertain as is plausible: "
        )
        nodes.append(Text(words + "; ".join(map(effect_words, found.unseen)) + "."))
    return nodes


def _log(found: Plan) -> list[Node]:
    rate = numbers.typeset(f"{numbers.number(found.rate_hz, 4)} Hz")
    return [
        Text(("Columns: ", code(", ".join(found.columns)))),
        Text(f"Rows: {rate}, from the first leg to the last."),
    ]


def _targets(found: Plan) -> list[Node]:
    if not found.targets:
        return []
    words = (
        f"{len(found.targets)} targets to survey beforehand, aimed at in turn; places in the local "
        "frame of the drive, whose origin is below its start."
    )
    if found.surveyed:
        words = (
            f"{len(found.targets)} of the targets that are surveyed already, aimed at in turn; the "
            "drive is laid beside them, in their frame."
        )
    rows: list[tuple[Cell | str, ...]] = [
        (
            t.label,
            *(Cell(numbers.places(v, 1), v) for v in (t.north_m, t.east_m, t.down_m)),
        )
        for t in found.targets
    ]
    heads = ("Target", "North [m] #", "East [m] #", "Down [m] #")
    whole: Table = table("Targets", heads, rows)
    few: Table = table("Targets", heads, rows[:MOST_TARGETS])
    more = len(rows) - MOST_TARGETS
    left = Text(f"{more} more in --output json, html or csv.", quiet=True, reach="text")
    nodes = [Text(words), *show(whole, silent=True, reach="page")]
    return [*nodes, *show(few, silent=True, reach="text"), *([left] if more > 0 else [])]


def _rests(found: Plan) -> list[Node]:
    lines = [f"Noise {found.noise}."]
    if found.assumed:
        lines.append("Not stated by the spec, so taken as usual: " + "; ".join(found.assumed) + ".")
    return [Items(tuple(lines))]


def _provenance(found: Plan) -> list[tuple[str, str]]:
    known = found.provenance
    own = pins(known.version, known.spec_sha256, known.catalogs_sha256, known.seed)
    return [("Spec file", found.spec.file), *own]
