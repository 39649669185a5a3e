"""Small random specs of several missions with a catalog of their own, and every payload tried.

Prices are few, so that designs tie; nothing of the package is used to try them.
"""

from __future__ import annotations

import copy
import itertools
import json
import random
from pathlib import Path
from typing import Any

from plain_enumeration import Enumeration, number, read_catalog

Raw = dict[str, Any]
Names = tuple[tuple[str, str, str], ...]


def drawn(seed: int) -> tuple[Raw, Raw]:
    """A spec of two or three missions, and its catalog."""
    rng = random.Random(seed)
    sensors: Raw = {}
    for role, key in (("position", "sigma_position"), ("attitude", "sigma_attitude")):
        for k in range(3):
            size = round(rng.uniform(1, 9), 1) / (100 if role == "position" else 20)
            unit = "m" if role == "position" else "deg"
            sensors[f"{role}_{k}"] = {key: f"{size:.4f} {unit}"}
    for k in range(3):
        sensors[f"ranging_{k}"] = {
            "sigma_range": f"{rng.randint(1, 20) / 100} m", "reach": {"max": "400 m"},
            "sigma_bearing": f"{rng.randint(1, 9) / 100} deg", "medium": "air",
        }  # fmt: skip
    for name, one in sensors.items():
        one |= {"modality": name.split("_")[0], "type": "made", "primitives": ["pps"]}
        one |= {"cost": f"{rng.choice([1, 2, 2, 3, 4]) * 100} EUR"}
    methods: Raw = {
        f"method_{k}": {
            "primitives": ["pps"], "timeline": "host", "cost": f"{cost} EUR",
            "error": {"distribution": "uniform", "low": f"-{tau:.9f} s", "high": f"{tau:.9f} s"},
        }
        for k, (tau, cost) in enumerate([(0.00001, 100), (0.0003, 100), (0.002, 0)])
    }  # fmt: skip
    stage: Raw = {
        "name": "uav",
        "platform": {"v_max": "10 m/s", "omega_max": "20 deg/s", "distance": "50 m",
                     "baseline": "1 m", "medium": "air"},
    }  # fmt: skip
    for role in ("position", "attitude", "ranging"):
        stage[role] = {"candidates": [one for one in sensors if one.startswith(role)]}
    missions = [
        {
            "name": f"m{m}",
            "stages": {"uav": {"distance": f"{rng.choice([20, 40, 60, 90])} m",
                               "v_max": f"{rng.choice([5, 10, 20])} m/s"}},
            "requirements": {"A": f"{rng.choice([0.4, 0.6, 0.9, 1.2])} m"},
        }
        for m in range(rng.choice([2, 3]))
    ]  # fmt: skip
    spec: Raw = {
        "syncline": 1, "name": f"family {seed}", "catalogs": ["parts.yaml"],
        "requirements": [{"id": "A", "kind": "accuracy", "limit": "1 m"}],
        "stages": [stage], "timestamping": {"candidates": [*methods]}, "missions": missions,
    }  # fmt: skip
    return spec, {"sensors": sensors, "timestamping": methods}


def written(folder: Path, spec: Raw, parts: Raw) -> Path:
    (folder / "parts.yaml").write_text(json.dumps(parts), "utf-8")
    path = folder / "spec.yaml"
    path.write_text(json.dumps(spec), "utf-8")
    return path


class Tried:
    """Every payload of a family with its price, and the missions that it keeps."""

    def __init__(self, spec: Raw, parts: Raw) -> None:
        shared = read_catalog()
        catalog = {**parts, "platforms": shared["platforms"], "infrastructure": {}, "clocks": {}}
        self.good: dict[Names, tuple[float, float]] = {}  # cost, largest error
        self.kept: list[dict[Names, Any]] = []
        for mission in spec["missions"]:
            own = copy.deepcopy({key: value for key, value in spec.items() if key != "missions"})
            own["stages"][0]["platform"] |= mission["stages"]["uav"]
            limit = number(mission["requirements"]["A"])
            self.kept.append({
                tuple((o.sensor, o.primitive, o.method) for o in one.options): one
                for one in Enumeration(own, catalog=catalog)
                if one.total_m <= limit * (1 + 1e-12) and one.sync < 1.0
            })  # fmt: skip
        for names in set.intersection(*map(set, self.kept)):
            errors = [own[names].total_m for own in self.kept]
            self.good[names] = (self.kept[0][names].cost, max(errors))

    def best(self) -> Names | None:
        """The cheapest, of the cheapest the one that errs least."""
        order = sorted(self.good, key=lambda one: (self.good[one][0], self.good[one][1]))
        return order[0] if order else None


def is_tied(tried: Tried) -> bool:
    """Whether there is no payload, or price and error do not tell which comes first."""
    best = tried.best()
    return best is None or any(
        payload(one) != payload(best)
        and tried.good[one][0] == tried.good[best][0]
        and abs(tried.good[one][1] / tried.good[best][1] - 1) < 1e-9
        for one in tried.good
    )


def payload(names: Names | None) -> tuple[tuple[str, str], ...] | None:
    """Sensor and method of each role."""
    return None if names is None else tuple((sensor, method) for sensor, _, method in names)


def grown(spec: Raw, parts: Raw, row: Any, value: float) -> tuple[Raw, Raw]:
    """Spec and catalog with the figure of a row of the slack ledger at another value."""
    spec, parts = copy.deepcopy(spec), copy.deepcopy(parts)
    share, where = value / row.value, row.term.split()
    chosen = {role: (sensor, method) for role, sensor, method in row.payload}
    if where[0] in chosen:
        sensor, method = chosen[where[0]]
        if where[1] == "sensor":
            entry = parts["sensors"][sensor]
            for key in [key for key in entry if key.startswith("sigma")]:
                size, unit = entry[key].split()
                entry[key] = f"{float(size) * share:.15f} {unit}"
            return spec, parts
        # In this role alone: a method of the same price that only it may use.
        parts["timestamping"]["grown"] = copy.deepcopy(parts["timestamping"][method])
        parts["timestamping"]["grown"]["error"] |= {"low": f"-{value:.15f} s",
                                                    "high": f"{value:.15f} s"}  # fmt: skip
        every = ["grown" if one == method else one for one in spec["timestamping"]["candidates"]]
        spec["stages"][0][where[0]]["timestamping"] = {"candidates": every}
        return spec, parts
    key = {"speed": "v_max", "distance": "distance", "turn": "omega_max"}[where[0]]
    unit = {"v_max": "m/s", "distance": "m", "omega_max": "deg/s"}[key]
    size = value * (57.29577951308232 if key == "omega_max" else 1.0)
    mission = next(one for one in spec["missions"] if one["name"] == row.mission)
    mission["stages"]["uav"][key] = f"{size:.15f} {unit}"
    return spec, parts


def sheet_figures(parts: Raw) -> list[tuple[str, str]]:
    """(sensor, key) of every datasheet figure."""
    return list(itertools.chain.from_iterable(
        [(name, key) for key in entry if key.startswith("sigma")]
        for name, entry in parts["sensors"].items()
    ))  # fmt: skip
