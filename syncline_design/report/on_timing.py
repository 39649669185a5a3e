"""What `timing` says: the bound, what may be claimed of it and why, sessions, events, noise."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Final

from syncline_design.clocks.result import Timing, TimingClaim
from syncline_design.comparison.clock_meaning import TimingAndSpec, TimingMeaning
from syncline_design.model.figure_text import format_duration
from syncline_design.report import numbers
from syncline_design.report.charts_timing import in_sight, offsets, sessions, stability
from syncline_design.report.document import (
    Chart,
    Document,
    Facts,
    Group,
    Inline,
    Items,
    Node,
    Outcome,
    Text,
    code,
    folded,
    given,
    provenance,
    section,
    show,
)
from syncline_design.report.rendered import rendered
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.verdict_words import pinned_by
from syncline_design.verdict.measured import coverage_words
from syncline_design.verdict.tree import PREDICATES

if TYPE_CHECKING:
    from syncline_design.report.svg import InlineChart

_MOST_ROWS: Final = 40
_WHOLE: Final = 0.995  # of the time: less is worth a word
_MOST_OPEN: Final = 12  # rows of a table that is not folded away
_OPEN: Final = ("doubts", "spec", "claim", "entry", "offsets", "sessions", "events", "notes")
_RESTS: Final = {
    "independent": "a measurement that does not steer the clock",
    "servo": "the offsets of the servo itself: it nulls what it measures, so a constant asymmetry "
    "of the path does not show (declare it: `--declare path_asymmetry=5us`)",
    "servo_and_declared": "the offsets of the servo itself, and what was declared beside",
    "unknown": "offsets as given; whether they steer the clock the logs do not say (--independent "
    "says that they do not)",
    "unknown_and_declared": "offsets as given, and what was declared beside",
}
_METHODS: Final = {
    "range": "a tolerance bound over sessions: the largest, and beyond it as their range tells",
    "order statistic": "the largest session (order statistic), or what raises it",
}


def on_timing(result: TimingAndSpec) -> Document:
    """Logs of a clock as a document."""
    return folded(Document(
        family="Timing evidence",
        outcome=_outcome(result),
        name=result.source.name,
        sentences=tuple(_sentences(result)),
        facts=tuple(_facts(result)),
        sections=(
            *section("doubts", "Not to be used before this is explained", _doubts(result),
                     "Doubts"),
            *section("spec", "What it means for the spec", _spec(result), "Spec"),
            *section("claim", "What may be claimed", _claim(result), "Claim"),
            *section("entry", "Catalog entry", _entry(result), "Entry"),
            *section("offsets", "Offset over time and by session",
                     [*_offsets(result), *_by_session(result)], "Offsets"),
            *section("sessions", "Sessions", _sessions(result)),
            *section("events", "Events", _events(result)),
            *section("noise", "Kind of noise", _noise(result), "Noise"),
            *section("sources", "Sources in the logs", _sources(result), "Sources"),
            *section("notes", "Notes", [Items(tuple(given(n) for n in result.notes))]
                     if result.notes else []),
            *section("evidence", "Evidence", show(_evidence(result), silent=True)),
            *provenance(_provenance(result)),
        ),
        title=f"Timing: {result.source.name}",
    ), _OPEN)  # fmt: skip


def _provenance(result: TimingAndSpec) -> list[tuple[str, str]]:
    """What the figures are pinned by; what they mean for a spec by that one besides."""
    spec = result.spec
    if spec is None or spec.provenance is None:
        return [("syncline-design", result.version)]
    return [("Spec file", spec.file), *pinned_by(spec.provenance)]


def _outcome(result: Timing) -> Outcome:
    if result.doubts:
        return Outcome("bad", "\u2717", "No claim: the logs are in doubt")
    if not result.claim.made:
        return Outcome("warn", "!", "No claim yet")
    if isinstance(result, TimingAndSpec) and _turns(result.spec):
        words = f"Bound {numbers.time(result.bound_s)}, with which the spec no longer passes"
        return Outcome("bad", "\u2717", words)
    return Outcome("good", "\u2713", f"Bound {numbers.time(result.bound_s)}")


def _turns(meaning: TimingMeaning | None) -> bool:
    """Whether the spec meets its requirements, and not with the measured clock."""
    return (
        meaning is not None and meaning.before == "meets" and meaning.after not in (None, "meets")
    )


def _sentences(result: Timing) -> Iterator[str]:
    claim = result.claim
    if claim.made:
        yield _claim_words(result)
    elif claim.sessions == 1 and result.bound_s is not None and not result.doubts:
        kept = next(one.quantile_s for one in result.sessions if one.counted)
        yield (f"It holds for this session: |offset| stays below {numbers.time(kept)} for "
               f"{numbers.percent(claim.coverage)} of its time. It says nothing about the next "
               f"start: {_more(result)}.")  # fmt: skip
    elif not result.doubts:
        more = f": {_more(result)}" if claim.needs_sessions else ""
        yield f"{_sentence(claim.why_not or '')}{more}."
    else:
        yield "Nothing is claimed and nothing written until the doubts below are explained."


def _claim_words(result: Timing) -> str:
    claim = result.claim
    length = "" if claim.session_s is None else f" of {format_duration(claim.session_s)}"
    lost = any(event.kind == "unlock" for event in result.events)
    share = claim.lock_share or 1.0
    in_lock = ""
    if lost or share < _WHOLE:
        in_lock = f" in lock ({numbers.percent(share)} of the time logged"
        in_lock += f"; within {numbers.time(result.event_bound_s)} else, as seen)" if lost else ")"
    return (
        f"With {numbers.percent(claim.confidence)} confidence, at least "
        f"{numbers.percent(claim.session_share)} of future sessions like these ({claim.sessions}"
        f"{length}) keep |offset| within {numbers.time(result.bound_s)} for "
        f"{numbers.percent(claim.coverage)} of their time{in_lock}."
    )


def _more(result: Timing) -> str:
    need = result.claim.needs_sessions
    return f"{need} more session{'s' if need > 1 else ''} would carry the claim"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _facts(result: Timing) -> Iterator[tuple[str, str]]:
    claim = result.claim
    if result.doubts:
        yield "Bound", "none: the logs are in doubt"
    else:
        yield "Bound", numbers.time(result.bound_s)
        yield "Statistical bound", numbers.time(result.statistical_bound_s)
        yield "Hard bound", numbers.time(result.hard_bound_s)
        yield "With events", numbers.time(result.event_bound_s)
    yield "Sessions", f"{claim.sessions}, {_operated(claim.hours)}"


def _operated(hours: float) -> str:
    """How long all sessions together last."""
    if hours < 1.0:
        return numbers.duration(3600.0 * hours)
    return f"{numbers.number(hours, 3)}\N{NO-BREAK SPACE}h"


def _doubts(result: Timing) -> list[Node]:
    entries = tuple(given(one) for one in result.doubts)
    return [Items(entries, mark="\u2717", tone="bad")] if entries else []


def _claim(result: Timing) -> list[Node]:
    claim = result.claim
    facts: list[tuple[str, Inline]] = [("Rests on", _RESTS[claim.rests_on])]
    if claim.method is not None:
        facts.append(("Statistical bound by", _METHODS[claim.method]))
    if result.use != "larger":
        facts.append(("Bound taken", f"the {result.use} one alone, as asked"))
    facts += [(f"Declared: {name}", numbers.time(value)) for name, value in result.declared.items()]
    if result.conditions:
        facts.append(("Conditions", given(result.conditions)))
    nodes: list[Node] = [Facts(tuple(facts), "record")]
    if claim.made and claim.method == "range":
        nodes.append(Text(_unseen(claim), quiet=True))
    if not claim.made:
        said = f"No claim: {claim.why_not}." if claim.why_not else "No claim."
        nodes.append(Text(said, mark="!", tone="warn"))
    return nodes


def _unseen(claim: TimingClaim) -> str:
    """What the tolerance bound takes for granted of the starts that these sessions are not."""
    return (
        f"It takes other starts to be of the kind of these {claim.sessions}. Bad ones of which "
        "none is among them are not covered: they may be up to "
        f"{numbers.percent(claim.unseen_share)} of all starts "
        f"({numbers.percent(claim.confidence)} confidence), and less than "
        f"{numbers.percent(1.0 - claim.session_share)} only from {claim.shape_free_from} on."
    )


def _spec(result: TimingAndSpec) -> list[Node]:
    means = result.spec
    if means is None:
        return []
    words = f"{means.name} {PREDICATES[means.before]}"
    if means.after is not None:
        same = means.after == means.before
        words += (
            "; with the measured clock it " + ("still " if same else "") + PREDICATES[means.after]
        )
    changes = [Items(tuple(given(one) for one in means.requirement_changes), mark="!")]
    nodes: list[Node] = [Text(given(words + "."))]
    nodes += changes if means.requirement_changes else []
    if not result.claim.made:
        nodes.append(Text("This holds only if the bound does: no claim is made.", quiet=True))
    if means.asked_coverage is not None:
        asked, share = means.asked_coverage, result.claim.coverage
        nodes.append(Text(
            f"The bound is claimed {coverage_words(share, asked)}: measure with "
            f"`--coverage {numbers.number(asked, 4)}`.",
            mark="!", tone="warn",
        ))  # fmt: skip
    if means.after is not None and means.tau_s is not None and means.measured_tau_s is not None:
        nodes.append(Facts((
            ("\u03c4 of the system", f"{numbers.time(means.tau_s)}, with this clock "
             f"{numbers.time(means.measured_tau_s)}"),
            ("Error of the system", f"{numbers.error(means.total_m, means.accuracy)}, with this "
             f"clock {numbers.error(means.measured_total_m, means.accuracy)}"),
        ), "record"))  # fmt: skip
    if (
        means.after is not None
        and means.tau_s == means.measured_tau_s
        and all(r.measured_tau_s == r.tau_s for r in means.sensors)
    ):
        nodes.append(Text("No \u03c4 changes: all stamps are of one clock, whose offset cancels, "
                          "or the spec's own clock has the same bound.", quiet=True))  # fmt: skip
    return [*nodes, *show(_sensors(means), silent=True)]


def _sensors(means: TimingMeaning) -> Table:
    rows = [
        (
            f"{row.stage} \u00b7 {row.role}",
            given_cell(row.sensor),
            Cell(numbers.time_limit(row.tau_crit_s), row.tau_crit_s),
            Cell(numbers.time(row.tau_s), row.tau_s),
            Cell("" if row.measured_tau_s is None else numbers.time(row.measured_tau_s),
                 row.measured_tau_s),
            _ratio(row.bound_ratio, kept=means.after == "meets"),
        )
        for row in means.sensors
    ]  # fmt: skip
    heads = ("Sensor of", "Sensor", "\u03c4_crit #", "\u03c4 of the spec #",
             "\u03c4 with this clock #", "Bound / \u03c4_crit #")  # fmt: skip
    return table("Sensors", heads, rows)


def given_cell(text: str) -> Cell:
    """A catalog id."""
    return Cell(text, code=True)


def _ratio(value: float | None, *, kept: bool) -> Cell:
    """kept: whether the spec meets its requirements with this clock, whatever the ratio is."""
    if value is None:
        return Cell(numbers.MISSING)
    if value >= 1.0 and kept:
        return Cell(numbers.percent(value, 3), value)
    kept = value < 1.0
    return Cell(numbers.percent(value, 3), value, "good" if kept else "bad",
                "\u2713" if kept else "\u2717")  # fmt: skip


def _entry(result: Timing) -> list[Node]:
    entry = result.entry
    if entry is None:
        return []
    use = f"clock: {{candidates: [{entry.id}]}}" if entry.kind == "clock" else entry.id
    where = "in a stage" if entry.kind == "clock" else "as timestamping of a role"
    name = entry.file.rsplit("/", 1)[-1]
    return [
        Text((code(entry.id), " in ", code(entry.file), ", values in ", code(entry.values_file))),
        Text(("In a spec beside it: ", code(f"catalogs: [{name}]"), " and ", code(use), f" {where}",
              "; cost, mass and power are 0 until you fill them in.")),
    ]  # fmt: skip


def _offsets(result: Timing) -> list[Node]:
    def draw() -> InlineChart:
        return offsets(result.trace, result.bound_s)

    if not result.trace:
        return []
    words = "Local minus reference: a clock that is late is below zero. "
    if in_sight(result.trace, result.bound_s):
        words += "Dashed: the bound."
    elif result.bound_s is not None:
        words += f"The bound, {numbers.time(result.bound_s)}, lies far beyond what is drawn."
    return [Chart("offsets", draw, words)]


def _by_session(result: Timing) -> list[Node]:
    counted = [(k, one) for k, one in enumerate(result.sessions) if one.counted and one.quantile_s]
    both = (("statistical", result.statistical_bound_s), ("hard", result.hard_bound_s))
    bounds = [(name, value) for name, value in both if value]

    def draw() -> InlineChart:
        return sessions(counted, result.claim.coverage, bounds)

    return [Chart("sessions", draw, "One dot a session.")] if counted else []


def _sessions(result: Timing) -> list[Node]:
    every = show(_session_table(result, 10_000), silent=True, reach="page")
    if len(result.sessions) > _MOST_OPEN:
        summary = f"Every session ({numbers.count(len(result.sessions))} rows)"
        every = [Group(tuple(every), "fold", summary=summary, reach="page")]
    return [*every, *show(_session_table(result, _MOST_ROWS), silent=True, reach="text")]


def _session_table(result: Timing, most: int) -> Table:
    rows = [
        (
            Cell(str(k), k),
            Cell(row.from_, sub="" if row.counted else "too short"),
            Cell(numbers.duration(row.duration_s), row.duration_s),
            Cell(numbers.count(row.samples), row.samples),
            Cell(numbers.time(row.median_s), row.median_s),
            Cell(numbers.time(row.quantile_s), row.quantile_s),
            Cell(numbers.time(row.hard_s), row.hard_s),
            Cell("" if row.autocorrelation_s is None else numbers.duration(row.autocorrelation_s),
                 row.autocorrelation_s),
            {True: "yes", False: "no", None: ""}[row.stationary],
        )
        for k, row in enumerate(result.sessions[:most])
    ]  # fmt: skip
    left = len(result.sessions) - most
    share = numbers.percent(result.claim.coverage)
    heads = ("#", "From", "Length #", "Samples #", "Median #", f"|offset|, {share} #", "Hard #",
             "Remembers #", "Stationary")  # fmt: skip
    note = f"and {left} more" if left > 0 else ""
    return table("Sessions", heads, rows, note)


def _events(result: Timing) -> list[Node]:
    if not result.events:
        return []
    kinds = list(dict.fromkeys(event.kind for event in result.events))
    rows = []
    for kind in kinds:
        found = [event for event in result.events if event.kind == kind]
        worst = max(found, key=lambda event: event.size_s)
        rows.append((
            kind.replace("_", " "), Cell(str(len(found)), len(found)),
            Cell(numbers.time(worst.size_s), worst.size_s), worst.from_,
            Cell(str(worst.session), worst.session),
        ))  # fmt: skip
    heads = ("Event", "How often #", "Largest #", "Then", "In session #")
    all_rows = [
        (event.kind.replace("_", " "), event.from_, event.to,
         Cell(numbers.time(event.size_s), event.size_s), Cell(str(event.session), event.session))
        for event in result.events
    ]  # fmt: skip
    every = table("Every event", ("Event", "From", "To", "Size #", "Session #"), all_rows)
    return [*show(table("Events by kind", heads, rows), silent=True), *show(every, reach="page")]


def _noise(result: Timing) -> list[Node]:
    def draw() -> InlineChart:
        return stability(result.stability)

    nodes: list[Node] = []
    if any(point.tdev_s and point.mtie_s for point in result.stability):
        nodes.append(Chart("stability", draw, "TDEV and MTIE of the longest session."))
        rows = [(Cell(numbers.time(p.tau_s), p.tau_s), Cell(numbers.time(p.tdev_s), p.tdev_s),
                 Cell(numbers.time(p.mtie_s), p.mtie_s)) for p in result.stability]  # fmt: skip
        points = table("TDEV and MTIE", ("Averaging time #", "TDEV #", "MTIE #"), rows)
        nodes += show(points, reach="text")
    hold = [(format_duration(p.after_s), Cell(numbers.time(p.error_s), p.error_s))
            for p in result.holdover]  # fmt: skip
    held = table("Holdover: error after a time without reference",
                 ("After", "Error #"), hold,
                 "from how much the frequency was seen to move in that time")  # fmt: skip
    return [*nodes, *show(held)]


def _sources(result: Timing) -> list[Node]:
    rows = [
        (
            Cell(row.name, code=True), "used" if row.used else "", row.sign, row.steering,
            Cell(numbers.count(row.samples), row.samples), Cell(str(row.sessions), row.sessions),
            Cell(numbers.time(row.quantile_s), row.quantile_s),
            Cell(numbers.time(row.hard_s), row.hard_s),
        )
        for row in result.sources
    ]  # fmt: skip
    heads = ("Source", "Used", "Sign", "Steers", "Rows #", "Sessions #", "Largest quantile #",
             "Hard #")  # fmt: skip
    return show(table("Sources", heads, rows), silent=True)


def _evidence(result: Timing) -> Table:
    rows = [(given_cell(one.file), given_cell(one.sha256)) for one in result.evidence]
    return table("Evidence", ("File", "SHA-256"), rows)


def render_timing(name: str, result: TimingAndSpec) -> str:
    """The text of one format."""
    return rendered(name, result, lambda: on_timing(result))
