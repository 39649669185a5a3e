"""Noise that the spec lists among its effects is the noise that a log is held against.

Oracle: the hidden world's draws.  Whitened by the right covariance, their mean square is 1.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis import DiagnosisSettings, diagnose
from syncline_design.diagnosis.candidates import candidates
from syncline_design.diagnosis.expected_noise import structure_of
from syncline_design.diagnosis.noise import as_specified, white_covariance
from syncline_design.diagnosis.scene import Scene, scene
from syncline_design.diagnosis.system import measured
from syncline_design.spec.load import load
from tests.world import Hidden, hidden, make_log, scenario


def told(folder: Path, *effects: Hidden, listed: bool = True) -> Path:
    """The spec and the log of a car, its effects hidden in the one and listed in the other."""
    log = make_log(scenario("car_stops", 5, 200.0, 5.0), effects)
    text = log.spec_yaml(effects if listed else ())
    (folder / "spec.yaml").write_text(text, encoding="utf-8")
    log.to_csv(folder / "log.csv")
    return folder


def seen(folder: Path) -> Scene:
    inputs = measured(load(folder / "spec.yaml"), [folder / "log.csv"])
    return scene(inputs.system, inputs.log, inputs.known)


def chi_square(view: Scene) -> float:
    """Mean square of the error, whitened by what the spec expects of each row."""
    structure = structure_of(view)
    covariance = white_covariance(structure, as_specified(structure))
    white = np.linalg.solve(np.linalg.cholesky(covariance), view.error()[:, :, None])
    return float(np.mean(white**2))


NOISES = (
    hidden("noise_understated", "position", factor=2.5),
    hidden("noise_understated", "attitude", factor=3.0),
    hidden("noise_understated", "ranging", factor=2.0),
    hidden("heavy_tails", "position", degrees_of_freedom=5.0, outlier_rate=0.0),
    hidden("timestamp_jitter", "position", std_s=0.03),
    hidden("timestamp_jitter", "attitude", std_s=0.02),
    hidden("packetised_timestamps", "position", interval_s=0.08),
)


@pytest.mark.parametrize("noise", NOISES, ids=lambda h: f"{h.effect}-{h.sensor}")
def test_listed_noise_is_expected(noise: Hidden, tmp_path: Path) -> None:
    """3 000 components: within 12 %; unlisted it is 1.2 to 6."""
    assert chi_square(seen(told(tmp_path, noise))) == pytest.approx(1.0, abs=0.12)
    assert chi_square(seen(told(tmp_path, noise, listed=False))) > 1.2


@pytest.mark.parametrize(("name", "axes"), [("correlated_noise", (1, 1, 1)),
                                            ("height_drift", (0, 0, 1))])  # fmt: skip
def test_listed_wander_is_slow_noise_of_the_spec(
    name: str, axes: tuple[int, int, int], tmp_path: Path
) -> None:
    """Variances of independent errors add, per axis of the position."""
    values = {"std_m": 0.07, "time_constant_s": 20.0}
    view = seen(told(tmp_path, hidden(name, "position", **values)))
    (slow,) = [s for s in structure_of(view).slow if s.sensor[1] == "position"]
    stage = view.system.stages[0]
    assert stage.position is not None
    wanted = np.square(stage.position.sigma) + np.array(axes) * 0.07**2
    np.testing.assert_allclose(np.sum(slow.loading**2, axis=2), np.tile(wanted, (len(view), 1)))


def test_tails_that_are_listed_are_not_told_again(tmp_path: Path) -> None:
    tails = hidden("heavy_tails", "position", degrees_of_freedom=5.0, outlier_rate=0.0)
    jitter = hidden("timestamp_jitter", "position", std_s=0.03)
    folder = told(tmp_path, tails, jitter)
    known = [(c.effect.name, c.sensor) for c in candidates(seen(folder))]
    assert ("heavy_tails", "position") not in known
    found = diagnose(folder / "spec.yaml", [folder / "log.csv"], DiagnosisSettings(max_effects=1))
    assert found.verdict == "agrees"


def test_one_axis_that_wanders_alone_is_named(tmp_path: Path) -> None:
    """A first-order Gauss-Markov course, drawn here, on the logged east positions alone."""
    folder = told(tmp_path)
    names, *rows = (folder / "log.csv").read_text(encoding="utf-8").splitlines()
    table = np.array([row.split(",") for row in rows], dtype=object)
    time, east = (names.split(",").index(name) for name in ("time_s", "position_east_m"))
    decay = np.exp(-np.diff(table[:, time].astype(float)) / 12.0)
    draws = np.random.default_rng(4).standard_normal(len(rows))
    course = [draws[0]]
    for share, draw in zip(decay, draws[1:], strict=True):
        course.append(share * course[-1] + np.sqrt(1.0 - share**2) * draw)
    stage = seen(folder).system.stages[0]
    assert stage.position is not None
    size = 2.5 * stage.position.sigma[1] * np.array(course)
    table[:, east] = table[:, east].astype(float) + size
    lines = [names, *(",".join(map(str, row)) for row in table)]
    (folder / "log.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = diagnose(folder / "spec.yaml", [folder / "log.csv"], DiagnosisSettings(max_effects=1))
    (finding,) = found.findings
    assert (finding.effect, finding.sensor, finding.kind) == (
        "correlated_noise",
        "position",
        "noise",
    )
    spread = np.sqrt(3.0) * finding.parameters["std_m"].value  # of all three axes together
    assert spread == pytest.approx(np.sqrt(np.mean(size**2)), rel=0.35)
