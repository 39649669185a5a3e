"""The main job once more, slow and plain: read a spec, try every design, say the cheapest.

Independent of the package: PyYAML and a regular expression for reading, the rules of the Syncline
paper and of the requirements written out as they stand, no pruning.  Only for the shipped specs
and catalogs (no inline sensors or errors, cost as the objective).
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

CATALOGS = Path(__file__).parent.parent / "catalogs"
FACTOR = {
    "m": 1.0, "cm": 1e-2, "mm": 1e-3, "km": 1e3, "m/s": 1.0,
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "h": 3600.0, "ppm": 1e-6,
    "deg": math.pi / 180, "rad": 1.0, "deg/s": math.pi / 180, "rad/s": 1.0,
    "EUR": 1.0, "kg": 1.0, "g": 1e-3, "W": 1.0,
}  # fmt: skip


def number(text: Any) -> float:
    """SI value of "NUMBER UNIT"."""
    match = re.fullmatch(r"([-+]?[0-9.]+(?:e[-+]?\d+)?) (\S+)", str(text))
    assert match, text
    return float(match[1]) * FACTOR[match[2]]


def catalog() -> dict[str, Any]:
    merged: dict[str, Any] = {}
    for name in ("platforms", "sensors", "timestamping"):
        merged.update(yaml.safe_load((CATALOGS / f"{name}.yaml").read_text("utf-8")))
    return merged


def tau_of(error: dict[str, Any], k: float) -> float:
    """Bound of |mu| [s]: |mean| + k std, or the larger end; a calibrated mean leaves its rest."""
    if error["distribution"] == "normal":
        mean, spread = number(error["mean"]), k * number(error["std"])
    else:
        low, high = number(error["low"]), number(error["high"])
        mean, spread = (low + high) / 2, (high - low) / 2
    if "calibrated" in error:
        return number(error["calibrated"]) + spread
    return abs(mean) + spread


def clock_bound(clock: dict[str, Any] | None, k: float) -> float:
    if clock is None:
        return 0.0
    drift = number(clock["drift"]) * number(clock["holdover"]) if "drift" in clock else 0.0
    return tau_of(clock["offset"], k) + drift


def norm(*values: float) -> float:
    return math.sqrt(sum(v * v for v in values))


@dataclass(frozen=True)
class Option:
    sensor: str
    primitive: str
    method: str
    error_m: float
    tau_s: float
    tau_crit_s: float
    utc: bool
    entries: tuple[dict[str, Any], ...]  # what is bought: sensor and method


@dataclass(frozen=True)
class Outcome:
    """One design, everything a verdict looks at."""

    options: tuple[Option, ...]
    clocks: tuple[str | None, ...]
    cost: float
    mass: float
    power: float
    sensor_error_m: float
    sync_rate_mps: float
    tau_s: float
    total_m: float

    @property
    def tau_crit_s(self) -> float:
        return self.sensor_error_m / self.sync_rate_mps

    @property
    def sync(self) -> float:
        """Largest tau / tau_crit, of the sensors and of the system."""
        ratios = [o.tau_s / o.tau_crit_s for o in self.options]
        return max([self.tau_s / self.tau_crit_s, *ratios])

    def names(self) -> list[tuple[str, str, str]]:
        return [(o.sensor, o.primitive, o.method) for o in self.options]


def sensor_error(sensor: dict[str, Any], d: float) -> float:
    if sensor["modality"] == "position":
        s = sensor["sigma_position"]
        return norm(*map(number, s)) if isinstance(s, list) else math.sqrt(3) * number(s)
    if sensor["modality"] == "attitude":
        return norm(*map(number, sensor["sigma_attitude"])) * d
    return number(sensor["sigma_range"]) + norm(*map(number, sensor["sigma_bearing"])) * d


def role_options(
    spec: dict[str, Any], stage: dict[str, Any], role: str, platform: dict[str, Any], cat: Any
) -> list[Option]:
    wanted = stage[role]
    names = [wanted["sensor"]] if "sensor" in wanted else wanted["candidates"]
    if isinstance(names, dict):
        names = [
            n for n, s in cat["sensors"].items()
            if s["modality"] == role
            and all(
                number(s["cost"]) <= number(v) if key == "max_cost" else s[key] == v
                for key, v in names.items()
            )
        ]  # fmt: skip
    choice = wanted.get("timestamping", stage.get("timestamping", spec.get("timestamping")))
    methods = [choice] if isinstance(choice, str) else choice["candidates"]
    v, w, d = (number(platform[key]) for key in ("v_max", "omega_max", "distance"))
    rate = v if role == "position" else v + d * w
    found = []
    for name, method in itertools.product(names, methods):
        sensor, stamping = cat["sensors"][name], cat["timestamping"][method]
        error = sensor_error(sensor, d)
        for primitive in [*sensor["primitives"], "arrival"]:
            if wanted.get("primitive", primitive) != primitive:
                continue
            if not {primitive, "arrival"} & set(stamping["primitives"]):
                continue
            if primitive != "arrival" and primitive not in stamping["primitives"]:
                if "primitive" not in wanted:
                    continue
            found.append(
                Option(
                    name,
                    primitive,
                    method,
                    error,
                    tau_of(stamping["error"], spec.get("coverage_factor", 3)),
                    error / rate,
                    stamping["timeline"] == "utc",
                    (sensor, stamping),
                )  # fmt: skip
            )
    return found


def designs(spec: dict[str, Any]) -> Iterator[Outcome]:
    cat = catalog()
    slots: list[tuple[int, str]] = []
    tables, platforms, vehicles = [], [], []
    for i, stage in enumerate(spec["stages"]):
        chosen = stage["platform"]
        if isinstance(chosen, str):
            chosen = {"use": chosen}
        platforms.append({**cat["platforms"].get(chosen.get("use"), {}), **chosen})
        vehicles.append(stage.get("vehicle", stage["name"]))
        for role in ("position", "attitude", "ranging"):
            if role in stage and (role != "position" or i == 0):
                slots.append((i, role))
                tables.append(role_options(spec, stage, role, platforms[i], cat))
    names = list(dict.fromkeys(vehicles))
    clock_lists = [
        next(
            (s["clock"]["candidates"] for s, v in zip(spec["stages"], vehicles, strict=True)
             if v == name and "clock" in s),
            [None],
        )
        for name in names
    ]  # fmt: skip
    for clocks in itertools.product(*clock_lists):
        entries = [cat["clocks"][c] if c else None for c in clocks]
        for options in itertools.product(*tables):
            yield outcome(spec, slots, options, platforms, vehicles, names, clocks, entries, cat)


def outcome(
    spec: Any, slots: Any, options: Any, platforms: Any, vehicles: Any, names: Any, clocks: Any,
    entries: Any, cat: Any,
) -> Outcome:  # fmt: skip
    k = spec.get("coverage_factor", 3)
    offsets = {n: clock_bound(e, k) for n, e in zip(names, entries, strict=True)}
    at = {slot: o for slot, o in zip(slots, options, strict=True)}

    def line(slot: tuple[int, str]) -> tuple[str, float]:
        vehicle = vehicles[slot[0]]
        return ("utc", 0.0) if at[slot].utc else (vehicle, offsets[vehicle])

    def relative(a: tuple[int, str], b: tuple[int, str]) -> float:
        (line_a, off_a), (line_b, off_b) = line(a), line(b)
        return at[a].tau_s + at[b].tau_s + (0.0 if line_a == line_b else off_a + off_b)

    tau, rate, per_sensor = 0.0, 0.0, 0.0
    for i, platform in enumerate(platforms):
        v, w, d = (number(platform[key]) for key in ("v_max", "omega_max", "distance"))
        if (i, "ranging") not in at:  # a position alone, against true time
            rate, tau = rate + v, max(tau, at[i, "position"].tau_s)
            per_sensor += v * at[i, "position"].tau_s
            continue
        rate += v + d * w
        position = (0, "position") if i == 0 else (i - 1, "ranging")
        for other, speed in ((position, v), ((i, "attitude"), d * w)):
            bound = relative(other, (i, "ranging"))
            tau = max(tau, bound)
            per_sensor += speed * bound
    sums = dict.fromkeys(("cost", "mass", "power"), 0.0)
    bought = [e for o in options for e in o.entries] + [e for e in entries if e]
    for name in names:
        channels: dict[str, int] = {}
        mine = [o.entries[1] for s, o in at.items() if vehicles[s[0]] == name]
        clock = entries[names.index(name)]
        for entry in [*mine, *([clock] if clock else [])]:
            for hardware, count in entry.get("requires", {}).items():
                channels[hardware] = channels.get(hardware, 0) + count
        for hardware, count in channels.items():
            item = cat["infrastructure"][hardware]
            bought += [item] * math.ceil(count / item["channels"])
    for entry in bought:
        for key in sums:
            sums[key] += number(entry[key])
    error = sum(o.error_m for o in options)
    sync = per_sensor if spec.get("sync_model") == "per_sensor" else rate * tau
    return Outcome(options, clocks, sums["cost"], sums["mass"], sums["power"], error, rate, tau,
                   error + sync)  # fmt: skip


def meets(spec: dict[str, Any], o: Outcome, skip: str = "") -> bool:
    """All requirements but those of kind `skip`; Monte Carlo ones are not looked at."""
    limits = {"sync": 1.0}
    for r in spec["requirements"]:
        if r["kind"] != "monte_carlo":
            limits[r["kind"]] = r["limit"] if r["kind"] == "sync" else number(r["limit"])
    values = {"accuracy": o.total_m, "cost": o.cost, "mass": o.mass, "power": o.power}
    for kind, limit in limits.items():
        if kind == skip:
            continue
        ok = o.sync < limit if kind == "sync" else values[kind] <= limit + 1e-9
        if not ok:
            return False
    return True


def read_spec(path: Path) -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load(path.read_text("utf-8"))
    return loaded
