"""Noise that is larger for a while: against what was put in, and what must not pass for it."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from syncline_design.diagnosis import Diagnosis, diagnose
from syncline_design.diagnosis.episodes import (
    MOST,
    _best_run,
    _clearest,
    _place,
    _shares,
    _stands_out,
)
from syncline_design.diagnosis.settings import DiagnosisSettings
from syncline_design.effects import registry
from syncline_design.report.on_findings import noise_lines
from syncline_design.spec.edit import with_effects
from syncline_design.spec.load import load
from tests.test_effects import rows
from tests.world import WorldLog, make_log, scenario

Array = NDArray[np.float64]
FROM_S, TO_S, TIMES = 30.0, 48.0, 6.0
SIGMA_M = (0.012, 0.012, 0.02)  # of the car's positions


def _louder(log: WorldLog, path: Path, to_s: float = TO_S) -> Path:
    """The log's file with more white noise in its positions for a while."""
    with log.to_csv(path).open(encoding="utf-8", newline="") as file:
        head, *lines = csv.reader(file)
    table = np.array(lines, dtype=float)
    time_s = table[:, head.index("time_s")]
    inside = (time_s >= FROM_S) & (time_s <= to_s)
    rng = np.random.default_rng(8)
    for axis, sigma in zip(("north", "east", "down"), SIGMA_M, strict=True):
        more = rng.normal(0.0, sigma * np.sqrt(TIMES**2 - 1.0), int(inside.sum()))
        table[inside, head.index(f"position_{axis}_m")] += more
    text = [",".join(head), *(",".join(f"{v:.9g}" for v in row) for row in table)]
    path.write_text("\n".join(text) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> tuple[Diagnosis, Diagnosis]:
    """What a log with a loud stretch says, and what it says once that is written into the spec."""
    folder = tmp_path_factory.mktemp("episodes")
    log = make_log(scenario("car_stops", 4, 80.0, 8.0), ())
    path = _louder(log, folder / "log.csv")
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    first = diagnose(spec, [path])
    return first, diagnose(with_effects(load(spec), first.effects_entries()), [path])


def test_a_loud_stretch_is_said_with_its_sensor_size_and_interval(
    found: tuple[Diagnosis, Diagnosis],
) -> None:
    (one,) = found[0].findings
    assert (one.effect, one.sensor, one.kind, one.material) == (
        "noise_episode", "position", "noise", True)  # fmt: skip
    assert one.from_s == pytest.approx(FROM_S, abs=0.6)
    assert one.to_s == pytest.approx(TO_S, abs=0.6)
    factor = one.parameters["factor"]
    assert factor.standard_uncertainty is not None
    assert factor.value == pytest.approx(TIMES, abs=3.0 * factor.standard_uncertainty)
    rows_inside, rows_all = 8.0 * (TO_S - FROM_S), 8.0 * 80.0
    more_m = np.sqrt(np.sum(np.square(SIGMA_M)) * (TIMES**2 - 1.0) * rows_inside / rows_all)
    assert one.size_m == pytest.approx(more_m, rel=0.1)
    (line,) = noise_lines(found[0].findings)
    assert line.startswith("Noise of position (car): ")
    assert "times as much from" in line


def test_written_back_the_same_log_agrees(found: tuple[Diagnosis, Diagnosis]) -> None:
    assert found[1].verdict == "agrees"
    assert found[1].findings == ()


def test_the_stretch_of_largest_sum_is_that_of_all_stretches() -> None:
    rng = np.random.default_rng(2)
    saved = rng.normal(-0.2, 1.0, 60)
    saved[20:33] += 1.5
    sums = {(a, b): saved[a:b].sum() for a in range(60) for b in range(a + 1, 61)}
    assert _best_run(saved) == max(sums, key=lambda pair: sums[pair])


def test_blocks_that_scatter_alike_have_no_loud_stretch() -> None:
    rng = np.random.default_rng(5)
    flagged = sum(
        _stands_out(rng.chisquare(30, 40) / 30.0, MOST, np.random.default_rng(k)) is not None
        for k in range(60)
    )
    assert flagged <= 1
    loud = rng.chisquare(30, 40) / 30.0
    loud[11:17] += 3.0
    assert _stands_out(loud, MOST, rng) == (11, 17)


def test_a_stretch_of_a_few_blocks_is_found_whatever_orders_are_drawn() -> None:
    rng = np.random.default_rng(6)
    slope = rng.chisquare(3, 1000) / 3.0 - 1.0
    slope[301:380] += 3.0  # of 40 blocks three, and a fifth of one
    places = [_place(slope, np.random.default_rng(k)) for k in range(10)]
    assert all(p is not None and abs(p[0] - 301) <= 7 and abs(p[1] - 380) <= 7 for p in places)


def test_rows_that_scatter_alike_have_no_loud_stretch_of_any_length() -> None:
    rng = np.random.default_rng(7)
    found = [_place(rng.chisquare(3, 1000) / 3.0 - 1.0, np.random.default_rng(k))
             for k in range(60)]  # fmt: skip
    assert sum(p is not None for p in found) <= 1  # two in 1000 a draw: more in 0.7 % of runs


def test_eight_seconds_of_a_hundred_are_a_loud_stretch_and_no_heavy_tails(tmp_path: Path) -> None:
    log = make_log(scenario("car_stops", 4, 80.0, 8.0), ())
    path = _louder(log, tmp_path / "log.csv", to_s=FROM_S + 6.4)
    spec = tmp_path / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    (one,) = diagnose(spec, [path], DiagnosisSettings(unseen_block=False)).findings
    assert (one.effect, one.sensor, one.material) == ("noise_episode", "position", True)
    assert one.from_s == pytest.approx(FROM_S, abs=0.6)
    assert one.to_s == pytest.approx(FROM_S + 6.4, abs=0.6)


def test_the_simulated_noise_grows_between_its_ends_alone() -> None:
    state = rows()  # 60 rows, a tenth of a second apart
    values = {"factor": 4.0, "from_s": 1.95, "to_s": 3.05}
    grown = registry()["noise_episode"].depart(state, values, "attitude", None).attitude_noise
    assert np.flatnonzero(grown).tolist() == list(range(20, 31))
    assert set(grown) == {0.0, 3.0}


def test_what_a_louder_sensor_saves_is_the_difference_of_two_normal_densities() -> None:
    """Against a library, row by row, one of them without noise of the sensor's."""
    rng = np.random.default_rng(4)
    half, rest = rng.normal(size=(6, 3, 1)), rng.normal(size=(6, 3, 3))
    half[0] = 0.0
    own, others = half @ np.swapaxes(half, 1, 2), rest @ np.swapaxes(rest, 1, 2)
    left, times, factor = rng.normal(size=(6, 3)), 1.7, 2.5
    lower = np.linalg.cholesky(own + others)
    alone = np.linalg.solve(lower, left[:, :, None])[:, :, 0]
    found = _shares(lower, own, alone).of_variance(times).saved(factor)

    def cost(k: int, size: float) -> float:
        return -multivariate_normal.logpdf(left[k], cov=times * (others[k] + size * own[k]))

    wanted = [cost(k, 1.0) - cost(k, factor**2) for k in range(6)]
    np.testing.assert_allclose(found, wanted, atol=1e-9)


@pytest.mark.parametrize("most", [4, 12])
def test_the_clearest_stretch_is_that_of_all_pairs_of_ends(most: int) -> None:
    rows = np.random.default_rng(9).exponential(size=(7, 12))

    def contrast(row: np.ndarray, a: int, b: int) -> float:
        inside, outside = row[a:b], np.r_[row[:a], row[b:]]
        size = np.sqrt(len(inside) * len(outside) / len(row))
        return float((inside.mean() - outside.mean()) * size)

    clearest, ends = _clearest(rows, most)
    for row, found, (a, b) in zip(rows, clearest, ends, strict=True):
        every = {
            (i, j): contrast(row, i, j)
            for i in range(12)
            for j in range(i + 2, min(i + most, 12) + 1)
            if j - i < 12
        }
        assert (a, b) == max(every, key=lambda pair: every[pair])
        assert found == pytest.approx(every[int(a), int(b)], rel=1e-12)
