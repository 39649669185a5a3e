"""Two poses, place and attitude late by one time: one finding, the delay of the whole system."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from syncline_design.diagnosis.result import Estimate, Finding
from syncline_design.effects import plain_delay
from syncline_design.logs.log import LogKind
from syncline_design.model.figure_text import format_estimate

SPREADS = 3.0  # standard deviations by which the two may differ
LEAST_S = 1e-3  # and at least this much: stamps of two systems agree no better


def with_system_delay(found: Sequence[Finding], kind: LogKind) -> tuple[Finding, ...]:
    """The findings of a log of pose pairs, with equal delays of place and attitude joined.

    The joined value is the mean of both, weighted by their variances.
    """
    place, turn = (_delay(found, sensor) for sensor in ("position", "attitude"))
    if kind != "pose" or place is None or turn is None or place.stage != turn.stage:
        return tuple(found)
    a, b = (next(iter(one.parameters.values())) for one in (place, turn))
    if a.standard_uncertainty is None or b.standard_uncertainty is None:
        return tuple(found)
    apart = abs(float(a.value) - float(b.value))
    spread = math.hypot(a.standard_uncertainty, b.standard_uncertainty)
    if apart > max(SPREADS * spread, LEAST_S):
        return tuple(found)
    joined = _joined(place, turn, a, b)
    return tuple(joined if one is place else one for one in found if one is not turn)


def _delay(found: Sequence[Finding], sensor: str) -> Finding | None:
    """The one delay of a sensor that deserves its name."""
    name = plain_delay().name
    there = [
        one
        for one in found
        if (one.effect, one.sensor, one.kind) == (name, sensor, "cause") and not one.varying
    ]
    return there[0] if len(there) == 1 else None


def _joined(place: Finding, turn: Finding, a: Estimate, b: Estimate) -> Finding:
    assert a.standard_uncertainty is not None
    assert b.standard_uncertainty is not None
    weights = [1.0 / max(e.standard_uncertainty or 0.0, 1e-12) ** 2 for e in (a, b)]
    value = (weights[0] * float(a.value) + weights[1] * float(b.value)) / sum(weights)
    spread = 1.0 / math.sqrt(sum(weights))
    ends = [e.interval95 for e in (a, b) if e.interval95 is not None]
    interval = None
    if len(ends) == 2:  # no narrower than the better of the two about the joined value
        half = min(0.5 * (high - low) for low, high in ends)
        interval = (value - half, value + half)
    name, text = next(iter(place.parameters)), format_estimate(value, spread, "s")
    estimate = replace(a, value=value, standard_uncertainty=spread, text=text, interval95=interval)
    sizes = [one.size_m for one in (place, turn) if one.size_m is not None]
    return replace(
        place,
        parameters={name: estimate},
        sentence=plain_delay().in_words("Position and attitude", {name: text}),
        evidence=f"{place.evidence}; of the attitude: {turn.evidence}",
        gain_nat=place.gain_nat + turn.gain_nat,
        material=place.material or turn.material,
        size_m=math.hypot(*sizes) if sizes else None,
        also=(turn.sensor,),
    )
