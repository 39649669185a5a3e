"""Effects asked together of which no drive tells one from the rest: one is held, and said to be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.planning.others import Others
from syncline_design.planning.run import plan
from syncline_design.planning.search import PlanJudge
from syncline_design.planning.setup import PlanRequest, Setup
from syncline_design.planning.singular import HeldPlaces, told_beside
from syncline_design.planning.telling import PlanRun
from syncline_design.planning.wanted import Goal, PlanWanted, reach_of, separate_of
from syncline_design.report.on_plan import on_plan
from syncline_design.report.render_console import console
from syncline_design.spec.load import load
from tests.planned_specs import spec_with

DRIFTS = "clock_drift(position)=1e-5, clock_drift(attitude)=1e-5, clock_drift(ranging)=1e-5"
ARMS = "lever_arm(position)=5 cm, lever_arm(ranging)=5 cm"


def planned(folder: Path, reach: str) -> PlanRun:
    request = PlanRequest(PlanWanted(reach_of(reach)), line_plans=False)
    return plan(load(spec_with(folder)), request)


def shown(run: PlanRun) -> str:
    return " ".join(console(on_plan(run)).split())


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    return Setup.begun(load(spec_with(tmp_path_factory.mktemp("singular"))), PlanRequest())


def test_of_three_clocks_that_drift_one_is_the_reference(tmp_path: Path) -> None:
    """All three alike shift nothing: asked together, the information was singular, no drive was
    found, and every other effect was blamed."""
    run = planned(tmp_path, DRIFTS)
    assert run.result.reached
    (held,) = run.result.held or ()
    assert held.effect == "clock_drift(ranging)"
    assert held.parameters == ("clock_drift(ranging).rate",)
    assert held.beside == ("clock_drift(position)", "clock_drift(attitude)")
    last = run.result.after[-1].sigma
    assert set(last) == set(run.result.tolerance)
    assert all(sigma <= 1e-5 for sigma in last.values())
    assert "clock_drift(ranging)" not in {one.effect for one in run.result.untold or ()}
    words = shown(run)
    assert "but for what no drive tells" in words.split("No drive")[0]
    assert (
        "No drive of this platform tells clock drift (position), clock drift (attitude) and clock "
        "drift (ranging) from one another, as far as their effects of first order go: changed "
        "together they make no error. Clock drift (ranging) is taken as known, as the reference "
        "beside which the others are told. All else that is asked is reached"
    ) in words


def test_of_two_lever_arms_one_is_known(tmp_path: Path) -> None:
    """A rigid body's two arms are one: of three combinations each, the ranging sensor's is held."""
    run = planned(tmp_path, ARMS)
    assert run.result.reached
    (held,) = run.result.held or ()
    assert held.effect == "lever_arm(ranging)"
    assert held.parameters == tuple(f"lever_arm(ranging).{axis}_m" for axis in "xyz")
    assert held.beside == ("lever_arm(position)",)
    assert "beside which the other is told" in shown(run)


def test_what_a_drive_tells_is_asked_whole(setup: Setup) -> None:
    """Both latencies, an arm, a boresight and a range bias: nothing of it is held."""
    assert setup.held == ()
    assert {setup.world.every[k].candidate.effect.name for k in setup.goal.wanted} == {
        "latency", "lever_arm", "boresight", "range_bias",
    }  # fmt: skip


def columns_of(setup: Setup, *names: str) -> list[int]:
    return [setup.keys.index(name) for name in names]


def test_only_what_depends_on_the_rest_is_held(setup: Setup) -> None:
    """Four columns a, b, c = a - 2 b and d: the last of a, b, c in the order of how often it is met
    is held, d is not; what no row shows stands alone; and where nothing else is asked it stays."""
    every = setup.world.every
    names = ("latency(position).latency_s", "latency(attitude).latency_s",
             "latency(ranging).latency_s", "range_bias(ranging).bias_m")  # fmt: skip
    a, b, c, d = columns_of(setup, *names)
    slopes = np.zeros((50, len(every)))
    slopes[:, [a, b, d]] = np.random.default_rng(3).normal(size=(50, 3)) * [1.0, 2.0, 1e-3]
    slopes[:, c] = slopes[:, a] - 2.0 * slopes[:, b]
    goal = Goal(tuple(sorted((a, b, c, d))), np.ones(4), ())
    kept, held = told_beside(every, goal, slopes.T @ slopes)
    assert held == (HeldPlaces(c, tuple(sorted((a, b)))),)
    assert kept.wanted == tuple(sorted((a, b, d)))
    np.testing.assert_array_equal(kept.tolerance, np.ones(3))
    slopes[:, d] = 0.0
    pair = Goal(tuple(sorted((a, d))), np.ones(2), ())
    assert told_beside(every, pair, slopes.T @ slopes)[1] == (HeldPlaces(d, ()),)
    alone = Goal((d,), np.ones(1), ())
    assert told_beside(every, alone, slopes.T @ slopes) == (alone, ())


def test_what_is_part_of_a_pair_is_not_held(tmp_path: Path) -> None:
    """The pair asks about the ranging sensor's latency: of the three the attitude's is held."""
    asked = PlanWanted(
        reach_of("latency(position)=2 ms, latency(attitude)=2 ms"),
        separate_of("latency(ranging)", "range_bias(ranging)"),
    )
    setup = Setup.begun(load(spec_with(tmp_path)), PlanRequest(asked))
    assert [setup.keys[one.held] for one in setup.held] == ["latency(attitude).latency_s"]
    assert [pair.names[0] for pair in setup.goal.pairs] == ["latency(ranging)"]


@pytest.mark.parametrize(("cosine", "blamed"), [(0.0, []), (0.8, []), (0.9, [1])])
def test_an_effect_is_blamed_for_what_it_at_least_doubles(cosine: float, blamed: list[int]) -> None:
    """sigma = 1 alone, where 0.1 is asked; free as well, the other makes it 1 / sqrt(1 - cos^2):
    1, 1.7 and 2.3.  All three were blamed for what the drive leaves uncertain by itself."""
    information = np.array([[1.0, cosine], [cosine, 1.0]])
    others = Others(np.array([[1]]), np.full((1, 1), 3.0))
    judge = PlanJudge(Goal((0,), np.array([0.1]), ()), np.full(2, 1e3), others)
    assert judge.confusing(information) == blamed
