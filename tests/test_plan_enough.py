"""The least minutes that a plan tells: enough, and hardly more than enough."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from syncline_design.effects.record import Array
from syncline_design.machine.deadline import NoVerdict
from syncline_design.planning import enough
from syncline_design.planning.drives import MOST_ROWS, World, whole_information
from syncline_design.planning.effort import Effort
from syncline_design.planning.others import Others
from syncline_design.planning.placing import LegTold
from syncline_design.planning.run import plan as planned
from syncline_design.planning.search import PlanJudge
from syncline_design.planning.setup import PlanRequest, Setup
from syncline_design.planning.standard import Lines, legs_needed, times_needed
from syncline_design.planning.telling import PlanRun
from syncline_design.planning.wanted import Goal, PlanWanted, reach_of
from syncline_design.report.plans import render_plan
from syncline_design.spec.load import load
from tests.planned_specs import spec_with

TIMED = "primitive: pps, timestamping: {error: {distribution: normal, mean: 0 us, std: 1 us}}"
SHIPPED = f"""\
syncline: 1
name: copter
requirements: [{{id: ACC-1, kind: accuracy, limit: 1 m}}]
stages:
  - name: uav
    platform: uav_multi_rotor
    position: {{sensor: {{modality: position, sigma_position: 2 cm, primitives: [pps]}}, {TIMED},
      lever_arm: [0.3 m, 0.1 m, -0.2 m]}}
    attitude: {{sensor: {{modality: attitude, sigma_attitude: [0.03 deg, 0.03 deg, 0.08 deg],
      primitives: [pps]}}, {TIMED}}}
    ranging: {{sensor: {{modality: ranging, type: lidar, sigma_range: 1 cm,
      sigma_bearing: [0.02 deg, 0.02 deg], primitives: [pps], rate: 10 Hz}}, {TIMED},
      lever_arm: [0.1 m, 0 m, 0.15 m]}}
