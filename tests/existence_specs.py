"""Random specs in which much cannot exist: reach, media, GNSS, views, depths, temperatures, sales.

A spec is plain data with a catalog of its own, so that an oracle reads the same text.
"""

from __future__ import annotations

import json
import random
from pathlib import Path
from typing import Any

from plain_enumeration import CATALOGS as CATALOGS

Raw = dict[str, Any]
DISTANCES = (2, 5, 20, 40, 41, 70, 120, 500)
RATES = (0.5, 1, 5, 10, 50)


def some(rng: random.Random, share: float, facts: Raw) -> Raw:
    """Each of some facts with a chance of its own."""
    return {key: make() for key, make in facts.items() if rng.random() < share}


def interval(rng: random.Random, least: int, most: int, unit: str, widest: int) -> str:
    low = rng.randint(least, most)
    return f"{low} {unit} .. {low + rng.randint(0, widest)} {unit}"


def view(rng: random.Random, wide: bool) -> Raw:
    found = {}
    if rng.random() < 0.8:
        found["azimuth"] = interval(rng, -180, 180, "deg", 360 if wide else 120)
    if rng.random() < 0.5 or not found:
        found["elevation"] = interval(rng, -90, 0, "deg", 90 if wide else 40)
    return found


def lifecycle(rng: random.Random) -> Raw:
    status = rng.choice(["active", "active", "discontinued", "announced"])
    return {"status": status, "read": "2026-11-22"}


def reach(rng: random.Random) -> Raw:
    near, far = sorted(rng.sample(DISTANCES, 2))
    found: Raw = {}
    if rng.random() < 0.4:
        found["min"] = f"{near} m"
    if rng.random() < 0.85 or not found:
        found["max"] = f"{far} m"
        if rng.random() < 0.4:
            found["max"] = {"10 %": f"{(near + far) / 2:g} m", "50 %": f"{far} m"}
        elif rng.random() < 0.3:
            found["at"] = "20 % reflectivity"
    return found


def product(rng: random.Random, share: float) -> Raw:
    warmth = {"temperature": lambda: interval(rng, -30, 0, "degC", 60)}
    return some(rng, share, {**warmth, "lifecycle": lambda: lifecycle(rng)})


def sensor(rng: random.Random, role: str, primitives: list[str]) -> Raw:
    """A sensor, the dearer the better, with some of its facts."""
    noise = rng.choice([0.01, 0.03, 0.1, 0.3])
    sigma: Raw = {
        "position": {"sigma_position": f"{noise} m"},
        "attitude": {"sigma_attitude": f"{noise} deg"},
        "ranging": {"sigma_range": f"{noise} m", "sigma_bearing": f"{noise} deg"},
    }[role]
    entry: Raw = {
        "modality": role, "primitives": primitives, "cost": f"{rng.randint(1, 40) * 100} EUR",
        **sigma, **product(rng, 0.4),
    }  # fmt: skip
    entry |= some(rng, 0.4, {"depth_rating": lambda: f"{rng.choice([10, 100, 300])} m"})
    if role == "position":
        entry["type"] = rng.choice(["gnss", "lbl", "GNSS/INS", "total station"])
    if role == "ranging":
        entry["type"] = rng.choice(["lidar", "mbes", "usbl"])
        entry |= some(
            rng, 0.6,
            {
                "reach": lambda: reach(rng),
                "medium": lambda: rng.choice(["air", "water", "both"]),
                "field_of_view": lambda: view(rng, True),
                "rate": lambda: f"{rng.choice(RATES)} Hz",
            },
        )  # fmt: skip
    return entry


