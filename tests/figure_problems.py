"""Random problems of choice under figures of the error, as specs with catalogs of their own."""

from __future__ import annotations

import json
import math
import random
from pathlib import Path
from typing import Any

Raw = dict[str, Any]
DEGREE = math.pi / 180.0


def drawn(seed: int, kinds: tuple[str, ...]) -> Raw:
    """Isotropic sensors by role, all dearer the better but for chance; level, without arms."""
    rng = random.Random(seed)
    sizes = {"position": (0.01, 0.3), "attitude": (0.02, 1.0), "ranging": (0.01, 0.2)}
    sensors: Raw = {}
    for role, (least, most) in sizes.items():
        for k in range(rng.randint(2, 4)):
            sigma = round(math.exp(rng.uniform(math.log(least), math.log(most))), 4)
            bearing = round(math.exp(rng.uniform(math.log(0.02), math.log(0.8))), 4)
            cost = max(1, int(rng.uniform(50, 100) / sigma))
            sensors[f"{role}{k}"] = {"role": role, "sigma": sigma, "bearing": bearing, "cost": cost}
    return {
        "sensors": sensors, "d": rng.choice([5.0, 20.0, 60.0]), "v": 2.0, "w": 10.0,
        "methods": {"good": (1e-6, rng.randint(1, 900)), "fair": (2e-5, rng.randint(1, 90))},
        "requirements": [(kind, round(rng.uniform(0.05, 0.8), 4)) for kind in kinds],
    }  # fmt: skip


WRITTEN = {"rmse": {"axis": "3d"}, "quantile": {"of": "3d", "p": 0.95}}


def written(raw: Raw, folder: Path) -> str:
    """The same as a spec; its catalog goes into the folder."""
    sensors, roles = {}, {}
    for name, one in raw["sensors"].items():
        entry: Raw = {"modality": one["role"], "primitives": ["pps"], "cost": f"{one['cost']} EUR"}
        if one["role"] == "position":
            entry["sigma_position"] = f"{one['sigma']} m"
        elif one["role"] == "attitude":
            entry["sigma_attitude"] = f"{one['sigma']} deg"
        else:
            entry |= {"sigma_range": f"{one['sigma']} m", "sigma_bearing": f"{one['bearing']} deg"}
        sensors[name] = entry
        roles.setdefault(one["role"], {"candidates": []})["candidates"].append(name)
    methods = {
        name: {"primitives": ["pps"], "timeline": "host", "cost": f"{cost} EUR",
               "error": {"distribution": "uniform", "low": f"{-tau} s", "high": f"{tau} s"}}
        for name, (tau, cost) in raw["methods"].items()
    }  # fmt: skip
    (folder / "own.yaml").write_text(json.dumps({"sensors": sensors, "timestamping": methods}))
    wanted = [
        {"id": f"R{k}", "kind": kind, "limit": f"{limit} m", **WRITTEN.get(kind, {})}
        for k, (kind, limit) in enumerate(raw["requirements"])
    ]
    platform = {"v_max": f"{raw['v']} m/s", "omega_max": f"{raw['w']} deg/s",
                "distance": f"{raw['d']} m", "baseline": "0 m"}  # fmt: skip
    return json.dumps({
        "syncline": 1, "name": "choice under figures", "catalogs": ["own.yaml"],
        "requirements": [*wanted, {"id": "S", "kind": "sync", "limit": 1000.0}],
        "horizon": {"tilt": "0 deg"}, "timestamping": {"candidates": list(methods)},
        "stages": [{"name": "uav", "platform": platform, **roles}],
    })  # fmt: skip


def rmse_3d_m(raw: Raw, names: tuple[str, str, str]) -> float:
    """Root mean square of the 3D error, level, isotropic noise, by hand [m].

    E |e|^2 = 3 s_p^2 + 2 (s_Theta d)^2 + s_r^2 + 2 (s_u d)^2 looking level; timestamps of 20 us at
    2 m/s and 10 deg/s add some 0.1 mm, less than 0.01 % of the limits that are drawn.
    """
    position, attitude, ranging = (raw["sensors"][name] for name in names)
    square = 3.0 * position["sigma"] ** 2 + ranging["sigma"] ** 2
    square += 2.0 * (attitude["sigma"] * DEGREE * raw["d"]) ** 2
    return math.sqrt(square + 2.0 * (ranging["bearing"] * DEGREE * raw["d"]) ** 2)