"""


TIGHT = "latency(position)=0.04 ms"


def asked(folder: Path, minutes: float, effort: Effort | None = None) -> PlanRun:
    """A drive of many legs, where what is asked needs long."""
    wanted = PlanWanted(reach_of(TIGHT))
    request = PlanRequest(wanted, minutes=minutes, line_plans=False, effort=effort)
    return planned(load(spec_with(folder, (", area: [250 m, 250 m]", ""))), request)


class Judged(list[int]):
    """How many legs each drive had that was judged whole."""

    def __init__(self, patch: pytest.MonkeyPatch) -> None:
        whole = enough.whole_information

        def counted(world: World, legs: list[LegTold]) -> Array:
            self.append(len(legs))
            return whole(world, legs)

        patch.setattr(enough, "whole_information", counted)


@pytest.fixture(scope="module")
def free(tmp_path_factory: pytest.TempPathFactory) -> tuple[PlanRun, int]:
    """A search of whatever effort, with too little time, and how many drives it judged whole."""
    with pytest.MonkeyPatch.context() as patch:
        judged = Judged(patch)
        return asked(tmp_path_factory.mktemp("free"), 0.2), len(judged)


def test_the_least_that_is_said_to_be_enough_is_hardly_more_than_enough(
    free: tuple[PlanRun, int], tmp_path: Path
) -> None:
    """What a drive tells grows with its time: it goes in the end to what is asked, within 3 %.

    A twentieth less than the least is not enough, judged by the same plan with fewer minutes.
    """
    short, _ = free
    least = short.result.least_minutes
    assert not short.result.reached
    assert least is not None
    whole = asked(tmp_path, least + 1e-6).result
    assert whole.reached
    assert whole.duration_s == pytest.approx(60.0 * least, abs=0.06)
    assert len(whole.legs) > 12
    (sigma,) = whole.after[-1].sigma.values()
    (tolerance,) = whole.tolerance.values()
    assert 0.97 <= sigma / tolerance <= 1.0
    assert not asked(tmp_path, 0.95 * least).result.reached
    words = " ".join(render_plan("markdown", short).split()).replace("\u202f", " ")
    said = float(
        words.split("The least that is enough, of the drives looked at: ")[1]
        .split()[0]
        .replace("\u00a0", "")
    )
    assert least <= said <= 1.01 * least


NARROW = (
    ("v_max: 9 m/s, omega_max: 50 deg/s", "v_max: 8 m/s, omega_max: 60 deg/s"),
    ("acceleration: 2 m/s^2, area: [250 m, 250 m]", "area: [60 m, 40 m], height: 25 m"),
)


def test_a_drive_of_one_leg_that_is_enough_is_not_passed_by(tmp_path: Path) -> None:
    """One full circle is enough, which is less than its legs say alone: asked with fewer minutes
    than the least, the same plan must not find it, nor say another least."""
    spec = load(spec_with(tmp_path, *NARROW))
    wanted = PlanWanted(reach_of("latency(position)=1 ms, lever_arm(position)=1 cm"))
    least = planned(spec, PlanRequest(wanted, line_plans=False)).result.least_minutes
    assert least is not None
    for share in (0.95, 0.75, 0.62):
        fewer = planned(spec, PlanRequest(wanted, minutes=share * least, line_plans=False)).result
        assert not fewer.reached, share
        assert fewer.least_minutes == pytest.approx(least)


CAR = (
    ("v_max: 9 m/s, omega_max: 50 deg/s", "v_max: 15 m/s, omega_max: 30 deg/s"),
    ("motion: multirotor", "motion: ground, minimum_turn_radius: 8 m"),
    (
        "acceleration: 2 m/s^2, area: [250 m, 250 m]",
        "acceleration: 1.5 m/s^2, area: [200 m, 150 m]",
    ),
)


def test_a_leg_is_judged_with_a_step_in_its_own_middle(tmp_path: Path) -> None:
    """What one leg tells alone is what it tells as a whole drive, wherever in the library it
    stands: judged with a step in the middle of all legs together, a drive of one leg was passed by,
    and the least was twice as long."""
    wanted = PlanWanted(reach_of("latency(position)=2 ms, lever_arm(position)=2 cm"))
    request = PlanRequest(wanted, line_plans=False)
    spec = load(spec_with(tmp_path, *CAR))
    setup = Setup.begun(spec, request)
    assert setup.judge.confusions(setup.told[0].at(0, 0.0)).size
    for told in setup.told:
        alone = setup.judge.confusions(told.at(0, 0.0))
        whole = setup.judge.confusions(whole_information(setup.world, [told]))
        assert np.all(alone < 6.0 * np.maximum(whole, 0.5)), told.leg.name
    found = planned(spec, request).result
    assert found.reached
    assert found.duration_s < 36.0


def test_more_time_makes_no_worse_drive_of_what_is_too_short(tmp_path: Path) -> None:
    """Of what there is too little time for: the leg that is best for its time may leave no room for
    another, where a longer one that fits tells more.  With 26 s as much is told as with 21 s."""
    path = tmp_path / "copter.yaml"
    path.write_text(SHIPPED, encoding="utf-8")
    spec, wanted = load(path), PlanWanted(reach_of("latency(position)=0.3 ms"))
    sigma = {}
    for seconds in (21.0, 25.8):
        request = PlanRequest(wanted, minutes=seconds / 60.0, line_plans=False)
        found = planned(spec, request).result
        assert not found.reached
        assert found.duration_s <= seconds
        (sigma[seconds],) = found.after[-1].sigma.values()
    assert sigma[25.8] <= sigma[21.0]


@pytest.mark.parametrize(("tolerance", "times"), [(0.05, 400.0), (0.3, 11.111), (2.0, 0.25)])
def test_a_drive_is_driven_as_often_as_its_information_asks(tolerance: float, times: float) -> None:
    """Of one parameter: sigma^2 = 1 / (n I), so that n = 1 / (I tolerance^2), the last in part."""
    none = Others(np.zeros((0, 1), dtype=np.int64), np.zeros((0, 1)))
    judge = PlanJudge(Goal((0,), np.array([tolerance]), ()), np.ones(1), none)
    assert times_needed(judge, np.diag([1.0, 0.0])) == pytest.approx(times, rel=0.005)


def test_what_another_effect_would_take_is_not_reached_yet() -> None:
    """One rule for drives, line plans and logs: with another effect free, of correlation r, sigma
    widens by (1 - r^2)^-1/2, which is more than threefold here; it may be twice what is asked then,
    so that n I (1 - r^2) = 1 / (2 tolerance)^2, where the effect alone needs n I = 1 / tolerance^2.
    """
    r, tolerance = 0.999, 0.5
    others = Others(np.array([[1]]), np.array([[3.0]]))
    judge = PlanJudge(Goal((0,), np.array([tolerance]), ()), np.full(2, 1e6), others)
    one = np.array([[1.0, r, 0.0], [r, 1.0, 0.0], [0.0, 0.0, 0.0]])
    alone, needed = tolerance**-2.0, (2.0 * tolerance) ** -2.0 / (1.0 - r**2)
    assert needed > 10.0 * alone
    for times, sure in ((1.01 * alone, False), (0.99 * needed, False), (1.01 * needed, True)):
        assert judge.enough(times * one) is sure
        assert judge.confusing(times * one) == ([] if sure else [1])
    assert times_needed(judge, one) == pytest.approx(needed, rel=0.005)
    line = Lines("line", one[None], np.array([20.0]), np.array([0.0]))
    assert legs_needed(judge, line) == math.ceil(needed)


def test_what_a_long_drive_tells_is_the_same_of_fewer_rows(tmp_path: Path) -> None:
    """Of hours only `MOST_ROWS` rows are computed, here one every 1.2 s for one every 0.1 s; which
    effects a log shows hangs on its rows a second, and what the figures stand for must not."""
    request = PlanRequest(PlanWanted(reach_of(TIGHT)), line_plans=False)
    setup = Setup.begun(load(spec_with(tmp_path, (", area: [250 m, 250 m]", ""))), request)
    few = setup.world.coarse(4 * 3600.0)
    assert few.computed_hz == pytest.approx(MOST_ROWS / (4 * 3600.0))
    longest = sorted(setup.told, key=lambda one: one.leg.duration_s)[-6:]
    told = np.sqrt(np.diag(whole_information(few, longest)))
    fine = np.sqrt(np.diag(whole_information(setup.world, longest)))
    seen = fine > 1e-6 * np.max(fine)
    ratio = told[seen] / fine[seen]
    assert np.median(np.abs(ratio - 1.0)) < 0.02
    assert np.all((ratio > 0.7) & (ratio < 1.4))


def test_a_search_ends_where_its_effort_does(tmp_path: Path) -> None:
    """Counted, not timed: what was looked at is the same however busy the machine is."""
    effort = Effort(most=30)
    with pytest.raises(NoVerdict, match="before it came to a drive"):
        asked(tmp_path, 60.0, effort)
    assert effort.is_over
    assert effort.spent < 60


def test_whole_drives_count_and_what_is_only_better_is_left(
    free: tuple[PlanRun, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A search of limited effort is enough as well, takes longer drives, and judges fewer whole."""
    judged, effort = Judged(monkeypatch), Effort(most=3000)
    limited = asked(tmp_path, 0.2, effort)
    assert 0 < len(judged) < 0.5 * free[1]
    least, more = free[0].result.least_minutes, limited.result.least_minutes
    assert least is not None
    assert more is not None
    assert least <= more < 1.3 * least
    assert asked(tmp_path, more + 1e-6).result.reached
    assert effort.is_half_over
