"""Printed figures to one standard deviation: against scipy's distributions and against draws."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from syncline_design.model.conversion import conversion_of, kinds, printed_value
from syncline_design.model.quantity import Dimension, UnitError

LENGTH, ANGLE = Dimension.LENGTH, Dimension.ANGLE


def factor(kind: str) -> float:
    found = conversion_of(kind)
    assert found is not None
    return found.factor


@pytest.mark.parametrize(
    ("kind", "figure_of_one_sigma"),
    [
        ("1 sigma", 1.0),
        ("2 sigma", 2.0),
        ("3 sigma", 3.0),
        ("rms", 1.0),
        ("drms", math.sqrt(2.0)),
        ("2drms", 2.0 * math.sqrt(2.0)),
        ("mrse", math.sqrt(3.0)),
        ("cep50", stats.rayleigh.ppf(0.5)),
        ("cep95", stats.rayleigh.ppf(0.95)),
        ("cep68", stats.rayleigh.ppf(0.68)),
        ("sep50", math.sqrt(stats.chi2.ppf(0.5, 3))),
        ("median", stats.halfnorm.ppf(0.5)),
        ("50 %", stats.halfnorm.ppf(0.5)),
        ("68.27 %", stats.halfnorm.ppf(0.6827)),
        ("95 %", stats.halfnorm.ppf(0.95)),
        ("99 %", stats.halfnorm.ppf(0.99)),
        ("max", 1.0 / stats.uniform(-1.0, 2.0).std()),
        ("resolution", 1.0 / stats.uniform(-0.5, 1.0).std()),
        ("1/e2 width", 4.0),
        ("typical", 1.0),
        ("unstated", 1.0),
    ],
)
def test_a_kind_is_what_its_distribution_says(kind: str, figure_of_one_sigma: float) -> None:
    assert factor(kind) == pytest.approx(1.0 / figure_of_one_sigma, rel=1e-12)


def test_beam_width_is_that_of_a_gaussian_at_half_power() -> None:
    """Half of the peak of the density is at half the width from the middle."""
    half = 1.0 / factor("beam width") / 2.0
    assert stats.norm.pdf(half) / stats.norm.pdf(0.0) == pytest.approx(0.5, rel=1e-12)
    edge = 1.0 / factor("1/e2 width") / 2.0
    assert stats.norm.pdf(edge) / stats.norm.pdf(0.0) == pytest.approx(math.exp(-2.0), rel=1e-12)


def test_draws_fall_inside_a_figure_as_often_as_its_kind_says() -> None:
    """200 000 draws; the shares are off by 5 standard errors in one run of 3.5 million."""
    draws = np.random.default_rng(4).normal(size=(200_000, 3))
    level, distance = np.hypot(draws[:, 0], draws[:, 1]), np.linalg.norm(draws, axis=1)
    for kind, sizes, share in (
        ("cep50", level, 0.5),
        ("cep95", level, 0.95),
        ("sep50", distance, 0.5),
        ("95 %", np.abs(draws[:, 2]), 0.95),
    ):
        found = float(np.mean(sizes <= 1.0 / factor(kind)))
        assert abs(found - share) < 5 * math.sqrt(share * (1 - share) / len(draws)), kind
    rms = math.sqrt(float(np.mean(level**2)))
    assert rms * factor("drms") == pytest.approx(1.0, rel=0.01)


@pytest.mark.parametrize("kind", ["", "95", "0 %", "cep", "cep00", "100 %", "rmss", "listed"])
def test_what_says_nothing_on_a_spread_has_no_conversion(kind: str) -> None:
    assert conversion_of(kind) is None


def test_every_kind_is_either_converted_or_plain() -> None:
    plain = [kind for kind in kinds() if conversion_of(kind) is None]
    assert plain == ["listed", "average", "nominal", "capability", "by type"]


@pytest.mark.parametrize(
    ("text", "dimension", "over", "value"),
    [
        ("0.01 m", LENGTH, None, 0.01),
        ("< 0.03 m", LENGTH, None, 0.03),
        ("+/- 25 mm", LENGTH, None, 0.025),
        ("0.01 m + 1 ppm", LENGTH, 10_000.0, 0.02),
        ("5 mm + 0.5 ppm", LENGTH, 2_000.0, 0.006),
        ("11 mm + 0.1 %", LENGTH, 5.0, 0.016),
        ("2 %", LENGTH, 4.0, 0.08),
        ("0.06 %", ANGLE, None, 0.0006),
        ("0.1 deg", ANGLE, None, math.radians(0.1)),
    ],
)
def test_printed_values(text: str, dimension: Dimension, over: float, value: float) -> None:
    assert printed_value(text, dimension, over) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("text", ["2 %", "0.01 m + 1 ppm", "0.1 deg", "7", "0.01 m + "])
def test_a_printed_value_that_cannot_be_read_says_so(text: str) -> None:
    with pytest.raises(UnitError):
        printed_value(text, LENGTH, None)


def test_the_guide_gives_the_factor_of_every_kind() -> None:
    """The table of docs/catalogs.md against scipy, not against the table of the code."""
    guide = (Path(__file__).parent.parent / "docs" / "catalogs.md").read_text("utf-8")
    section = guide.split("## What is printed, and what is counted")[1].split("\n## ")[0]
    rows = [line.strip("|").split("|") for line in section.splitlines() if line.startswith("| `")]
    told = {row[0].strip(): row[2].strip() for row in rows}
    wanted = {
        "`1 sigma`, `std`, `rms`": 1.0,
        "`drms`": math.sqrt(0.5),
        "`2drms`": math.sqrt(0.125),
        "`mrse`": math.sqrt(1 / 3),
        "`cep50`": 1 / stats.rayleigh.ppf(0.5),
        "`sep50`": 1 / math.sqrt(stats.chi2.ppf(0.5, 3)),
        "`50 %`, `median`": 1 / stats.halfnorm.ppf(0.5),
        "`95 %`": 1 / stats.halfnorm.ppf(0.95),
        "`max`": stats.uniform(-1.0, 2.0).std(),
        "`resolution`": stats.uniform(0.0, 1.0).std(),
        "`beam width`": 1 / (2 * math.sqrt(2 * math.log(2))),
        "`1/e2 width`": 0.25,
        "`typical`, `unstated`": 1.0,
    }
    assert set(told) == {*wanted, "`2 sigma`, `3 sigma`"}
    for kind, factor in wanted.items():
        assert float(told[kind]) == pytest.approx(factor, abs=5e-5), kind
    named = {word for row in told for word in re.findall(r"`([^`]+)`", row)}
    assert named - {"50 %"} == {kind for kind in kinds() if conversion_of(kind)} - {"cep95"}
