"""What a diagnosis found, in words: causes, noise, what is left, and what else each could be."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from syncline_design.diagnosis.gap_result import Regime, Remaining
from syncline_design.diagnosis.identify import SAME
from syncline_design.diagnosis.one_of_several import (
    class_words,
    is_one_of_several,
    members,
    rivals_words,
)
from syncline_design.diagnosis.result import (
    Diagnosis,
    Estimate,
    Finding,
    NextDrive,
    Rival,
    Stretch,
    WithinNoise,
    readings_words,
)
from syncline_design.effects import registry
from syncline_design.machine.sentences import sentence_list
from syncline_design.model.quantity import split_suffix
from syncline_design.planning.from_diagnosis import moves
from syncline_design.report import numbers
from syncline_design.report.document import (
    Facts,
    Group,
    Heading,
    Items,
    Node,
    Text,
    given,
)
from syncline_design.report.on_gap import rms_length
from syncline_design.report.on_joint import scope_nodes

NOWHERE: Final = "in no regime on average: it shows in how the errors vary, not in their mean"
NAT: Final = (
    "1 nat, the unit of evidence: the log is 2.7 times as likely with it as without; 5 nat: 148 "
    "times."
)


def called(one: Finding) -> str:
    """The sentence of a cause; of a stand-in, that it is none; of what noise may do, that too."""
    text = one.sentence
    if one.within_noise is not None:
        text = f"{text}; constant noise of {one.within_noise.sensor} would do the same"
    return text if one.kind == "cause" else f"Not as a cause, as the nearest word for it: {text}"


def headline(one: Finding) -> str:
    """The sentence of a finding; of one of several that its log cannot tell apart, that first."""
    if not is_one_of_several(one):
        return full_stop(called(one))
    if one.kind != "cause":
        return f"{called(one).rstrip('.')}; as well: {rivals_words(one)}."
    every = members(one)
    who = "this log" if one.scope is None else "these logs"
    chance = ""
    if one.probability is not None:
        chance = f", probability {numbers.number(one.probability, 2)}"
    return (
        f"One of {len(every)} effects that {who} cannot tell apart: {class_words(one)}. "
        f"If it is {every[0]}{chance}: {full_stop(called(one))}"
    )


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
    return ", ".join(parts) or spaced(one.effect)


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


def finding_nodes(found: Diagnosis) -> list[Node]:
    """Material causes each at length, then the noise, what is immaterial, and what is left."""
    causes = [one for one in found.findings if one.material and one.kind != "noise"]
    nodes: list[Node] = [
        finding_node(one, found.plan, first=k == 0) for k, one in enumerate(causes)
    ]
    if lines := noise_lines(found.findings):
        nodes.append(Items(tuple(lines)))
    slight = [
        f"{_effect_text(one)}: {_figures_of(one)}" for one in found.findings if not one.material
    ]
    if slight:
        nodes.append(Text(f"Seen, immaterial: {'; '.join(slight)}.", quiet=True))
    remaining = found.remaining
    if remaining.material:
        where = "; ".join(regime_text(one) for one in remaining.where)
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
    names = sorted({f"{spaced(one.effect)} ({one.sensor})" for one in found.informative.blind_to})
    words = (
        "This log could not have shown everything that would turn a requirement: "
        f"it is blind to {sentence_list(names)}."
    )
    return [Text(words, mark="!", tone="warn")]


def _figures_of(one: Finding) -> str:
    return ", ".join(estimate.text for estimate in one.parameters.values())


def _noise_instead(found: Finding, noise: WithinNoise) -> str:
    times, share = numbers.number(noise.sigmas, 2), numbers.percent(noise.chance, 2)
    if found.scope is None:
        return (
            f"It cannot be told from noise of {noise.sensor} that stays the same over the whole "
            f"log: {times} times the spec's standard deviation does the same, and such noise is as "
            f"large in {share} of logs."
        )
    return (
        f"It cannot be told from noise of {noise.sensor} that stays the same over each log and is "
        f"another in the next: at most {times} times the spec's standard deviation does the same, "
        f"and such noise does as much in {share} of such sets of logs."
    )


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
    driven = [one for one in aliases if moves(one.effect)]
    if drive is not None and drive.first in _spelt(found) and _among(driven, drive.alike):
        return "No drive can: on every leg of this platform they make the same error."
    if drive is not None and drive.minutes is None:
        return "No drive that does was found."
    lost = drive.inseparable or () if drive is not None and drive.first in _spelt(found) else ()
    if _among(driven, lost):
        return "No drive of this platform does in ten minutes, at this size."
    return f"To separate them: {found.separated_by}."


def _among(aliases: Sequence[Rival], names: Sequence[str] | None) -> bool:
    """Whether all of some aliases are named."""
    known = names or ()
    return bool(aliases) and all(any(name in known for name in _spelt(one)) for one in aliases)


def _spelt(one: Finding | Rival) -> tuple[str, str]:
    """An effect as plans spell it, in a system of one stage and in a chain."""
    return f"{one.effect}({one.sensor})", f"{one.effect}({one.stage}.{one.sensor})"


def finding_node(found: Finding, drive: NextDrive | None = None, *, first: bool = True) -> Node:
    """One finding: its figures, how sure it is, what else it could be.

    first: of a document, which says what its evidence is counted in.
    """
    facts = [(spaced(split_suffix(n)[0]), _parameter_text(p)) for n, p in found.parameters.items()]
    nodes: list[Node] = [
        Heading(given(spaced(found.effect)), given(f"{found.sensor}, {found.stage}")),
        Text(full_stop(called(found)), reach="page"),
        Facts(tuple(facts)),
        Text(f"Evidence: {full_stop(found.evidence)}"),
        *([Text(NAT, quiet=True)] if first and " nat" in found.evidence else []),
        *scope_nodes(found),
    ]
    if found.within_noise is not None:
        nodes.append(Text(_noise_instead(found, found.within_noise), mark="!", tone="warn"))
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
    return f"{one.text} from {numbers.from_to(one.from_s, one.to_s)}"


def spaced(name: str) -> str:
    return name.replace("_", " ")


def full_stop(text: str) -> str:
    return text if not text or text.endswith(".") else text + "."


def _effect_text(one: Finding | Rival) -> str:
    """`lever arm (position)`."""
    return f"{spaced(one.effect)} ({one.sensor})"


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
    return shown.text if isinstance(shown.value, str) else numbers.typeset(shown.text)


def regime_text(one: Regime) -> str:
    """`along track at speed 6.3 m/s to 9 m/s: mean -652 mm, 508 standard errors`."""
    low, high = (numbers.si_quantity(end, one.unit, 3) for end in (one.low, one.high))
    if one.unit == "s":  # `0.0003 s to 50 s`
        low = numbers.like(high, one.low, 3)
    place = f"{one.axis}, {spaced(one.covariate)} {low} to {high}"
    return (
        f"{place}: mean {rms_length(one.mean_m)}, {numbers.number(abs(one.score), 3)} "
        f"standard errors"
    )
