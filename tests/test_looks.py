"""Where a stage looks bounds the line of sight of figures and samples."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.model.horizon import Horizon
from syncline_design.model.system import Look, Platform, Sensor, Stage, System
from syncline_design.model.timing import NO_ERROR
from syncline_design.simulation.draws import sight
from syncline_design.simulation.statistical import Wanted, statistical_figures
from syncline_design.spec.load import load_text
from syncline_design.verdict.verify import CheckSettings, check_loaded

DEGREE = math.pi / 180.0
THU, TVU = Wanted("horizontal", 0.95), Wanted("vertical", 0.95)
Q = 1.959964


def sonar(look: Look | None, attitude: tuple[float, float, float], along: float) -> System:
    """A level vehicle with arms of no length, its object 50 m away."""
    stage = Stage(
        "boat", "boat", Platform(0.0, 0.0, 50.0, 0.0),
        Sensor("gnss", "position", (0.0, 0.0, 0.0), NO_ERROR, lever_arm_m=(0.0, 0.0, 0.0)),
        Sensor("ins", "attitude", attitude, NO_ERROR),
        Sensor("mbes", "ranging", (along, 0.0, 0.0), NO_ERROR, lever_arm_m=(0.0, 0.0, 0.0)),
        look=look,
    )  # fmt: skip
    return System((stage,), horizon=Horizon(tilt_rad=0.0))


def figures(system: System) -> list[float]:
    return [found.value_m for found in statistical_figures(system, (THU, TVU), seed=0)]


def test_range_noise_counts_only_along_what_is_looked_at() -> None:
    """s_r cos(el) level, s_r sin|el| vertically: largest at the ends of the elevations."""
    down = Look(elevation=(-90.0 * DEGREE, -60.0 * DEGREE))
    level, vertical = figures(sonar(down, (0.0, 0.0, 0.0), 0.1))
    assert level == pytest.approx(Q * 0.1 * math.cos(60.0 * DEGREE), rel=1e-3)
    assert vertical == pytest.approx(Q * 0.1, rel=1e-3)
    flat = Look(elevation=(-20.0 * DEGREE, 10.0 * DEGREE))
    level, vertical = figures(sonar(flat, (0.0, 0.0, 0.0), 0.1))
    assert level == pytest.approx(Q * 0.1, rel=1e-3)
    assert vertical == pytest.approx(Q * 0.1 * math.sin(20.0 * DEGREE), rel=1e-3)


def test_roll_counts_where_the_object_is_abeam() -> None:
    """Roll noise lifts an object at azimuth az, elevation el by d cos(el) |sin az| s_roll."""
    ahead = Look((-10.0 * DEGREE, 30.0 * DEGREE), (-40.0 * DEGREE, -20.0 * DEGREE))
    _, vertical = figures(sonar(ahead, (0.01, 0.0, 0.0), 1e-6))
    by_hand = 50.0 * math.cos(20.0 * DEGREE) * math.sin(30.0 * DEGREE) * 0.01
    assert vertical == pytest.approx(Q * by_hand, rel=1e-3)
    _, anywhere = figures(sonar(None, (0.01, 0.0, 0.0), 1e-6))
    assert anywhere == pytest.approx(Q * 0.5, rel=1e-3)


def test_samples_are_spread_evenly_over_what_is_looked_at() -> None:
    look = Look((170.0 * DEGREE, 200.0 * DEGREE), (-80.0 * DEGREE, -10.0 * DEGREE))
    share = np.random.default_rng(3).random((2, 100_000))
    x, y, z = sight(look, *share)
    assert np.allclose(x * x + y * y + z * z, 1.0)
    azimuth, elevation = np.degrees(np.arctan2(y, x)) % 360.0, -np.degrees(np.arcsin(z))
    assert azimuth.min() >= 170.0 - 1e-9
    assert azimuth.max() <= 200.0 + 1e-9
    assert elevation.min() >= -80.0 - 1e-9
    assert elevation.max() <= -10.0 + 1e-9
    ends = np.sin(np.radians([10.0, 80.0]))
    assert z.mean() == pytest.approx(ends.mean(), abs=3e-3)  # heights are uniform
    assert np.median(azimuth) == pytest.approx(185.0, abs=0.3)


SPEC: dict[str, Any] = {
    "syncline": 1, "name": "looks down",
    "requirements": [{"id": "ACC-1", "kind": "accuracy", "limit": "9 m"},
                     {"id": "TVU-1", "kind": "tvu", "limit": "9 m"}],
    "stages": [{
        "name": "boat", "gnss": True,
        "platform": {"v_max": "2 m/s", "omega_max": "5 deg/s", "distance": "50 m",
                     "baseline": "1 m"},
        "position": {"sensor": {"modality": "position", "sigma_position": "2 cm",
                                "primitives": []}},
        "attitude": {"sensor": {"modality": "attitude", "sigma_attitude": "0.3 deg",
                                "primitives": []}},
        "ranging": {"sensor": {"modality": "ranging", "type": "lidar", "sigma_range": "2 cm",
                               "sigma_bearing": "0.1 deg", "primitives": []}},
    }],
}  # fmt: skip


def test_a_spec_that_looks_down_is_told_less_vertical_error(tmp_path: Path) -> None:
    """Level looks make the vertical error of an attitude; looking down half of it remains."""
    raw = json.loads(json.dumps(SPEC))
    stamp = {"error": {"distribution": "constant", "value": "0 s"}}
    stage = raw["stages"][0]
    for role in ("position", "attitude", "ranging"):
        stage[role]["timestamping"] = stamp
    raw["horizon"] = {"tilt": "0 deg"}
    anywhere = told(raw, tmp_path)
    stage["look"] = {"elevation": "-90 deg .. -60 deg"}
    below = told(raw, tmp_path)
    assert below["figures"]["tvu95_m"] < 0.65 * anywhere["figures"]["tvu95_m"]
    x, y, z = below["figures"]["worst_at"][4]["stages"][0]["look"]
    assert z >= math.sin(60.0 * DEGREE) - 1e-9
    assert math.hypot(x, y) <= math.cos(60.0 * DEGREE) + 1e-9
    simulated = below["monte_carlo"]["quantiles"]["0.95"]["value_m"]
    assert simulated <= below["figures"]["quantile95_3d_m"]
    assert below["figures"]["worst_case_m"] == anywhere["figures"]["worst_case_m"]


def told(raw: dict[str, Any], folder: Path) -> dict[str, Any]:
    raw = raw | {"monte_carlo": {"samples": 20000}}
    case = load_text(json.dumps(raw), folder / "s.yaml")
    return check_loaded(case, replace(CheckSettings(), seed=2)).to_json()
