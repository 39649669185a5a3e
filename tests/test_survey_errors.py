"""Errors of the targets' survey: one random constant a target, common to all of its rows."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import multivariate_normal

from syncline_design.diagnosis import diagnose
from syncline_design.diagnosis.covariance import factored, with_lasting
from tests.world import Noise, WorldLog, hidden, make_log, scenario

NED = ("north", "east", "down")
ROWS, TARGETS = 30, 4


def test_lasting_errors_are_those_of_the_dense_covariance() -> None:
    """Everything against one dense matrix and scipy's density."""
    rng = np.random.default_rng(5)
    time_s = np.cumsum(rng.uniform(0.1, 0.5, ROWS))
    white = np.array([np.diag(rng.uniform(0.5, 2.0, 3)) for _ in range(ROWS)])
    loading = rng.standard_normal((ROWS, 3, 2))
    constants_s = np.array([0.7, 4.0])
    target = rng.integers(0, TARGETS, ROWS)
    survey = np.zeros((ROWS, 3, 3 * TARGETS))
    for row in range(ROWS):
        for axis in range(3):
            survey[row, axis, 3 * target[row] + axis] = 1.7
    dense = np.zeros((3 * ROWS, 3 * ROWS))
    for i in range(ROWS):
        for j in range(ROWS):
            block = slice(3 * i, 3 * i + 3), slice(3 * j, 3 * j + 3)
            for k, constant_s in enumerate(constants_s):
                alike = np.exp(-abs(time_s[i] - time_s[j]) / constant_s)
                dense[block] += alike * np.outer(loading[i, :, k], loading[j, :, k])
            dense[block] += 1.7**2 * np.eye(3) * (target[i] == target[j])
            dense[block] += white[i] * (i == j)
    error = rng.standard_normal((ROWS, 3))
    known = with_lasting(factored(white, loading, time_s, constants_s), survey)
    solved = np.linalg.solve(dense, error.ravel())
    assert np.allclose(known.solve(error[:, :, None])[:, :, 0].ravel(), solved, rtol=1e-9)
    assert np.isclose(known.information(error[:, :, None])[0, 0], error.ravel() @ solved, rtol=1e-9)
    density = -multivariate_normal(np.zeros(3 * ROWS), dense).logpdf(error.ravel())
    assert np.isclose(known.negative_log_likelihood(error), density, rtol=1e-10)
    flat = survey.reshape(3 * ROWS, -1)
    assert np.allclose(known.constant_part(error).ravel(), flat @ (flat.T @ solved), rtol=1e-9)


def surveyed(log: WorldLog, size_m: float) -> WorldLog:
    """The log with every target's listed place off by normal errors of its own."""
    rng = np.random.default_rng(11)
    _, target = np.unique(log.columns["target_north_m"], return_inverse=True)
    off = size_m * rng.standard_normal((int(target.max()) + 1, 3))
    moved = {f"target_{axis}_m": log.columns[f"target_{axis}_m"] + off[target, k]
             for k, axis in enumerate(NED)}  # fmt: skip
    return replace(log, columns={**log.columns, **moved})


def test_survey_errors_are_sized_and_do_not_pass_for_effects(tmp_path: Path) -> None:
    """Seven millimetres of every target, and a latency: named alone, and held by its interval."""
    late = hidden("latency", "position", latency_s=0.02)
    run = scenario("multirotor_lines", 5, 80.0, 8.0)
    run = replace(run, targets_m=run.targets_m[::8], sighted=run.sighted // 8)
    log = make_log(run, (late,), Noise(scale=0.5))
    targets = np.unique(log.columns["target_north_m"]).size
    assert 8 <= targets <= 64
    spec = tmp_path / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    found = diagnose(spec, [surveyed(log, 0.007).to_csv(tmp_path / "log.csv")])
    assert found.noise.survey_m is not None
    assert 0.0035 < found.noise.survey_m < 0.009  # in part it passes for slow noise
    (one,) = [f for f in found.findings if f.kind == "cause"]
    assert (one.effect, one.sensor) == ("latency", "position")
    low, high = one.parameters["latency_s"].interval95 or (0.0, 0.0)
    assert low < 0.02 < high
