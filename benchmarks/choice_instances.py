"""Design problems of any size for timing: sensors with a price for accuracy, eight methods."""

from __future__ import annotations

import json
import math
import random
from fractions import Fraction
from pathlib import Path

from syncline_design.choice.option import Option, Resources
from syncline_design.choice.table import (
    NO_CLOCK,
    ClockOption,
    Infrastructure,
    Limits,
    Pair,
    Problem,
    RoleTable,
    VehicleTable,
)

# name, bound [s], timeline, cost [EUR], channels of shared hardware: magnitudes of real methods
METHODS = (
    ("capture", 10e-9, "host", 20, (("board", 1),)),
    ("pps_direct", 0.53e-6, "utc", 30, ()),
    ("ptp", 1e-6, "utc", 10, (("switch", 1),)),
    ("gpio", 12e-6, "host", 15, ()),
    ("gpio_rt", 160e-6, "host", 5, ()),
    ("ptp_software", 1e-3, "host", 8, (("switch", 1),)),
    ("ntp", 2e-3, "host", 3, ()),
    ("arrival", 16e-3, "host", 0, ()),
)
ROLE_ERROR_M = {"position": 0.05, "attitude": 0.2, "ranging": 0.1}


def instance(
    stages: int,
    sensors: int,
    methods: int = 8,
    seed: int = 0,
    *,
    vehicles: int = 1,
    clocks: int = 1,
    boards: bool = False,
    accuracy_m: float | None = None,
) -> Problem:
    """A chain of stages: 2 stages + 1 roles, each with `sensors` sensors and `methods` methods."""
    rng = random.Random(seed)
    speed, turn = 2.0, 8.0
    names = [(0, "position")]
    for stage in range(stages):
        names += [(stage, "attitude"), (stage, "ranging")]
    vehicle_of = [min(stage, vehicles - 1) for stage in range(stages)]
    roles = tuple(
        _role(rng, stage, role, vehicle_of[stage], sensors, methods, speed, turn, boards)
        for stage, role in names
    )
    place = {name: r for r, name in enumerate(names)}
    pairs = []
    for stage in range(stages):
        before = place[0, "position"] if stage == 0 else place[stage - 1, "ranging"]
        pairs.append(Pair(before, place[stage, "ranging"], speed))
        pairs.append(Pair(place[stage, "attitude"], place[stage, "ranging"], turn))
    return Problem(
        roles=roles,
        pairs=tuple(pairs),
        vehicles=tuple(
            VehicleTable(
                f"v{v}", tuple(s for s in range(stages) if vehicle_of[s] == v), _clocks(clocks)
            )
            for v in range(vehicles)
        ),
        infrastructure=(
            Infrastructure("board", 8, Resources(Fraction(350))),
            Infrastructure("switch", 4, Resources(Fraction(500))),
        ),
        sync_rate_mps=stages * (speed + turn),
        fixed_error_m=0.0,
        limits=Limits(accuracy_m, 1.0),
        sync_model="syncline",
        objective="cost",
    )


def _role(
    rng: random.Random,
    stage: int,
    role: str,
    vehicle: int,
    sensors: int,
    methods: int,
    speed: float,
    turn: float,
    boards: bool,
) -> RoleTable:
    """Sensors whose price falls with their error, give or take a factor; every method fits."""
    options = []
    rate = speed if role == "position" else speed + turn
    for s in range(sensors):
        error = ROLE_ERROR_M[role] * 10 ** rng.uniform(-1.0, 1.0)
        price = Fraction(round(100 * 200.0 / error**0.8 * math.exp(rng.gauss(0.0, 0.5))), 100)
        for name, tau, timeline, cost, needs in METHODS[:methods]:
            crit = error / rate
            if not tau / crit < 1.0:
                continue
            options.append(
                Option(
                    f"s{s:04d}", "pps", name, error, tau, crit, timeline,
                    Resources(price + cost), needs if boards else (),
                )
            )  # fmt: skip
    return RoleTable(stage, f"stage{stage}", role, vehicle, tuple(options))


