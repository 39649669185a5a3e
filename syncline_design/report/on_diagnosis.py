"""What `diagnose` says: what is missing, how sure, what it explains, what remains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Final

from syncline_design.comparison.meaning import DesignMeaning, DiagnosisAndDesign
from syncline_design.diagnosis.gap_result import Gap
from syncline_design.diagnosis.one_of_several import is_one_of_several
from syncline_design.diagnosis.result import (
    Diagnosis,
    LogRead,
    NextDrive,
    UnlikeOthers,
)
from syncline_design.machine.records import with_texts
from syncline_design.machine.sentences import sentence_list
from syncline_design.report import charts_diagnosis as drawings
from syncline_design.report import numbers
from syncline_design.report.document import (
    Chart,
    Document,
    Facts,
    Items,
    Node,
    Outcome,
    Text,
    code,
    provenance,
    section,
    show,
)
from syncline_design.report.on_findings import (
    finding_nodes,
    full_stop,
    headline,
    left_text,
    noise_lines,
    regime_text,
    spaced,
)
from syncline_design.report.on_gap import closed_text, gap_nodes, rms_length
from syncline_design.report.on_joint import joint_nodes, unlike_words
from syncline_design.report.on_repairs import repair_nodes
from syncline_design.report.on_residuals import residual_nodes
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import visible
from syncline_design.report.verdict_charts import tightest_limit
from syncline_design.report.words import effect_words

DIAGNOSES: Final[dict[str, Outcome]] = {
    "agrees": Outcome(
        "good", "\u2713",
        "Agrees: nothing is missing; what differs is the noise that the spec expects",
    ),
    "explained": Outcome(
        "warn", "!", "Explained: what is missing was found, and what remains is noise"
    ),
    "unexplained": Outcome(
        "bad", "?", "Unexplained: something remains that no effect of the dictionary explains"
    ),
}  # fmt: skip
_UNSOUND: Final = Outcome(
    "bad", "!", "Unexplained: the log contradicts itself or the limits of the spec's platform"
)
_CONSTANT: Final = Outcome(
    "warn", "!", "Explained, or within the spec: constant noise of its size would do the same"
)
_CLASS: Final = (
    "Explained{part} by one of several effects that {who} cannot tell apart; what remains is noise"
)
LARGE: Final = 1.25  # times the RMS that the spec's noise expects: said in the outcome
MOST_REGIMES: Final = 4  # told outside the page


def on_diagnosis(found: DiagnosisAndDesign) -> Document:
    """A diagnosis, and what it means for the design, as a document."""
    found = with_texts(found, visible)  # charts take texts as they are
    return Document(
        family="Diagnosis",
        outcome=outcome_of(found),
        name=found.spec.name if found.spec is not None else "Measured log against simulation",
        sentences=(*_unlike(found), sentence_text(found)),
        facts=tuple(_facts(found)),
        sections=(
            *section("findings", "What is missing", finding_nodes(found), "Findings"),
            *section("gap", "How much of the gap is closed", gap_nodes(found), "Gap"),
            *section("residuals", "Residuals", residual_nodes(found.plots)),
            *section("where", "Where they disagree", _where(found), "Where"),
            *section("drive", "The drive that would tell", _drive(found), "Drive"),
            *section("unseen", "What this log cannot show", _unseen(found), "Not shown"),
            *section("design", "What it means for the design", _design(found.design), "Design"),
            *section("repairs", "What would put it right", repair_nodes(found), "Repairs"),
            *section("logs", "Log by log", joint_nodes(found.joint), "Logs"),
            *section("log", "The log" if found.joint is None else "The logs", _log(found), "Log"),
            *provenance(_provenance(found)),
        ),
        source=found.spec.file if found.spec is not None else "",
    )


def _drive(found: Diagnosis) -> list[Node]:
    """The test drive for a class, in short, and the command that prints it whole."""
    plan = found.plan
    if plan is None:
        return []
    who = "This log" if found.joint is None else "These logs"
    if plan.minutes is None:
        return [Text((f"{plan.why_none}: ", code(plan.command)))]
    length = numbers.drive_time(plan.minutes)
    told = sentence_list([plan.second, *(plan.others or ())])
    words = f"{who} cannot tell {plan.first} from {told}. A drive of {length} does:"
    if not plan.reached:
        least = numbers.drive_time(plan.least_minutes or plan.minutes)
        words = f"{who} cannot tell {plan.first} from {told}. It takes {least} of:"
    targets = f", over {plan.targets} surveyed targets" if plan.targets else ""
    more = f"Whole, with waypoints{targets}: "
    nodes: list[Node] = [Text(words), Items(plan.legs), Text((more, code(plan.command)))]
    nodes += [Text(words) for words in _untold(plan)]
    return nodes


def _untold(plan: NextDrive) -> Iterator[str]:
    """What the drive does not tell the finding from."""
    alike = [one for one in plan.inseparable or () if one in (plan.alike or ())]
    lost = [one for one in plan.inseparable or () if one not in alike]
    if alike:
        yield f"No drive of this platform can tell it from {sentence_list(alike)}."
    if lost:
        yield (
            f"No drive of this platform tells it from {sentence_list(lost)} in ten minutes, at "
            "this size."
        )


def _unseen(found: Diagnosis) -> list[Node]:
    return [Items(tuple(effect_words(line) for line in found.unseen))] if found.unseen else []


def _unlike(found: Diagnosis) -> Iterator[str]:
    """Logs that are unlike the others they were given with."""
    for one in () if found.joint is None else found.joint.unlike or ():
        words = unlike_words(one)
        yield f"{words[0].upper()}{words[1:]}."


def outcome_of(found: Diagnosis) -> Outcome:
    """The verdict's words; a log that contradicts itself is said to, whatever was named."""
    if not found.sound:
        return _UNSOUND
    if found.joint is not None and found.joint.unlike:
        return _unlike_outcome(found.joint.unlike)
    known, times = DIAGNOSES[found.verdict], _times_expected(found.gap)
    if _maybe_constant(found):
        known = _CONSTANT
    elif found.verdict == "explained":
        known = _up_to_a_class(found, known)
    if _maybe_slow(found):
        return Outcome(
            "warn",
            "!",
            f"Agrees as far as this log can tell: {numbers.number(times, 2)} times what white "
            "noise of the spec's size makes, as slow noise of that size can",
        )
    if found.verdict != "explained" or times <= LARGE:
        return known
    more = f"{known.word}, {numbers.number(times, 2)} times what the spec expects"
    return Outcome(known.tone, known.mark, more)


