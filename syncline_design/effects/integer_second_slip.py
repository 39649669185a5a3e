"""The stamps of the positions are ahead by whole seconds, as between GPS time and UTC."""

from __future__ import annotations

from syncline_design.effects.kinematics import column, shifted
from syncline_design.effects.record import (
    ActsOn,
    Basis,
    Contribution,
    Departures,
    Effect,
    Parameter,
    Rng,
    StageRows,
    Undoing,
    Values,
)
from syncline_design.model.system import Stage

MOST_S = 18  # GPS time less UTC


def _depart(rows: StageRows, values: Values, sensor: ActsOn, _: Rng) -> Departures:
    """stamp = true + seconds, so mu = -seconds."""
    return shifted(sensor, column(-values["seconds"], rows))


def _contribute(stage: Stage, values: Values, sensor: ActsOn, basis: Basis) -> Contribution:
    """tau of the sensor grows by |seconds|."""
    return Contribution(tau_s=abs(values["seconds"]))


EFFECT = Effect(
    name="integer_second_slip",
    sensors=("position",),
    kind="discrete",
    parameters=(Parameter("seconds", 1.0, float(MOST_S), "s", whole=True),),
    sentence="the position stamps are ahead by {seconds}, whole seconds",
    confused_with="a latency of the same size",
    separated_by="nothing needs to: a whole number of seconds is a matter of time scales",
    source="GPS time is ahead of UTC by 18 s since 2017 (IERS Bulletin C 52)",
    depart=_depart,
    sensitivity=None,
    contribute=_contribute,
    undoing=Undoing(
        tried={"position": tuple(float(s) for s in range(-MOST_S, MOST_S + 1) if s)},
        instead_of="latency",
    ),
    breaks="latency",
    comes_with="stamps",
)
