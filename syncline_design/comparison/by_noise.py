"""What a measured log says of a sensor's noise: how large, and whether it is that sensor's.

The diagnosis names the sensor whose noise fits best; the split by directions (`noise_split`) says
how much of it that sensor can have at all.  A row is broken where both say more than the spec's,
and where it is no course that begins and ends: a knock that nothing names is noise of some sensor.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

from syncline_design.comparison.acceptance import MeasuredFigure
from syncline_design.comparison.assumptions import Assumed
from syncline_design.comparison.departing import of_stretch
from syncline_design.comparison.judgement import Judgement
from syncline_design.comparison.log_evidence import LogEvidence
from syncline_design.diagnosis.noise import FACTOR_LIMIT
from syncline_design.diagnosis.noise_split import NoiseFactors
from syncline_design.diagnosis.result import Estimate, Finding
from syncline_design.effects import registry
from syncline_design.machine.sentences import or_rivals
from syncline_design.model.figure_text import format_duration, percent, rounded, to_digits
from syncline_design.model.normal import NORMAL_95

_SCATTER: Final = ("factor", "slow", "down", "episode", "tails")  # what noise can be besides white
Span = tuple[float, float]
Span3 = tuple[float, float, float]


def noise_open(one: Assumed, log: LogEvidence, breaking: Sequence[Finding]) -> Judgement | None:
    """Why a sensor's noise is neither broken nor borne out; None where the log tells.

    breaking: what was found of it and matters.
    """
    figure = noise_figure(one, log)
    if one.name != "noise" or figure is None or figure.low is None or figure.high is None:
        return None
    words = _not_taken(log) or _not_its_own(one, log, breaking, figure)
    return None if not words else Judgement("not_shown", words, figure)


def _not_taken(log: LogEvidence) -> str:
    """What acts in so much of the log that it could not be left out is noise of all sensors."""
    left = () if log.sight is None else log.sight.left_in
    if not left:
        return ""
    said = ", ".join(f"{of_stretch(s).words} from {to_digits(s.from_s, 6)} s to "
                     f"{to_digits(s.to_s, 6)} s" for s in left)  # fmt: skip
    return f"what stands out is a part of what scatters here: {said}; without it the log would tell"


def _not_its_own(
    one: Assumed, log: LogEvidence, breaking: Sequence[Finding], figure: MeasuredFigure
) -> str:
    low, high = figure.low or 0.0, figure.high or 0.0
    if not breaking:
        return _of_another(one, log, high)
    said = _said(breaking[0])
    if not all(is_scatter(f) for f in breaking):
        return ""
    if f"{one.stage}/{one.role}" in sways(log):
        return f"{said}, but {swaying_words(one, log)}"
    least = min((span[0] for f in breaking if (span := _stated(one, f, log))), default=1.0)
    if high <= max(1.0, least):
        return (f"{said}, but {one.role} readings scatter {to_digits(high, 3)} times the spec's "
                "figure at most: this log cannot tell whose it is")  # fmt: skip
    course = None if log.sight is None else log.sight.course
    if course is not None:
        return (f"{said}, but {percent(course.share, 2)} of what is beyond the spec's noise is one "
                f"course that begins and ends, from {to_digits(course.from_s, 6)} s to "
                f"{to_digits(course.to_s, 6)} s (as of {of_label(course.label)}): what was moved "
                "then, or a log of another start, would tell it from noise")  # fmt: skip
    whole = all(registry()[f.effect].opens == "factor" for f in breaking)
    others = list(_others(one, log)) if whole and low <= 1.0 else []
    if others:
        return (f"noise beyond the spec's, of {one.role} or {' or '.join(others)}: this log cannot "
                f"tell whose ({said})")  # fmt: skip
    sure = low > 1.0 or any(_is_beyond(one, f, log) for f in breaking)
    if sure or log.found.verdict == "unexplained":  # where it is the shape of what has no name
        return ""
    return (f"{said}, but on this log alone {one.role} readings scatter {to_digits(low, 3)} to "
            f"{to_digits(high, 3)} times the spec's figure: a longer log would tell")  # fmt: skip


def sways(log: LogEvidence) -> dict[str, float]:
    """RMS [s] of the delays that scatter as noise does, of sensors whose noise was found."""
    known = {} if log.sight is None else log.sight.sways
    loud = {f"{f.stage}/{f.sensor}" for f in log.found.findings if f.material and is_scatter(f)}
    return {key: rms_s for key, rms_s in known.items() if key in loud}


def swaying_words(one: Assumed, log: LogEvidence) -> str:
    """What varies along the motion as no noise does."""
    rms_s = sways(log)[f"{one.stage}/{one.role}"]
    return (f"{one.role} readings scatter along the motion and by speed, as a delay that varies by "
            f"{format_duration(rounded(rms_s, 2))} (RMS) does: no noise of a sensor does so, and "
            "no delay of one value")  # fmt: skip


def _others(one: Assumed, log: LogEvidence) -> Iterator[str]:
    """Other sensors of the stage whose noise may be beyond the spec's."""
    known = log.sight.factors if log.sight else {}
    for name, own in known.items():
        stage, _, role = name.partition("/")
        more = max(part.high for part in own.parts) > FACTOR_LIMIT
        if stage == one.stage and role != one.role and more:
            yield role


