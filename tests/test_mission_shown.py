"""Of several missions: whose ledger and figures are shown, and which limit stands beside them."""

from __future__ import annotations

from pathlib import Path

import pytest

import syncline_design as sd
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.render_html import html
from syncline_design.report.verdict_charts import shown_mission, tightest_limit
from syncline_design.verdict.tree import Verdict

SPEC = """\
syncline: 1
name: Two missions, one price
requirements:
  - {id: ACC-1, kind: accuracy, limit: 0.60 m}
  - {id: COST-1, kind: cost, limit: 61000 EUR}
stages:
  - name: uav
    platform: {use: uav_fixed_wing, distance: 60 m}
    position: {sensor: ublox_f9p_rtk, primitive: pps, timestamping: hardware}
    attitude: {sensor: sbg_apogee, primitive: pps, timestamping: hardware}
    ranging: {sensor: velodyne_hdl32e, primitive: pps, timestamping: hardware}
missions:
  - {name: wide, stages: {uav: {distance: 60 m}}, requirements: {ACC-1: 0.6 m}}
  - {name: near, stages: {uav: {distance: 10 m}}, requirements: {ACC-1: NEAR}}
"""


@pytest.mark.parametrize(
    ("near", "shown", "limit_m"),
    [
        ("0.07 m", "near", 0.07),  # 62.7 mm, 10 % to spare; `wide` has 189 mm of 0.6 m
        ("0.5 m", "wide", 0.6),
        ("0.06 m", "near", 0.06),  # missed
    ],
)
def test_the_mission_nearest_to_its_own_limit_is_shown_beside_that(
    tmp_path: Path, near: str, shown: str, limit_m: float
) -> None:
    """The limit on cost, 0.4 % away, is the same in both and chooses neither."""
    path = tmp_path / "two.yaml"
    path.write_text(SPEC.replace("NEAR", near), encoding="utf-8")
    verdict = sd.check(path)
    assert isinstance(verdict, Verdict)
    found, limit = shown_mission(verdict), tightest_limit(verdict, "accuracy")
    assert found is not None
    assert limit is not None
    assert (found.name, limit.limit) == (shown, limit_m)
    assert verdict.syncline == found.syncline
    page = html(on_verdict(verdict))
    assert page.count(f"Of mission {shown}.") >= 4  # ledger, tau, distribution, figures
    told = next(one.message for one in verdict.warnings if one.code == "mission-shown")
    assert f"those of mission {shown}, the one nearest to a limit of its own" in told
