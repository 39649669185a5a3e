"""Distances that make a spec feasible: windows, found wherever they lie.

Nearer is more accurate, but with less noise from angles the timestamps have to be better: a design
keeps its limits between two distances.  Both ends follow from linear inequalities in d, worked out
here for every design: E = A + B d, rate = v + w d, tau fixed.
"""

from __future__ import annotations

import itertools
import math
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.spec.load import load_text
from syncline_design.verdict.verify import CheckSettings, check_loaded
from test_choice_conflicts import World, text_of

SPEED, TURN = 4.0, math.radians(6.0)
Window = tuple[float, float]


def below(slope: float, start: float, window: Window) -> Window:
    """The part of a window where start + slope d <= 0."""
    low, high = window
    if slope > 0:
        return low, min(high, -start / slope)
    if slope < 0:
        return max(low, -start / slope), high
    return (low, high) if start <= 0 else (1.0, 0.0)


def windows(world: World, accuracy: float, sync: float) -> list[Window]:
    """Distances at which each design keeps both limits."""
    out = []
    roles = [itertools.product(world.sensors[r], world.methods) for r in world.sensors]
    one_degree = math.radians(1.0)
    for (p, pm), (a, am), (r, rm) in itertools.product(*roles):
        fixed = math.sqrt(3) * p[0] + r[0]
        turning = math.sqrt(3) * a[0] * one_degree
        bearing = math.sqrt(2) * 0.1 * one_degree
        tau = max(pm[0], am[0]) + rm[0]
        if not SPEED * pm[0] < sync * math.sqrt(3) * p[0]:
            continue
        window = (1e-9, math.inf)
        window = below(turning + bearing + TURN * tau, fixed + SPEED * tau - accuracy, window)
        window = below(TURN * tau - sync * (turning + bearing), SPEED * tau - sync * fixed, window)
        window = below(TURN * am[0] - sync * turning, SPEED * am[0], window)
        window = below(TURN * rm[0] - sync * bearing, SPEED * rm[0] - sync * r[0], window)
        if window[0] < window[1]:
            out.append(window)
    return out


def nearest_below(found: list[Window], before: float) -> float | None:
    """Largest distance below the present one inside a window; None: there is none."""
    inside = [min(high, before) for low, high in found if low < before]
    return max(inside, default=None)


def nearest_above(found: list[Window], before: float) -> float | None:
    inside = [max(low, before) for low, high in found if high > before]
    return min(inside, default=None)


def distance_fixes(
    folder: Path, world: World, accuracy: float, sync: float, distance: str
) -> list[dict[str, Any]] | None:
    requirements = [("A", "accuracy", f"{accuracy!r} m"), ("S", "sync", repr(sync))]
    text, own = text_of(world, requirements, distance)
    (folder / "own.yaml").write_text(own)
    verdict = check_loaded(
        load_text(text, folder / "spec.yaml"), CheckSettings(monte_carlo=False)
    ).to_json()
    if verdict["verdict"] == "meets":
        return None
    return [f for f in verdict["infeasibility"]["fixes"] if f["figure"] == "distance"]


def random_case(rng: random.Random) -> tuple[World, float, float]:
    """A world whose feasible distances are a window that a coarse grid easily misses."""

    def figure(low: float, high: float) -> float:
        return float(f"{10 ** rng.uniform(math.log10(low), math.log10(high)):.5g}")

    sensors = {
        "position": [(figure(0.05, 0.5), 1, 1.0) for _ in range(2)],
        "attitude": [(figure(0.02, 0.5), 1, 1.0) for _ in range(rng.randint(1, 2))],
        "ranging": [(figure(0.02, 0.3), 1, 1.0)],
    }
    world = World(sensors, [(figure(0.0005, 0.02), 1) for _ in range(rng.randint(1, 2))])
    sync = float(f"{rng.uniform(0.2, 1.0):.2g}")
    lows = [low for low, _ in windows(world, math.inf, sync)]
    if not lows:
        return random_case(rng)
    low = max(min(lows), 0.5)
    best = min(a for a in (x / 1000 for x in range(1, 20000)) if windows_at(world, a, sync, low))
    return world, float(f"{best * rng.uniform(1.0, 1.05):.4g}"), sync


def windows_at(world: World, accuracy: float, sync: float, low: float) -> bool:
    return any(high >= low for _, high in windows(world, accuracy, sync))


@pytest.mark.parametrize("seed", range(10))
def test_the_nearest_distance_to_either_side_is_found(seed: int, tmp_path: Path) -> None:
    rng = random.Random(seed)
    world, accuracy, sync = random_case(rng)
    found = windows(world, accuracy, sync)
    before = 10 ** rng.uniform(-0.5, 1.7)
    if any(low * 0.98 < before < high * 1.02 for low, high in found):
        before = max(high for _, high in found) * rng.uniform(1.1, 20.0)
    before = float(f"{before:.6g}")
    fixes = distance_fixes(tmp_path, world, accuracy, sync, f"{before!r} m")
    assert fixes is not None
    offered = {"below": None, "above": None}
    for fix in fixes:
        offered["below" if fix["to"] < before else "above"] = fix["to"]
        at = fix["text"].rsplit(" to ", 1)[1]
        assert distance_fixes(tmp_path, world, accuracy, sync, at) is None  # meets
    below_, above = nearest_below(found, before), nearest_above(found, before)
    wide = [(low, high) for low, high in found if high > low * 1.001]
    if below_ is not None and below_ > before * 1.01e-3 and wide:
        assert offered["below"] is not None, (found, before)
        assert below_ * 0.985 <= offered["below"] <= below_ * (1 + 1e-9)
    if below_ is None:
        assert offered["below"] is None
    if above is not None and above < before * 9.9 and wide:
        assert offered["above"] is not None, (found, before)
        assert above * (1 - 1e-9) <= offered["above"] <= above * 1.015
    if above is None:
        assert offered["above"] is None


