"""What can be done about one finding: calibrate it out, stamp its sensor otherwise, replace it.

What an option takes away is a claim about where the finding comes from, so each says what it
assumes.  Prices are those of what has to be bought: what the built system has is there already.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Literal

from syncline_design.choice.effect_tables import problem_of
from syncline_design.choice.evaluate import broken, evaluate
from syncline_design.choice.option import Option
from syncline_design.choice.problem import sole_design
from syncline_design.choice.table import Design
from syncline_design.choice.variations import with_stage
from syncline_design.choice.ways import INLINE
from syncline_design.diagnosis.result import Estimate, Finding
from syncline_design.effects import registry
from syncline_design.effects.record import Origin
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.normal import NORMAL_95
from syncline_design.spec.case import Case, RoleCase, StageCase
from syncline_design.spec.choices import MethodChoice
from syncline_design.spec.edit import PinnedRole, with_effects
from syncline_design.spec.effects_listed import EffectChoice
from syncline_design.verdict.bill import bill_of_materials
from syncline_design.verdict.named import BillLine

RepairKind = Literal["nothing", "calibrate", "rewire", "timestamping", "sensor"]
MOST_KEPT = 6  # options of one finding that others are combined with


@dataclass(frozen=True, slots=True)
class Remedy:
    """One thing to do about a finding.

    roles: what is wired, stamped or bought otherwise; left: what of the effect remains.
    """

    kind: RepairKind
    finding: Finding
    text: str
    assumes: str
    roles: tuple[PinnedRole, ...] = ()
    left: tuple[EffectChoice, ...] = ()


def _origin(finding: Finding) -> Origin:
    """What the finding's effect goes away with; what has no name of its own hangs on the build."""
    effect = registry().get(finding.effect)
    return "build" if effect is None else effect.comes_with


def bought(before: Sequence[BillLine], after: Sequence[BillLine]) -> float | None:
    """What has to be bought for one design where another stands, to the cent; None: not told."""
    there: Counter[tuple[str, str]] = Counter()
    for line in before:
        there[_use(line), line.entry] += line.quantity
    cents = 0
    for line in after:
        key = (_use(line), line.entry)
        have = min(there[key], line.quantity)
        there[key] -= have
        if line.quantity > have:
            if line.cost is None:
                return None
            cents += round(100 * line.cost) * (line.quantity - have) // line.quantity
    return cents / 100


def _use(line: BillLine) -> str:
    """A sensor is one wherever it stands; what stamps a role was laid for it."""
    stamps = line.use.endswith("timestamping")
    return f"{line.stage} {line.use}" if stamps else line.use.rpartition(" ")[2]


def applied(case: Case, remedies: Sequence[Remedy]) -> Case:
    """The case with everything done, and what remains of the effects."""
    for new in (role for one in remedies for role in one.roles):
        role = case.stages[new.stage].role(new.role)
        assert role is not None
        keys: dict[str, object] = {"primitive": new.primitive, "timestamping": new.timestamping}
        if new.sensor != role.sensors[0].id:  # the present one may be given in place
            keys |= {"sensor": new.sensor, "candidates": None}
        choice = role.choice.model_copy(update=keys)
        case = with_stage(case, new.stage, **{new.role: choice})
    left = [entry for one in remedies for entry in one.left]
    return with_effects(case, left)


def compatible(remedies: Sequence[Remedy]) -> bool:
    """Whether all of them can be done: no role is to have two sensors or to be stamped two ways."""
    wanted: dict[tuple[int, str], PinnedRole] = {}
    return all(
        wanted.setdefault((new.stage, new.role), new) == new
        for one in remedies
        for new in one.roles
    )


def _proviso(finding: Finding) -> str:
    """What a calibration rests on."""
    if finding.within_noise is None:
        return "it stays as it was found"
    return (
        f"a log of another day shows it again, for constant noise of {finding.within_noise.sensor} "
        "would do the same"
    )


def remedies(case: Case, whole: Case, finding: Finding) -> Iterator[Remedy]:
    """Everything that can be done about a finding.

    whole: the case with every shipped entry.  Of wires, methods and sensors those that no other one
    beats in price and error where nothing else is wrong.
    """
    yield _nothing(finding)
    left = _calibrated(finding)
    if left is not None:
        yield Remedy(
            "calibrate", finding, f"take the {_name(finding)} into the calibration",
            f"{_proviso(finding)}; what remains is its 95 % interval", left=left,
        )  # fmt: skip
    stage = next((one for one in case.stages if one.choice.name == finding.stage), None)
    role = None if stage is None or finding.also else stage.role(finding.sensor)  # type: ignore[arg-type]
    if stage is None or role is None or _origin(finding) == "build":
        return
    if _origin(finding) == "stamps" and role.choice.primitive not in (None, "arrival"):
        yield Remedy(
            "rewire", finding,
            f"put the {role.choice.primitive} wire of {_place(stage, role)} right",
            "the wire is missing or broken; its parts are there",
        )  # fmt: skip
    yield from _other_ways(case, whole, finding, (stage, role))


def _nothing(finding: Finding) -> Remedy:
    text = f"leave the {_name(finding)} as it is"
    return Remedy("nothing", finding, text, "", left=finding.as_entries())


