"""A family's front over a figure of the error, against its closed form for every payload.

A position alone, level motion at v_max in any direction: noise sigma on each axis, a uniform
timestamp error of +-tau.  Root mean square in space: sqrt(3 sigma^2 + (v tau)^2 / 3).
"""

from __future__ import annotations

import csv
import io
import itertools
import math
from pathlib import Path

import pytest

from family_specs import Raw, written
from syncline_design.report.optimizations import render_optimize
from syncline_design.spec.load import BadInput, load
from syncline_design.verdict.optimize import OptimizeSettings, optimize

SIGMA_M = {"poor": 0.20, "fair": 0.10, "fine": 0.02}
PRICE = {"poor": 100, "fair": 300, "fine": 300, "slow": 0, "quick": 150}
TAU_S = {"slow": 0.01, "quick": 0.0001}
SPEEDS = {"slow water": 1.0, "transit": 8.0}


def family() -> tuple[Raw, Raw]:
    sensors = {
        name: {"modality": "position", "type": "made", "sigma_position": f"{sigma} m",
               "primitives": ["pps"], "cost": f"{PRICE[name]} EUR"}
        for name, sigma in SIGMA_M.items()
    }  # fmt: skip
    methods = {
        name: {"primitives": ["pps"], "cost": f"{PRICE[name]} EUR",
               "error": {"distribution": "uniform", "low": f"-{tau} s", "high": f"{tau} s"}}
        for name, tau in TAU_S.items()
    }  # fmt: skip
    platform = {"v_max": "1 m/s", "omega_max": "0 deg/s", "distance": "1 m", "baseline": "1 m"}
    stage = {"name": "boat", "platform": platform, "position": {"candidates": [*sensors]}}
    spec: Raw = {
        "syncline": 1, "name": "tracks", "catalogs": ["parts.yaml"],
        "requirements": [{"id": "S", "kind": "sync", "limit": 100.0}],
        "stages": [stage], "timestamping": {"candidates": [*methods]},
        "missions": [
            {"name": name, "stages": {"boat": {"v_max": f"{speed} m/s"}}}
            for name, speed in SPEEDS.items()
        ],
    }  # fmt: skip
    return spec, {"sensors": sensors, "timestamping": methods}


def closed_form() -> list[tuple[float, float]]:
    """Price and the larger of both missions' figures, of payloads that nothing dominates."""
    every = sorted(
        (
            PRICE[sensor] + PRICE[method],
            max(math.sqrt(3 * SIGMA_M[sensor] ** 2 + (v * TAU_S[method]) ** 2 / 3)
                for v in SPEEDS.values()),
        )
        for sensor, method in itertools.product(SIGMA_M, TAU_S)
    )  # fmt: skip
    out: list[tuple[float, float]] = []
    for price, figure in every:
        if not out or figure < out[-1][1]:
            out.append((float(price), figure))
    return out


def test_each_point_is_the_largest_figure_of_any_mission(tmp_path: Path) -> None:
    case = load(written(tmp_path, *family()))
    found = optimize(case, OptimizeSettings(pareto=True, figure="rmse"))
    points = [(one.cost, one.figure_m) for one in found.result.front or ()]
    wanted = closed_form()
    assert len(wanted) >= 3
    assert [price for price, _ in points] == [price for price, _ in wanted]
    assert [f for _, f in points] == pytest.approx([f for _, f in wanted], rel=2e-3)
    assert found.result.front_figure == "RMS of 3D errors"
    rows = list(csv.DictReader(io.StringIO(render_optimize("csv", found))))
    assert [float(row["figure_m"]) for row in rows] == [figure for _, figure in points]
    steps = [step.tightest_m for step in found.result.staircase or ()]
    assert steps == pytest.approx([f for _, f in wanted], rel=2e-3)


def test_intervals_have_no_such_front(tmp_path: Path) -> None:
    spec, parts = family()
    case = load(written(tmp_path, spec | {"choose_for": "always"}, parts))
    with pytest.raises(
        BadInput, match=r"spec.yaml:1:\d+.* drawn for designs chosen at given figures"
    ):
        optimize(case, OptimizeSettings(pareto=True, figure="rmse"))
