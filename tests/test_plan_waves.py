"""What a ship's drive owes to the waves, what a dear leg is for, and what stays unseen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.planning.drives import outcome, whole_information
from syncline_design.planning.lacking import dear_legs, in_calm_water, lacking
from syncline_design.planning.result import CalmWater, Lacking
from syncline_design.planning.run import plan as planned
from syncline_design.planning.setup import PlanRequest, Setup
from syncline_design.planning.wanted import PlanWanted, reach_of, separate_of
from syncline_design.report.plans import render_plan
from syncline_design.spec.load import load
from tests.test_plan_cut import TRACTOR

MOTION = "motion: ground, minimum_turn_radius: 5 m, acceleration: 0.8 m/s^2"
SHIP = "motion: surface, acceleration: 0.05 m/s^2, minimum_turn_radius: 25 m"
PLACE = "v_max: 4 m/s, omega_max: 25 deg/s"
SLOW = "v_max: 1 m/s, omega_max: 2 deg/s"
PAIR = separate_of("latency(position)=150 ms", "lever_arm(position)")


def barge(folder: Path) -> Path:
    path = folder / "barge.yaml"
    path.write_text(TRACTOR.replace(MOTION, SHIP).replace(PLACE, SLOW), encoding="utf-8")
    return path


def test_a_drive_that_only_the_waves_make_enough_says_so(tmp_path: Path) -> None:
    """One speed on one line and back: latency and forward lever arm are one but for the waves.  By
    theory: on the level a latency L at the speed v is a lever arm of L v, whichever way it heads,
    so that nothing of 150 ms is left but what joints and turns tell."""
    setup = Setup.begun(load(barge(tmp_path)), PlanRequest(PlanWanted((), PAIR), line_plans=False))
    lines = [one for one in setup.told if one.leg.name == "straight line"]
    found = outcome(setup.world, lines * 3)
    calm = in_calm_water(setup, found)
    assert calm is not None
    assert not calm.reached
    assert calm.lacking is not None
    assert calm.lacking.value < 0.2 * 60.0
    level = whole_information(setup.world.calm, found.sequence)
    assert lacking(setup, level) == calm.lacking
    states = setup.world.calm.driven(setup.world.courses_of(0, lines[0].leg.course)).states[0]
    assert np.ptp(states.euler_rad[:, :2]) == 0.0
    assert np.ptp(states.position_m[:, 2]) == 0.0


def test_a_ship_is_given_a_drive_that_is_enough_in_calm_water_too(tmp_path: Path) -> None:
    """In the minutes given; and the answer says so."""
    request = PlanRequest(PlanWanted((), PAIR), minutes=30.0, line_plans=False)
    run = planned(load(barge(tmp_path)), request)
    assert run.result.reached
    assert run.result.calm is not None
    assert run.result.calm.reached
    assert "enough in calm water as well" in " ".join(render_plan("markdown", run).split())
    lost = CalmWater(False, Lacking("latency(position) and lever_arm(position)", None, 12.9, 60.0))
    waved = replace(run, result=replace(run.result, calm=lost))
    text = " ".join(render_plan("markdown", waved).split())
    assert "in waves only" in text
    assert "Only the waves make it enough" in text
    assert "noncentrality 12.9 of 60 asked" in text


def test_a_rival_of_a_known_effect_need_not_be_told_from_anything_else(tmp_path: Path) -> None:
    """A latency of 20 ms on rails beside a lever arm: the surveyed coordinates may take the lever
    arm's place, and are no latency either.  A turn about of ten minutes was planned for it."""
    rail = TRACTOR.replace(PLACE, "v_max: 20 m/s, omega_max: 0.5 deg/s").replace(
        MOTION, "motion: ground, minimum_turn_radius: 3000 m, acceleration: 0.5 m/s^2"
    )
    path = tmp_path / "rail.yaml"
    path.write_text(rail, encoding="utf-8")
    wanted = PlanWanted((), separate_of("latency(position)=20 ms", "lever_arm(position)"))
    found = planned(load(path), PlanRequest(wanted, minutes=30.0, line_plans=False)).result
    assert found.reached
    assert found.duration_s < 60.0


def test_what_a_dear_leg_is_for_is_what_fails_without_it(tmp_path: Path) -> None:
    """Of a short leg and a long one that tells all: without the long one the figure is that of the
    short one alone."""
    path = tmp_path / "tractor.yaml"
    path.write_text(TRACTOR, encoding="utf-8")
    wanted = PlanWanted(reach_of("latency(position)=3 ms"))
    setup = Setup.begun(load(path), PlanRequest(wanted, line_plans=False))
    legs = {one.leg.name: one for one in setup.told}
    short, long = legs["two speeds, short"], legs["slow and fast"]
    found = outcome(setup.world, [short, long])
    (dear,) = dear_legs(setup, found)
    assert dear.leg == "2 slow and fast"
    alone = whole_information(setup.world, [short])
    if dear.without.beside is None:
        k = setup.goal.wanted[0]
        assert dear.without.value == pytest.approx(alone[k, k] ** -0.5, rel=0.01)
    assert dear.without.value > dear.without.asked
    assert list(dear_legs(setup, replace(found, stretches=found.stretches[:1]))) == []


def test_what_is_reached_is_not_unseen_and_what_stays_plausible_is(tmp_path: Path) -> None:
    """By the information itself: each effect with what is asked free beside it."""
    path = tmp_path / "tractor.yaml"
    path.write_text(TRACTOR, encoding="utf-8")
    wanted = PlanWanted(reach_of("latency(position)=1 ms, lever_arm(position)=5 mm"))
    request = PlanRequest(wanted, line_plans=False)
    found = planned(load(path), request).result
    assert found.reached
    assert not [one for one in found.unseen if one.startswith(("latency(pos", "lever_arm(pos"))]
    assert "lever_arm(ranging): z_m" in found.unseen or "lever_arm(ranging)" in found.unseen
    short = planned(load(path), replace(request, minutes=0.5)).result
    assert not short.reached
    assert [one for one in short.unseen if one.startswith(("latency(pos", "lever_arm(pos"))]