def _clocks(count: int) -> tuple[ClockOption, ...]:
    figures = [(1e-3, 0), (20e-6, 40), (1e-6, 150)]
    if count == 1:
        return (NO_CLOCK,)
    return tuple(
        ClockOption(f"clock{i}", offset, Resources(Fraction(cost)))
        for i, (offset, cost) in enumerate(figures[:count])
    )


def write_spec(
    folder: Path,
    stages: int,
    sensors: int,
    methods: int = 8,
    seed: int = 0,
    *,
    accuracy_m: float | None = None,
    sync: float = 1.0,
) -> Path:
    """The chain of `instance` as a spec with a catalog of its own, for whole processes."""
    problem_roles = instance(stages, sensors, methods, seed).roles
    catalog: dict[str, dict[str, object]] = {"sensors": {}, "timestamping": {}}
    names: dict[tuple[int, str], list[str]] = {}
    for role in problem_roles:
        for option in role.options:
            entry = f"{role.role}{role.stage}_{option.sensor}"
            here = names.setdefault((role.stage, role.role), [])
            if entry not in catalog["sensors"]:
                here.append(entry)
                catalog["sensors"][entry] = _sensor_entry(role.role, option)
    for name, tau, timeline, cost, _ in METHODS[:methods]:
        catalog["timestamping"][f"m_{name}"] = {
            "name": name, "primitives": ["pps"], "timeline": timeline,
            "error": {"distribution": "uniform", "low": f"{-tau!r} s", "high": f"{tau!r} s"},
            "cost": f"{cost} EUR", "mass": "0 g", "power": "0 W",
        }  # fmt: skip
    (folder / "catalog.yaml").write_text(json.dumps(catalog, indent=1), "utf-8")
    requirements: list[dict[str, object]] = [
        {"id": "SYNC-1", "kind": "sync", "limit": sync},
        {"id": "ACC-1", "kind": "accuracy", "limit": f"{accuracy_m or 0.5 * stages!r} m"},
    ]
    spec = {
        "syncline": 1, "name": f"{stages} x {sensors} x {methods}", "catalogs": ["catalog.yaml"],
        "requirements": requirements,
        "stages": [_stage_entry(stage, names) for stage in range(stages)],
        "timestamping": {"candidates": [f"m_{name}" for name, *_ in METHODS[:methods]]},
    }  # fmt: skip
    path = folder / "spec.yaml"
    path.write_text(json.dumps(spec, indent=1), "utf-8")
    return path


def _sensor_entry(role: str, option: Option) -> dict[str, object]:
    """A catalog entry whose term of the sensor error is the option's, at 10 m distance."""
    cost = option.resources.cost or Fraction(0)
    entry: dict[str, object] = {
        "name": option.sensor, "modality": role, "primitives": ["pps"], "mass": "100 g",
        "power": "1 W", "cost": f"{float(cost):.2f} EUR",
    }  # fmt: skip
    if role == "ranging":
        half = option.sensor_error_m / 2.0
        entry |= {
            "sigma_range": f"{half:.9f} m",
            "sigma_bearing": f"{half / math.sqrt(200.0):.9f} rad",
        }
    else:
        each = option.sensor_error_m / math.sqrt(3.0) / (1.0 if role == "position" else 10.0)
        unit = "m" if role == "position" else "rad"
        entry[f"sigma_{role}"] = [f"{each:.9f} {unit}"] * 3
    return entry


def _stage_entry(stage: int, names: dict[tuple[int, str], list[str]]) -> dict[str, object]:
    platform = {"name": f"platform {stage}", "v_max": "2 m/s", "omega_max": "0.8 rad/s",
                "distance": "10 m", "baseline": "1 m"}  # fmt: skip
    entry: dict[str, object] = {"name": f"stage{stage}", "platform": platform}
    for role in ("position", "attitude", "ranging"):
        if (stage, role) in names:
            entry[role] = {"candidates": names[stage, role]}
    return entry
