"""The main job once more, slow and plain: read a spec, try every design, say which meet it.

Independent of the package: PyYAML and a regular expression for reading, the equations of the
Syncline paper and the rules of requirements written out as they stand, no pruning.  It knows what
the shipped specs and catalogs use: no inline sensors or errors, no known effects, cost as the
objective, and no Monte Carlo requirement.
"""

from __future__ import annotations

import functools
import itertools
import math
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from plain_existence import codes_of_part, codes_of_sensor

CATALOGS = Path(__file__).parent.parent / "catalogs"
ROLES = ("position", "attitude", "ranging")
FACTOR = {
    **{"m": 1.0, "cm": 1e-2, "mm": 1e-3, "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "h": 3600.0},
    **{"m/s": 1.0, "deg": math.pi / 180, "deg/s": math.pi / 180, "ppm": 1e-6},
    **{"degC": 1.0, "Hz": 1.0, "EUR": 1.0, "kg": 1.0, "g": 1e-3, "W": 1.0},
}
Slot = tuple[int, str]  # stage, role


@functools.cache
def number(text: Any) -> float:
    """SI value of "NUMBER UNIT"."""
    match = re.fullmatch(r"([-+]?[0-9.]+) (\S+)", str(text))
    assert match, text
    return float(match[1]) * FACTOR[match[2]]


@functools.cache
def read_catalog(families: bool = False) -> dict[str, Any]:
    """The catalogs that hold the paper's entries; with families, all that is shipped."""
    merged: dict[str, Any] = {}
    for name in ("platforms", "sensors", "timestamping"):
        merged.update(yaml.safe_load((CATALOGS / f"{name}.yaml").read_text("utf-8")))
    for path in sorted(CATALOGS.glob("*/*.yaml")) if families else ():
        for section, entries in yaml.safe_load(path.read_text("utf-8")).items():
            merged[section].update(entries)
    return merged


def read_spec(path: Path) -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load(path.read_text("utf-8"))
    return loaded


def bound_of(error: dict[str, Any], k: float) -> float:
    """Bound of |mu| [s]: |mean| + k std, or the larger end; a calibrated mean leaves its rest."""
    if error["distribution"] == "normal":
        mean, spread = number(error["mean"]), k * number(error["std"])
    else:
        low, high = number(error["low"]), number(error["high"])
        mean, spread = (low + high) / 2, (high - low) / 2
    left = number(error["calibrated"]) if "calibrated" in error else abs(mean)
    return left + spread


def clock_bound(clock: dict[str, Any] | None, k: float) -> float:
    """Bound of a host clock's offset from UTC [s], drift over the holdover included."""
    if clock is None:
        return 0.0
    drift = number(clock["drift"]) * number(clock["holdover"]) if "drift" in clock else 0.0
    return bound_of(clock["offset"], k) + drift


def norm(values: list[str]) -> float:
    return math.sqrt(sum(number(v) ** 2 for v in values))


def sensor_error(sensor: dict[str, Any], distance_m: float) -> float:
    """A sensor's term of the paper's eq. sensor_error_ub [m]; a scalar sigma_p is per axis."""
    if sensor["modality"] == "position":
        return norm(_axes(sensor["sigma_position"], 3))
    if sensor["modality"] == "attitude":
        return norm(_axes(sensor["sigma_attitude"], 3)) * distance_m
    bearing = norm(_axes(sensor["sigma_bearing"], 2))
    return number(sensor["sigma_range"]) + bearing * distance_m


def _axes(sigma: str | list[str], count: int) -> list[str]:
    """One figure holds for every axis."""
    return sigma if isinstance(sigma, list) else [sigma] * count


@dataclass(frozen=True)
class Option:
    sensor: str
    primitive: str
    method: str
    error_m: float
    tau_s: float
    tau_crit_s: float


@dataclass(frozen=True)
class Outcome:
    """One design and everything a verdict looks at."""

    options: tuple[Option, ...]
    clocks: tuple[str | None, ...]
    cost: float
    mass_kg: float
    power_w: float
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
        return max(self.tau_s / self.tau_crit_s, *(o.tau_s / o.tau_crit_s for o in self.options))

    def names(self) -> list[tuple[str, str]]:
        return [(o.sensor, o.method) for o in self.options]


@dataclass(frozen=True)
class Stage:
    vehicle: str
    v_mps: float
    w_radps: float
    d_m: float

    @property
    def rate_mps(self) -> float:
        return self.v_mps + self.d_m * self.w_radps


class Enumeration:
    """Every design of one spec; gnss_everywhere: those that cannot work for want of GNSS too."""

    def __init__(
        self,
        spec: dict[str, Any],
        gnss_everywhere: bool = False,
        catalog: dict[str, Any] | None = None,
    ) -> None:
        self.spec = spec
        self.gnss_everywhere = gnss_everywhere
        self.catalog = catalog or read_catalog(families=True)
        self.k = spec.get("coverage_factor", 3)
        self.stages = [self._stage(raw) for raw in spec["stages"]]
        self.vehicles = list(dict.fromkeys(stage.vehicle for stage in self.stages))
        self.slots = [
            (i, role)
            for i, raw in enumerate(spec["stages"])
            for role in ROLES
            if role in raw and (role != "position" or i == 0)
        ]

    def _stage(self, raw: dict[str, Any]) -> Stage:
        figures = self._platform(raw)
        v, w, d = (number(figures[key]) for key in ("v_max", "omega_max", "distance"))
        return Stage(raw.get("vehicle", raw["name"]), v, w, d if "ranging" in raw else 0.0)

    def _platform(self, raw: dict[str, Any]) -> dict[str, Any]:
        platform = raw["platform"]
        if isinstance(platform, str):
            platform = {"use": platform}
        return {**self.catalog["platforms"].get(platform.get("use"), {}), **platform}

    def _sensors(self, wanted: dict[str, Any], role: str) -> list[str]:
        if "sensor" in wanted:
            return [wanted["sensor"]]
        if isinstance(wanted["candidates"], list):
            return list(wanted["candidates"])
        keys = wanted["candidates"].items()
        sensors = self.catalog["sensors"].items()
        fits = [n for n, s in sensors if all(s[key] == value for key, value in keys)]
        fits = [name for name in fits if self.catalog["sensors"][name]["modality"] == role]
        objective = self.spec.get("objective", "cost")
        due = {one["kind"] for one in self.spec["requirements"]} | {objective}
        due &= {"cost", "mass", "power"}
        whole = [name for name in fits if due <= set(self.catalog["sensors"][name])]
        return whole or fits

    def options(self, slot: Slot) -> list[Option]:
        """What a role can be: every sensor, primitive and method that fit together."""
        raw, stage, role = self.spec["stages"][slot[0]], self.stages[slot[0]], slot[1]
        wanted = raw[role]
        choice = wanted.get("timestamping", raw.get("timestamping", self.spec.get("timestamping")))
        methods = [choice] if isinstance(choice, str) else choice["candidates"]
        rate = stage.v_mps if role == "position" else stage.rate_mps
        found: list[Option] = []
        for name, method in itertools.product(self._sensors(wanted, role), methods):
            sensor, stamping = self.catalog["sensors"][name], self.catalog["timestamping"][method]
            if self.codes(slot[0], sensor) or self._codes_of_parts(stamping, slot[0]):
                continue
            if not self.has_time(slot[0]) and self._needs_gnss(stamping):
                continue
            error, tau = sensor_error(sensor, stage.d_m), bound_of(stamping["error"], self.k)
            common = {*sensor["primitives"], "arrival"} & set(stamping["primitives"])
            found += [
                Option(name, primitive, method, error, tau, error / rate)
                for primitive in sorted(common)
                if wanted.get("primitive", primitive) == primitive
            ]
        return found

    def codes(self, stage: int, sensor: dict[str, Any]) -> list[str]:
        """Why a sensor cannot work on a stage."""
        raw, spec = self.spec["stages"][stage], self.spec
        spacing = [
            number(r["limit"]) for r in spec["requirements"] if r["kind"] == "sample_spacing"
        ]
        return codes_of_sensor(
            sensor, raw, self._platform(raw), spec, self.has_gnss(stage), min(spacing, default=None)
        )

    def _codes_of_parts(self, entry: dict[str, Any], stage: int) -> list[str]:
        hardware = [self.catalog["infrastructure"][name] for name in entry.get("requires", ())]
        raw = self.spec["stages"][stage]
        return [code for one in (entry, *hardware) for code in codes_of_part(one, raw, self.spec)]

    def clocks(self, vehicle: str) -> list[str | None]:
        """Clocks that a vehicle's host can have; None alone where the spec names none."""
        named = [raw["clock"]["candidates"] for raw in self._raw_of(vehicle) if "clock" in raw]
        return [name for name in named[0] if self._works(name, vehicle)] if named else [None]

    @property
    def count(self) -> int:
        """How many designs there are."""
        tables = [self.options(slot) for slot in self.slots]
        return math.prod(map(len, (*tables, *map(self.clocks, self.vehicles))))

    def __iter__(self) -> Iterator[Outcome]:
        tables = [self.options(slot) for slot in self.slots]
        offered = [self.clocks(vehicle) for vehicle in self.vehicles]
        for chosen_clocks in itertools.product(*offered):
            for options in itertools.product(*tables):
                yield self.outcome(options, chosen_clocks)

    def has_gnss(self, stage: int) -> bool:
        """GNSS is on the first stage unless it is at a depth, and nowhere else by itself."""
        if self.gnss_everywhere:
            return True
        raw = self.spec["stages"][stage]
        deep = number(raw.get("depth", "0 m")) > 0
        said = raw.get("gnss")
        return said in ("yes", True) if said is not None else stage == 0 and not deep

    def has_time(self, stage: int) -> bool:
        """GNSS time, which needs a cable or GNSS."""
        return self.has_gnss(stage)

    def _needs_gnss(self, entry: dict[str, Any]) -> bool:
        """Whether an entry, or the shared hardware that it requires, says so."""
        hardware = [self.catalog["infrastructure"][name] for name in entry.get("requires", ())]
        return any("gnss" in one.get("needs", ()) for one in (entry, *hardware))

    def _works(self, clock: str, vehicle: str) -> bool:
        aboard = [i for i, stage in enumerate(self.stages) if stage.vehicle == vehicle]
        entry = self.catalog["clocks"][clock]
        if any(self._codes_of_parts(entry, stage) for stage in aboard):
            return False
        return not self._needs_gnss(entry) or any(map(self.has_time, aboard))

    def _raw_of(self, vehicle: str) -> list[dict[str, Any]]:
        pairs = zip(self.spec["stages"], self.stages, strict=True)
        return [raw for raw, stage in pairs if stage.vehicle == vehicle]

    def outcome(self, options: tuple[Option, ...], clocks: tuple[str | None, ...]) -> Outcome:
        at = dict(zip(self.slots, options, strict=True))
        tau, per_sensor = self._sync(at, dict(zip(self.vehicles, clocks, strict=True)))
        rate = sum(stage.rate_mps for stage in self.stages)
        error = sum(option.error_m for option in options)
        sync = per_sensor if self.spec.get("sync_model") == "per_sensor" else rate * tau
        bought = self._bought(at, dict(zip(self.vehicles, clocks, strict=True)))
        cost, mass, power = (
            sum(number(e[key]) if key in e else math.nan for e in bought)
            for key in ("cost", "mass", "power")
        )
        return Outcome(options, clocks, cost, mass, power, error, rate, tau, error + sync)

    def _sync(self, at: dict[Slot, Option], clocks: dict[str, str | None]) -> tuple[float, float]:
        """tau of the system [s] and the sync error of the per-sensor model [m]."""
        tau = error = 0.0
        for i, stage in enumerate(self.stages):
            position = (0, "position") if i == 0 else (i - 1, "ranging")
            if (i, "ranging") not in at:  # a position alone, against true time, which is UTC
                pairs = [(at[position].tau_s + self._from_utc(at, position, clocks), stage.v_mps)]
            else:
                speeds = ((position, stage.v_mps), ((i, "attitude"), stage.d_m * stage.w_radps))
                pairs = [(self._relative(at, a, (i, "ranging"), clocks), v) for a, v in speeds]
            tau = max(tau, *(bound for bound, _ in pairs))
            error += sum(bound * speed for bound, speed in pairs)
        return tau, error

    def _relative(
        self, at: dict[Slot, Option], a: Slot, b: Slot, clocks: dict[str, str | None]
    ) -> float:
        """Bound of the relative timestamp error of two sensors [s]."""
        if self._timeline(at, a) == self._timeline(at, b):
            offset = 0.0
        else:
            offset = self._from_utc(at, a, clocks) + self._from_utc(at, b, clocks)
        return at[a].tau_s + at[b].tau_s + offset

    def _timeline(self, at: dict[Slot, Option], slot: Slot) -> str:
        """`utc`, or the vehicle whose host clock stamps."""
        timeline = self.catalog["timestamping"][at[slot].method].get("timeline", "host")
        return "utc" if timeline == "utc" else self.stages[slot[0]].vehicle

    def _from_utc(self, at: dict[Slot, Option], slot: Slot, clocks: dict[str, str | None]) -> float:
        """Bound of the offset of a sensor's timeline from UTC [s]."""
        timeline = self._timeline(at, slot)
        clock = None if timeline == "utc" else clocks[timeline]
        return clock_bound(self.catalog["clocks"][clock] if clock else None, self.k)

    def _bought(
        self, at: dict[Slot, Option], clocks: dict[str, str | None]
    ) -> list[dict[str, Any]]:
        """Catalog entries that the design buys, shared hardware per full set of channels."""
        bought = [self.catalog["sensors"][option.sensor] for option in at.values()]
        for vehicle in self.vehicles:
            mine = [
                self.catalog["timestamping"][option.method]
                for (i, _), option in at.items()
                if self.stages[i].vehicle == vehicle
            ]
            clock = clocks[vehicle]
            mine += [self.catalog["clocks"][clock]] if clock else []
            channels: Counter[str] = Counter()
            for entry in mine:
                channels.update(entry.get("requires", {}))
            for hardware, count in channels.items():
                item = self.catalog["infrastructure"][hardware]
                mine += [item] * math.ceil(count / item["channels"])
            bought += mine
        return bought


def limits_of(spec: dict[str, Any]) -> dict[str, tuple[str, float]]:
    """Requirement id -> (kind, limit); the implied sync requirement has the id "implied"."""
    limits = {
        r["id"]: (r["kind"], r["limit"] if r["kind"] == "sync" else number(r["limit"]))
        for r in spec["requirements"]
        if r["kind"] not in ("monte_carlo", "sample_spacing")  # that one bars options
    }
    if "sync" not in {kind for kind, _ in limits.values()}:
        limits["implied"] = ("sync", 1.0)
    return limits


def failed(spec: dict[str, Any], outcome: Outcome) -> set[str]:
    """Ids of the requirements that a design misses (Monte Carlo ones are not looked at)."""
    values = {
        "accuracy": outcome.total_m,
        "sync": outcome.sync,
        "cost": outcome.cost,
        "mass": outcome.mass_kg,
        "power": outcome.power_w,
    }
    missed = set()
    for name, (kind, limit) in limits_of(spec).items():
        value = values[kind]
        # Sums of decimal prices in binary: a billionth of slack, no spec comes closer than that.
        if not (value < limit if kind == "sync" else value <= limit + 1e-9):
            missed.add(name)
    return missed
