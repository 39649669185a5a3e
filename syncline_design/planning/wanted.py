"""What a plan is asked for: effects to know within a tolerance, pairs of effects to tell apart.

Effects are spelt `latency(position)`; of a chain, `latency(auv.attitude)` names the stage.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from syncline_design.effects import registry
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import format_quantity
from syncline_design.model.quantity import UnitError, parse_quantity, suffix_unit
from syncline_design.model.system import System
from syncline_design.model.unit_table import Dimension
from syncline_design.planning.information import Unknown
from syncline_design.spec.fields import did_you_mean

_NAME: Final = re.compile(
    r"\s*(?P<effect>\w+)\s*\(\s*(?:(?P<stage>[^().]+)\.)?(?P<sensor>\w+)\s*\)\s*"
)
_EXAMPLE: Final = 'such as "latency(position)=1 ms, lever_arm(position)=1 cm"'
SIZE_DIGITS: Final = 3  # of a size that a command names
MATERIAL: Final = 0.2  # of the RMS that the noise makes: what an effect has to make to matter
TOLERANCE: Final = 0.1  # of the same: how well an effect is to be known where nothing is said


class PlanError(ValueError):
    """A plan that cannot be made as asked; the text says what was expected and found."""


@dataclass(frozen=True, slots=True)
class NamedEffect:
    """One effect of one sensor, as it was written."""

    effect: str
    sensor: str
    stage: str | None = None

    @property
    def text(self) -> str:
        where = self.sensor if self.stage is None else f"{self.stage}.{self.sensor}"
        return f"{self.effect}({where})"


@dataclass(frozen=True, slots=True)
class EffectPair:
    """Two effects to tell apart; sizes: of the first's parameters by its key, where known."""

    first: NamedEffect
    second: NamedEffect
    sizes: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class PlanWanted:
    """What is asked: tolerances by effect (None: what matters to this system), and pairs."""

    reach: tuple[tuple[NamedEffect, float | None], ...] = ()
    pairs: tuple[EffectPair, ...] = ()

    @property
    def named(self) -> tuple[NamedEffect, ...]:
        """Every effect in it, each once."""
        both = (one for pair in self.pairs for one in (pair.first, pair.second))
        return tuple(dict.fromkeys([*(one for one, _ in self.reach), *both]))

    def without(self, left_out: Collection[NamedEffect]) -> PlanWanted:
        """The rest without some effects, and without the pairs that they are in."""
        return PlanWanted(
            tuple(one for one in self.reach if one[0] not in left_out),
            tuple(p for p in self.pairs if p.first not in left_out and p.second not in left_out),
        )


def named(text: str, option: str) -> NamedEffect:
    """`latency(position)` read."""
    found = _NAME.fullmatch(text)
    if found is None:
        raise PlanError(f"{option} {text.strip()!r}: expected effect(sensor), "
                        "such as latency(position)")  # fmt: skip
    _demand_known(found["effect"], found["sensor"], option)
    return NamedEffect(found["effect"], found["sensor"], found["stage"])


def _demand_known(name: str, sensor: str, option: str) -> None:
    known = registry()
    if name not in known:
        hint = did_you_mean(name, known)
        more = f"; {hint}" if hint else f"; one of {', '.join(sorted(known))}"
        raise PlanError(f"{option}: there is no effect {name!r}{more}")
    effect = known[name]
    if sensor not in effect.sensors:
        raise PlanError(f"{option}: {name} does not act on {sensor!r}, expected one of "
                        f"{', '.join(effect.sensors)}")  # fmt: skip
    if effect.sensitivity is None:
        why = (
            "is a matter of the columns, which one log shows whatever was driven"
            if effect.kind == "discrete"
            else "only scatters: a longer log shows it, no particular drive does"
        )
        raise PlanError(f"{option}: {name}({sensor}) {why}; expected an effect that moves the mean")


def separate_of(first: str, second: str) -> tuple[EffectPair, ...]:
    """`latency(position)=100 ms` and what to tell it from, one effect or several.

    The size may be left out; of an effect with several parameters it is a list, `[1 cm, 0, 2 cm]`.
    """
    name, mark, amount = first.partition("=")
    one = named(name, "--separate")
    sizes = _stated_sizes(one, amount.strip()) if mark else {}
    return tuple(EffectPair(one, named(text, "--separate"), sizes) for text in second.split(","))


