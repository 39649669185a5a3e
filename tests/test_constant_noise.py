"""A constant within what noise of a sensor may be: found, and said to be what it may do.

Oracle: an offset of the targets is minus a constant error of the position, component by component;
an arm turns with the vehicle.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.comparison.meaning import with_design
from syncline_design.comparison.repair_options import remedies
from syncline_design.diagnosis import diagnose
from syncline_design.diagnosis.result import Diagnosis, Finding
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.render_console import console
from syncline_design.spec.load import load
from tests.world import Hidden, hidden, make_log, scenario


def found_with(folder: Path, effect: Hidden) -> tuple[Diagnosis, Finding]:
    log = make_log(scenario("multirotor_lines", 3, 100.0, 10.0), (effect,))
    spec = folder / "spec.yaml"
    spec.write_text(log.spec_yaml(), "utf-8")
    found = diagnose(spec, [log.to_csv(folder / "log.csv")])
    (one,) = (f for f in found.findings if f.kind == "cause")
    assert one.effect == effect.effect
    return found, one


def said(found: Diagnosis) -> str:
    return " ".join(console(on_diagnosis(with_design(found, None)), colour=False).split())


SIGMAS = scenario("multirotor_lines", 3, 100.0, 10.0).carriers[-1].sensors.position_m
SIGMA = float(SIGMAS[0])


@pytest.mark.parametrize("times", [0.5, 1.5, 3.5])
def test_a_datum_within_the_noise_of_position_is_said_to_be(tmp_path: Path, times: float) -> None:
    north = times * SIGMA
    effect = hidden("datum_offset", "target", north_m=north, east_m=0.3 * north, down_m=0.0)
    found, one = found_with(tmp_path, effect)
    words = "It cannot be told from noise of position that stays the same over the whole log"
    if times > 3.0:
        assert one.within_noise is None
        assert words not in said(found)
        assert "Explained: what is missing was found" in said(found)
        return
    assert one.within_noise is not None
    assert one.within_noise.sensor == "position"
    largest = max(
        abs(float(p.value)) / s for p, s in zip(one.parameters.values(), SIGMAS, strict=True)
    )
    assert one.within_noise.sigmas == pytest.approx(largest, rel=0.02)
    sizes = np.array([p.value for p in one.parameters.values()]) / np.array(SIGMAS)
    drawn = np.random.default_rng(2).standard_normal((200_000, 3))
    share = float(np.mean(np.sum(drawn**2, axis=1) > np.sum(sizes**2)))
    assert one.within_noise.chance == pytest.approx(share, abs=0.02)
    assert words in said(found)
    assert "Explained, or within the spec: constant noise" in said(found)
    assert "noise that changes along the log does that with a chance" in one.evidence
    case = load(tmp_path / "spec.yaml")
    (calibrated,) = (r for r in remedies(case, case, one) if r.kind == "calibrate")
    assert calibrated.assumes.startswith("a log of another day shows it again")


def test_an_arm_of_a_vehicle_that_turns_is_no_constant_of_a_sensor(tmp_path: Path) -> None:
    effect = hidden("lever_arm", "position", x_m=0.6 * SIGMA, y_m=0.0, z_m=0.0)
    found, one = found_with(tmp_path, effect)
    assert one.within_noise is None
    assert "cannot be told from noise" not in said(found)