def _of_another(one: Assumed, log: LogEvidence, high: float) -> str:
    """Noise that is laid on another sensor, which cannot have so much of it, or of which the log
    leaves open whether it has any."""
    if high <= FACTOR_LIMIT or log.sight is None:
        return ""
    for f in log.found.findings:
        own = log.sight.factors.get(f"{f.stage}/{f.sensor}")
        if f.stage != one.stage or f.sensor == one.role or own is None:
            continue
        if f.effect not in registry():  # a wave is noise of no sensor
            continue
        other = Assumed(f.stage, f.sensor, "noise", 1.0, one.key)
        stated = _stated(other, f, log) if f.material and is_scatter(f) else None
        whole = registry()[f.effect].opens == "factor"
        key = f"{f.stage}/{f.sensor}"
        cannot = key in sways(log)
        cannot |= stated is not None and max(p.high for p in own.parts) <= max(1.0, stated[0])
        if cannot or (stated is not None and whole and own.loudest.low <= 1.0):
            return f"{_said(f)}, or those of {one.role}: this log cannot tell whose noise it is"
    return ""


def of_label(label: tuple[str, str, int]) -> str:
    """`lever_arm (position)`."""
    return f"{label[0]} ({label[1]})"


def is_scatter(finding: Finding) -> bool:
    """Whether it says how far a sensor's readings scatter, as their figure does."""
    return finding.kind == "noise" and registry()[finding.effect].opens in _SCATTER


def _is_beyond(one: Assumed, finding: Finding, log: LogEvidence) -> bool:
    stated = _stated(one, finding, log)
    return stated is not None and stated[0] > 1.0


def _stated(one: Assumed, finding: Finding, log: LogEvidence) -> Span | None:
    """The sensor's whole scatter over the spec's by a finding itself, 95 %; None: it says none.

    Of a factor that of all readings; for a while, in squares over the time that it lasts; of slow
    noise of std s beside white noise within the figure sqrt(1 + (s / sigma)^2) at most.
    """
    opens, figures = registry()[finding.effect].opens, finding.parameters
    own = log.split(one)
    part = figures.get("std_m" if opens in ("slow", "down") else "factor")
    if part is None:
        return None
    low, high = (max(end, 0.0) for end in _span(part))
    if opens == "factor" and finding.readings is None:
        return low, high
    if opens == "episode" and finding.from_s is not None and finding.to_s is not None:
        lasts = (finding.to_s - finding.from_s) / max(log.found.log.duration_s, 1e-9)
        low, high = (math.sqrt(max(1.0 + lasts * (end**2 - 1.0), 0.0)) for end in (low, high))
        return low, high
    if opens in ("slow", "down") and own is not None and len(own.sigma) == 3:
        axes = own.sigma[2:] if opens == "down" else own.sigma
        sigma = math.sqrt(sum(s**2 for s in axes) / len(axes))
        low, high = low / sigma, high / sigma
        if opens == "down":  # of one axis, in all of the sensor
            share = sigma / math.sqrt(sum(s**2 for s in own.sigma))
            low, high = low * share, high * share
        return low, math.hypot(1.0, high)
    return None


def _span(part: Estimate) -> Span:
    value = float(part.value)
    half = NORMAL_95 * (part.standard_uncertainty or 0.0)
    return part.interval95 or (value - half, value + half)


def is_shape(one: Assumed, finding: Finding, log: LogEvidence) -> bool:
    """Whether noise may be the shape of what has no name: a slow one takes that of whatever is
    missing, and so does a constant of the readings.  It is none where the sensor's figure is shown
    to be beyond the spec's."""
    if one.name != "noise" or log.found.verdict != "unexplained":
        return False
    figure = noise_figure(one, log)
    beyond = figure is not None and figure.low is not None and figure.low > 1.0
    return not (beyond and is_scatter(finding))


