"""A drive of few rows and targets, as `plan` finds them, is judged by groups enough to tell."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.plan import case_of, drawn, named_in, scenario_of
from fitted_data import data_from
from syncline_design.diagnosis.slow_states import slow_states
from syncline_design.diagnosis.system import pinned_system
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.planning.run import plan
from syncline_design.planning.setup import PlanRequest
from syncline_design.planning.telling import PlanRun
from syncline_design.planning.wanted import PlanWanted, named
from syncline_design.spec.case import Case
from tests.world import make_log, scenario
from tests.world.noise import Noise

ASKED = {"latency(position)": 5e-3, "boresight(ranging)": np.radians(0.1)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("short")


@pytest.fixture(scope="module")
def car(folder: Path) -> Case:
    return case_of(0, "car", folder)


@pytest.fixture(scope="module")
def drive(car: Case) -> PlanRun:
    """A few seconds by a handful of targets: 46 rows."""
    asked = PlanWanted(tuple((named(name, ""), figure) for name, figure in ASKED.items()))
    run = plan(car, PlanRequest(asked, line_plans=False))
    assert run.result.reached
    assert run.result.duration_s < 6.0
    assert len(run.result.targets) <= 6
    return run


@pytest.mark.parametrize("seed", [1320, 1321, 1322, 1323])
def test_what_a_short_drive_was_planned_for_is_named(
    car: Case, drive: PlanRun, folder: Path, seed: int
) -> None:
    """Two effects of 10 to 25 predicted sigmas: the second is in what is left beside the first.

    By 5 groups of 8 rows three values need a Fisher F of several hundred, and both were taken for
    noise: `unexplained`, or slow noise of the position.
    """
    rng = np.random.default_rng([seed, 77])
    truth = [drawn(drive, name, rng, (10.0, 25.0)) for name in ASKED]
    run = scenario_of(drive, "car", pinned_system(car), seed)
    found = named_in(car, make_log(run, truth, Noise()).to_csv(folder / "drive.csv"), seed)
    causes = {(one.effect, one.sensor) for one in found.findings if one.kind == "cause"}
    assert causes == {(one.effect, one.sensor) for one in truth}
    assert found.verdict == "explained"


@pytest.mark.parametrize(
    ("seconds", "rows", "groups", "parts"),
    [(4.5, 45, 11, False), (8.0, 80, 16, False), (12.9, 129, 16, True), (30.0, 300, 16, True)],
)
def test_groups_of_rows_are_as_many_as_have_four(
    folder: Path, seconds: float, rows: int, groups: int, parts: bool
) -> None:
    """16 at most; only groups of eight rows are told by themselves."""
    with one_thread():
        data = data_from(make_log(scenario("multirotor_lines", 5, seconds, 10.0), ()), folder)
        states = slow_states(data)
    assert len(data.view) == pytest.approx(rows, abs=1)
    assert states.count == groups
    assert states.has_parts is parts
    _, sizes = np.unique(states.block, return_counts=True)
    assert sizes.min() >= 4