SIMULATED = """\
syncline: 1
name: distances between a sync limit and a simulated one
catalogs: [own.yaml]
requirements:
  - {id: S, kind: sync, limit: 0.004}
  - {id: Q, kind: monte_carlo, quantile: 0.95, limit: LIMIT m}
stages:
  - name: boat
    platform: {v_max: 5 m/s, omega_max: 0.01 deg/s, distance: BEFORE m, baseline: 1 m}
    position: {candidates: [p], lever_arm: [0 m, 0 m, 0 m]}
    attitude: {candidates: [a]}
    ranging: {candidates: [coarse, fine]}
timestamping: {candidates: [still]}
monte_carlo: {samples: 4000}
"""
SIMULATED_CATALOG = """\
sensors:
  p: {modality: position, sigma_position: 1 cm, primitives: [pps], cost: 1 EUR}
  a: {modality: attitude, sigma_attitude: [TILT, TILT, TILT], primitives: [pps], cost: 1 EUR}
  coarse: {modality: ranging, sigma_range: COARSE m, sigma_bearing: [B, B], primitives: [pps],
    cost: 1 EUR}
  fine: {modality: ranging, sigma_range: 1 mm, sigma_bearing: [B, B], primitives: [pps],
    cost: 2 EUR}
timestamping:
  still: {primitives: [pps], timeline: host, cost: 1 EUR,
    error: {distribution: uniform, low: -10 us, high: 10 us}}
"""


def noise_quantile(distance: float, spread: float, attitude: float, bearing: float) -> float:
    """95 % of |e|: range noise along an isotropic line of sight, the angles' noise across it.

    Timestamps of 10 us at 5 m/s move it by less than 0.1 mm.
    """
    rng = np.random.default_rng(5)
    noise = 0.01 * rng.standard_normal((400_000, 3))
    up = rng.uniform(-1, 1, 400_000)
    noise[:, 0] += spread * rng.standard_normal(400_000)
    sideways = attitude**2 + bearing**2 * (1 - up**2)
    noise[:, 1] += distance * np.sqrt(sideways) * rng.standard_normal(400_000)
    noise[:, 2] += distance * math.hypot(attitude, bearing) * rng.standard_normal(400_000)
    return float(np.quantile(np.linalg.norm(noise, axis=1), 0.95))


def simulated(folder: Path, catalog: dict[str, str], limit: float, before: str) -> dict[str, Any]:
    text, own = SIMULATED, SIMULATED_CATALOG
    text = text.replace("LIMIT", f"{limit:.6g}").replace("BEFORE", before)
    for name, value in catalog.items():
        own = own.replace(name, value)
    (folder / "own.yaml").write_text(own)
    return check_loaded(load_text(text, folder / "spec.yaml"), CheckSettings()).to_json()


def the_distance_fix(verdict: dict[str, Any]) -> tuple[float, str]:
    """The only one: its figure, and the number as it is printed."""
    (fix,) = [f for f in verdict["infeasibility"]["fixes"] if f["figure"] == "distance"]
    return fix["to"], fix["text"].rsplit(" to ")[1].removesuffix(" m")


def test_a_window_between_sync_and_simulation_is_found(tmp_path: Path) -> None:
    """The attitude's tau_crit asks for 5e-5 m / (0.004 sqrt(3) 0.2 deg); 4 % more is simulated."""
    attitude, bearing = math.radians(0.2), math.radians(1e-3)
    nearest = 5e-5 / (0.004 * math.sqrt(3) * attitude)
    limit = noise_quantile(1.04 * nearest, 0.02, attitude, bearing)
    catalog = {"TILT": "0.2 deg", "COARSE": "0.02", "B": "0.001 deg"}
    to, shown = the_distance_fix(simulated(tmp_path, catalog, limit, "200"))
    assert nearest < to < 1.08 * nearest
    assert noise_quantile(to, 0.02, attitude, bearing) < 1.015 * limit
    assert simulated(tmp_path, catalog, limit, shown)["verdict"] == "meets"


def test_a_sensor_that_works_from_afar_helps_against_simulation(tmp_path: Path) -> None:
    """30 cm of range noise fail; the fine sensor's tau_crit asks for 11.5 mm / bearing."""
    attitude, bearing = math.radians(0.6), math.radians(0.3)
    nearest = (5e-5 / 0.004 - 0.001) / (math.sqrt(2) * bearing)
    limit = noise_quantile(1.1 * nearest, 0.001, attitude, bearing)
    catalog = {"TILT": "0.6 deg", "COARSE": "0.3", "B": "0.3 deg"}
    to, shown = the_distance_fix(simulated(tmp_path, catalog, limit, "1"))
    assert nearest < to < 1.02 * nearest
    assert simulated(tmp_path, catalog, limit, shown)["verdict"] == "meets"