def broken_figure(
    one: Assumed, log: LogEvidence, breaking: Sequence[Finding]
) -> MeasuredFigure | None:
    """The figure of a noise row that is broken: of the split, or of the finding where that leaves
    it open whether it is beyond the spec's; with what is a departure of all readings in squares."""
    figure = noise_figure(one, log)
    lasting = [f for f in breaking if not is_scatter(f)]
    if lasting:
        return _with_lasting(one, log, figure, lasting)
    if figure is None or figure.low is None or figure.high is None:
        return figure
    if figure.low <= 1.0:
        stated = [s for f in breaking if is_scatter(f) and (s := _stated(one, f, log))]
        low = max((span[0] for span in stated), default=0.0)
        if low > 1.0:
            value = max(figure.value or 0.0, low)
            return MeasuredFigure(value, low, max(figure.high, value))
    return figure


def _with_lasting(
    one: Assumed, log: LogEvidence, figure: MeasuredFigure | None, lasting: Sequence[Finding]
) -> MeasuredFigure | None:
    """What scatters with what constants, drifts and scales of the readings make on this log beside
    it, as RMS over what the spec's noise of the sensor makes: sqrt(f^2 + sum (m / m_spec)^2)."""
    known = {} if log.sight is None else log.sight.stated_m
    stated = known.get(f"{one.stage}/{one.role}", 0.0)
    if not stated > 0.0 or any(f.size_m is None for f in lasting):
        return None
    own = log.split(one)
    scatter = (1.0,) * 3 if own is None else own.whole
    if own is None and figure is not None:
        scatter = (figure.value or 1.0,) * 3
    sizes = [tuple(share * (f.size_m or 0.0) / stated for share in _shares(f)) for f in lasting]
    value, low, high = (
        math.hypot(part, *(size[k] for size in sizes)) for k, part in enumerate(scatter)
    )
    return MeasuredFigure(value, low, high)


def _shares(finding: Finding) -> Span3:
    """1, and a finding's interval over its value: of several parameters, of their length."""
    spans = [(float(p.value), *_span(p)) for p in finding.parameters.values()
             if p.seen and p.standard_uncertainty is not None]  # fmt: skip
    size = math.hypot(*(value for value, *_ in spans))
    if not size > 0.0:
        return 1.0, 0.0, math.inf
    reach = math.hypot(*(0.5 * (high - low) for _, low, high in spans)) / size
    return 1.0, max(1.0 - reach, 0.0), 1.0 + reach


def noise_figure(one: Assumed, log: LogEvidence) -> MeasuredFigure | None:
    """The standard deviation that was found, white and slow together, over the spec's."""
    key, own = f"{one.stage}/{one.role}", log.split(one)
    if own is not None:
        return MeasuredFigure(own.loudest.value, own.loudest.low, own.loudest.high)
    found = log.found
    white = found.noise.white_factor.get(key)
    if white is None:
        return None
    slow = found.noise.slow.get(key)
    share = max(slow.variance_over_spec) if slow is not None else 0.0
    return MeasuredFigure(math.sqrt(white**2 + share))


def noise_within(one: Assumed, log: LogEvidence, figure: MeasuredFigure) -> Judgement:
    """Of noise of which nothing was found: it holds where as much as may be turns no verdict."""
    factor = figure.value or 0.0
    own = log.split(one)
    if own is None and log.sight is not None:  # nothing tells how far it may be off
        words = f"{_times(factor)} the spec's figure, and a log of so few rows bounds none"
        return Judgement("not_shown", words, figure)
    most = max(factor, figure.high or 0.0) if own is None else own.most
    if log.paper.noisier(one.role, one.stage, most):
        words = (f"up to {to_digits(most, 3)} times the spec's figure is nothing unusual on "
                 "this log, but turns the verdict")  # fmt: skip
        return Judgement("not_shown", words, figure)
    words = f"{_times(factor)} the spec's figure{readings(own)}, nothing material beyond it"
    return Judgement("holds", words, figure)


def _times(factor: float) -> str:
    """`1.02 times`, `equal to`."""
    text = to_digits(factor, 3)
    return "equal to" if text == "1" else f"{text} times"


def readings(own: NoiseFactors | None) -> str:
    """Which readings a sensor's figure is of, and that of the others: ` in range; 0.98 in ...`."""
    if own is None or len(own.parts) < 2:
        return ""
    others = (f"{to_digits(f.value, 3)} in {' and '.join(f.readings)}" for f in own.parts[1:])
    return f" in {' and '.join(own.loudest.readings)} ({', '.join(others)})"


def of_what(breaking: Sequence[Finding], own: NoiseFactors | None) -> str:
    """What the figure of a broken row is of: all that is off, or what scatters most."""
    if any(not is_scatter(f) for f in breaking):
        return " the spec's noise on this log, with all of that"
    return f"{readings(own)}, where the interval counts what is as likely another sensor's"


def _said(finding: Finding) -> str:
    return finding.sentence + or_rivals(f"{a.effect} ({a.sensor})" for a in finding.aliases)
