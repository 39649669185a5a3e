"""How the evidence for an effect is told, of one log and of several alike."""

from __future__ import annotations

import math

import pytest

from syncline_design.diagnosis.finding import evidence_words


@pytest.mark.parametrize("chance", [0.3, 2e-5, 7.4e-13, 9.6e-8, 1e-4, 9.49e-299])
def test_the_chance_of_noise_is_rounded_to_one_figure(chance: float) -> None:
    assert evidence_words(15.5, math.log10(chance)) == (
        f"saves 15.5 nat; noise alone does that with a chance of {chance:.0e}"
    )


@pytest.mark.parametrize("log10_p", [None, -300.0, -5921.3, -math.inf])
def test_what_is_too_small_for_a_float_is_said_to_be_less(log10_p: float | None) -> None:
    assert evidence_words(1.0, log10_p).endswith("a chance of less than 1e-300")
