"""What `diagnose` says: what is missing, how sure, what it explains, what remains."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

from syncline_design.comparison.meaning import DesignMeaning, DiagnosisAndDesign
from syncline_design.diagnosis.gap_result import Gap, Regime, Remaining
from syncline_design.diagnosis.identify import SAME
from syncline_design.diagnosis.result import (
    Diagnosis,
    Estimate,
    Finding,
    LogRead,
    NextDrive,
    Rival,
    Stretch,
    readings_words,
)
from syncline_design.effects import registry
from syncline_design.machine.records import with_texts
from syncline_design.machine.sentences import sentence_list
from syncline_design.model.quantity import split_suffix
from syncline_design.planning.from_diagnosis import moves
from syncline_design.report import charts_diagnosis as drawings
from syncline_design.report import numbers
from syncline_design.report.document import (
    Chart,
    Document,
    Facts,
    Group,
    Heading,
    Items,
    Node,
    Outcome,
    Text,
    code,
    given,
    provenance,
    section,
    show,
)
from syncline_design.report.on_gap import closed_text, gap_nodes, rms_length
from syncline_design.report.on_joint import joint_nodes, scope_nodes
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
LARGE: Final = 1.25  # times the RMS that the spec's noise expects: said in the outcome
NOWHERE: Final = "in no regime on average: it shows in how the errors vary, not in their mean"
MOST_REGIMES: Final = 4  # told outside the page
NAT: Final = (
    "1 nat, the unit of evidence: the log is 2.7 times as likely with it as without; 5 nat: 148 "
    "times."
)


def on_diagnosis(found: DiagnosisAndDesign) -> Document:
    """A diagnosis, and what it means for the design, as a document."""
    found = with_texts(found, visible)  # charts take texts as they are
    return Document(
        family="Diagnosis",
        outcome=outcome_of(found),
        name=found.spec.name if found.spec is not None else "Measured log against simulation",
        sentences=(sentence_text(found),),
        facts=tuple(_facts(found)),
        sections=(
            *section("findings", "What is missing", _findings(found), "Findings"),
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
    length = numbers.typeset(f"{numbers.number(plan.minutes, 2)} min")
    told = sentence_list([plan.second, *(plan.others or ())])
    words = f"{who} cannot tell {plan.first} from {told}. A drive of {length} does:"
    if not plan.reached:
        least = numbers.typeset(f"{numbers.number(plan.least_minutes or plan.minutes, 2)} min")
        words = f"{who} cannot tell {plan.first} from {told}. It takes {least} of:"
    targets = f", over {plan.targets} surveyed targets" if plan.targets else ""
    more = f"Whole, with waypoints{targets}: "
    nodes: list[Node] = [Text(words), Items(plan.legs), Text((more, code(plan.command)))]
    if plan.inseparable:
        lost = sentence_list(list(plan.inseparable))
        nodes.append(
            Text(f"No drive of this platform tells it from {lost} in ten minutes, at this size.")
        )
    return nodes


def _unseen(found: Diagnosis) -> list[Node]:
    return [Items(tuple(effect_words(line) for line in found.unseen))] if found.unseen else []


def outcome_of(found: Diagnosis) -> Outcome:
    """The verdict's words; a log that contradicts itself is said to, whatever was named."""
    if not found.sound:
        return _UNSOUND
    known, times = DIAGNOSES[found.verdict], _times_expected(found.gap)
    if found.verdict != "explained" or times <= LARGE:
        return known
    more = f"{known.word}, {numbers.number(times, 2)} times what the spec expects"
    return Outcome(known.tone, known.mark, more)


def _times_expected(gap: Gap) -> float:
    """RMS after, over what the spec's noise gives; 0 where no rows were held out."""
    if gap.held_out is None or gap.expected_rms_m is None:
        return 0.0
    return gap.held_out.after.rms_m / max(gap.expected_rms_m, 1e-300)


def sentence_text(found: Diagnosis) -> str:
    """What is wrong with the log first, then what was found in it."""
    said = [_full_stop(check.message) for check in found.checks]
    checks = [text[0].upper() + text[1:] for text in said]
    if not found.sound:
        checks.append("Mend that first: every figure below rests on it.")
    return " ".join([*checks, _found_text(found)])


def _found_text(found: Diagnosis) -> str:
    """What is sure, then the noise, then what is left."""
    named = [one for one in found.findings if one.material and one.kind != "noise"]
    said = [_full_stop(_called(one)) for one in named]
    said += [_full_stop(line) for line in noise_lines(found.findings)]
    if not said and not found.remaining.material:
        said = ["Nothing beyond the spec's own noise was found."]
    if not named and found.remaining.material:
        said.append("No effect of the dictionary explains what differs.")
    return " ".join([*said, left_text(found.remaining)]).strip()


def _called(one: Finding) -> str:
    """The sentence of a cause; of a stand-in, that it is none."""
    text = one.sentence
    return text if one.kind == "cause" else f"Not as a cause, as the nearest word for it: {text}"


