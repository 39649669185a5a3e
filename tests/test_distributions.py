"""Tails and quantiles of the package beside the library's distributions, which load slowly."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest
from scipy import stats

from syncline_design.model import distributions as own

FREEDOMS = (1, 2, 3, 7, 15, 240)
CHANCES = (1e-12, 1e-4, 0.025, 0.5, 0.9)
FAR = np.array([0.0, 1e-9, 0.3, 2.0, 30.0, 400.0, 5000.0])


@pytest.mark.parametrize("freedom", FREEDOMS)
def test_chi_square_and_student_are_the_librarys(freedom: int) -> None:
    chi2 = stats.chi2(freedom)
    beyond = [own.chi_square_beyond(x, freedom) for x in FAR]
    assert beyond == pytest.approx(chi2.sf(FAR), rel=1e-9)
    finite = FAR[:-1]
    assert own.chi_square_log_beyond(finite, freedom) == pytest.approx(
        chi2.logsf(finite), rel=1e-9, abs=1e-15
    )
    assert own.chi_square_log_beyond(-1.0, freedom) == 0.0
    assert own.chi_square_beyond(-1.0, freedom) == 1.0
    for p in CHANCES:
        assert own.chi_square_limit(p, freedom) == pytest.approx(chi2.isf(p), rel=1e-9)
        assert own.student_limit(p, freedom) == pytest.approx(
            stats.t.isf(p, freedom), rel=1e-9, abs=1e-12
        )
    found = own.student_log_density(FAR, freedom, 2.5)
    assert found == pytest.approx(stats.t.logpdf(FAR, freedom, scale=2.5), rel=1e-9)


@pytest.mark.parametrize("first", [1, 3, 6])
def test_fisher_is_the_librarys(first: int) -> None:
    second = np.array([2.0, 13.0, 90.0])
    for x in (-0.1, *FAR[1:]):
        found = own.fisher_log_beyond(np.full(3, x), first, second)
        assert found == pytest.approx(stats.f.logsf(x, first, second), rel=1e-9, abs=1e-15)
    for p in (1e-4, 0.5, 0.9):
        assert own.fisher_limit(p, first, 13) == pytest.approx(stats.f.isf(p, first, 13), rel=1e-9)


def test_the_normal_is_the_librarys() -> None:
    for p in CHANCES:
        assert own.normal_limit(p) == pytest.approx(stats.norm.isf(p), rel=1e-12, abs=1e-15)
    assert own.normal_beyond(6.0) == pytest.approx(stats.norm.sf(6.0), rel=1e-12)
    found = own.normal_log_density(FAR, 0.2)
    assert found == pytest.approx(stats.norm.logpdf(FAR, scale=0.2), rel=1e-12)


def test_what_no_number_can_say_is_infinite_or_none() -> None:
    """Of 1e6 on one degree of freedom the chance underflows; none has no limit."""
    assert own.chi_square_log_beyond(1e6, 1) == -math.inf
    assert own.chi_square_limit(0.0, 3) == math.inf
    assert math.isnan(own.student_limit(0.025, 0))


def test_a_diagnosis_loads_no_library_of_distributions() -> None:
    """It took a second of every `diagnose`, as long as a log of some hundred rows."""
    code = (
        "import sys; import syncline_design.diagnosis, syncline_design.campaign.joint, "
        "syncline_design.planning.next_drive, syncline_design.comparison.meaning; "
        "print('scipy.stats' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
