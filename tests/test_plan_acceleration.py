"""No vehicle of a drive accelerates harder than it can: by differences of its path alone."""

from __future__ import annotations

from itertools import zip_longest
from pathlib import Path

import numpy as np
import pytest

from benchmarks.plan import PAYLOADS, spec_text
from syncline_design.diagnosis.system import pinned_system
from syncline_design.planning.drives import World
from syncline_design.planning.legs import transition
from syncline_design.planning.path import CourseCommands, joined
from syncline_design.planning.vehicle import vehicles
from syncline_design.spec.load import load
from tests.world import make_log, scenario

QUARTERS_RAD = np.pi / 2 * np.array([2, -1, 1, -2])
ROW_S = 0.1


def world_of(text: str, folder: Path) -> World:
    path = folder / "vehicle.yaml"
    path.write_text(text, encoding="utf-8")
    case = load(path)
    system = pinned_system(case)
    types = tuple("" if s.ranging is None else s.ranging.type for s in system.stages)
    return World(system, vehicles(case, types), 1.0 / ROW_S)


def all_legs(world: World) -> list[list[CourseCommands]]:
    """Every leg of every vehicle with a turn before it, the vehicles by turns; by stage."""
    parts: list[list[CourseCommands]] = [[] for _ in world.vehicles]
    own_legs = [[g for g in world.legs if g.stage == k] for k in range(len(parts))]
    ordered = [leg for row in zip_longest(*own_legs) for leg in row if leg is not None]
    for k, leg in enumerate(ordered):
        turn = transition(world.vehicles[leg.stage], float(QUARTERS_RAD[k % 4]))
        for course in (turn, leg.course):
            for own, one in zip(parts, world.courses_of(leg.stage, course), strict=True):
                own.append(one)
    return parts


def hardest(world: World, *, level: bool) -> list[float]:
    """Largest second difference of each vehicle's place over what it can, over rows."""
    driven = world.driven([joined(own) for own in all_legs(world)])
    found = []
    for vehicle, states in zip(world.vehicles, driven.states, strict=True):
        axes = slice(0, 2) if level or vehicle.motion == "surface" else slice(0, 3)
        assert np.allclose(np.diff(states.time_s), ROW_S)
        gain = np.diff(states.position_m[:, axes], 2, axis=0) / ROW_S**2
        found.append(float(np.max(np.linalg.norm(gain, axis=1))) / vehicle.acceleration_mps2)
    return found


@pytest.mark.parametrize("platform", PAYLOADS)
def test_every_platform_keeps_to_the_acceleration_that_it_assumes(
    platform: str, tmp_path: Path
) -> None:
    """All its legs with turns between them; of ships on the level, as the plan says."""
    world = world_of(spec_text(platform, ""), tmp_path)
    (most,) = hardest(world, level=False)
    assert 0.4 < most <= 1.0
    if world.vehicles[0].motion == "surface":
        assert any("on the level" in words for words in world.vehicles[0].assumed)


def test_vehicles_of_a_chain_take_over_from_each_other_without_a_jerk(tmp_path: Path) -> None:
    """The one that waits goes on as fast as its legs begin and end."""
    world = world_of(make_log(scenario("survey_chain", 3, 20.0, 5.0)).spec_yaml(), tmp_path)
    assert len(world.vehicles) == 2
    assert {leg.stage for leg in world.legs} == {0, 1}
    assert all(0.4 < most <= 1.0 for most in hardest(world, level=False))