def noise_lines(findings: Sequence[Finding]) -> list[str]:
    """What the noise does otherwise than the spec says, one line a sensor."""
    lines: dict[tuple[str, str], list[str]] = {}
    for one in findings:
        if one.kind == "noise" and one.material:
            lines.setdefault((one.stage, one.sensor), []).append(_noise_words(one))
    return [
        f"Noise of {sensor} ({stage}): {', '.join(parts)}"
        for (stage, sensor), parts in lines.items()
    ]


def _noise_words(one: Finding) -> str:
    """`slow, 6.4 mm over 22 s`: a noise effect in a few words, shares in percent."""
    parts = []
    for part in registry()[one.effect].brief:
        named = [name for name in one.parameters if f"{{{name}}}" in part]
        if all(one.parameters[name].value for name in named):
            parts.append(part.format(**{name: _figure_words(one, name) for name in named}))
    if one.readings:
        parts.append(readings_words(one.readings))
    return ", ".join(parts) or _spaced(one.effect)


def _figure_words(one: Finding, name: str) -> str:
    estimate = one.parameters[name]
    is_share = name.endswith("_rate") and isinstance(estimate.value, float)
    return numbers.percent(estimate.value) if is_share else estimate.text


def left_text(remaining: Remaining) -> str:
    """What nobody can name, in metres of what the spec's noise makes."""
    if not remaining.beyond_noise or not remaining.size_m or not remaining.spec_m:
        return ""
    size, allowed = rms_length(remaining.size_m), rms_length(remaining.spec_m)
    words = (
        "Structure that nobody can name" if remaining.material else "Structure that is immaterial"
    )
    return f"{words}: {size}, where the spec's noise makes {allowed}."


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


def _findings(found: Diagnosis) -> list[Node]:
    """Material causes each at length, then the noise, what is immaterial, and what is left."""
    causes = [one for one in found.findings if one.material and one.kind != "noise"]
    nodes: list[Node] = [
        finding_node(one, found.plan, first=k == 0) for k, one in enumerate(causes)
    ]
    if lines := noise_lines(found.findings):
        nodes.append(Items(tuple(lines)))
    slight = [
        f"{_effect_of(one)}: {_figures_of(one)}" for one in found.findings if not one.material
    ]
    if slight:
        nodes.append(Text(f"Seen, immaterial: {'; '.join(slight)}.", quiet=True))
    remaining = found.remaining
    if remaining.material:
        where = "; ".join(_regime_text(one) for one in remaining.where)
        words = f"Unexplained and still there: {where or NOWHERE}. {left_text(remaining)}"
        nodes.append(Text(words, mark="?", tone="bad"))
    elif left := left_text(remaining):
        nodes.append(Text(left, quiet=True))
    nodes += _blind(found)
    return nodes


def _blind(found: Diagnosis) -> list[Node]:
    """What would turn a requirement and would not have been seen."""
    if found.informative.ok or found.verdict != "agrees":
        return []
    names = sorted({f"{_spaced(one.effect)} ({one.sensor})" for one in found.informative.blind_to})
    words = (
        "This log could not have shown everything that would turn a requirement: "
        f"it is blind to {sentence_list(names)}."
    )
    return [Text(words, mark="!", tone="warn")]


def _effect_of(one: Finding) -> str:
    return f"{_spaced(one.effect)} ({one.sensor})"


def _figures_of(one: Finding) -> str:
    return ", ".join(estimate.text for estimate in one.parameters.values())


def _varying_text(found: Finding, varying: Sequence[Stretch]) -> str:
    """How a parameter varies: stretch by stretch, or by how much from one to the next."""
    if found.varying_std is None or found.varying_over_s is None:
        return f"It varies along the log: {sentence_list([_stretch_text(one) for one in varying])}."
    ends = sorted(varying, key=lambda one: one.value)
    long = numbers.si_quantity(found.varying_over_s, "s", 2)
    return (
        f"It varies along the log: by {found.varying_std.text} (standard deviation) from one "
        f"stretch of {long} to the next, between {ends[0].text} and {ends[-1].text}."
    )


def _apart(found: Finding, aliases: Sequence[Rival], drive: NextDrive | None) -> str:
    """What would tell a finding from its aliases; that nothing does where none of them is told.

    In one voice with the drive below: where that is none, no manoeuvre is promised here.
    """
    if drive is not None and drive.minutes is None:
        return "No drive that does was found."
    lost = drive.inseparable or () if drive is not None and drive.first in _spelt(found) else ()
    driven = [one for one in aliases if moves(one.effect)]
    if lost and driven and all(any(name in lost for name in _spelt(one)) for one in driven):
        return "No drive of this platform does in ten minutes, at this size."
    return f"To separate them: {found.separated_by}."


def _spelt(one: Finding | Rival) -> tuple[str, str]:
    """An effect as plans spell it, in a system of one stage and in a chain."""
    return f"{one.effect}({one.sensor})", f"{one.effect}({one.stage}.{one.sensor})"