def _up_to_a_class(found: Diagnosis, known: Outcome) -> Outcome:
    """The outcome; where a cause is one of several that the log leaves, that it is."""
    causes = [one for one in found.findings if one.material and one.kind == "cause"]
    classes = [one for one in causes if is_one_of_several(one)]
    if not classes:
        return known
    part = ", in part" if len(classes) < len(causes) else ""
    who = "this log" if found.joint is None else "these logs"
    return Outcome(known.tone, known.mark, _CLASS.format(part=part, who=who))


def _maybe_constant(found: Diagnosis) -> bool:
    """Whether constant noise within the spec's would do all that was found."""
    told = [one for one in found.findings if one.material]
    constant = bool(told) and all(one.within_noise is not None for one in told)
    return found.verdict == "explained" and constant


def _maybe_slow(found: Diagnosis) -> bool:
    """Whether the log agrees, though it differs by more than white noise of the spec's makes."""
    large = _times_expected(found.gap) > LARGE
    return found.verdict == "agrees" and large and not found.findings


def _unlike_outcome(unlike: Sequence[UnlikeOthers]) -> Outcome:
    logs = sentence_list([str(one.number) for one in unlike])
    said = f"Logs {logs} are" if len(unlike) > 1 else f"Log {logs} is"
    return Outcome("warn", "!", f"{said} unlike the others: below is what the others say together")


def _times_expected(gap: Gap) -> float:
    """RMS after, over what the spec's noise gives; 0 where no rows were held out."""
    if gap.held_out is None or gap.expected_rms_m is None:
        return 0.0
    return gap.held_out.after.rms_m / max(gap.expected_rms_m, 1e-300)


def sentence_text(found: Diagnosis) -> str:
    """What is wrong with the log first, then what was found in it."""
    said = [full_stop(check.message) for check in found.checks]
    checks = [text[0].upper() + text[1:] for text in said]
    if not found.sound:
        checks.append("Mend that first: every figure below rests on it.")
    return " ".join([*checks, _found_text(found)])


def _found_text(found: Diagnosis) -> str:
    """What is sure, then the noise, then what is left."""
    named = [one for one in found.findings if one.material and one.kind != "noise"]
    said = [headline(one) for one in named]
    said += [full_stop(line) for line in noise_lines(found.findings)]
    if not said and not found.remaining.material:
        slow = _maybe_slow(found)
        said = [
            "Nothing was found that slow noise of the spec's size could not make."
            if slow
            else f"Nothing{_beside(found)} beyond the spec's own noise was found."
        ]
    if not named and found.remaining.material:
        said.append("No effect of the dictionary explains what differs.")
    return " ".join([*said, left_text(found.remaining)]).strip()


def _beside(found: Diagnosis) -> str:
    """Of a log that is explained by what was left out of it."""
    return " else" if found.verdict == "explained" else ""


