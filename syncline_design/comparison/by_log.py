"""Evidence of a measured log: what its diagnosis says of each assumption."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.by_motion import CODES, by_motion
from syncline_design.comparison.by_noise import (
    broken_figure,
    is_shape,
    noise_figure,
    noise_open,
    noise_within,
    of_what,
    swaying_words,
    sways,
)
from syncline_design.comparison.by_scatter import as_bound, with_scatter
from syncline_design.comparison.by_shift import by_shifts, shifts, widened
from syncline_design.comparison.by_stretch import SPOKEN_OF
from syncline_design.comparison.departing import amount, figure_of, with_room
from syncline_design.comparison.in_doubt import (
    InDoubt,
    Suspicion,
    as_size,
    likeliest,
    widened_by,
)
from syncline_design.comparison.judgement import OF_PLACES, Judgement
from syncline_design.comparison.log_evidence import LogEvidence
from syncline_design.comparison.on_paper import OnPaper, size_of
from syncline_design.comparison.shapes import beside_shapes, shapes
from syncline_design.comparison.whole_delay import delaying, with_all_delays
from syncline_design.diagnosis.result import Finding, Smallest
from syncline_design.effects import registry
from syncline_design.machine.sentences import or_rivals
from syncline_design.model.figure_text import format_duration, percent, rounded, to_digits

# what undoes a departure, so that neither the log nor the objects' places show both together
_ALONE: Final = {
    "latency": ", but for a delay common to all sensors, which moves nothing that stands still",
    "lever_arm": ", but for an equal error of the other lever arm, which undoes it",
    "mounting": ", but for a turn of the other sensor that undoes it",
}
LONGEST_S: Final = 4 * 3600.0  # of a drive that one would ask for


def by_log(one: Assumed, log: LogEvidence) -> Judgement:
    """What a measured log says of one assumption."""
    if one.name in CODES:
        return by_motion(one, log.found, log.sight, log.last_stage)
    own = [f for f in log.found.findings if log.is_of(f.effect, _sensors(f), f.stage, one)]
    large = [f for f in own if f.material and f.kind != "stand_in"]
    breaking = [f for f in large if not log.within_figure(one, f)]
    if large and not breaking:
        return Judgement("not_shown", _as_slow(large), noise_figure(one, log))
    unsure = noise_open(one, log, breaking)
    if unsure is not None:
        return unsure
    standing = log.parts.standing(one)
    suspect = _suspect(one, log)
    breaking = [f for f in breaking if log.is_sure(one, f) and not is_shape(one, f, log)]
    if breaking or (standing is not None and standing.status == "broken"):
        said = _broken(
            one,
            breaking,
            standing,
            broken_figure(one, log, breaking),
            of_what(breaking, log.split(one)),
        )
        undone = list(log.parts.undone(one, _width(said.measured)))
        said = as_bound(one, said, breaking, log)
        if one.name == "noise":  # how far it scatters is not what constants and drifts hide
            return replace(said, words=_with_more(said, undone))
        said = _in_all(one, said, log) or said
        said = _but_for(said, undone, log.parts.room_undone(one), _is_signed(one))
        said = with_scatter(one, said, log)
        return beside_shapes(one, _or_more(one, said, log), log, signed=_is_signed(one))
    moved = [each for each in shifts(one, log.found) if log.is_sure(one, each.finding)]
    shifted = by_shifts(one, moved, log.paper)
    shifted = _in_all(one, shifted, log)
    if shifted is not None and shifted.status == "broken":
        return beside_shapes(one, shifted, log, signed=_is_signed(one))
    if suspect is not None:
        return suspect
    doubt = _doubt(one, log)
    if doubt:
        return Judgement("not_shown", doubt)
    if (unclear := standing or shifted) is not None:
        return unclear
    undone = list(log.parts.undone(one))
    if undone:
        return _untold(undone)
    if own:
        return _immaterial(one, own, log.paper)
    return _nothing_found(one, log)


def _in_all(one: Assumed, said: Judgement | None, log: LogEvidence) -> Judgement | None:
    """What is said of a delay, with what adds to it, as far as all of that is sure."""
    sure = all(log.is_sure(one, f) for f in delaying(one, log.found))
    passing = list(log.parts.late(one, log.began_s))
    return with_all_delays(one, said, log.found, log.paper, passing) if sure else said


def _suspect(one: Assumed, log: LogEvidence) -> Judgement | None:
    """What was found and may be this or something else, with the figure that it would have."""
    own = {k: each for k, each in enumerate(log.in_doubt) if log.may_be(one, each)}
    if not own:
        return None
    figure = likeliest([_suspicion(one, log, each) for each in own.values()], _is_signed(one))
    first = next(iter(own.values()))
    words = "; ".join(each.words_of(log.ways_of(one, each)) for each in own.values())
    said = Judgement("not_shown", words, figure, first.from_s, first.to_s,
                     in_doubt=tuple(own))  # fmt: skip
    undone = list(log.parts.undone(one, _width(said.measured)))
    return _but_for(said, undone, log.parts.room_undone(one), _is_signed(one))


def _or_more(one: Assumed, said: Judgement, log: LogEvidence) -> Judgement:
    """What is broken, with an interval that holds what may have been added by what is in doubt."""
    added = [_suspicion(one, log, each) for each in log.in_doubt if log.may_be(one, each)]
    return replace(said, measured=widened_by(said.measured, added, _is_signed(one)))


def _suspicion(one: Assumed, log: LogEvidence, each: InDoubt) -> Suspicion:
    """What a finding in doubt would make of an assumption."""
    parts = [(way, part) for way in each.ways for part in way.parts if log.breaks(one, part)]
    figures = tuple((way.probability, log.figure(one, part)) for way, part in parts)
    return Suspicion(figures, in_part=each.from_s is not None)


def _is_signed(one: Assumed) -> bool:
    """Whether its figure is one component; of several it is a size."""
    return one.name == "latency"


def _untold(words: Sequence[str]) -> Judgement:
    return Judgement("not_shown", f"not told apart on this log: {'; '.join(words)}")


def _as_slow(within: Sequence[Finding]) -> str:
    """A constant or a drift that noise slower than the log leaves as well."""
    said = "; ".join(finding.sentence for finding in within)
    return (f"{said}, within the figure: noise that is slower than this log leaves as much, and "
            "logs of other starts would tell")  # fmt: skip


def _width(figure: MeasuredFigure | None) -> float:
    """Of an interval: what is undone counts where it is more than that; 0 of none."""
    if figure is None or figure.low is None or figure.high is None:
        return 0.0
    return figure.high - figure.low


def _but_for(said: Judgement, undone: Sequence[str], room: float, signed: bool) -> Judgement:
    """What is broken, with an interval that holds what another departure may undo of it.

    room: how far it may be off with the others free; 0 of what is in another unit, and has no
    interval then.  signed: of one component; of several none is shorter than 0.
    """
    if not undone:
        return said
    measured = _with_room(said.measured, room, signed)
    return replace(said, words=_with_more(said, undone), measured=measured)


def _with_more(said: Judgement, undone: Sequence[str]) -> str:
    more = f"; more of it may be there: {'; '.join(undone)}" if undone else ""
    return f"{said.words}{more}"


def _with_room(figure: MeasuredFigure | None, room: float, signed: bool) -> MeasuredFigure | None:
    if figure is None or figure.value is None:
        return None
    figure = figure if signed else as_size(figure)
    value = figure.value or 0.0
    if room <= 0.0:
        return MeasuredFigure(value)
    wide = with_room(figure, value, room)
    return wide if signed else MeasuredFigure(value, max(wide.low or 0.0, 0.0), wide.high)


def _sensors(finding: Finding) -> tuple[str, ...]:
    """Whose it is: of a delay that several sensors share, all of theirs."""
    return (finding.sensor, *(finding.also or ()))


def _broken(
    one: Assumed, breaking: Sequence[Finding], standing: Judgement | None,
    noise: MeasuredFigure | None, where: str = "",
) -> Judgement:  # fmt: skip
    """By the largest departure; all of them are said, with what the log cannot tell them from.

    where: of what the noise is so large.
    """
    also = standing if standing is not None and standing.status == "broken" else None
    if not breaking:
        assert also is not None
        return also
    first = max(breaking, key=lambda f: f.size_m or 0.0)
    words = "; ".join([*(_said(f) for f in breaking), *([also.words] if also else [])])
    figure = figure_of(one, first.parameters)
    if one.name == "noise" and noise is not None:
        figure = noise
        words += f"; {to_digits(noise.value or 0.0, 3)} times{where}"
    return Judgement("broken", words, figure, first.from_s, first.to_s)


def _said(finding: Finding) -> str:
    return finding.sentence + or_rivals(f"{a.effect} ({a.sensor})" for a in finding.aliases)


def _immaterial(one: Assumed, own: Sequence[Finding], paper: OnPaper) -> Judgement:
    """Departures that do not matter on this log: they hold unless they turn the verdict."""
    first = max(own, key=lambda f: f.size_m or 0.0)
    words, figure = "; ".join(f.sentence for f in own), figure_of(one, first.parameters)
    if paper.turned_by(own):
        return Judgement("broken", f"small, and it turns the verdict: {words}", figure)
    if paper.sound and not paper.keeps_slight:
        said = f"immaterial alone, but with all that was found the verdict turns: {words}"
        return Judgement("broken", said, figure)
    return Judgement("holds", f"immaterial: {words}", figure)


def _doubt(one: Assumed, log: LogEvidence) -> str:
    """Why the absence of a finding says nothing here; "" where it does."""
    found = log.found
    if log.sight is not None and log.sight.left_out > SPOKEN_OF:
        share = percent(log.sight.left_out, 2)
        return f"what stands out takes {share} of the log: of so much nothing else is shown"
    if one.name == "latency" and f"{one.stage}/{one.role}" in sways(log):
        return swaying_words(one, log)
    if not found.sound:
        first = next(c for c in found.checks if c.severity == "contradiction")
        return f"the log contradicts itself or the spec: {first.message}"
    if found.verdict == "unexplained":
        near = "; ".join(f.sentence for f in shapes(found))
        near = f" (the nearest word for it: {near})" if near else ""
        return f"the log disagrees with the spec and the cause has no name{near}: nothing is shown"
    for finding in found.findings:
        if finding.material and finding.effect not in registry():
            return f"the log holds what has no cause by name: {finding.sentence}"
        rivals = [a for a in finding.aliases if log.is_of(a.effect, (a.sensor,), a.stage, one)]
        others = any(log.is_of(e, (s,), stage, one) for e, s, stage in log.others_of(finding))
        if finding.material and (rivals or others):
            return f"this log cannot tell it from what was found: {finding.sentence}"
    return ""


def _nothing_found(one: Assumed, log: LogEvidence) -> Judgement:
    """Holds where the log would have shown whatever turns the verdict."""
    if one.name in ("timing", "clock"):
        return OF_PLACES
    figure = noise_figure(one, log) if one.name == "noise" else _seen(one, log)
    hidden = list(_hidden(one, log))
    if hidden:
        words = f"this log could hide what turns the verdict: {'; '.join(hidden)}"
        return Judgement("not_shown", words, figure if one.name == "noise" else None)
    if figure is None:
        return Judgement("not_shown", "this log cannot show it")
    if one.name == "noise":
        return noise_within(one, log, figure)
    return _shown(one, log, figure)


def _shown(one: Assumed, log: LogEvidence, figure: MeasuredFigure) -> Judgement:
    """Holds, and says how long what turns the verdict would have had to act to show."""
    alone = _ALONE[one.name]
    if moved := shifts(one, log.found):
        figure = widened(figure, moved)
    figure = _with_undone(figure, log.parts.largest_undone(one))
    size, slight = log.parts.slight(one)
    figure, alone = _with_undone(figure, size), alone + slight
    least = log.parts.least_s(one)
    if least is None:
        words = f"not found, and this log would have shown what turns the verdict{alone}"
        return Judgement("holds", words, figure)
    length_s, sizes = least
    if not length_s <= SPOKEN_OF * log.found.log.duration_s:
        begins = "half" if math.isinf(length_s) else format_duration(rounded(length_s, 2))
        shows = f" (it shows {sizes})" if sizes else ""
        words = (f"what turns the verdict and acts for less than {begins} of this log would not "
                 f"have shown{shows}; {_longer(log.parts.needs_s(one))}")  # fmt: skip
        return Judgement("not_shown", words)
    stretch = format_duration(rounded(length_s, 2))
    words = (f"not found, and what turns the verdict would have shown wherever it had acted for "
             f"{stretch} or longer ({sizes}){alone}")  # fmt: skip
    return Judgement("holds", words, figure, least_stretch_s=length_s)


def _longer(needs_s: float | None) -> str:
    """Which log would do; needs_s: how long, of such motion and noise."""
    if needs_s is None:
        return "a longer log would do"
    if needs_s > LONGEST_S:
        return "a log of other motion would do: `plan` names one"
    return f"a log of about {format_duration(_rounded_up(needs_s))} of such motion would do"


def _with_undone(figure: MeasuredFigure, size: float) -> MeasuredFigure:
    """An interval that holds what another departure undoes on this log as well."""
    return MeasuredFigure(
        figure.value, min(figure.low or 0.0, -size), max(figure.high or 0.0, size)
    )


def _hidden(one: Assumed, log: LogEvidence) -> Iterator[str]:
    """Effects that would turn the verdict before nearly all such logs would show them."""
    told: set[str] = set()
    excluded: set[tuple[str, str, str, str]] = set()
    for shown in log.found.smallest_seen:
        if shown.effect in told or not log.is_of(shown.effect, (shown.sensor,), shown.stage, one):
            continue
        if log.paper.hides(shown):
            told.add(shown.effect)
            yield _hidden_words(shown, log)
        elif shown.within is not None and shown.within == size_of(shown):
            excluded.add((shown.effect, shown.sensor, shown.stage, shown.parameter))
    for spot in log.found.informative.blind_to:
        own = log.is_of(spot.effect, (spot.sensor,), spot.stage, one)
        own = own and (spot.effect, spot.sensor, spot.stage, spot.parameter) not in excluded
        if own and spot.effect not in told:
            told.add(spot.effect)
            yield spot.effect


def _hidden_words(shown: Smallest, log: LogEvidence) -> str:
    """From which size on it turns the verdict, from which on it shows, and what would help."""
    units = {p.name: p.unit for p in registry()[shown.effect].parameters}
    unit = units[shown.parameter]
    at = log.paper.turns_at(shown)
    begins = "" if at is None else f" from {amount(at, unit)} on"
    if shown.sure is None:
        return f"{shown.effect} turns it{begins}, and no size of it shows"
    words = f"{shown.effect} turns it{begins or ' before it shows'}, "
    words += f"{'and shows ' if at else ''}from {amount(shown.sure, unit)} on"
    if registry()[shown.effect].grows and at is not None:
        # what drifts shows with the log's length to the power 3/2
        longer_s = log.found.log.duration_s * (size_of(shown) / at) ** (2.0 / 3.0)
        words += (f" (over the spec's horizon; a log of {format_duration(_rounded_up(longer_s))} "
                  "would show it)")  # fmt: skip
    elif at:
        longer_s = log.found.log.duration_s * (size_of(shown) / at) ** 2  # as a mean's error falls
        words += f" ({_longer(longer_s)})"
    return words


def _rounded_up(duration_s: float) -> float:
    """To whole minutes."""
    return 60.0 * math.ceil(duration_s / 60.0)


def _seen(one: Assumed, log: LogEvidence) -> MeasuredFigure | None:
    """No departure, and the largest that one log in twenty would have hidden."""
    sizes = list(_sizes(one, log))
    if not sizes:
        return None
    return MeasuredFigure(0.0, -max(sizes), max(sizes))


def _sizes(one: Assumed, log: LogEvidence) -> Iterator[float]:
    """Of all parameters in the assumption's unit."""
    for shown in log.found.smallest_seen:
        if not log.is_of(shown.effect, (shown.sensor,), shown.stage, one):
            continue
        units = {p.name: p.unit for p in registry()[shown.effect].parameters}
        if units[shown.parameter] == one.unit and shown.value is not None:
            yield size_of(shown)