def stage(rng: random.Random, index: int, roles: tuple[str, ...], parts: Raw) -> Raw:
    platform: Raw = {
        "v_max": f"{rng.choice([1, 3, 10])} m/s", "omega_max": f"{rng.choice([1, 10, 40])} deg/s",
        "distance": f"{rng.choice(DISTANCES)} m", "baseline": "1 m",
    }  # fmt: skip
    platform |= some(rng, 0.7, {"medium": lambda: rng.choice(["air", "water", "both"])})
    found: Raw = {"name": f"s{index}", "platform": platform}
    found |= some(
        rng, 0.25,
        {
            "medium": lambda: rng.choice(["air", "water"]),
            "gnss": lambda: rng.choice(["yes", "no", True, False]),
            "depth": lambda: f"{rng.choice([0, 5, 50, 200])} m",
            "look": lambda: view(rng, False),
            "temperature": lambda: interval(rng, -20, 20, "degC", 15),
            "reflectivity": lambda: rng.choice(["5 %", "20 %", "60 %"]),
        },
    )  # fmt: skip
    for role in roles:
        known = [name for name, one in parts["sensors"].items() if one["modality"] == role]
        found[role] = {"candidates": rng.sample(known, rng.randint(1, len(known)))}
    if rng.random() < 0.4:
        found["clock"] = {"candidates": rng.sample(list(parts["clocks"]), rng.randint(1, 2))}
    return found


def drawn(seed: int, chains: bool = True) -> tuple[Raw, Raw]:
    """One random spec and its catalog."""
    rng = random.Random(seed)
    parts: Raw = {"sensors": {}, "timestamping": {}, "clocks": {}, "infrastructure": {}}
    for role, count in (("position", 3), ("attitude", 3), ("ranging", 5)):
        for k in range(count):
            primitives = rng.choice([["pps"], ["pps", "trigger"], ["trigger"]])
            parts["sensors"][f"{role}_{k}"] = sensor(rng, role, primitives)
    parts["infrastructure"]["board"] = {"channels": 2, "cost": "90 EUR", **product(rng, 0.3)}
    for k, tau in enumerate(rng.sample([1e-4, 1e-3, 1e-2, 0.1], 3)):
        entry: Raw = {
            "primitives": rng.choice([["pps"], ["pps", "trigger"], ["arrival"]]),
            "error": {"distribution": "uniform", "low": f"-{tau:.9f} s", "high": f"{tau:.9f} s"},
            "timeline": rng.choice(["host", "utc"]), "cost": f"{rng.randint(0, 9) * 10} EUR",
            **product(rng, 0.25), **some(rng, 0.3, {"needs": lambda: ["gnss"]}),
            **some(rng, 0.4, {"requires": lambda: {"board": 1}}),
        }  # fmt: skip
        parts["timestamping"][f"method_{k}"] = entry
    for k in range(2):
        error = {"distribution": "normal", "mean": "0 ms", "std": f"{rng.choice([0.01, 1])} ms"}
        parts["clocks"][f"clock_{k}"] = {
            "offset": error, "cost": f"{k * 50} EUR", **product(rng, 0.3),
            **some(rng, 0.3, {"needs": lambda: ["gnss"]}),
        }  # fmt: skip
    stages = [stage(rng, 0, ("position", "attitude", "ranging"), parts)]
    if chains and rng.random() < 0.25:
        stages.append(stage(rng, 1, ("attitude", "ranging"), parts))
        if rng.random() < 0.5:
            stages[1]["timing_from"] = "s0"
    spec: Raw = {
        "syncline": 1, "name": f"existence {seed}", "catalogs": ["parts.yaml"],
        "requirements": [
            {"id": "A", "kind": "accuracy", "limit": f"{rng.choice([0.5, 2, 10, 100])} m"},
            {"id": "S", "kind": "sync", "limit": rng.choice([1.0, 3.0, 30.0])},
        ],
        "stages": stages, "timestamping": {"candidates": list(parts["timestamping"])},
        **some(rng, 0.15, {"strict_facts": lambda: True, "allow_discontinued": lambda: "yes"}),
    }  # fmt: skip
    if rng.random() < 0.2:
        spec["sync_model"] = "per_sensor"
    if rng.random() < 0.35:
        limit = f"{rng.choice([0.1, 0.2, 0.6, 1, 2, 6])} m"
        spec["requirements"].append({"id": "G", "kind": "sample_spacing", "limit": limit})
    return spec, parts


def written(folder: Path, spec: Raw, parts: Raw) -> Path:
    (folder / "parts.yaml").write_text(json.dumps(parts))
    path = folder / "spec.yaml"
    path.write_text(json.dumps(spec, indent=1))
    return path
