"""The time limit ends a single step of the merge, however many partial designs it compares."""

from __future__ import annotations

import json
import random
from pathlib import Path

import numpy as np
import pytest
import yaml

from syncline_design.choice.pareto import Columns, undominated
from syncline_design.machine.deadline import Deadline, OutOfTime, within
from test_time_limit import run, startup_s

SENSORS, METHODS, STAGES = 12, 9, 3


def entry(draw: random.Random, factor: float) -> dict[str, str]:
    """Amounts of one sensor: nothing that is better in all of them."""
    return {
        "cost": f"{int(2000 / factor) + draw.randint(0, 500)} EUR",
        "mass": f"{draw.randint(5, 900)} g",
        "power": f"{draw.randint(1, 90)} W",
        "source": "made up",
    }


def catalog(draw: random.Random) -> dict[str, object]:
    sensors: dict[str, object] = {}
    for stage in range(STAGES):
        for role in ("position", "attitude", "ranging"):
            for k in range(SENSORS):
                f = 10 ** draw.uniform(-1, 1)
                figures: dict[str, object] = {"sigma_position": f"{f * 0.02:.6f} m"}
                if role == "attitude":
                    figures = {"sigma_attitude": [f"{f:.6f} mrad"] * 3}
                if role == "ranging":
                    figures = {
                        "sigma_range": f"{f * 0.02:.6f} m",
                        "sigma_bearing": [f"{f:.6f} mrad"] * 2,
                    }
                one = {"modality": role, "primitives": ["pps"], **figures, **entry(draw, f)}
                sensors[f"{role}_{stage}_{k}"] = one
    methods = {}
    for k in range(METHODS):
        bound = 10 ** draw.uniform(-1, 3)
        error = {"distribution": "uniform", "low": f"-{bound:.4f} us", "high": f"{bound:.4f} us"}
        amounts = {"cost": f"{draw.randint(1, 90)} EUR", "mass": f"{draw.randint(1, 9)} g"}
        methods[f"m{k}"] = {
            "primitives": ["pps"], "timeline": "host", "error": error, **amounts,
            "power": "0.1 W", "source": "made up",
        }  # fmt: skip
    return {"sensors": sensors, "timestamping": methods}


@pytest.fixture
def limited(tmp_path: Path) -> Path:
    """Seven roles under limits of mass and power: no partial design replaces many others."""
    draw = random.Random(5)
    (tmp_path / "own.yaml").write_text(yaml.safe_dump(catalog(draw)), "utf-8")
    platform = {"name": "p", "v_max": "2 m/s", "omega_max": "20 deg/s", "distance": "20 m"}
    stages = []
    for stage in range(STAGES):
        roles = ("position", "attitude", "ranging")[stage > 0 :]
        own = {r: {"candidates": [f"{r}_{stage}_{k}" for k in range(SENSORS)]} for r in roles}
        stages.append({"name": f"s{stage}", "platform": {**platform, "baseline": "0 m"}, **own})
    spec = {
        "syncline": 1, "name": "limited", "catalogs": ["own.yaml"],
        "requirements": [
            {"id": "A", "kind": "accuracy", "limit": "0.6 m"},
            {"id": "M", "kind": "mass", "limit": "3 kg"},
            {"id": "P", "kind": "power", "limit": "300 W"},
        ],
        "stages": stages,
        "timestamping": {"candidates": [f"m{k}" for k in range(METHODS)]},
    }  # fmt: skip
    path = tmp_path / "limited.yaml"
    path.write_text(yaml.safe_dump(spec, sort_keys=False), "utf-8")
    return path


def test_limit_binds_where_several_amounts_are_limited(limited: Path, tmp_path: Path) -> None:
    """Processor time can only be less than what passes, so a busy machine does not fail this."""
    out = tmp_path / "out.json"
    given = ("optimize", str(limited), "--time-limit", "2", "--quiet", "-o", f"json:{out}")
    code, used, complaint = run(*given)
    assert used < 2.0 + startup_s(), used
    assert "Traceback" not in complaint
    data = json.loads(out.read_text("utf-8"))
    assert (code, data["verdict"]) in {(0, "meets"), (3, "indeterminate")}
    assert code == 3 or (data["proof"]["rechecked"] and data["cut_short"])


@pytest.mark.parametrize("kinds", [8, 500])
def test_comparing_many_rows_looks_at_the_clock(kinds: int) -> None:
    """All rows on one falling line: none replaces another, whatever group it is in."""
    count = 20_000
    rise = np.arange(float(count))
    columns = Columns((rise, np.arange(count) % kinds, rise[::-1].copy()))
    with within(Deadline(0.0)), pytest.raises(OutOfTime):
        undominated(columns)
    small = np.arange(200)
    with within(Deadline(0.0)):
        assert len(undominated(columns.take(small))) == len(small)
