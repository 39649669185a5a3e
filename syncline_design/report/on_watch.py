"""What `watch` says: what changed since when, and every effect over the runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

from syncline_design.campaign.watch_result import Alarm, Unsettled, Watch, WatchedRun, e_value_text
from syncline_design.diagnosis.result import BlindSpot, Other, UnlikeOthers
from syncline_design.effects import registry
from syncline_design.machine.records import with_texts
from syncline_design.machine.sentences import any_of, sentence_list
from syncline_design.model.figure_text import format_interval, format_quantity
from syncline_design.model.quantity import split_suffix, suffix_unit
from syncline_design.report import charts_watch as drawings
from syncline_design.report import numbers
from syncline_design.report.document import (
    Chart,
    Document,
    Facts,
    Group,
    Heading,
    Inline,
    Items,
    Node,
    Outcome,
    Text,
    code,
    given,
    pins,
    provenance,
    section,
)
from syncline_design.report.formats import WATCH_FORMATS as WATCH_FORMATS
from syncline_design.report.json_out import json_text
from syncline_design.report.on_joint import latest, torn_nodes
from syncline_design.report.render_html import html
from syncline_design.report.render_markdown import markdown
from syncline_design.report.table import Cell
from syncline_design.report.text import visible

MOST_RUNS: Final = 10  # told outside the page
MOST_NAMED: Final = 2  # effects in the headline
PLATFORM: Final = ("speed", "turn_rate", "range")  # checks against the spec's platform
FAR: Final = 30.0  # times what turns a requirement; of runs that are driven it is some five
FEWEST_RUNS: Final = 3  # of two that differ, neither says what is usual between runs


def render_watch(name: str, found: Watch) -> str:
    """The text of one format."""
    if name == "json":
        return json_text(found.to_json())
    return markdown(on_watch(found)) if name == "markdown" else html(on_watch(found))


def on_watch(found: Watch) -> Document:
    """A watched system as a document."""
    found = with_texts(found, visible)
    return Document(
        family="Watch",
        outcome=_outcome(found),
        name=found.spec.name,
        sentences=tuple(_sentences(found)),
        facts=tuple(_facts(found)),
        sections=(
            *section("alarms", "What changed", _alarms(found), "Changed"),
            *section("odd", "What else is odd", _odd(found), "Odd"),
            *section("evidence", "Evidence for a change", _evidence(found), "Evidence",
                     reach="page"),
            *section("effects", "Every effect over the runs", _effects(found), "Effects",
                     reach="page"),
            *section("runs", "Runs", _runs(found)),
            *section("rests", "What it rests on", _rests(found), "Rests on"),
            *provenance(_provenance(found)),
        ),
        source=found.spec.file,
        title=f"Watch: {found.spec.name}",
    )  # fmt: skip


def _outcome(found: Watch) -> Outcome:
    looks = _looks(found)
    if not found.alarms and (found.contradicted or found.unlike):
        return Outcome("warn", "?", f"Nothing seen to change, but {_odd_one(found)}")
    if not found.alarms and looks < FEWEST_RUNS:
        return Outcome("warn", "?", f"Too few runs to tell ({looks} of {FEWEST_RUNS})")
    if found.unsettled is not None:
        return Outcome("warn", "?", f"The runs are not all alike: {_name(found.unsettled, found)}")
    if not found.alarms and (unseen := _unseen_delays(found)):
        words = f"run {_last(found).run} shows no {unseen}"
        return Outcome("warn", "?", f"Nothing seen to change, but {words}")
    if not found.alarms:
        return Outcome("good", "\u2713", f"Nothing changed in {looks} run{'s'[: looks != 1]}")
    first = found.alarms[0]
    lone = list(dict.fromkeys(str(one.since.run) for one in found.alarms if one.alone))
    if len(lone) > 1:
        return Outcome("bad", "!", f"Runs {sentence_list(lone)} are unlike the others")
    own = [one for one in found.unlike or () if one.number == first.since.run]
    beyond = first.since.run in [run.run for run in found.contradicted]
    if first.alone or len(own) > 1 or (own and beyond):
        names = sentence_list([_names(one, found) for one in own[:MOST_NAMED]])
        more = f" and {len(own) - MOST_NAMED} more" if len(own) > MOST_NAMED else ""
        also = f"{_contradiction(found, first.since.run)} and " if beyond else ""
        words = f"Run {first.since.run} {also}is unlike the others: {names}{more}"
        return Outcome("bad", "!", words)
    when = first.since.date or f"run {first.since.run}"
    drifts = first.drift is not None and not first.drift.ended
    what = "Drifts" if drifts else "Changed"
    return Outcome("bad", "!", f"{what}: {_names(first, found)}, since {when}")


def _odd_one(found: Watch) -> str:
    """`run 5 is unlike the others`: which run does not belong there, in a few words."""
    if found.contradicted:
        run = found.contradicted[-1].run
        return f"run {run} {_contradiction(found, run)}"
    numbers_of = list(dict.fromkeys(str(one.number) for one in found.unlike or ()))
    if len(numbers_of) == 1:
        return f"run {numbers_of[0]} is unlike the others"
    return f"runs {sentence_list(numbers_of)} are unlike the others"


def _contradiction(found: Watch, number: int) -> str:
    run = next(run for run in found.contradicted if run.run == number)
    beyond = any(check.code in PLATFORM for check in run.checks or ())
    return "is beyond the platform's limits" if beyond else "contradicts itself"


def _looks(found: Watch) -> int:
    """Runs since the baseline, which are held against one another."""
    return len([r for r in found.runs if r.run > found.baseline_after and not r.left_out])


def _name(one: Alarm | BlindSpot | UnlikeOthers | Unsettled | Other, found: Watch) -> str:
    """`latency (position)`; of a chain with the stage, `latency (position, ship)`."""
    stages = {value.stage for run in found.runs for value in run.values}
    stage = getattr(one, "stage", None) if len(stages) > 1 else None
    place = f"{one.sensor}, {stage}" if stage else one.sensor
    return f"{one.effect.replace('_', ' ')} ({place})"


def _names(one: Alarm | UnlikeOthers, found: Watch) -> str:
    """The same with what the runs cannot tell it from: `latency (position) or lever arm (..)`."""
    return any_of([_name(each, found) for each in (one, *(one.aliases or ()))])


def _sentences(found: Watch) -> Iterator[Inline]:
    for one in found.alarms:
        yield _sentence(one, found)
    if found.alarms:
        lone = list(dict.fromkeys(one.since.run for one in found.alarms if one.alone))
        out = f"watch STORE --leave-out {lone[0] if len(lone) == 1 else 'N'} --reason TEXT"
        which = "the run" if len(lone) == 1 else "each of these runs"
        yield (
            "The alarm stays until ",
            *([code(out), f" counts {which} no more, or "] if lone else ()),
            code("watch STORE --accept"),
            " makes a new baseline: after a repair, or where the change is meant to stay.",
        )
    elif _looks(found) < FEWEST_RUNS:
        if all(run.new for run in found.runs):
            yield ("A new store, begun with this run: ", code(found.store), ".")
        yield (
            f"Fewer than {FEWEST_RUNS} runs do not say what differs from run to run anyway, so "
            "that even a large change may not ring yet. What each says alone is in the table of "
            "runs."
        )
    if not found.alarms and not found.informative.ok:
        yield _blind(found)


def _unseen_delays(found: Watch) -> str:
    """What the last run shows of no delay, as of a vehicle at rest: `delay at all`, or where they
    would have to be FAR times what turns a requirement, `latency (position) below 0.24 s`."""
    known = registry()
    blind = [one for one in found.informative.blind_to if known[one.effect].delays]
    if any(one.smallest_seen is None for one in blind):
        return "delay at all"
    sizes = [(one.smallest_seen or 0.0) / one.turns_at for one in blind]
    if not blind or max(sizes) < FAR:
        return ""
    worst = blind[sizes.index(max(sizes))]
    size = format_quantity(worst.smallest_seen or 0.0, suffix_unit(worst.parameter)[1], 2)
    return f"{_name(worst, found)} below {size}"


def _blind(found: Watch) -> str:
    """`Run 13 (P13.csv) could not have shown ...`."""
    last = _last(found)
    names = sorted({_name(one, found) for one in found.informative.blind_to})
    return (
        f"Run {last.run} ({last.files[0]}) could not have shown every change that would turn a "
        f"requirement: it is blind to {sentence_list(names)}."
    )


def _sentence(one: Alarm, found: Watch) -> str:
    """`Latency (position): latency changed by 2.5 ms with run 7 (day7.csv).`"""
    dated = f", {one.since.date}" if one.since.date else ""
    place = f"run {one.since.run} ({one.since.file}{dated})"
    if one.words is not None:
        return f"Since {place}: {one.words}."
    name = _names(one, found)
    name = name[0].upper() + name[1:]
    if one.aliases:
        name += f" (these runs cannot tell). As {_name(one, found)}"
    if one.alone:
        return f"{name}: {_parameter(one)} differs by {one.text} in {place} alone."
    near = ""
    if one.since.low != one.since.high:
        first, last = one.since.low_date, one.since.high_date
        ends = f"{first} to {last}" if first and last else f"{one.since.low} to {one.since.high}"
        near = f", with 95 % one of the runs {ends}"
    if one.drift is not None:
        each = f"{one.drift.text} a run"
        if one.drift.ended:
            until = f"until run {one.drift.by_run}: {one.text}"
            return f"{name}: {_parameter(one)} drifted by {each} since {place}{near}, {until}."
        by = f"{one.text} by the last, run {one.drift.by_run}"
        return f"{name}: {_parameter(one)} drifts by {each} since {place}{near}: {by}."
    return f"{name}: {_parameter(one)} changed by {one.text} with {place}{near}."


def _parameter(one: Alarm) -> str:
    """`latency` of latency_s."""
    return split_suffix(one.parameter)[0].replace("_", " ")


def _facts(found: Watch) -> Iterator[tuple[str, str]]:
    if found.e_value is not None:
        yield "Evidence for a change", _e_values(found)
        yield "Alarm", f"from {numbers.number(found.rule.threshold, 3)} on, at any look"
    yield "Runs", _counted(found)
    if found.baseline_after:
        yield "Baseline", f"after run {found.baseline_after}"


def _e_values(found: Watch) -> str:
    """`e-value 40 at run 7, 0.8 by now`: that of an alarm which stays is the one that rang."""
    now = 0.0 if found.e_value is None else found.e_value
    rang = [one for one in found.alarms if one.e_value is not None]
    if not rang or now >= found.rule.threshold:
        return f"e-value {e_value_text(now)}"
    first = min(rang, key=lambda one: one.first_run)
    known = next((r.e_value for r in found.runs if r.run == first.first_run), None)
    then = first.e_value if known is None or known < found.rule.threshold else known
    if then is None or then < found.rule.threshold:
        return f"e-value {e_value_text(now)}"
    return f"e-value {e_value_text(then)} at run {first.first_run}, {e_value_text(now)} by now"


def _counted(found: Watch) -> str:
    """`13 held against one another, 2 before the baseline, 1 left out`: all that the store has."""
    compared = _looks(found)
    apart = len([r for r in found.runs if r.left_out])
    before = len(found.runs) - compared - apart
    if compared == len(found.runs):
        return str(compared)
    parts = [f"{compared} held against one another"]
    parts += [f"{before} before the baseline"] if before else []
    parts += [f"{apart} left out"] if apart else []
    return ", ".join(parts)


def _alarms(found: Watch) -> list[Node]:
    return [_alarm(one, found) for one in found.alarms]


def _alarm(one: Alarm, found: Watch) -> Node:
    what = "Departure" if one.alone else "Change"
    facts: list[tuple[str, str]] = [(f"{what} of {_parameter(one)}", one.text)]
    if one.drift is not None:
        facts[0] = (f"Drift of {_parameter(one)}", f"{one.drift.text} a run")
        by = "Until" if one.drift.ended else "By the last,"
        facts.append((f"{by} run {one.drift.by_run}", one.text))
    if one.interval95 is not None and one.change is not None:
        told = format_interval(
            one.change, one.standard_uncertainty or 0.0, one.interval95, one.unit
        )
        facts.append(("95 % interval", numbers.typeset(told)))
    since = f"run {one.since.run}, {one.since.file}"
    facts.append(
        ("In" if one.alone else "Since", since + (f", {one.since.date}" if one.since.date else ""))
    )
    nodes: list[Node] = [
        Heading(given(one.effect.replace("_", " ")), given(f"{one.sensor}, {one.stage}")),
        Text(_sentence(one, found), reach="page"),
        Facts(tuple(facts)),
        Text(f"Evidence: {one.evidence}; first at run {one.first_run}."),
    ]
    if one.aliases:
        names = sentence_list([_name(other, found) for other in one.aliases])
        apart = registry()[one.effect].separated_by if one.effect in registry() else ""
        words = f"These runs cannot tell it apart from a change of {names}. To separate: {apart}."
        nodes.append(Text(words, mark="!", tone="warn"))
    return Group(tuple(nodes), "article")


def _odd(found: Watch) -> list[Node]:
    nodes: list[Node] = (
        [Items(tuple(found.cautions), mark="!", tone="warn")] if found.cautions else []
    )
    return [*nodes, *torn_nodes(found.torn)]


def _compared(found: Watch) -> list[WatchedRun]:
    """The runs in the order in which they are compared."""
    if found.ordered_by == "adding":
        return list(found.runs)
    return sorted(found.runs, key=lambda one: (one.baseline, one.date or "", one.run))


def _last(found: Watch) -> WatchedRun:
    """The last run that counts."""
    every = _compared(found)
    return next((one for one in reversed(every) if not one.left_out), every[-1])


def _evidence(found: Watch) -> list[Node]:
    runs = [r for r in _compared(found) if r.e_value is not None]
    if len(runs) < 2:
        return []
    caption = "E-value after each run since the baseline; an alarm from the dashed line on."
    if max(r.e_value or 0.0 for r in runs) > drawings.MOST:
        caption += f" Drawn up to {numbers.number(drawings.MOST, 3)}; a triangle stands for more."
    return [Chart("evidence", partial(drawings.evidence, runs, found.rule.threshold), caption)]


def _effects(found: Watch) -> list[Node]:
    """The changed effects, then every other, folded; those of one run have no course."""
    runs = [r for r in _compared(found) if r.values]
    if len(runs) < 2:
        return []
    since: dict[tuple[str, str, str, str], list[int]] = {}
    for a in found.alarms:
        since.setdefault((a.effect, a.sensor, a.stage, a.parameter), []).append(a.since.run)
    keys = sorted(
        dict.fromkeys((v.effect, v.sensor, v.stage, v.parameter) for r in runs for v in r.values),
        key=lambda key: (key not in since, key),
    )
    caption = (
        "Each parameter as every run alone tells it, with its 95 % interval; all others are held "
        "at what the runs together name, and at nothing where they name nothing. A vertical line "
        "where a change began."
    )
    changed = [key for key in keys if key in since]
    rest = [key for key in keys if key not in since]
    nodes: list[Node] = []
    if changed:
        draw = partial(drawings.courses, runs, changed, since)
        nodes.append(Chart("effects", draw, caption))
    half = (len(rest) + 1) // 2
    others = tuple(
        Chart(f"others-{k}", partial(drawings.courses, runs, some, since, f"fig-courses-{k}"),
              "" if changed else caption)
        for k, some in enumerate((rest[:half], rest[half:]), 1) if some
    )  # fmt: skip
    summary = f"Every other parameter ({len(rest)})" if changed else f"Parameters ({len(rest)})"
    return [*nodes, *([Group(others, "fold", summary=summary)] if others else [])]


def _runs(found: Watch) -> list[Node]:
    heads = ("Run", "State", "File", "First stamp", "Rows #", "Alone", "Named alone", "E-value #")
    return latest("Runs", heads, [_row(one) for one in _compared(found)], MOST_RUNS)


def _row(one: WatchedRun) -> Sequence[Cell | str]:
    e_value = "" if one.e_value is None else e_value_text(one.e_value)
    state = "left out" if one.left_out else "new" if one.new else ""
    return (Cell(str(one.run), one.run), state, ", ".join(one.files), one.date or "",
            Cell(numbers.count(one.rows), one.rows), one.verdict, "; ".join(one.named),
            Cell(e_value, one.e_value))  # fmt: skip


def _rests(found: Watch) -> list[Node]:
    rate = numbers.percent(found.rule.false_alarm_rate)
    order = (
        "in the order of their first stamps"
        if found.ordered_by == "date"
        else "in the order of adding, as not every log's timeline is known"
    )
    told = (
        f"Runs that are unlike all the others are looked for besides, with a chance of "
        f"{numbers.percent(found.unlike_rate)} over all looks that one of alike runs is said to be."
        if found.unlike_rate else ""
    )  # fmt: skip
    return [
        Items((
            f"{found.rule.method}: at most {rate} while nothing changes.",
            *([told] if told else []),
            f"Runs are compared {order}.",
            ("Kept in ", code(found.store), ", whose lines are chained by their hashes; hash of "
             "the last line ", code(found.last[:16]), ". Whoever writes the whole chain anew is "
             "believed."),
        ))
    ]  # fmt: skip


def _provenance(found: Watch) -> list[tuple[str, str]]:
    own = found.provenance
    return [
        ("Spec file", found.spec.file),
        *pins(own.version, own.spec_sha256, own.catalogs_sha256, None),
        ("Last line of the store, SHA-256", found.last),
    ]