def finding_node(found: Finding, drive: NextDrive | None = None, *, first: bool = True) -> Node:
    """One finding: its figures, how sure it is, what else it could be.

    first: of a document, which says what its evidence is counted in.
    """
    facts = [(_spaced(split_suffix(n)[0]), _parameter_text(p)) for n, p in found.parameters.items()]
    nodes: list[Node] = [
        Heading(given(_spaced(found.effect)), given(f"{found.sensor}, {found.stage}")),
        Text(_full_stop(_called(found)), reach="page"),
        Facts(tuple(facts)),
        Text(numbers.unbroken(f"Evidence: {_full_stop(found.evidence)}")),
        *([Text(numbers.unbroken(NAT), quiet=True)] if first and " nat" in found.evidence else []),
        *scope_nodes(found),
    ]
    if found.varying:
        nodes.append(Text(_varying_text(found, found.varying), mark="!"))
    open_ = found.open_aliases
    unlikely = [a for a in found.aliases if a not in open_]
    if open_:
        names = sentence_list([_alias_text(one) for one in open_])
        apart = _apart(found, open_, drive)
        who = "This log" if found.scope is None else "These logs"
        words = f"{who} cannot tell it apart from {names}. {apart}"
        nodes.append(Text(words, mark="!", tone="warn"))
    if unlikely:
        names = sentence_list([_alias_text(one) for one in unlikely])
        nodes.append(Text(f"Of the same signature, but unlikely here: {names}.", quiet=True))
    if found.lookalikes:
        names = sentence_list([rival_text(one, alike=True) for one in found.lookalikes])
        nodes.append(Text(f"In its place on this log: {names}.", quiet=True))
    if found.excluded:
        names = sentence_list([rival_text(one) for one in found.excluded])
        nodes.append(Text(f"Told apart on this log from {names}.", quiet=True))
    return Group(tuple(nodes), "article")


def _stretch_text(one: Stretch) -> str:
    """`64 ms from 0 s to 43.5 s`."""
    ends = " to ".join(numbers.si_quantity(end, "s", 3) for end in (one.from_s, one.to_s))
    return f"{one.text} from {ends}"


def _spaced(name: str) -> str:
    return name.replace("_", " ")


def _full_stop(text: str) -> str:
    return text if not text or text.endswith(".") else text + "."


def _effect_text(one: Rival) -> str:
    """`lever arm (position)`."""
    return f"{_spaced(one.effect)} ({one.sensor})"


def _alias_text(one: Rival) -> str:
    """Name, and how likely it is in place of the named one."""
    if one.probability is None:
        return _effect_text(one)
    return f"{_effect_text(one)}, probability {numbers.number(one.probability, 2)}"


def rival_text(one: Rival, *, alike: bool = False) -> str:
    """Name and how much worse it fits; one that fits better says why it is not the name."""
    if one.nats_worse >= 0.0:
        kept = "" if one.refitted else " with the noise kept"
        other = ", of another signature" if alike and one.cosine <= SAME else ""
        return f"{_effect_text(one)}{other}, {numbers.nats(one.nats_worse)} worse{kept}"
    if not one.possible:
        better = f"{numbers.nats(-one.nats_worse)} better"
        why = "but only with impossible values"
        if registry()[one.effect].spread is not None:
            why = "but this log does not scatter as it would have to"
        return f"{_effect_text(one)}, {better}, {why}"
    return f"{_effect_text(one)}, as well in its place"


def _parameter_text(shown: Estimate) -> str:
    """`87.1 \u00b1 0.3 ms`: an estimate with its standard uncertainty, both in one unit."""
    if not shown.seen:
        return "not seen in this log"
    if isinstance(shown.value, str):
        return shown.value
    spread = numbers.finite(shown.standard_uncertainty)
    return numbers.with_uncertainty(shown.value, spread, shown.unit)


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
    lines = tuple(_regime_text(one) for one in regimes)
    if not lines:
        return []
    short = Items(lines[:MOST_REGIMES], reach="text")
    half, top = (len(maps) + 1) // 2, drawings.largest(maps)
    chart = [
        Chart(name, partial(drawings.where_map, some, top, f"fig-{name}"), caption)
        for name, some in (("where", maps[:half]), ("where-too", maps[half:])) if some
    ]  # fmt: skip
    return [*chart, Items(lines, reach="page"), *([short] if found.findings else [])]


def _regime_text(one: Regime) -> str:
    """`along track at speed 6.3 m/s to 9 m/s: mean -652 mm, 508 standard errors`."""
    low, high = (numbers.si_quantity(end, one.unit, 3) for end in (one.low, one.high))
    if one.unit == "s":  # `0.0003 s to 50 s`
        low = numbers.like(high, one.low, 3)
    place = f"{one.axis}, {_spaced(one.covariate)} {low} to {high}"
    return (
        f"{place}: mean {rms_length(one.mean_m)}, {numbers.number(abs(one.score), 3)} "
        f"standard errors"
    )


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
        f"{_spaced(n)} {numbers.number(m.low, 3)} to {numbers.number(m.high, 3)} {m.unit}"
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
    return [*file, *((_spaced(key), _listed(value)) for key, value in known)]


def _listed(value: object) -> str:
    """A setting in words: a list by its entries, an empty one as none."""
    return (", ".join(map(str, value)) or "none") if isinstance(value, list) else str(value)
