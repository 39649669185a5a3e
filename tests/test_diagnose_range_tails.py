"""Ranges that are far off now and then are said to be that, and nothing else is.

Outliers are put into the range column of a log of the hidden world by numpy; what they do to a
place follows from that log's own code.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

from syncline_design.diagnosis import Diagnosis, diagnose
from syncline_design.diagnosis.result import Finding
from syncline_design.diagnosis.sensor_tails import SensorTails, expected_variance
from tests.world import Hidden, hidden, make_log, scenario
from tests.world.worldlog import write_columns

RATE, TIMES = 0.03, 20.0
HALF_NORMAL, NORMAL, ONE_SIZE = "one side", "both sides", "one size"


def told(
    folder: Path, name: str, kind: str = "", effects: tuple[Hidden, ...] = (), seed: int = 21
) -> tuple[Diagnosis, float]:
    """The diagnosis of 200 s at 5 Hz, and the share of the ranges that are far off."""
    world = make_log(scenario(name, seed, 200.0, 5.0), effects)
    sensors = world.run.carriers[-1].sensors
    assert sensors.ranging is not None
    rng, n = np.random.default_rng([seed, 7]), world.columns["time_s"].size
    struck = rng.random(n) < RATE
    size = {
        "": 0.0,
        NORMAL: rng.standard_normal(n),
        HALF_NORMAL: np.abs(rng.standard_normal(n)),
        ONE_SIZE: rng.choice([-1.0, 1.0], n),
    }[kind]
    ranges = world.columns["range_m"] + np.where(struck, TIMES * sensors.ranging[0] * size, 0.0)
    write_columns(folder / "log.csv", world.columns | {"range_m": ranges})
    (folder / "spec.yaml").write_text(world.spec_yaml(), encoding="utf-8")
    return diagnose(folder / "spec.yaml", [folder / "log.csv"]), float(np.mean(struck))


def tails_of(found: Diagnosis) -> list[Finding]:
    return [one for one in found.findings if one.effect == "heavy_tails"]


PLATFORMS = ("car_stops", "vessel_figure_eights", "fixed_wing_circuits")


@pytest.mark.parametrize("kind", [NORMAL, HALF_NORMAL, ONE_SIZE])
@pytest.mark.parametrize("name", PLATFORMS[:2])
def test_outliers_of_ranges_are_named_with_their_share(
    name: str, kind: str, tmp_path: Path
) -> None:
    """And are no cause: not even those of one side are a bias, of a median that stays."""
    found, share = told(tmp_path, name, kind)
    (tails,) = tails_of(found)
    assert (tails.sensor, tails.kind, tails.material) == ("ranging", "noise", True)
    assert {one.sensor for one in found.findings} == {"ranging"}
    assert not any(one.kind != "noise" for one in found.findings)
    rate = tails.parameters["outlier_rate"]
    assert rate.interval95 is not None
    low, high = rate.interval95
    assert low < share < high
    assert high - low < 0.05
    assert found.verdict == "explained"


def test_outliers_of_ranges_leave_an_effect_its_value(tmp_path: Path) -> None:
    late = hidden("latency", "position", latency_s=0.05)
    found, _ = told(tmp_path, "car_stops", NORMAL, (late,))
    cause, tails = found.findings
    assert (tails.effect, tails.sensor) == ("heavy_tails", "ranging")
    assert cause.effect == "latency"
    assert cause.parameters["latency_s"].value == pytest.approx(0.05, abs=1e-3)


@pytest.mark.parametrize("name", PLATFORMS)
def test_a_clean_log_has_no_tails(name: str, tmp_path: Path) -> None:
    found, _ = told(tmp_path, name)
    assert not tails_of(found)
    assert found.verdict == "agrees"


OTHER = (
    hidden("heavy_tails", "position", outlier_rate=0.03),
    hidden("heavy_tails", "position", degrees_of_freedom=2.5),
)


@pytest.mark.parametrize("other", OTHER, ids=["outliers", "student"])
@pytest.mark.parametrize("name", ["car_stops", "fixed_wing_circuits"])
def test_tails_of_positions_are_not_laid_on_ranges(
    name: str, other: Hidden, tmp_path: Path
) -> None:
    found, _ = told(tmp_path, name, effects=(other,))
    assert [one.sensor for one in tails_of(found)] == ["position"]


@pytest.mark.parametrize(
    "other",
    [
        hidden("timestamp_jitter", "position", std_s=0.03),
        hidden("noise_understated", "ranging", factor=2.0),
    ],
    ids=lambda one: one.effect,
)
def test_noise_of_another_kind_is_no_tail(other: Hidden, tmp_path: Path) -> None:
    found, _ = told(tmp_path, "car_stops", effects=(other,))
    assert [one.effect for one in found.findings] == [other.effect]


def test_ranges_that_are_loud_for_a_while_have_no_tails(tmp_path: Path) -> None:
    """12 of 200 s at six times the spec's deviation: in as many rows as outliers would be."""
    world = make_log(scenario("car_stops", 21, 200.0, 5.0))
    assert world.run.carriers[-1].sensors.ranging is not None
    time_s, sigma_m = world.columns["time_s"], world.run.carriers[-1].sensors.ranging[0]
    draws = np.random.default_rng(5).standard_normal(time_s.size)
    loud = np.where((time_s > 90.0) & (time_s < 102.0), 6.0 * sigma_m * draws, 0.0)
    ranges = world.columns["range_m"] + loud
    write_columns(tmp_path / "log.csv", world.columns | {"range_m": ranges})
    (tmp_path / "spec.yaml").write_text(world.spec_yaml(), encoding="utf-8")
    found = diagnose(tmp_path / "spec.yaml", [tmp_path / "log.csv"])
    assert not tails_of(found)


