"""What `plan` says: the drive leg by leg, what it tells, what it leaves open, what it saves."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Final

from syncline_design.machine.records import with_texts
from syncline_design.model.figure_text import format_duration, format_like, format_quantity
from syncline_design.model.quantity import si_name, split_suffix, suffix_unit
from syncline_design.model.unit_table import Dimension
from syncline_design.planning.legs import speed_words
from syncline_design.planning.path import PathStates
from syncline_design.planning.result import Flown, Lacking, Plan, Separated
from syncline_design.planning.run import LONGEST_S
from syncline_design.planning.telling import PlanRun
from syncline_design.report import charts_plan as drawings
from syncline_design.report import numbers
from syncline_design.report.document import (
    Chart,
    Document,
    Inline,
    Items,
    Node,
    Outcome,
    Text,
    code,
    pins,
    provenance,
    section,
    show,
)
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import visible
from syncline_design.report.words import effect_words

UNITS: Final = {
    Dimension.TIME: "s", Dimension.LENGTH: "m", Dimension.ANGLE: "rad",
    Dimension.ANGULAR_RATE: "rad/s", Dimension.SPEED: "m/s",
}  # fmt: skip
Row = tuple[Cell | str, ...]
FIRST_ORDER: Final = "as far as their effects of first order go"  # a large lag is no latency
ONE: Final = "on every leg that it can drive they make the same error"
AT_SIZE: Final = "at the size that is known, in these minutes"
STANDS_MPS: Final = 0.01  # below which a vehicle is at rest
MOST_TARGETS: Final = 12  # told outside the page


def on_plan(run: PlanRun) -> Document:
    """A plan as a document."""
    found: Plan = with_texts(run.result, visible)
    return Document(
        family="Test drive",
        outcome=_outcome(found),
        name=found.spec.name,
        sentences=tuple(_sentences(found)),
        facts=tuple(_facts(found)),
        sections=(
            *section("legs", "Legs", _legs(found, run.path)),
            *section("path", "Path", _path(run), reach="page"),
            *section("after", "What is known after each leg", _after(found), "After"),
            *section("pairs", "Told apart", _pairs(found), "Pairs"),
            *section("standard", "The field's standard line plans", _standard(found), "Standard"),
            *section("flown", "What was flown", _flown(found.flown), "Flown"),
            *section("open", "What stays unseen", _open(found), "Unseen"),
            *section("log", "What the log needs", _log(found), "Log"),
            *section("targets", "Targets", _targets(found)),
            *section("rests", "What it rests on", _rests(found), "Rests on"),
            *provenance(_provenance(found)),
        ),
        source=found.spec.file,
        title=f"Test drive: {found.spec.name}",
    )


def _outcome(found: Plan) -> Outcome:
    legs = f"{len(found.legs)} leg{'s' if len(found.legs) != 1 else ''}"
    length = numbers.drive_time(found.duration_s / 60.0)
    if found.reached:
        rest = ", but for what no drive tells" if found.inseparable else ""
        if found.calm is not None and not found.calm.reached:
            rest = f"{rest}, in waves only"
        return Outcome("good", "\u2713", f"Reached by {legs} in {length}{rest}")
    if found.least_minutes is None and _larger(found) is not None:
        return Outcome("bad", "\u2717", "Told apart only where it is larger")
    if found.least_minutes is None:
        why = "no drive of this platform tells it" if found.inseparable else _none_found(found)
        return Outcome("bad", "\u2717", f"Not reachable: {why}")
    return Outcome("bad", "\u2717", f"Not reached in {numbers.number(found.minutes, 6)} min")


def _none_found(found: Plan) -> str:
    """What is asked is only a matter of time, and of more than any drive is looked at for."""
    most_s = max(LONGEST_S, 60.0 * found.minutes)
    return f"no drive of up to {format_duration(most_s)} was found that tells so much"


def _sentences(found: Plan) -> Iterator[Inline]:
    if not found.reached and found.least_minutes is not None:
        least = _least(found.least_minutes)
        given = f"{numbers.number(found.minutes, 6)} min"
        below = f"Below is the best for {given}."
        if found.duration_s > 60.0 * found.minutes:
            length = numbers.drive_time(found.duration_s / 60.0)
            below = f"No drive as short as {given} was found: below is one of {length}."
        yield f"The least that is enough, of the drives looked at: {least}. {below}"
    if not found.reached and found.flown is not None and found.flown.reached:
        files, length = ", ".join(found.flown.files), numbers.time(found.flown.duration_s)
        yield f"What was flown ({files}) is enough: it reaches what is asked in {length}."
    for words in found.inseparable:
        larger = _larger(found)
        if larger is not None and words == f"{larger.first} and {larger.second}":
            yield from _told_where_larger(larger)
        elif words in (found.alike or ()):
            yield f"No drive of this platform can tell {words} apart: {ONE}."
        else:
            yield f"No drive of this platform tells {words} apart, {_how_far(found)}."
    if found.reached:
        asked = "else that" if found.inseparable else "that"
        stays = "within twice what is asked" if found.tolerance else "told"
        yield (
            f"All {asked} is asked is reached, and stays {stays} when any one of the other effects "
            f"that a drive can tell apart is free as well{_steps(found)}."
        )
    if found.confused:
        yield _would_take(found.confused)
    if found.untold:
        yield _known_otherwise(found)
    if found.calm is not None:
        yield from _in_calm_water(found)
    for one in found.dear or ():
        lasts, whole = (numbers.drive_time(s / 60.0) for s in (one.lasts_s, found.duration_s))
        yield f"Leg {one.leg} takes {lasts} of the {whole}. Without it {_lacking(one.without)}."
    yield from found.cautions or ()


def _in_calm_water(found: Plan) -> Iterator[Inline]:
    """Whether a ship's drive rests on the waves."""
    assert found.calm is not None
    if found.calm.lacking is None:
        yield "It is enough in calm water as well as in the waves that are taken."
    else:
        yield (
            "Only the waves make it enough, and no drive was found that is in calm water, too: "
            f"there {_lacking(found.calm.lacking)}."
        )


