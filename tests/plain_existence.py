"""Whether an entry can be where a spec puts it, from raw YAML: the rules as they are stated.

Independent of the package.  Angles are tried in steps of a tenth of a degree.
"""

from __future__ import annotations

import re
from fractions import Fraction
from typing import Any

RECEIVERS = ("gnss", "gps")
UNITS = {"m": 1.0, "km": 1e3, "degC": 1.0, "deg": 1.0, "%": 0.01, "Hz": 1.0, "m/s": 1.0}
Raw = dict[str, Any]


def figure(text: Any) -> float:
    number, unit = re.fullmatch(r"([-+.0-9eE]+) (\S+)", str(text)).groups()  # type: ignore[union-attr]
    return float(number) * UNITS[unit]


def interval(text: str) -> tuple[float, float]:
    low, high = text.split(" .. ")
    return figure(low), figure(high)


def yes(value: Any) -> bool:
    return value in (True, "yes")


def medium_of(stage: Raw, platform: Raw) -> str | None:
    """The stage's own word; under water it is water; else the platform's."""
    deep = figure(stage.get("depth", "0 m")) > 0
    found: str | None = stage.get("medium") or ("water" if deep else platform.get("medium"))
    return found


def reach_of(sensor: Raw, stage: Raw) -> tuple[float | None, float | None]:
    """(how far it is told to measure, beyond what it surely does not)."""
    far = sensor.get("reach", {}).get("max")
    if far is None:
        return None, None
    rows = {k: figure(v) for k, v in far.items()} if isinstance(far, dict) else {"": figure(far)}
    at = re.search(r"([0-9.]+) ?%", sensor["reach"].get("at", ""))
    if not isinstance(far, dict) and at:
        rows = {at[0]: rows[""]}
    if "reflectivity" not in stage:
        return min(rows.values()), min(rows.values())
    asked = figure(stage["reflectivity"])
    share = {k: 0.0 if not k else float(k.rstrip("% ")) / 100 for k in rows}
    dark = [rows[k] for k in rows if share[k] <= asked + 1e-12]
    bright = [rows[k] for k in rows if share[k] > asked + 1e-12]
    return (max(dark), max(dark)) if dark else (None, min(bright))


def sees(seen: str, asked: str, turns: bool) -> bool:
    (low, high), (first, last) = interval(seen), interval(asked)
    steps = max(1, round((last - first) / 0.1))
    for k in range(steps + 1):
        angle = first + (last - first) * k / steps
        if not any(
            low - 1e-9 <= angle + turn <= high + 1e-9
            for turn in ((-720, -360, 0, 360, 720) if turns else (0,))
        ):
            return False
    return True


def codes_of_sensor(
    sensor: Raw, stage: Raw, platform: Raw, spec: Raw, has_gnss: bool, spacing: float | None = None
) -> list[str]:
    """Every reason against a sensor, the strongest first; spacing: the limit asked, if any."""
    out = []
    ranging = sensor["modality"] == "ranging"
    far, surely = reach_of(sensor, stage)
    distance, path = figure(platform["distance"]), medium_of(stage, platform)
    if ranging:
        near = figure(sensor.get("reach", {}).get("min", "0 m"))
        out += ["reach"] if distance < near or (surely is not None and distance > surely) else []
        out += ["medium"] if {sensor.get("medium"), path} == {"air", "water"} else []
    listens = any(word in sensor.get("type", "").lower() for word in RECEIVERS)
    out += ["gnss"] if (listens or "gnss" in sensor.get("needs", ())) and not has_gnss else []
    look, view = stage.get("look", {}), sensor.get("field_of_view", {})
    if ranging and any(
        axis in look and axis in view and not sees(view[axis], look[axis], axis == "azimuth")
        for axis in ("azimuth", "elevation")
    ):
        out.append("field_of_view")
    if ranging and spacing is not None:
        known = spacing_of(sensor, platform)[0]
        out += ["rate"] if known is not None and known > spacing else []
    depth, rating = figure(stage.get("depth", "0 m")), sensor.get("depth_rating")
    out += ["depth"] if depth > 0 and rating is not None and figure(rating) < depth else []
    out += codes_of_part(sensor, stage, spec)
    if yes(spec.get("strict_facts", False)):
        asked = [("medium", path)] if ranging else []
        asked += [("depth_rating", depth), ("temperature", stage.get("temperature"))]
        silent = any(wanted and key not in sensor for key, wanted in asked)
        silent |= ranging and (far is None or any(axis not in view for axis in look))
        silent |= ranging and spacing is not None and "rate" not in sensor
        out += ["unknown-fact"] if silent else []
    return out


def spacing_of(sensor: Raw, platform: Raw) -> tuple[float | None, bool]:
    """Ground between two samples at v_max [m]; whether the rate is told; echoes take 2 d / c."""
    waits = [1 / exactly(sensor["rate"])] if "rate" in sensor else []
    if sensor.get("type") in ("usbl", "mbes", "single_beam", "imaging_sonar"):
        waits.append(2 * exactly(platform["distance"]) / 1500)
    apart = float(exactly(platform["v_max"]) * max(waits)) if waits else None
    return apart, "rate" in sensor


def exactly(text: str) -> Fraction:
    """A figure in m, Hz or m/s."""
    return Fraction(text.split()[0])


def codes_of_part(entry: Raw, stage: Raw, spec: Raw) -> list[str]:
    """What is asked of everything that is bought."""
    out = []
    if "temperature" in entry and "temperature" in stage:
        (low, high), (cold, hot) = interval(entry["temperature"]), interval(stage["temperature"])
        out += ["temperature"] if cold < low or hot > high else []
    state = entry.get("lifecycle", {}).get("status", "active")
    out += (
        ["discontinued"] if state != "active" and not yes(spec.get("allow_discontinued", 0)) else []
    )
    return out