def test_noise_of_a_known_kind_is_not_told_again(tmp_path: Path) -> None:
    """The spec that lists its tails of ranges is agreed with: noise that the log has."""
    world = make_log(scenario("car_stops", 21, 200.0, 5.0))
    values = (("degrees_of_freedom", 30.0), ("outlier_rate", 0.1))
    listed = Hidden("heavy_tails", "ranging", values)
    sigma_m = (world.run.carriers[-1].sensors.ranging or (0.0,))[0]
    rng = np.random.default_rng(6)
    struck = rng.random(world.columns["time_s"].size) < 0.1
    far = np.where(struck, 10.0 * sigma_m * rng.standard_normal(struck.size), 0.0)
    ranges = world.columns["range_m"] + far
    write_columns(tmp_path / "log.csv", world.columns | {"range_m": ranges})
    (tmp_path / "spec.yaml").write_text(world.spec_yaml((listed,)), encoding="utf-8")
    found = diagnose(tmp_path / "spec.yaml", [tmp_path / "log.csv"])
    assert not tails_of(found)
    assert found.verdict == "agrees"


@pytest.mark.parametrize("error", [0.0, 1.5, 8.0, 40.0])
def test_a_row_is_as_uncertain_as_its_error_makes_it(error: float) -> None:
    """The mean of 1 / (variance + others) over all variances by their likelihood, by quadrature."""
    freedom, rate, own, others = 3.0, 0.02, 2.0, 0.7

    def likely(log_w: float) -> float:
        w = float(np.exp(log_w))
        gamma = w * float(stats.gamma.pdf(w, 0.5 * freedom, scale=2.0 / freedom))
        return (1.0 - rate) * gamma * float(stats.norm.pdf(error, scale=(own / w + others) ** 0.5))

    far = rate * float(stats.norm.pdf(error, scale=(100.0 * own + others) ** 0.5))
    ends = (-20.0, 4.0)  # of log w
    whole = quad(likely, *ends, limit=400)[0] + far
    weight = quad(lambda x: likely(x) / (own / np.exp(x) + others), *ends, limit=400)[0]
    weight += far / (100.0 * own + others)
    wanted = (whole / weight - others) / own
    one = np.ones((1, 1))
    tails = SensorTails(freedom, 0.1, rate)
    found = expected_variance(error * one, own * one, others * one, tails)
    assert found[0] == pytest.approx(wanted, rel=0.01)