def _lacking(one: Lacking) -> str:
    """What fails, with its figure."""
    if " and " in one.what:
        value, asked = numbers.number(one.value, 3), numbers.number(one.asked, 3)
        return f"{one.what} are not told apart: noncentrality {value} of {asked} asked"
    value, asked = figure(one.what, one.value), figure(one.what, one.asked)
    if one.beside is None:
        return f"{parameter(one.what)} stays at {value}, where {asked} is asked"
    return (
        f"{effect_words(one.beside)}, left free, would take {parameter(one.what)}: {value}, where "
        f"{asked} is the most that it may make of it"
    )


def _steps(found: Plan) -> str:
    """Where a step of stamps is looked for, where a delay is asked for."""
    if not any(key.startswith("latency(") for key in found.after[-1].sigma):
        return ""
    return " (a step of the stamps in the middle of the drive: one before what tells is a delay)"


def _would_take(confused: Sequence[str]) -> str:
    names = ", ".join(map(effect_words, confused))
    return f"Left free one at a time, these would take what is asked: {names}."


def _known_otherwise(found: Plan) -> str:
    """What no drive tells from what is asked, with what it leaves of that where it is free."""
    each = [
        f"{effect_words(one.effect)} (would leave "
        + ", ".join(
            f"{parameter(key)} at {figure(key, sigma, found.tolerance.get(key))}"
            for key, sigma in one.sigma.items()
        )
        + ")"
        for one in found.untold or ()
    ]
    return (
        "Taken as known, since nothing that can be driven tells them from what is asked, or only "
        f"what takes many times as long, the most harmful first: {'; '.join(each)}. Ask for one as "
        "well to have it told."
    )


def _larger(found: Plan) -> Separated | None:
    """The pair that this drive tells apart where the first effect is larger."""
    return next((one for one in found.pairs if one.told_from), None)


def _told_where_larger(one: Separated) -> Iterator[Inline]:
    """A pair of which only the size decides whether it can be told."""
    sizes = one.told_from or {}
    each = [f"{split_suffix(name)[0]} {figure(name, size)}" for name, size in sizes.items()]
    least = " or ".join(each) if len(one.sizes) > 1 else figure(*next(iter(sizes.items())))
    yield (
        f"{one.first} and {one.second} look nearly alike on every drive (correlation "
        f"{_correlation(one.correlation)}), so that a small effect is not told. From "
        f"{least} of the first on, the "
        "drive below tells them apart. Where its size is known, --separate with "
        f"{one.first}=SIZE plans for it."
    )


def _correlation(value: float) -> str:
    """To two figures, and to more where two would make one of it."""
    return numbers.number(value, 2 if value < 0.995 else 4)


def _how_far(found: Plan) -> str:
    """In which sense effects are not told apart."""
    return AT_SIZE if found.sized else FIRST_ORDER


def _least(minutes: float) -> str:
    """Minutes to three figures, never too few: `36.9 min`, `11.3 h`."""
    value, unit = (minutes / 60.0, "h") if minutes >= 600.0 else (minutes, "min")
    scale = 10.0 ** (math.floor(math.log10(max(value, 1e-9))) - 2)
    return numbers.typeset(f"{numbers.number(math.ceil(value / scale - 1e-9) * scale, 3)} {unit}")


def _facts(found: Plan) -> Iterator[tuple[str, str]]:
    last = found.after[-1]
    for key, value in last.sigma.items():
        asked = found.tolerance.get(key)
        words = figure(key, value, asked)
        asks = "" if asked is None else f" (asked: {figure(key, asked, asked)})"
        yield parameter(key), words + asks
    if last.correlation is not None:
        yield "Correlation of the pair", _correlation(last.correlation)


