"""What `diagnose --joint` says besides: whose value a finding is, and what each log says alone."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from syncline_design.diagnosis.one_of_several import names_of
from syncline_design.diagnosis.result import Estimate, Finding, Joint, LogAlone, UnlikeOthers
from syncline_design.machine.sentences import any_of, sentence_list
from syncline_design.model.figure_text import format_chance, format_components, format_estimates
from syncline_design.model.quantity import split_suffix
from syncline_design.report import charts_watch as drawings
from syncline_design.report import numbers
from syncline_design.report.document import Chart, Items, Node, Text, code, show
from syncline_design.report.table import Cell, table

MOST_LOGS: Final = 12  # told outside the page
SCOPES: Final = {
    "build": "One value in all logs: it belongs to the build.",
    "start": "Another value at every start of the system.",
    "log": "Another value in every log.",
}


def scope_nodes(found: Finding) -> list[Node]:
    """Whether a finding is one value in all logs, how that was tested, and its value in each."""
    if found.scope is None:
        return []
    if found.per_log and not any(one.parameters for one in found.per_log):
        return [Text(f"In {', '.join(one.file for one in found.per_log)}.")]
    words = SCOPES[found.scope]
    if found.one_value is not None:
        words += f" {_tested(found)}"
    drawn = _by_log(found)
    nodes: list[Node] = [Text(words), *drawn]
    if found.per_log:
        names = list(found.per_log[0].parameters)
        columns = [_column([one.parameters[n] for one in found.per_log]) for n in names]
        rows: list[tuple[Cell | str, ...]] = [
            (str(one.log), one.file, *cells)
            for one, cells in zip(found.per_log, zip(*columns, strict=True), strict=True)
        ]
        heads = ("Log", "File", *(f"{split_suffix(name)[0].replace('_', ' ')} #" for name in names))
        called = found.effect.replace("_", " ")
        shown = table(f"{called} ({found.sensor}) in each log", heads, rows)
        nodes += show(shown, reach="text" if drawn else "everywhere")  # the figure has its values
    return nodes


def _column(estimates: Sequence[Estimate]) -> list[Cell]:
    """A parameter by every log, all in one unit."""
    pairs = {
        k: (one.value, one.standard_uncertainty)
        for k, one in enumerate(estimates)
        if one.seen and not isinstance(one.value, str)
    }
    texts = format_estimates(list(pairs.values()), estimates[0].unit)
    shown = dict(zip(pairs, texts, strict=True))
    return [Cell(shown.get(k, one.text)) for k, one in enumerate(estimates)]


def _by_log(found: Finding) -> list[Node]:
    """What each log by itself tells of it, in a figure."""
    logs = found.per_log or found.each_log or ()
    if not drawings.drawn_by_log(logs):
        return []
    name = "-".join((found.effect, found.sensor, found.stage))
    common = found.parameters if found.scope == "build" else {}
    caption = "What each log by itself tells of it, with its 95 % interval."
    if common:
        caption += " Band and dashed line: the one value of all logs."
    draw = partial(drawings.by_log, logs, common, f"fig-logs-{name}")
    return [Chart(f"logs-{name}", draw, caption)]


def _tested(found: Finding) -> str:
    chance = found.one_value or 0.0
    size = "less than 0.001" if chance < 0.001 else numbers.number(chance, 2)
    if found.scope == "build":
        return f"Separate values fit no better than chance (p = {size})."
    return f"Were it one value, the logs would differ so much with a chance of {size}."


def latest(
    title: str, heads: Sequence[str], rows: Sequence[Sequence[Cell | str]], most: int
) -> list[Node]:
    """A table that grows with time: whole on the page, elsewhere its last rows."""
    nodes = show(table(title, heads, rows), silent=True, reach="page")
    nodes += show(table(title, heads, rows[-most:]), silent=True, reach="text")
    if len(rows) > most:
        words = f"The last {most} of {len(rows)}; all in --output json or html."
        nodes.append(Text(words, quiet=True, reach="text"))
    return nodes


def unlike_words(one: UnlikeOthers) -> str:
    """`log 4 (d.csv) is unlike the others: latency (position) differs there by ...`."""
    seen = {name: (own.value, own.standard_uncertainty, own.unit)
            for name, own in one.differs.items()
            if own.seen and not isinstance(own.value, str)}  # fmt: skip
    parts = [f"{split_suffix(name)[0].replace('_', ' ')} by {text}"
             for name, text in format_components(seen).items()]  # fmt: skip
    every = names_of(one, list(one.aliases or ()))
    first = f"as {every[0]}, " if len(every) > 1 else ""
    return (
        f"log {one.number} ({', '.join(one.files)}) is unlike the others: {any_of(every)} differs "
        f"there, {first}{sentence_list(parts)}; noise alone does that with a chance of "
        f"{format_chance(one.log10_chance)}, all logs and effects counted. What is said here is "
        "what the others say together"
    )


def joint_nodes(joint: Joint | None) -> list[Node]:
    """Every log by itself, and where their statistics are kept."""
    if joint is None:
        return []
    several = joint.starts not in (1, len(joint.logs))
    heads = ("Log", "File", *(["Start"] if several else []), "First stamp", "Rows #",
             "Alone", "Named alone")  # fmt: skip
    rows = [_row(one, several=several) for one in joint.logs]
    nodes = latest("The logs", heads, rows, MOST_LOGS)
    said = (*map(unlike_words, joint.unlike or ()), *(joint.left_out or ()))
    if said:
        nodes = [Items(tuple(f"{one}." for one in said), "!", "warn"), *nodes]
    if joint.starts == len(joint.logs) > 1:
        words = "Each log is a start of its own, so what differs by start differs by log."
        nodes.append(Text(words, quiet=True))
    if joint.store is not None:
        nodes.append(Text(("Kept in ", code(joint.store), "; hash of its last line ",
                           code((joint.last or "")[:16]), "."), quiet=True))  # fmt: skip
    return [*nodes, *torn_nodes(joint.torn)]


def torn_nodes(torn: int) -> list[Node]:
    """What a kill had left at the end of a store."""
    if not torn:
        return []
    words = (
        f"The store ended in a line without its end ({torn} bytes), as a kill leaves it: that "
        "line was dropped; add its log again if it is missing above."
    )
    return [Text(words, mark="!", tone="warn")]


def _row(one: LogAlone, *, several: bool) -> tuple[Cell | str, ...]:
    mark = "+" if one.new else ""
    start = [one.start] if several else []
    return (Cell(str(one.number), one.number, mark=mark), ", ".join(one.files), *start,
            one.date or "", Cell(numbers.count(one.used), one.used), one.verdict,
            "; ".join(one.named))  # fmt: skip
