"""One delay of a sensor, where a shift of its stamps was undone first and some of it was left.

The search for gross faults tries shifts on a grid, and takes the best; on a short or slow log that
may be off by tenths of a second, which the fit then finds as a delay of its own.  Both are one.
"""

from __future__ import annotations

from collections.abc import Sequence

from syncline_design.diagnosis.finding import estimate, finding
from syncline_design.diagnosis.result import Finding
from syncline_design.effects import plain_delay
from syncline_design.effects.record import Effect


def with_one_delay(found: Sequence[Finding]) -> tuple[Finding, ...]:
    """The findings, a delay that was undone and the rest of it in one, where the first stood."""
    delay, kept = plain_delay(), list(found)
    for shift in (one for one in found if _is_of(one, delay) and not _is_fitted(one, delay)):
        rest = next((one for one in kept if _is_rest_of(shift, one, delay)), None)
        if rest is not None:
            kept[kept.index(shift)] = _both(delay, shift, rest)
            kept.remove(rest)
    return tuple(kept)


def _is_of(one: Finding, delay: Effect) -> bool:
    return one.effect == delay.name and one.kind == "cause"


def _is_fitted(one: Finding, delay: Effect) -> bool:
    """Whether it has an uncertainty: a shift that is undone has none."""
    return one.parameters[delay.parameters[0].name].standard_uncertainty is not None


def _is_rest_of(shift: Finding, one: Finding, delay: Effect) -> bool:
    """Whether one value of all of the log is the same sensor's."""
    own = (one.sensor, one.stage) == (shift.sensor, shift.stage)
    whole = one.from_s is None and one.to_s is None and one.varying is None
    return own and whole and _is_of(one, delay) and _is_fitted(one, delay)


def _both(delay: Effect, shift: Finding, rest: Finding) -> Finding:
    name = delay.parameters[0].name
    undone, left = shift.parameters[name], rest.parameters[name]
    assert isinstance(undone.value, float)
    assert isinstance(left.value, float)
    ends = left.interval95
    whole = estimate(
        undone.value + left.value,
        left.standard_uncertainty,
        left.unit,
        interval95=None if ends is None else (undone.value + ends[0], undone.value + ends[1]),
    )
    return finding(
        delay,
        shift.sensor,
        shift.stage,
        {name: whole},
        f"{shift.evidence}; what is left of it then {rest.evidence}",
        shift.gain_nat + rest.gain_nat,
        rest.log10_p,
        (rest.aliases, rest.lookalikes, rest.excluded),
        material=shift.material or rest.material,
        size_m=shift.size_m if rest.size_m is None else rest.size_m,
    )