def figure(key: str, value: float | None, like: float | None = None) -> str:
    """A figure of a parameter in its unit; what no row depends on is not seen.

    like: a figure of the same column, in whose unit it stands.
    """
    if value is None or not math.isfinite(value):
        return "not seen"
    dimension = suffix_unit(si_name(key.rpartition(".")[2]))[1]
    if like is None or dimension not in UNITS:
        return numbers.si_quantity(value, UNITS.get(dimension, ""), 3)
    return numbers.typeset(format_like(format_quantity(like, dimension), value, 3))


def parameter(key: str) -> str:
    """`lever_arm(position).x_m` as `lever arm x (position)`."""
    effect, _, name = key.rpartition(".")
    kind, _, place = effect.partition("(")
    own = split_suffix(name)[0]
    words = kind if kind.endswith(own) else f"{kind} {own}"
    return f"{words} ({place}".replace("_", " ") if place else key


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
    keys, sizes = list(found.after[-1].sigma), _column_sizes(found)

    def row(name: str, values: Mapping[str, float], correlation: float | None = None) -> Row:
        shown = [Cell(figure(k, values[k], sizes[k]) if k in values else "", _sort(values.get(k)))
                 for k in keys]  # fmt: skip
        last = "" if correlation is None else _correlation(correlation)
        return (name, *shown, Cell(last))

    rows = [row(one.leg, one.sigma, one.correlation) for one in found.after]
    rows += [row("asked", found.tolerance)] if found.tolerance else []
    rows.append(row("all effects free", found.after[-1].sigma_all))
    heads = ("After leg", *(f"{parameter(k)} #" for k in keys), "Correlation #")
    note = (
        "Standard uncertainties with what is asked and the noise free; the last row with every "
        "effect free that this system can have, within its prior. What has a double (the latencies "
        "of all sensors together, the two lever arms) stays at its prior there, whatever is driven."
    )
    nodes = show(table("After each leg", heads, rows, note), silent=True)
    if not found.tolerance or len(found.after) < 2:
        return nodes
    caption = "Standard uncertainty over what is asked, after each leg."
    return [*nodes, Chart("after", partial(drawings.after, found), caption)]


def _sort(value: float | None) -> float:
    return math.inf if value is None else value


def _pairs(found: Plan) -> list[Node]:
    return [Items(tuple(_pair_text(one) for one in found.pairs))] if found.pairs else []


def _pair_text(one: Separated) -> str:
    """`latency(position) of 2 ms from lever_arm(position): told apart; correlation ...`."""
    sizes = ", ".join(figure(name, size) for name, size in one.sizes.items())
    said = "told apart" if one.separated else "not told apart"
    return (
        f"{one.first} of {sizes} from {one.second}: {said}; correlation "
        f"{_correlation(one.correlation)}, noncentrality "
        f"{numbers.number(one.noncentrality, 3)} of {numbers.number(one.wanted, 3)}"
    )


def _standard(found: Plan) -> list[Node]:
    if not found.standard:
        return []
    keys = list(found.after[-1].sigma)
    rows = [_standard_row("this drive", found, found.after[-1].sigma, found.after[-1].correlation,
                          found.duration_s / 60.0 if found.reached else None, keys)]  # fmt: skip
    rows += [
        _standard_row(one.name, found, one.sigma, one.correlation, one.minutes, keys)
        for one in found.standard
    ]
    heads = ("Plan", "Until reached #", *(f"{parameter(k)} #" for k in keys), "Correlation #")
    note = (
        "Until what is asked is reached, and told from every other effect that some drive tells "
        "it from. Line plans are taken line by line in their order; the turns between lines count "
        "as time, and are not logged. Standard uncertainties in the time of this drive."
    )
    return show(table("Beside the standard line plans", heads, rows, note), silent=True)


def _standard_row(
    name: str, found: Plan, sigma: Mapping[str, float], correlation: float | None,
    minutes: float | None, keys: list[str],
) -> tuple[Cell | str, ...]:  # fmt: skip
    sizes = _column_sizes(found)
    reached = Cell("never" if minutes is None else numbers.drive_time(minutes),
                   _sort(minutes))  # fmt: skip
    return (
        name,
        reached,
        *(Cell(figure(k, sigma[k], sizes[k]), _sort(sigma[k])) for k in keys),
        Cell("" if correlation is None else _correlation(correlation)),
    )


def _flown(flown: Flown | None) -> list[Node]:
    if flown is None:
        return []
    lines = [f"{parameter(key)}: {figure(key, value)}" for key, value in flown.sigma.items()]
    if flown.correlation is not None:
        lines.append(f"correlation {_correlation(flown.correlation)}")
    said = "reaches what is asked" if flown.reached else "does not reach what is asked"
    files = ", ".join(flown.files)
    words = f"{files}: {numbers.count(flown.rows)} rows, {numbers.time(flown.duration_s)}; {said}."
    if flown.confused:
        words = f"{words} {_would_take(flown.confused)}"
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
                    else f"{one}: no drive tells them apart, {_how_far(found)}"
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
            t.name or str(t.id),
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