def _facts(found: Diagnosis) -> list[tuple[str, str]]:
    gap, log, facts = found.gap, found.log, []
    if gap.held_out is not None:
        scores = gap.held_out
        facts.append(("RMS before", rms_length(scores.before.rms_m)))
        facts.append(("RMS after", rms_length(scores.after.rms_m)))
        facts.append(("RMS at best", rms_length(scores.fitted.rms_m)))
        if closed := closed_text(gap, scores):
            facts.insert(0, ("Gap closed on held-out data", closed))
    if gap.expected_rms_m is not None:
        facts.append(("The spec's noise expects", rms_length(gap.expected_rms_m)))
    rows = f"{numbers.count(log.used)} of {numbers.count(log.rows)}"
    if found.joint is not None:
        facts.append(("Logs together", str(len(found.joint.logs))))
    return [*facts, ("Rows used", rows)]


def _where(found: Diagnosis) -> list[Node]:
    """Where they disagreed most; of a log that agrees on average, where it still does."""
    regimes = found.where or found.remaining.where
    maps = [
        drawings.WhereCells(
            one.covariate, one.unit, tuple((c.low, c.high, abs(c.score)) for c in one.cells)
        )
        for one in found.plots.where_map[:6]
    ]
    caption = (
        "Disagreement of each regime in standard errors; noise alone seldom exceeds 3 (dashed)."
    )
    lines = tuple(regime_text(one) for one in regimes)
    if not lines:
        return []
    short = Items(lines[:MOST_REGIMES], reach="text")
    half, top = (len(maps) + 1) // 2, drawings.largest(maps)
    chart = [
        Chart(name, partial(drawings.where_map, some, top, f"fig-{name}"), caption)
        for name, some in (("where", maps[:half]), ("where-too", maps[half:])) if some
    ]  # fmt: skip
    return [*chart, Items(lines, reach="page"), *([short] if found.findings else [])]


def _design(design: DesignMeaning | None) -> list[Node]:
    """What the findings mean for the design, in words and figures."""
    if design is None:
        return []
    lines = (*design.text, design.horizon.text)
    return [Items(tuple(line.strip() for line in lines)), *show(meaning_table(design))]


def meaning_table(design: DesignMeaning) -> Table:
    """The error without and with the findings, by model and simulated, in the limit's unit."""
    limit = tightest_limit(design.before, "accuracy")
    rows: list[tuple[Cell | str, ...]] = [
        (
            one.label,
            *(Cell(numbers.error(value, limit), value) for value in (one.before_m, one.after_m)),
            " to ".join(numbers.error(end, limit) for end in one.after_interval_m or ()),
        )
        for one in design.figures
    ]
    heads = ("Error of the design", "Without #", "With the findings #", "95 % interval, with")
    return table("The error without and with the findings", heads, rows)


def _log(found: Diagnosis) -> list[Node]:
    return [
        Facts(tuple(_log_facts(found)), reach="page"),
        *show(_rejected(found.log), reach="page"),
        Items(tuple(log_lines(found.log)), reach="text"),
    ]


def log_lines(log: LogRead) -> list[str]:
    """How many rows were read, used, fitted and left out, and how the log was read."""
    used, rows = numbers.count(log.used), numbers.count(log.rows)
    lines = [f"Log: {used} of {rows} rows used, {numbers.count(log.fitted)} fitted."]
    if log.thinned:
        lines.append(f"Too long to hold: {numbers.count(log.thinned)} rows are between windows.")
    lines += [f"Left out: {numbers.count(n)} ({why})" for why, n in log.rejected.items()]
    motion = [f"Varied: {_motion(log)}"] if log.motion else []
    return [*lines, *motion, *log.notes]


def _motion(log: LogRead) -> str:
    """`speed 0.82 to 7.8 m/s, range 31 to 46 m`."""
    return ", ".join(
        f"{spaced(n)} {numbers.number(m.low, 3)} to {numbers.number(m.high, 3)} {m.unit}"
        for n, m in log.motion.items()
    )


def _log_facts(found: Diagnosis) -> list[tuple[str, str]]:
    log = found.log
    facts = [
        ("Files", sentence_list(list(found.log_files))),
        ("Kind", log.kind),
        ("Rows", numbers.count(log.rows)),
        ("Rows used", numbers.count(log.used)),
        ("Rows between windows", numbers.count(log.thinned)),
        ("Rows fitted", numbers.count(log.fitted)),
        ("Duration", numbers.time(log.duration_s)),
        ("Interval", numbers.time(log.interval_s)),
        ("Varied", _motion(log)),
        ("Notes", sentence_list(list(log.notes))),
    ]
    return [(label, text) for label, text in facts if text]


def _rejected(log: LogRead) -> Table | None:
    rows = [(reason, Cell(numbers.count(n), n)) for reason, n in log.rejected.items()]
    return table("Rows left out", ("Reason", "Rows #"), rows) if rows else None


def _provenance(found: Diagnosis) -> list[tuple[str, str]]:
    file = [] if found.spec is None else [("Spec file", found.spec.file)]
    known = found.provenance.to_json().items()
    return [*file, *((spaced(key), _listed(value)) for key, value in known)]


def _listed(value: object) -> str:
    """A setting in words: a list by its entries, an empty one as none."""
    return (", ".join(map(str, value)) or "none") if isinstance(value, list) else str(value)