def _name(finding: Finding) -> str:
    where = " and ".join((finding.sensor, *(finding.also or ())))
    return f"{finding.effect.replace('_', ' ')} of {finding.stage} {where}"


def _place(stage: StageCase, role: RoleCase) -> str:
    return f"{stage.choice.name} {role.role}"


def _calibrated(finding: Finding) -> tuple[EffectChoice, ...] | None:
    """What is left of an effect once its estimate is taken out; None where that cannot be done."""
    effect = registry()[finding.effect]
    if effect.kind == "stochastic":
        return None
    if effect.kind == "discrete":
        return ()
    left: dict[str, float | str] = {}
    for one in effect.parameters:
        found = finding.parameters[one.name]
        rest = found.value if one.located else _half_width(found)
        if rest is None:
            return None
        left[one.name] = rest
    entries = finding.as_entries()
    return tuple(
        one.model_copy(update={"parameters": left, "standard_uncertainty": {}}) for one in entries
    )


def _half_width(found: Estimate) -> float | None:
    if found.interval95 is not None:
        return 0.5 * (found.interval95[1] - found.interval95[0])
    spread = found.standard_uncertainty
    return NORMAL_95 * spread if spread is not None and math.isfinite(spread) else None


def _other_ways(
    case: Case, whole: Case, finding: Finding, at: tuple[StageCase, RoleCase]
) -> Iterator[Remedy]:
    """The role stamped or taken otherwise, of each kind the front of price against error."""
    stage, role = at
    found: dict[RepairKind, list[tuple[float, float, Option]]] = {}
    for present in (True, False):
        opened = _opened(whole, stage, role, present=present)
        for kind, price, error, option in _scored(case, opened, at, finding):
            found.setdefault(kind, []).append((price, error, option))
    for kind, scored in found.items():
        for _, _, option in _front(scored)[:MOST_KEPT]:
            yield _remedy(kind, finding, at, option)


def _opened(whole: Case, stage: StageCase, role: RoleCase, *, present: bool) -> Case:
    """The role open to every way of stamping its present sensor, or to every other sensor."""
    listed = whole.catalog.sensors
    now = role.sensors[0].id
    changes: dict[str, object] = {
        "primitive": None,
        "timestamping": MethodChoice.model_construct(candidates=tuple(whole.catalog.timestamping)),
    }
    if not present:
        suited = tuple(n for n, one in listed.items() if one.modality == role.role and n != now)
        changes |= {"sensor": None, "candidates": suited}
    choice = role.choice.model_copy(update=changes)
    return with_stage(whole, stage.index, **{role.role: choice})


def _scored(
    case: Case, opened: Case, at: tuple[StageCase, RoleCase], finding: Finding
) -> Iterator[tuple[RepairKind, float, float, Option]]:
    """Price and error of every option that a role then has."""
    stage, role = at
    now = sole_design(problem_of(case))
    assert now is not None
    before = bill_of_materials(case, *now)
    problem = problem_of(opened)
    place = next(
        i for i, t in enumerate(problem.roles)
        if (t.stage_name, t.role) == (stage.choice.name, role.role)
    )  # fmt: skip
    method = role.methods[0].id if role.methods else INLINE
    pinned_so = (role.sensors[0].id, role.choice.primitive, method)
    if any(len(t.options) != 1 for i, t in enumerate(problem.roles) if i != place):
        return  # a role that keeps no sync limit as it is: nothing to hold the others against
    for row, option in enumerate(problem.roles[place].options):
        kind = _kind(pinned_so, option, finding)
        if kind is None:
            continue
        design = Design(
            tuple(row if i == place else 0 for i in range(len(problem.roles))),
            (0,) * len(problem.vehicles),
        )
        price = bought(before, bill_of_materials(opened, problem, design))
        sums = evaluate(problem, design)
        if price is not None and not set(broken(problem, sums)) - {"accuracy", "cost"}:
            yield kind, price, sums.error_m, option


def _kind(now: tuple[str, str | None, str], option: Option, finding: Finding) -> RepairKind | None:
    if option.sensor != now[0]:
        return "sensor"
    if _origin(finding) != "stamps" or option.names == now:
        return None
    return "timestamping" if option.primitive == now[1] else "rewire"


def _front(scored: list[tuple[float, float, Option]]) -> list[tuple[float, float, Option]]:
    """What no other one beats in price and error, the cheapest first."""
    kept: list[tuple[float, float, Option]] = []
    for one in sorted(scored, key=lambda each: (each[0], each[1], each[2].names)):
        if not kept or one[1] < kept[-1][1]:
            kept.append(one)
    return kept


def _remedy(
    kind: RepairKind, finding: Finding, at: tuple[StageCase, RoleCase], option: Option
) -> Remedy:
    stage, role = at
    way = f"by {option.primitive}, {option.method}"
    new = PinnedRole(stage.index, role.role, option.sensor, option.primitive, option.method)
    text = f"{option.sensor} {way} for {_place(stage, role)}"
    assumes = "the new sensor does not have it"
    if kind != "sensor":
        text = f"stamp {_place(stage, role)} {way}"
        assumes = "the fault is on the way of the stamp, not inside the sensor"
    return Remedy(kind, finding, text, assumes, (new,))
