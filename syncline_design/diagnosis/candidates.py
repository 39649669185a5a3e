"""Which effects of the dictionary a log can show, and how they would look in it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from typing import Final

import numpy as np

from syncline_design.diagnosis.followed import follows_noise
from syncline_design.diagnosis.noise import Directed
from syncline_design.diagnosis.scene import Scene, asked
from syncline_design.effects import registry
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import SELDOM, ActsOn, Array, Effect
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import Stage

STEP_TIMES = 30  # places along the log where a step is looked for at first
MEMORIES_S = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # time constants whose shape is looked for as it is
LEAST_MEMORY = 2.0  # stamps
STEP = 1e-4  # of a value, by which it is moved for a slope: far below what bends, above rounding
AS_GOOD_NATS: Final = 2.0  # within which the commoner of two effects is named
EDGE = 0.03  # share of the rows at either end where a step is not looked for: too few tell it


@dataclass(frozen=True, slots=True)
class Candidate:
    """An effect at one place of the system."""

    effect: Effect
    sensor: ActsOn
    stage: int

    @property
    def label(self) -> tuple[str, str, int]:
        return self.effect.name, self.sensor, self.stage

    @property
    def key(self) -> str:
        """The label as one text."""
        return "/".join(map(str, self.label))

    def acting(self, values: dict[str, float]) -> Acting:
        return Acting(self.effect, self.sensor, self.stage, values)


@dataclass(frozen=True, slots=True)
class Signature:
    """Columns (n, 3, p) [m per unit] that a candidate adds to the error, located at `at`.

    start: values at which a memory has that shape, none where it is the slope at zero.
    """

    candidate: Candidate
    at: dict[str, float]
    columns: Array
    start: dict[str, float] = field(default_factory=dict)

    @property
    def plain(self) -> bool:
        """Whether it is its candidate's one slope at zero."""
        return not self.at and not self.start

    @property
    def asked_jointly(self) -> bool:
        """Whether it is looked at together with others: what a build can be wrong by."""
        return self.plain and self.candidate.effect.asked_jointly


def candidates(view: Scene, exclude: Sequence[str] = ()) -> tuple[Candidate, ...]:
    """Every effect that this kind of log and this system can show."""
    stages = view.system.stages
    found = []
    for effect in registry().values():
        if effect.name in exclude:
            continue
        for sensor in effect.sensors:
            for k, stage in enumerate(stages):
                if sensor == "target" and k != len(stages) - 1:
                    continue
                if view.log.kind == "position" and sensor not in ("position", "target"):
                    continue  # attitude and rates are the better system's
                if _has_tails(view, effect, sensor, k):
                    continue
                if follows_noise(view, effect, k):
                    continue
                if _can_have(effect, stage, sensor, k):
                    found.append(Candidate(effect, sensor, k))
    return tuple(found)


def _can_have(effect: Effect, stage: Stage, sensor: ActsOn, index: int) -> bool:
    """Whether a stage can have it; a later one's position is its transponder's place."""
    carried = effect.transponder and sensor == "position" and index > 0
    return carried or effect.applies(stage, sensor)


def _has_tails(view: Scene, effect: Effect, sensor: str, index: int) -> bool:
    """Whether the spec says already that this noise has tails: shape is not told twice."""
    return effect.opens == "tails" and any(
        (one.effect.opens, one.sensor, one.stage) == ("tails", sensor, index) for one in view.known
    )


def hidden_by_noise(view: Scene, exclude: Sequence[str] = ()) -> tuple[Candidate, ...]:
    """What is no candidate because the values that it follows hardly vary in this log."""
    return tuple(
        Candidate(effect, sensor, k)
        for effect in registry().values()
        if effect.name not in exclude and view.log.kind != "position"
        for sensor in effect.sensors
        for k, stage in enumerate(view.system.stages)
        if effect.applies(stage, sensor) and follows_noise(view, effect, k)
    )


def commonness(label: tuple[str, str, int]) -> tuple[int, int]:
    """How seldom it is met; sensors in the order position, attitude, ranging, target."""
    name, sensor, _ = label
    known = registry().get(name)  # a wave has no cause that could be common
    return known.rarity if known else SELDOM, ("position", "attitude", "ranging", "target").index(
        sensor
    )


def zero_values(effect: Effect, at: dict[str, float] | None = None) -> dict[str, float]:
    """All parameters at zero, located ones where they are."""
    return {p.name: (at or {}).get(p.name, 0.0) for p in effect.parameters}


