"""What many logs name within what a sensor's constant errors may be: named, and said to be that.

Oracles: an offset of the targets is minus a constant error of the position, component by component,
and the mean of three such errors is drawn; an arm turns with the vehicle; statistics of rows whose
constants are integrated out by hand.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from syncline_design.campaign.joint import JointRequest, diagnose_joint
from syncline_design.campaign.lasting_noise import within_lasting_noise
from syncline_design.campaign.pool import Scoped, fitted, pool_of
from syncline_design.comparison.meaning import with_design
from syncline_design.diagnosis.result import Diagnosis
from syncline_design.diagnosis.sufficient import Sufficient
from syncline_design.diagnosis.system import pinned_system
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.render_console import console
from syncline_design.spec.load import load
from tests.world import Hidden, hidden, make_log, scenario

SIGMAS = scenario("multirotor_lines", 3, 30.0, 5.0).carriers[-1].sensors.position_m
SIGMA = float(SIGMAS[0])
LOGS = 3
WORDS = "cannot be told from noise of position that stays the same over each log"


def together(folder: Path, effect: Hidden) -> Diagnosis:
    paths = []
    for seed in range(LOGS):
        log = make_log(scenario("multirotor_lines", 40 + seed, 40.0, 5.0), (effect,))
        paths.append(log.to_csv(folder / f"{seed}.csv"))
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), "utf-8")
    return diagnose_joint(load(spec), JointRequest(tuple(paths)))


def said(found: Diagnosis) -> str:
    return " ".join(console(on_diagnosis(with_design(found, None)), colour=False).split())


@pytest.mark.parametrize("times", [1.0, 3.0])
def test_a_datum_within_the_noise_of_position_is_said_to_be(tmp_path: Path, times: float) -> None:
    north = times * SIGMA
    found = together(
        tmp_path, hidden("datum_offset", "target", north_m=north, east_m=0.0, down_m=0.0)
    )
    (one,) = (f for f in found.findings if f.kind == "cause")
    assert (one.effect, one.scope) == ("datum_offset", "build")
    sizes = np.array([p.value for p in one.parameters.values()]) / np.array(SIGMAS)
    drawn = np.random.default_rng(2).standard_normal((200_000, LOGS, 3)).mean(axis=1)
    share = float(np.mean(np.sum(drawn**2, axis=1) > np.sum(sizes**2)))
    if times > 2.0:
        assert share < 0.01
        assert one.within_noise is None
        assert "cannot be told from noise" not in said(found)
        return
    assert one.within_noise is not None
    assert (one.within_noise.sensor, one.within_noise.stage) == ("position", "multirotor")
    assert one.within_noise.chance == pytest.approx(share, abs=0.05)
    assert one.within_noise.sigmas == pytest.approx(np.max(np.abs(sizes)), rel=0.35)
    assert WORDS in said(found)
    assert "Explained, or within the spec: constant noise" in said(found)
    assert "noise that changes along the log does that with a chance" in one.evidence


def test_an_arm_of_a_vehicle_that_turns_is_no_constant_of_a_sensor(tmp_path: Path) -> None:
    found = together(tmp_path, hidden("lever_arm", "position", x_m=0.8 * SIGMA, y_m=0.0, z_m=0.0))
    (one,) = (f for f in found.findings if f.kind == "cause")
    assert one.effect == "lever_arm"
    assert one.within_noise is None


def test_the_chance_is_that_of_rows_with_constants_of_their_own(tmp_path: Path) -> None:
    """A delay beside constant errors of the position, by rows and their whole covariance."""
    rng, rows = np.random.default_rng(3), 60
    labels = (*(("datum_offset", "target", 0, f"{axis}_m") for axis in ("north", "east", "down")),
              ("latency", "position", 0, "latency_s"))  # fmt: skip
    logs, normal, score = [], 0.0, 0.0
    for _ in range(LOGS):
        offsets = np.tile(np.eye(3), (rows, 1))
        speed = np.tile([5.0, 1.0, 0.0], rows) + 0.05 * rng.standard_normal(3 * rows)
        error = 0.002 * speed + 0.02 * rng.standard_normal(3 * rows)
        x = np.column_stack([offsets, speed]) / 0.02
        y = error / 0.02
        logs.append(Sufficient(labels, x.T @ x, x.T @ y, float(y @ y), np.eye(4), ()))
        constants = offsets @ np.diag(SIGMAS) / 0.02
        whole = np.linalg.inv(np.eye(3 * rows) + constants @ constants.T)
        normal += float(x[:, 3] @ whole @ x[:, 3])
        score += float(x[:, 3] @ whole @ y)
    run = scenario("multirotor_lines", 3, 30.0, 5.0)
    (tmp_path / "spec.yaml").write_text(make_log(run, ()).spec_yaml(), "utf-8")
    pool = pool_of(logs, range(LOGS))
    (late,) = (term for term in pool.terms if term.effect.name == "latency")
    fit = fitted(pool, (Scoped(late, "build"),))
    system = pinned_system(load(tmp_path / "spec.yaml"))
    found = within_lasting_noise(fit, 0, system, positions=False)
    share = math.erfc(math.sqrt(score**2 / normal / 2.0))
    assert 0.05 < share < 0.95
    assert found is not None
    assert found.chance == pytest.approx(share, rel=1e-6)
    alone = math.erfc(math.sqrt(2.0 * fit.gain / 2.0))
    assert alone < 1e-10
