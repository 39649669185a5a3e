"""What would let missions share a payload: against every payload tried, mission by mission."""

from __future__ import annotations

import math
import random
from pathlib import Path
from typing import Any

import pytest
import yaml

from checked import check_file
from plain_enumeration import Enumeration, number
from syncline_design.choice.outcome import Fix
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.render_console import console
from syncline_design.verdict.verify import CheckSettings
from test_missions import written_out

QUICK = CheckSettings(monte_carlo=False)
ROLES = {
    "position": ["ublox_f9p_pvt", "ublox_f9p_rtk", "trimble_r12_rtk"],
    "attitude": ["vectornav_vn200", "sbg_ellipse_d", "sbg_apogee"],
    "ranging": ["livox_mid360", "livox_tele15", "hesai_xt32m", "riegl_vux1uav"],
}


def _spec(seed: int) -> dict[str, Any]:
    """Two or three missions whose limits are a little too tight, for one of them or for all."""
    rng = random.Random(seed)
    stage: dict[str, Any] = {"name": "uav", "platform": "uav_fixed_wing"}
    for role, names in ROLES.items():
        stage[role] = {"candidates": rng.sample(names, 2)}
    missions = [
        {
            "name": f"m{m}",
            "stages": {"uav": {"distance": f"{rng.choice([20, 35, 60, 110])} m"}},
            "requirements": {"ACC": f"{rng.choice([0.15, 0.22, 0.3, 0.5])} m"},
        }
        for m in range(rng.choice([2, 3]))
    ]
    return {
        "syncline": 1, "name": "tight",
        "requirements": [
            {"id": "ACC", "kind": "accuracy", "limit": "1 m"},
            {"id": "COST", "kind": "cost", "limit": f"{rng.choice([8, 12, 20, 35])}000 EUR"},
        ],
        "stages": [stage], "timestamping": {"candidates": ["hardware", "gpio"]},
        "missions": missions,
    }  # fmt: skip


def _least(spec: dict[str, Any]) -> dict[tuple[str | None, str], float]:
    """Of each limit the least that some payload keeps with every other met; absent: none does."""
    tried: dict[Any, dict[str, tuple[float, float]]] = {}
    limits = {}
    for name, own in written_out(spec).items():
        limits[name] = number(own["requirements"][0]["limit"])
        for one in Enumeration(own):
            if one.sync < 1.0:
                key = tuple((o.sensor, o.primitive, o.method) for o in one.options)
                tried.setdefault(key, {})[name] = (one.total_m, one.cost)
    every = [found for found in tried.values() if len(found) == len(limits)]
    budget = number(spec["requirements"][1]["limit"])
    out: dict[tuple[str | None, str], float] = {}
    accurate = [f for f in every if all(f[m][0] <= limits[m] for m in limits)]
    if accurate:
        out[None, "COST"] = min(next(iter(f.values()))[1] for f in accurate)
    for mission in limits:
        rest = [
            found[mission][0]
            for found in every
            if next(iter(found.values()))[1] <= budget
            and all(found[m][0] <= limits[m] for m in limits if m != mission)
        ]
        if rest:
            out[mission, "ACC"] = min(rest)
    return out


def _place(fix: Fix) -> tuple[str | None, str]:
    return (None if fix.requirement == "COST" else fix.mission, fix.requirement or "")


@pytest.mark.parametrize("seed", [1, 2, 5, 13, 16])
def test_limits_are_moved_as_far_as_enumeration_says(seed: int, tmp_path: Path) -> None:
    spec = _spec(seed)
    path = tmp_path / "tight.yaml"
    path.write_text(yaml.safe_dump(spec, sort_keys=False), "utf-8")
    found = check_file(path, QUICK)
    least = _least(spec)
    if found.verdict == "meets":
        assert least[None, "COST"] <= number(spec["requirements"][1]["limit"])
        return
    assert found.infeasibility is not None
    fixes = [one for one in found.infeasibility.fixes if one.kind in ("cost", "accuracy")]
    by_itself = any("by itself" in one.text for one in fixes)
    told = {} if by_itself else {_place(one): one.to for one in fixes}
    assert set(told) == set(least)
    for place, value in least.items():
        to = told[place]
        assert to is not None
        step = 1.0 if place[1] == "COST" else 10.0 ** (math.floor(math.log10(value)) - 2)
        assert value * (1.0 - 1e-12) <= to <= value + step


def test_who_cannot_share_is_said_with_what_helps(tmp_path: Path) -> None:
    spec = _spec(0) | {"timestamping": {"candidates": ["hardware", "gpio", "ptp"]}}
    stage = spec["stages"][0]
    stage["ranging"] = {"candidates": ["livox_tele15", "hesai_xt32m", "riegl_vux1uav"]}
    spec["requirements"][0]["limit"], spec["requirements"][1]["limit"] = "2 m", "30000 EUR"
    spec["missions"] = [
        {"name": "near", "stages": {"uav": {
            "distance": "30 m", "ranging": {"candidates": ["livox_tele15", "riegl_vux1uav"]}}}},
        {"name": "far", "stages": {"uav": {
            "distance": "80 m", "ranging": {"candidates": ["hesai_xt32m", "riegl_vux1uav"]}}}},
    ]  # fmt: skip
    stage["position"] = {"candidates": ["ublox_f9p_rtk"]}
    stage["attitude"] = {"candidates": ["vectornav_vn200", "sbg_ellipse_d"]}
    path = tmp_path / "split.yaml"
    path.write_text(yaml.safe_dump(spec, sort_keys=False), "utf-8")
    found = check_file(path, QUICK)
    why = found.infeasibility
    assert why is not None
    assert why.missions == ("near", "far")
    assert [one.id for one in why.conflict.requirements] == ["COST"]
    assert why.conflict.minimal
    kinds = [(one.kind, one.figure, one.mission) for one in why.fixes]
    assert ("missions", "per_mission", None) in kinds
    assert ("missions", None, "near") in kinds
    text = console(on_verdict(found))
    assert "No one payload meets the missions near and far together" in text
    # the fix as it is told: a sensor of its own in each mission
    stage["ranging"]["per_mission"] = True
    path.write_text(yaml.safe_dump(spec, sort_keys=False), "utf-8")
    assert check_file(path, QUICK).verdict == "meets"