def _stated_sizes(one: NamedEffect, amount: str) -> dict[str, float]:
    """The parameters of an effect as they are written."""
    names = [p.name for p in registry()[one.effect].slopes()]
    parts = amount.removeprefix("[").removesuffix("]").split(",")
    where = f"--separate {one.text}={amount}"
    if len(parts) != len(names):
        raise PlanError(f"{where}: expected {len(names)} size{'s'[: len(names) != 1]}, "
                        f"of {', '.join(names)}; found {len(parts)}")  # fmt: skip
    found = {}
    for key, text in zip(names, parts, strict=True):
        try:
            kind = suffix_unit(key)[1]
            found[key] = _amount(text.strip(), kind)
        except UnitError as error:
            raise PlanError(f"{where}: cannot read {key}: {error}") from None
    if not any(found.values()) or not all(map(math.isfinite, found.values())):
        raise PlanError(f"{where}: expected a size other than 0")
    return found


def sized_text(one: NamedEffect, sizes: Mapping[str, float]) -> str:
    """An effect with its size as `separate_of` reads it; without, where not all of it is known."""
    names = [p.name for p in registry()[one.effect].slopes()]
    if not all(name in sizes for name in names) or not any(sizes.values()):
        return one.text
    parts = [format_quantity(sizes[name], suffix_unit(name)[1], SIZE_DIGITS) for name in names]
    return f"{one.text}={parts[0] if len(parts) == 1 else '[' + ', '.join(parts) + ']'}"


def reach_of(text: str) -> tuple[tuple[NamedEffect, float | None], ...]:
    """`latency(position)=1 ms, lever_arm(position)=1 cm` read; each tolerance in its unit."""
    found: list[tuple[NamedEffect, float | None]] = []
    for part in text.split(","):
        name, mark, amount = part.partition("=")
        if not mark or not amount.strip():
            raise PlanError(
                f"--reach {part.strip()!r}: expected effect(sensor)=TOLERANCE, {_EXAMPLE}"
            )
        one = named(name, "--reach")
        if one.text in [known.text for known, _ in found]:
            raise PlanError(f"--reach: {one.text} is given twice")
        found.append((one, _tolerance(one, amount.strip())))
    return tuple(found)


def _tolerance(one: NamedEffect, amount: str) -> float:
    effect = registry()[one.effect]
    kinds = {p.name: suffix_unit(p.name)[1] for p in effect.slopes()}
    problem = None
    for name, kind in kinds.items():
        try:
            value = _amount(amount, kind)
        except UnitError as error:
            problem = f"--reach {one.text}={amount}: cannot read {name}: {error}"
            continue
        if not (0.0 < value < math.inf):
            raise PlanError(f"--reach {one.text}={amount}: expected a tolerance above 0")
        return value
    raise PlanError(problem or f"--reach {one.text}: nothing to reach")


def _amount(text: str, kind: Dimension) -> float:
    """A figure in SI; scales and rates are bare or have a unit of a ratio, as in `20 ppm`."""
    number: object = text
    with suppress(ValueError):
        number = float(text)
    if number is text and kind is Dimension.DIMENSIONLESS:
        with suppress(UnitError):
            return float(parse_quantity(text, Dimension.RATIO, tolerance=False))
    return float(parse_quantity(number, kind, tolerance=False))


@dataclass(frozen=True, slots=True)
class PairGoal:
    """A pair by the places of its parameters among the unknowns; sizes of the first's, SI.

    known: whether the sizes are found ones; otherwise every direction of the effect counts.
    beyond: where the columns of the pair beyond first order stand (`beyond`), the first's own and
    then the second's; None where it is judged to first order.
    """

    first: tuple[int, ...]
    second: tuple[int, ...]
    names: tuple[str, str]
    sizes: Array
    second_sizes: Array
    known: bool
    beyond: tuple[int, tuple[int, ...]] | None = None


@dataclass(frozen=True, slots=True)
class Goal:
    """What a plan is judged by, on the whole list of unknowns.

    wanted: places of the parameters whose sigma is told, with the others of them free; tolerance:
    theirs, infinite where none is asked; keys: their names.
    """

    wanted: tuple[int, ...]
    tolerance: Array
    pairs: tuple[PairGoal, ...]

    @property
    def out_by_size(self) -> tuple[int, ...]:
        """The rival of the first pair where only the size that is known tells it, so that what is
        wanted is told without it."""
        pair = self.pairs[0] if self.pairs else None
        if pair is None or pair.beyond is None:
            return ()
        return () if set(pair.second) & set(self.wanted) else pair.second

    @property
    def only_rival(self) -> NDArray[np.bool_]:
        """Which of what is wanted is only what an effect of known size is to be told from.

        What else such a rival may be does not matter: whatever takes its place as well, it is not
        the effect.
        """
        rivals = set(self.pairs[0].second) if self.pairs and self.pairs[0].known else set()
        own = {*self.pairs[0].first} if self.pairs else set()
        return np.array([k in rivals - own for k in self.wanted]) & ~np.isfinite(self.tolerance)