def signatures(view: Scene, found: Sequence[Candidate]) -> tuple[Signature, ...]:
    """Signatures of all candidates whose mean error moves; a step at several times.

    A memory of many seconds looks like no slope at zero: it is also looked for as it is, at some
    time constants.
    """
    moving = [candidate for candidate in found if candidate.effect.sensitivity is not None]
    located = [
        Signature(candidate, at, signature(view, candidate, at))
        for candidate in moving
        for at in _locations(view, candidate.effect)
    ]
    return (*located, *(s for candidate in moving for s in _remembered(view, candidate)))


def plain_signatures(view: Scene, found: Sequence[Candidate]) -> tuple[Signature, ...]:
    """Signatures of what acts all along: each one's slope at zero."""
    return tuple(
        Signature(one, {}, signature(view, one, {}))
        for one in found
        if one.effect.sensitivity is not None and not any(p.located for p in one.effect.parameters)
    )


def _remembered(view: Scene, candidate: Candidate) -> Iterator[Signature]:
    """What an effect with a memory does, over its time constant, for those that the log can tell.

    The slope at zero holds while the motion does not change within the memory.
    """
    name = candidate.effect.memory
    if not name:
        return
    most = next(p.high for p in candidate.effect.parameters if p.name == name)
    for constant_s in MEMORIES_S:
        if LEAST_MEMORY * view.log.interval_s < constant_s < min(most, 0.1 * view.log.duration_s):
            moved = view.error() - view.error((candidate.acting({name: constant_s}),))
            yield Signature(candidate, {}, moved[:, :, None] / constant_s, {name: constant_s})


def _locations(view: Scene, effect: Effect) -> list[dict[str, float]]:
    located = [p.name for p in effect.parameters if p.located]
    if not located:
        return [{}]
    since = view.log.time_s - view.log.time_s[0]
    times = np.quantile(since, np.linspace(EDGE, 1.0 - EDGE, STEP_TIMES))
    return [{located[0]: float(t)} for t in times]


def signature(view: Scene, candidate: Candidate, at: dict[str, float]) -> Array:
    """Slope (n, 3, p) of the error by the candidate's parameters.

    The effect's own sensitivity, except for a ranging sensor that carries another stage: what it
    does to the next stage's position is found by re-simulation.
    """
    effect, k = candidate.effect, candidate.stage
    values = zero_values(effect, at)
    if candidate.sensor == "ranging" and k + 1 < len(view.system.stages):
        return slopes(view, [candidate.acting(values)])
    assert effect.sensitivity is not None
    return effect.sensitivity(view.rows[k], values, candidate.sensor)


def slopes(view: Scene, acting: Sequence[Acting]) -> Array:
    """Slope (n, 3, P) of the error by all continuous parameters, by differences.

    Columns in the order of the effects and their `slopes()`; the sign is that of the error of an
    uncorrected log, so minus the slope of `Scene.error`.
    """
    return view.slopes.of(asked(acting), lambda: slopes_of(view.error, acting))


def slopes_of(error: Callable[[Sequence[Acting]], Array], acting: Sequence[Acting]) -> Array:
    """Minus the slope (n, 3, P) by all continuous parameters of what effects leave; error: that,
    (n, 3) [m]."""
    columns = []
    for i, one in enumerate(acting):
        for p in one.effect.slopes():
            value = one.values[p.name]
            step = max(0.1 * p.low, STEP * abs(value))

            def moved(to: float, i: int = i, one: Acting = one, name: str = p.name) -> Array:
                values = {**one.values, name: to}
                changed = Acting(one.effect, one.sensor, one.stage, values)
                return error([*acting[:i], changed, *acting[i + 1 :]])

            # no memory reaches below zero: its slope there is that of both sides together
            both = p.name == one.effect.memory and value < step
            before = moved(value - step) if both else error(acting)
            columns.append((before - moved(value + step)) / (2.0 * step if both else step))
    return np.stack(columns, axis=-1) if columns else np.zeros((*error(acting).shape, 0))


def directed_parts(view: Scene, found: Sequence[Candidate]) -> tuple[Directed, ...]:
    """White noise along the motion of every candidate that has it, per unit of its parameter."""
    parts = []
    for one in found:
        names = [p.name for p in one.effect.parameters]
        if one.effect.spread is None or len(names) != 1:
            continue
        spread = one.effect.spread(view.rows[one.stage], {names[0]: 1.0}, one.sensor)
        parts.append(Directed(one.key, spread))
    return tuple(parts)
