"""Errors along a trajectory's file, against speed times delay and against all draws together."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flown_specs import FAST, SLOW, TURN_S, flight, flown
from html_page import Page
from syncline_design.machine.records import read_as
from syncline_design.model.system import Platform, Sensor, Stage, System
from syncline_design.model.timing import Constant, Normal, TimingError
from syncline_design.report.on_verdict import on_verdict
from syncline_design.report.render_html import html
from syncline_design.simulation import SimulationSettings, cross_check, sample_errors, simulate
from syncline_design.simulation.along import SAMPLES, STRETCHES, along
from syncline_design.spec.load import load
from syncline_design.verdict.settings import CheckSettings
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import check_loaded
from tests.simulation_systems import fixed_wing


def asked(path: Path, samples: int = 2000) -> SimulationSettings:
    return SimulationSettings(samples, envelope="trajectory", trajectory=path)


def late(position_s: float) -> System:
    """Without noise; the position is late by a constant."""
    roles = [
        Sensor(role, role, (0.0,) * 3, TimingError(Constant(mu)))  # type: ignore[arg-type]
        for role, mu in (("position", position_s), ("attitude", 0.0), ("ranging", 0.0))
    ]
    return System((Stage("uav", "uav", Platform(20.0, 0.5, 100.0), *roles),))


def test_a_delay_moves_a_place_by_speed_times_delay(tmp_path: Path) -> None:
    system, settings = late(0.02), asked(flight(tmp_path))
    found = along(cross_check(system, settings).monte_carlo, system, settings)
    assert found is not None
    assert len(found.stretches) == STRETCHES
    for one in found.stretches:
        if one.from_s < TURN_S + 1.0 and one.to_s > TURN_S - 1.0:
            continue  # where the speed changes
        speed = SLOW if one.to_s < TURN_S else FAST
        assert one.speed_mps == pytest.approx(speed, rel=1e-9)
        assert one.quantile95_m == pytest.approx(0.02 * speed, rel=1e-9)
        assert one.rms_m == pytest.approx(0.02 * speed, rel=1e-9)
        assert one.turn_rate_radps == pytest.approx(0.0, abs=1e-12)
        middle = 0.5 * (one.from_s + one.to_s)
        place = SLOW * middle if speed == SLOW else SLOW * TURN_S + FAST * (middle - TURN_S)
        assert one.north_m == pytest.approx(place, rel=1e-6)
        assert (one.east_m, one.distance_m) == (0.0, 100.0)
    assert found.largest.from_s > TURN_S - 1.0


def test_the_mean_square_over_the_stretches_is_that_of_the_whole_flight(tmp_path: Path) -> None:
    """Of independent draws, to five standard errors of both (a chance of 6e-7)."""
    system = fixed_wing(Normal(0.0, 5e-3))
    settings = asked(flight(tmp_path), samples=40_000)
    found = along(cross_check(system, settings).monte_carlo, system, settings)
    assert found is not None
    whole = np.sum(sample_errors(system, settings) ** 2, axis=1)
    mean = np.mean([one.rms_m**2 for one in found.stretches])
    # stretches share their random numbers: the mean is no better than of one of them
    spread = np.std(whole) * np.sqrt(1.0 / len(whole) + 1.0 / SAMPLES)
    assert abs(mean - np.mean(whole)) < 5.0 * spread
    slow, fast = found.stretches[2], found.stretches[-3]
    assert fast.rms_m > slow.rms_m


def test_manoeuvres_and_free_motion_have_no_way_to_draw(tmp_path: Path) -> None:
    def way(settings: SimulationSettings) -> object:
        one_tau = replace(settings, tau_grid_s=(1e-3,))  # the worst cases are not looked at
        return simulate(fixed_wing(), one_tau).monte_carlo.along

    assert way(SimulationSettings(500)) is None
    assert way(asked("circle", 500)) is None  # type: ignore[arg-type]
    assert way(asked(flight(tmp_path), 500)) is not None


def test_a_page_draws_the_way_and_says_where_errors_are_largest(tmp_path: Path) -> None:
    case = load(flown(tmp_path))
    plain = check_loaded(case, CheckSettings())
    assert plain.monte_carlo is not None
    assert plain.monte_carlo.along is None  # only where a figure was asked for
    verdict = check_loaded(case, CheckSettings(cloud=True))
    assert verdict.monte_carlo is not None
    found = verdict.monte_carlo.along
    assert found is not None
    assert read_as(Verdict, json.dumps(verdict.to_json())) == verdict
    page = Page(html(on_verdict(verdict)))
    assert "Errors along the trajectory" in page.text
    assert page.unbalanced == []
    limit = min(row.limit for row in verdict.requirements if row.kind == "accuracy")
    beyond = sum(one.quantile95_m > limit for one in found.stretches)
    assert (f"{beyond} of {STRETCHES} exceed" in page.text) is (beyond > 0)