def keys_of(system: System, every: Sequence[Unknown]) -> tuple[str, ...]:
    """`latency(position).latency_s`, with the stage where a chain has the sensor before it."""
    return tuple(f"{text_of(system, one)}.{one.parameter.name}" for one in every)


def text_of(system: System, one: Unknown) -> str:
    """The effect of an unknown as it is spelt."""
    c = one.candidate
    stage = None
    if len(system.stages) > 1 and c.stage != default_stage(system, c.sensor):
        stage = system.stages[c.stage].name
    return NamedEffect(c.effect.name, c.sensor, stage).text


def default_stage(system: System, sensor: str) -> int:
    """The stage that is meant where none is named: the first that has the sensor."""
    if sensor == "target":
        return len(system.stages) - 1
    return next((k for k, s in enumerate(system.stages) if getattr(s, sensor) is not None), 0)


def places(
    system: System, every: Sequence[Unknown], one: NamedEffect, option: str
) -> tuple[int, ...]:
    """Where the parameters of an effect stand among the unknowns; PlanError where it cannot act."""
    label = label_of(system, one, option)
    found = tuple(k for k, u in enumerate(every) if u.candidate.label == label)
    if not found:
        known = sorted({text_of(system, u) for u in every})
        raise PlanError(f"{option}: {one.text} does not apply to stage "
                        f"{system.stages[label[2]].name!r} of this system; what does: "
                        f"{', '.join(known)}")  # fmt: skip
    return found


def label_of(system: System, one: NamedEffect, option: str) -> tuple[str, str, int]:
    """Effect, sensor and place of the stage that are meant; PlanError where there is none such."""
    if one.stage is None:
        return one.effect, one.sensor, default_stage(system, one.sensor)
    names = [s.name for s in system.stages]
    if one.stage not in names:
        raise PlanError(f"{option}: there is no stage {one.stage!r}, expected one of "
                        f"{', '.join(names)}")  # fmt: skip
    return one.effect, one.sensor, names.index(one.stage)


def goal_of(
    system: System, every: Sequence[Unknown], asked: PlanWanted, noise_m: float, per_unit: Array
) -> Goal:
    """What is asked in terms of the unknowns; sizes that matter where nothing else is said."""
    matters = noise_m / np.maximum(per_unit, 1e-300)
    tolerance = np.full(len(every), np.inf)
    wanted: list[int] = []
    for one, stated in asked.reach:
        found = places(system, every, one, "--reach")
        tolerance[list(found)] = TOLERANCE * matters[list(found)] if stated is None else stated
        wanted += found
    pairs = tuple(_pair(system, every, one, MATERIAL * matters) for one in asked.pairs)
    for pair in pairs[:1]:
        wanted += [*pair.first, *pair.second]
    order = tuple(sorted(set(wanted)))
    return Goal(order, tolerance[list(order)], pairs)


def _pair(system: System, every: Sequence[Unknown], pair: EffectPair, matters: Array) -> PairGoal:
    first = places(system, every, pair.first, "--separate")
    second = places(system, every, pair.second, "--separate")
    if first == second:
        raise PlanError(f"--separate: {pair.first.text} and {pair.second.text} are one effect")
    found = np.array([pair.sizes.get(every[k].parameter.name, 0.0) for k in first])
    known = bool(np.any(found))
    sizes = found if known else matters[list(first)]
    names = (pair.first.text, pair.second.text)
    return PairGoal(first, second, names, sizes, matters[list(second)], known)


def usual(system: System, every: Sequence[Unknown]) -> PlanWanted:
    """What a commissioning drive is for where nothing is asked; what is met most often first."""
    known = {text_of(system, u) for u in every}
    effects = sorted(registry().values(), key=lambda one: (one.rarity, one.name))
    all_of = (NamedEffect(one.name, sensor) for one in effects for sensor in one.commissioned)
    return PlanWanted(tuple((one, None) for one in all_of if one.text in known))
