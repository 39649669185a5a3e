"""What the product says of one random spec, held against plain enumeration."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

from existence_specs import Raw, written
from plain_enumeration import Enumeration, Outcome, failed, number, read_catalog
from syncline_design.choice.decide import choose
from syncline_design.choice.evaluate import evaluate
from syncline_design.choice.front import front
from syncline_design.choice.outcome import Choice
from syncline_design.choice.problem import build_problem, selection_of
from syncline_design.choice.table import Problem
from syncline_design.spec.case import Case
from syncline_design.spec.load import load
from syncline_design.spec.selection import ClockSelection, RoleSelection, Selection
from syncline_design.verdict.recheck_facts import impossible
from syncline_design.verdict.verify import CheckSettings, check_loaded

QUICK = CheckSettings(monte_carlo=False)
OF_SENSORS = {
    "reach", "medium", "gnss", "field_of_view", "rate", "depth", "temperature", "discontinued",
    "unknown-fact",
}  # fmt: skip


class Plain(Enumeration):
    """The oracle on a spec with a catalog of its own; cables bring GNSS time."""

    def __init__(self, spec: Raw, parts: Raw) -> None:
        shipped = read_catalog(families=True)
        super().__init__(spec, catalog={"platforms": shipped["platforms"], **parts})

    def _timed(self, stage: int) -> bool:
        source = self.spec["stages"][stage].get("timing_from")
        names = [raw["name"] for raw in self.spec["stages"]]
        return self.has_gnss(stage) or (source is not None and self._timed(names.index(source)))

    def lacks_time(self, entry: Raw, stage: int) -> bool:
        return self._needs_gnss(entry) and not self._timed(stage)

    def has_time(self, stage: int) -> bool:
        return self._timed(stage)


def disagreements(spec: Raw, parts: Raw, folder: Path, rng: random.Random) -> list[str]:
    """What the product says that the oracle does not."""
    plain, case = Plain(spec, parts), load(written(folder, spec, parts))
    problem = build_problem(case)
    good = [one for one in plain if not failed(spec, one)]
    out = _roads(problem, good) + _front(problem, good, list(plain), spec)
    out += _verdict(case, good) + _excluded(case, plain) + _recheck(case, plain, rng)
    return out


def _roads(problem: Problem, good: list[Outcome]) -> list[str]:
    least = min((one.cost for one in good), default=None)
    out = []
    for road in ("front", "milp", "enumerate"):
        found = choose(problem, road)
        cost = evaluate(problem, found.design).cost if isinstance(found, Choice) else None
        if (cost is None) != (least is None) or (cost is not None and abs(cost - least) > 1e-6):
            out.append(f"{road}: {cost}, the oracle {least}")
        if isinstance(found, Choice):
            names = [one.sensor for one in selection_of(problem, found.design).roles]
            if names not in [[o.sensor for o in one.options] for one in good]:
                out.append(f"{road}: {names} is no design")
    return out


def _front(problem: Problem, good: list[Outcome], every: list[Outcome], spec: Raw) -> list[str]:
    """The front holds what meets all but accuracy: rising cost, falling error."""
    fits = [one for one in every if failed(spec, one) <= {"A"}]
    wanted: list[tuple[float, float]] = []
    for one in sorted(fits, key=lambda one: (one.cost, one.total_m)):
        if not wanted or one.total_m < wanted[-1][1] * (1 - 1e-9):
            wanted.append((one.cost, one.total_m))
    found = [(float(point.amount), point.error_m) for point in front(problem)]
    same = len(found) == len(wanted) and all(
        abs(a - c) < 1e-6 and abs(b - d) <= 1e-9 * d
        for (a, b), (c, d) in zip(found, wanted, strict=True)
    )
    return [] if same else [f"front {found}, the oracle {wanted}"]


def _verdict(case: Case, good: list[Outcome]) -> list[str]:
    verdict = check_loaded(case, QUICK).to_json()
    word = verdict["verdict"]
    if good:
        least = min(one.cost for one in good)
        same = word == _word(case, verdict) and abs(verdict["design"]["cost"] - least) < 1e-6
        return [] if same else [f"verdict {word}, the oracle meets at {least}"]
    pinned = word == "fails"  # a spec that leaves one design only
    return [] if word == "infeasible" or pinned else [f"verdict {word}, the oracle finds none"]


def _word(case: Case, verdict: Raw) -> str:
    """Meets, unless the spacing of samples is asked for and not told."""
    asked = any(one.kind == "sample_spacing" for one in case.spec.requirements)
    chosen = [one["roles"]["ranging"]["sensor"] for one in verdict["design"]["stages"]]
    told = all(case.catalog.sensors[name].rate is not None for name in chosen)
    return "meets" if told or not asked else "indeterminate"


def _excluded(case: Case, plain: Plain) -> list[str]:
    """One row a sensor that cannot be there, with its strongest reason, and no other such row."""
    rows = check_loaded(case, QUICK).to_json()["choice"]["excluded"]
    said: dict[tuple[str, str, str], list[str]] = {}
    for row in rows:
        if row["method"] is None and row["role"] != "clock" and row["primitive"] is None:
            said.setdefault((row["stage"], row["role"], row["sensor"]), []).append(row["code"])
    wanted: dict[tuple[str, str, str], list[str]] = {}
    for (stage, role), raw in _roles(plain):
        for name in raw["candidates"]:
            codes = plain.codes(stage, plain.catalog["sensors"][name])
            if codes:
                wanted[plain.spec["stages"][stage]["name"], role, name] = codes[:1]
    return [] if said == wanted else [f"excluded {said}, the oracle {wanted}"]


def _roles(plain: Plain) -> list[tuple[tuple[int, str], Raw]]:
    return [((i, role), plain.spec["stages"][i][role]) for i, role in plain.slots]


def _recheck(case: Case, plain: Plain, rng: random.Random) -> list[str]:
    """Any selection, possible or not: the recheck finds something wrong where the oracle does."""
    out = []
    for _ in range(6):
        roles, wrong = [], False
        for (i, role), raw in _roles(plain):
            name, method = (
                rng.choice(raw["candidates"]),
                rng.choice([*plain.catalog["timestamping"]]),
            )
            stage, entry = plain.spec["stages"][i]["name"], plain.catalog["timestamping"][method]
            roles.append(RoleSelection(stage, role, name, "arrival", method))  # type: ignore[arg-type]
            wrong |= bool({*plain.codes(i, plain.catalog["sensors"][name])} - {"rate"})
            wrong |= bool(plain._codes_of_parts(entry, i)) or plain.lacks_time(entry, i)
        clocks = []
        for i, raw in enumerate(plain.spec["stages"]):
            named = rng.choice(raw["clock"]["candidates"]) if "clock" in raw else None
            clocks.append(ClockSelection(raw["name"], named))
            if named:
                entry = plain.catalog["clocks"][named]
                wrong |= bool(plain._codes_of_parts(entry, i)) or plain.lacks_time(entry, i)
        found = impossible(case, Selection(tuple(roles), tuple(clocks)))
        if bool(found) != wrong:
            out.append(f"recheck {found}, the oracle {wrong}: {roles} {clocks}")
    return out


# ------------------------------------------------------------------ what would help

UNITS = {"distance": ("m", 1.0), "v_max": ("m/s", 1.0), "omega_max": ("deg/s", 180.0 / math.pi)}
NEAR = 0.015  # a fix is written in few figures, and found to 1e-4


def fix_disagreements(spec: Raw, parts: Raw, folder: Path) -> list[str]:
    """Fixes of a spec without a design: each one leaves one, and none that is nearer was missed."""
    if has_design(spec, parts):
        return []
    verdict = check_loaded(load(written(folder, spec, parts)), QUICK).to_json()
    fixes = (verdict.get("infeasibility") or {"fixes": []})["fixes"]
    out = [
        f"no design with {fix['text']}"
        for fix in fixes
        if fix["kind"] != "timestamping" and not has_design(_fixed(spec, fix), parts)
    ]
    if verdict["verdict"] == "infeasible":
        out += _missed(spec, parts, fixes)
    return out


def has_design(spec: Raw, parts: Raw) -> bool:
    plain = Plain(spec, parts)
    return any(not failed(spec, one) for one in plain)


def _with(spec: Raw, stage: int, **keys: Any) -> Raw:
    stages = [dict(one) for one in spec["stages"]]
    stages[stage] |= keys
    return spec | {"stages": stages}


def _at(spec: Raw, stage: int, figure: str, value: float) -> Raw:
    unit, factor = UNITS[figure]
    platform = spec["stages"][stage]["platform"] | {figure: f"{value * factor:.15f} {unit}"}
    return _with(spec, stage, platform=platform)


def _fixed(spec: Raw, fix: Raw) -> Raw:
    names = [one["name"] for one in spec["stages"]]
    stage = names.index(fix["stage"]) if fix["stage"] else 0
    if fix["kind"] == "platform":
        return _at(spec, stage, fix["figure"], fix["to"])
    if fix["figure"] == "gnss":
        return _with(spec, stage, gnss="yes")
    if fix["figure"] == "timing_from":
        return _with(spec, stage, timing_from=fix["text"].split()[1])
    if fix["kind"] == "facts":
        return spec | {fix["figure"]: fix["figure"] == "allow_discontinued"}
    limit = fix["to"] if fix["kind"] == "sync" else f"{fix['to']:.15f} m"
    rows = [one | ({"limit": limit} if one["kind"] == fix["kind"] else {})
            for one in spec["requirements"]]  # fmt: skip
    return spec | {"requirements": rows}


def _missed(spec: Raw, parts: Raw, fixes: list[Raw]) -> list[str]:
    """Distances of a coarse grid, and ends of reach, that help and are nearer than what is said."""
    out = []
    for stage, raw in enumerate(spec["stages"]):
        before = number(raw["platform"]["distance"])
        told = [f["to"] for f in fixes if f["figure"] == "distance" and f["stage"] == raw["name"]]
        for sign in (-1, 1):
            side = [to for to in told if (to - before) * sign > 0]
            reached = abs(math.log(side[0] / before)) if side else math.inf
            for value in _grid(parts, before, sign):
                if abs(math.log(value / before)) >= reached - NEAR:
                    break
                if has_design(_at(spec, stage, "distance", value), parts):
                    out.append(f"{raw['name']}: {value} m helps, said is {side}")
                    break
    return out


def _grid(parts: Raw, before: float, sign: int) -> list[float]:
    """Values from the nearest to the farthest that is searched."""
    far = math.log(10.0 if sign > 0 else 1000.0) * 0.99
    values = [before * math.exp(sign * far * k / 25) for k in range(1, 26)]
    for one in parts["sensors"].values():
        reach = one.get("reach", {})
        ends = reach.get("max")
        ends = list(ends.values()) if isinstance(ends, dict) else [ends]
        values += [number(end) for end in (*ends, reach.get("min")) if end is not None]
    sided = [v for v in values if 1e-6 < math.log(v / before) * sign < far]
    return sorted(sided, key=lambda v: abs(math.log(v / before)))
