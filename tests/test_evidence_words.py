"""How the evidence for an effect is told, of one log and of several alike."""

from __future__ import annotations

import math

import pytest

from syncline_design.diagnosis.finding import estimate, evidence_words, finding
from syncline_design.effects import registry


@pytest.mark.parametrize("chance", [0.3, 2e-5, 7.4e-13, 9.6e-8, 1e-4, 9.49e-299])
def test_the_chance_of_noise_is_rounded_to_one_figure(chance: float) -> None:
    assert evidence_words(15.5, math.log10(chance)) == (
        f"saves 15.5 nat; noise alone does that with a chance of {chance:.0e}"
    )


@pytest.mark.parametrize("log10_p", [None, -300.0, -5921.3, -math.inf])
def test_what_is_too_small_for_a_float_is_said_to_be_less(log10_p: float | None) -> None:
    assert evidence_words(1.0, log10_p).endswith("a chance of less than 1e-300")


def test_components_of_one_arm_are_told_in_one_unit() -> None:
    """1.6 mm beside 17.67 cm is hard to compare; a part that the log does not see stays unsaid."""
    arm = {
        "x_m": estimate(-1.6e-3, 2.1e-3, "m"),
        "y_m": estimate(0.1767, 2.8e-3, "m"),
        "z_m": estimate(0.0, None, "m", seen=False),
    }
    found = finding(registry()["lever_arm"], "position", "usv", arm, "clear", 1.0)
    assert "-0.16 ± 0.21 cm forward, 17.67 ± 0.28 cm right, (not seen) down" in found.sentence
    assert found.parameters["x_m"].text == "-0.16 ± 0.21 cm"
    assert found.parameters["z_m"].text == "(not seen)"


def test_what_logs_save_together_is_counted_with_the_noise_that_is_left() -> None:
    """Each log by itself saves less, with its noise fitted anew: 9 600 nat beside 122 000."""
    words = evidence_words(122_023.9, -104.05, noise_kept=True)
    assert words.endswith("nat with the noise kept; noise alone does that with a chance of 9e-105")
