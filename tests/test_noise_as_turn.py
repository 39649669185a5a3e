"""Noise that an attitude and bearings could both make: a group of which one row is broken."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.comparison import accept as acceptance
from syncline_design.comparison.accept import AcceptSettings, accept
from syncline_design.comparison.noise_as_turn import either
from syncline_design.diagnosis.built import Sighted
from syncline_design.diagnosis.noise_split import NoiseFactor, NoiseFactors
from syncline_design.diagnosis.result import Diagnosis, Finding
from syncline_design.spec.load import load
from tests.acceptance_samples import EXAMPLE, first_rows, found_in_first_rows, rows_of

SIGMA = (5e-4, 5e-4, 1e-3)
BEARING = 5e-4


@pytest.fixture(scope="module")
def found() -> Diagnosis:
    return found_in_first_rows()


def loud(found: Diagnosis, sensor: str = "attitude") -> Finding:
    part = replace(found.findings[0].parameters["latency_s"], value=3.0, unit="", interval95=None)
    return replace(
        found.findings[0], effect="noise_understated", sensor=sensor, also=None, kind="noise",
        parameters={"factor": part}, material=True, aliases=(),
    )  # fmt: skip


def split(tilts: float, yaw: float, bearings: float) -> dict[str, NoiseFactors]:
    attitude = NoiseFactors(
        (NoiseFactor(tilts, 0.8 * tilts, 1.2 * tilts, ("roll", "pitch")),
         NoiseFactor(yaw, 0.8 * yaw, 1.2 * yaw, ("yaw",))), (0.5, 0.5), SIGMA,
    )  # fmt: skip
    ranging = NoiseFactors(
        (NoiseFactor(1.0, 0.9, 1.1, ("range",)),
         NoiseFactor(bearings, 0.0, 1.0, ("azimuth", "elevation"))),
        (0.5, 0.5), (0.02, BEARING, BEARING),
    )  # fmt: skip
    return {"multirotor/attitude": attitude, "multirotor/ranging": ranging}


def test_bearings_do_in_the_place_of_an_attitude_that_is_alike_in_all_directions(
    found: Diagnosis,
) -> None:
    """3.3 x 0.5 and 1.7 x 1 mrad are one turn of 1.67; what moves a beam as much is drawn here."""
    both = either(loud(found), split(3.3, 1.7, 0.3))
    assert both is not None
    attitude, ranging = both
    assert (attitude.sensors, ranging.sensors) == (("attitude",), ("ranging",))
    assert attitude.parameters["factor"].interval95 == pytest.approx((0.8 * 3.3, 1.2 * 3.3))
    rng = np.random.default_rng(1)
    beam = np.array([0.6, 0.0, 0.8])
    turns = rng.standard_normal((200_000, 3)) * 3.3 * SIGMA[0]
    known = rng.standard_normal((200_000, 3)) * SIGMA[0]  # of it a sound attitude makes as much
    across = [np.cross(each, beam).std(axis=0) for each in (turns, known)]
    left = np.sqrt(np.sum(across[0] ** 2) - np.sum(across[1] ** 2)) / math.sqrt(2.0)
    told = ranging.parameters["factor"]
    assert told.value == pytest.approx(math.hypot(left / BEARING, 0.3), rel=0.01)
    assert told.interval95 is not None
    assert told.interval95[0] < float(told.value) < told.interval95[1]


@pytest.mark.parametrize(
    ("tilts", "yaw", "bearings", "sensor"),
    [
        (3.3, 1.7, 1.0, "attitude"),  # bearings scatter as they should: it is no noise of theirs
        (3.3, 3.3, 0.3, "attitude"),  # unlike in its directions
        (1.0, 4.0, 0.3, "attitude"),  # yaw alone
        (3.3, 1.7, 0.3, "position"),
    ],
)
def test_nothing_else_does(
    found: Diagnosis, tilts: float, yaw: float, bearings: float, sensor: str
) -> None:
    assert either(loud(found, sensor), split(tilts, yaw, bearings)) is None


def test_both_rows_are_of_a_group_of_which_one_is_broken(found: Diagnosis, tmp_path: Path) -> None:
    """The attitude's row was broken by it, and that of the bearings, which made it, held."""
    told = replace(found, findings=(loud(found),), verdict="explained")
    with pytest.MonkeyPatch.context() as patched:
        sight = Sighted(told, factors=split(3.3, 1.7, 0.3))
        patched.setattr(acceptance, "sighted", lambda *_: sight)
        result = accept(load(EXAMPLE), [first_rows(tmp_path)], AcceptSettings(("noise",)), seed=0)
    (group,) = result.groups
    assert result.exit_code == 1
    assert set(group.rows) == {"multirotor/attitude/noise", "multirotor/ranging/noise"}
    rows = rows_of(result)
    assert {rows[role, "noise"].one_of for role in ("attitude", "ranging")} == {1}
    assert rows["position", "noise"].status != "broken"
