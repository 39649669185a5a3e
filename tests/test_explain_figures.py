"""Worst case, THU, TVU, root mean squares and quantiles worked out: whoever puts the printed lines
into a calculator gets the printed figure, and the lines are what an own chain does."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jsonschema
import mpmath
import numpy as np
import pytest
from scipy.stats import chi2, norm
from typer.testing import CliRunner

from syncline_design.choice.chosen_system import system_of
from syncline_design.cli.app import app
from syncline_design.model.known import EffectEntry
from syncline_design.model.system import Look, System
from syncline_design.model.timing import Normal, TimingError, Uniform
from syncline_design.report.result_schemas import result_schema
from syncline_design.simulation.figures import worst_case_m
from syncline_design.simulation.situations import Situations
from syncline_design.simulation.statistical import Wanted, Worst, exact, statistical_figures
from syncline_design.spec.load import load
from syncline_design.verdict.explain_certificate import certificate
from syncline_design.verdict.explain_figures import statistical
from syncline_design.verdict.explain_shared import Worked
from syncline_design.verdict.explain_sheet import between_rows, worked_out
from syncline_design.verdict.named import ExplainedStep
from syncline_design.verdict.pinned import picked_design
from test_explain import MEETING, SPECS
from test_statistical_figures import boat, chain, lidar, plain_errors

KINDS = {
    "thu": Wanted("horizontal", 0.95), "tvu": Wanted("vertical", 0.95), "rmse": Wanted("3d"),
    "quantile": Wanted("3d", 0.9),
}  # fmt: skip
CALCULATOR = {
    "sqrt": mpmath.sqrt, "sin": mpmath.sin, "cos": mpmath.cos, "abs": abs, "max": max, "min": min,
    "__builtins__": {},
}  # fmt: skip


def by_calculator(steps: tuple[ExplainedStep, ...] | list[dict[str, Any]]) -> dict[str, Any]:
    """Every line anew with 40 digits, from nothing but what is printed; names are earlier lines."""
    known: dict[str, Any] = {}
    with mpmath.workdps(40):
        for step in steps:
            name, numbers, value = (
                (step["name"], step["numbers"], step["value"])
                if isinstance(step, dict)
                else (step.name, step.numbers, step.value)
            )
            known[name] = mpmath.mpf(eval(numbers, dict(CALCULATOR), dict(known)))
            assert float(known[name]) == pytest.approx(value, rel=1e-9, abs=1e-18), name
    return known


def worked(system: System) -> Worked:
    return Worked(system, "syncline", SimpleNamespace(stages=()), ())  # type: ignore[arg-type]


def at(system: System, wanted: Wanted, seed: int) -> Worst:
    """A figure at a situation at random, instead of the worst one."""
    situations = Situations(system)
    point = situations.starting_points(seed, 1)
    nodes = situations.nodes(4093 if situations.linear else 16381)
    value = exact(situations.moments(point, nodes), wanted, situations.dimensions)
    return Worst(wanted, value, point[:, 0], value, 0.0)


@pytest.mark.parametrize("name", MEETING)
def test_every_kind_of_every_shipped_spec_adds_up(name: str) -> None:
    case = load(SPECS / f"{name}.yaml")
    system = system_of(case, *picked_design(case, 0))
    for seed, wanted in enumerate(KINDS.values()):
        worst = at(system, wanted, seed)
        steps = statistical(worked(system), system, worst, "last")
        assert float(by_calculator(steps)["last"]) == pytest.approx(worst.value_m, rel=1e-10)
        found = {step.name: step.value for step in steps}
        assert found["beyond"] == pytest.approx(1.0, abs=2e-3)  # no shipped shift turns far
        assert found.get("shape", 1.0) == pytest.approx(1.0, abs=0.04)
    steps = certificate(worked(system), system, "last")
    value = worst_case_m(system, system.coverage_factor)
    assert float(by_calculator(steps)["last"]) == pytest.approx(value, rel=1e-10)


def test_isotropic_noise_is_the_table_of_chi_square() -> None:
    """1, 2, 3 degrees of freedom: 1.9600, 2.4477, 2.7955 sigma, nothing beyond."""
    system = boat((0.02, 0.02, 0.02))
    for axis, freedom in (("vertical", 1), ("horizontal", 2), ("3d", 3)):
        worst = at(system, Wanted(axis, 0.95), 0)  # type: ignore[arg-type]
        known = by_calculator(statistical(worked(system), system, worst, "last"))
        assert float(known["h"]) == pytest.approx(freedom, rel=1e-9)
        hand = 0.02 * math.sqrt(chi2.ppf(0.95, freedom))
        assert float(known["first_order"]) == pytest.approx(hand, rel=1e-9)
        assert float(known["beyond"] * known["shape"]) == pytest.approx(1.0, abs=1e-4)


def test_a_uniform_shift_says_that_it_has_no_normal_tails() -> None:
    """0.95 a instead of 1.96 a / sqrt(3): the factor `shape` holds it."""
    system = boat(timing=TimingError(Uniform(-0.03, 0.03)))
    (worst,) = statistical_figures(system, (Wanted("vertical", 0.95),), seed=0)
    known = by_calculator(statistical(worked(system), system, worst, "last"))
    assert float(known["last"]) == pytest.approx(0.95 * 4.0 * 0.03, rel=1e-3)
    shape = 0.95 * math.sqrt(3.0) / norm.ppf(0.975)
    assert float(known["shape"]) == pytest.approx(shape, rel=1e-3)


@pytest.mark.parametrize("seed", [9, 11])
def test_mean_and_covariance_are_those_of_an_own_chain(seed: int) -> None:
    """10 000 draws (SciPy's rotations) of two stages with clocks, arms and late stamps of 1 ms:
    mean and variances by the printed lines within 4.5 standard errors of the sample."""
    system, n = chain(seed), 10_000
    worst = at(system, Wanted("3d", 0.95), seed)
    known = by_calculator(statistical(worked(system), system, worst, "last"))
    error = plain_errors(system, worst.point, n, seed)
    axes = "ned"
    for i in range(3):
        spread = float(np.std(error[i]))
        mean = float(known[f"mean_{axes[i]}"])
        assert mean == pytest.approx(error[i].mean(), abs=4.5 * spread / math.sqrt(n) + 2e-4)
        for j in range(i, 3):
            product = (error[i] - error[i].mean()) * (error[j] - error[j].mean())
            scatter = 4.5 * float(np.std(product)) / math.sqrt(n)
            covariance = float(known[f"C_{axes[i]}{axes[j]}"])
            assert covariance == pytest.approx(product.mean(), abs=scatter + 1e-3 * spread**2)


def with_effects(system: System) -> System:
    """A late position, an arm that is off, twice the attitude's noise, jitter, a slow height."""
    first, last = system.stages[0].name, system.stages[-1].name
    listed = (
        EffectEntry("latency", "position", first, (("latency_s", 0.02),)),
        EffectEntry("lever_arm", "ranging", last, (("x_m", 0.3), ("y_m", 0.0), ("z_m", -0.2))),
        EffectEntry("noise_understated", "attitude", last, (("factor", 2.0),)),
        EffectEntry("timestamp_jitter", "ranging", first, (("std_s", 0.003),)),
        EffectEntry(
            "height_drift", "position", first, (("std_m", 0.05), ("time_constant_s", 100.0))
        ),
    )
    return replace(system, effects=listed)


def test_known_effects_have_lines_of_their_own() -> None:
    """What they displace, scatter and make of the noise, by hand for a straight way."""
    system = with_effects(lidar(position=(0.02,) * 3, attitude=(0.001,) * 3, ranging=(0.03, 0, 0)))
    stage = system.stages[0]
    straight = replace(stage, platform=replace(stage.platform, omega_max_radps=0.0))
    system = replace(system, stages=(straight,))
    worst = at(system, Wanted("3d"), 2)
    known = by_calculator(statistical(worked(system), system, worst, "last"))
    assert float(known["last"]) == pytest.approx(worst.value_m, rel=1e-10)
    assert float(known["s_roll_uav"]) == pytest.approx(0.002, rel=1e-9)
    displaced = [float(known[f"effect_1_{axis}"]) for axis in "ned"]
    assert math.hypot(*displaced) == pytest.approx(10.0 * 0.02, rel=1e-6)  # v times latency
    arm = [float(known[f"effect_2_{axis}"]) for axis in "ned"]
    assert math.hypot(*arm) == pytest.approx(math.hypot(0.3, 0.2), rel=1e-6)
    scattered = {name: float(value) for name, value in known.items() if name.startswith("scatter_")}
    sizes = sorted(
        math.hypot(*(scattered.get(f"scatter_{k}_{axis}", 0.0) for axis in "ned")) for k in (1, 2)
    )
    assert sizes == pytest.approx([10.0 * 0.003, 0.05], rel=1e-3)
    assert float(known["beyond"]) == pytest.approx(1.0, abs=2e-3)


LOOKS = (None, Look(elevation=(-1.5, -1.0)), Look((-0.3, 0.9), (-1.2, 0.4)))


@pytest.mark.parametrize("seed", range(6))
def test_the_certificate_adds_up_with_looks_clocks_and_effects(seed: int) -> None:
    system = chain(seed)
    stages = tuple(
        replace(one, look=look)
        for one, look in zip(system.stages, (LOOKS[seed % 3], LOOKS[(seed + 1) % 3]), strict=True)
    )
    system = replace(system, stages=stages)
    if seed % 2:
        system = with_effects(system)
    if seed == 4:
        first = replace(system.stages[0].position, lever_arm_m=None)  # type: ignore[type-var]
        system = replace(system, stages=(replace(stages[0], position=first), stages[1]))
    steps = certificate(worked(system), system, "last")
    value = worst_case_m(system, system.coverage_factor)
    assert float(by_calculator(steps)["last"]) == pytest.approx(value, rel=1e-10)


def test_certificate_of_a_straight_line_by_hand() -> None:
    """v (0.05 + 3 x 0.002) s plus 3 sqrt(3) sigma: no turn, no object."""
    late = TimingError(Normal(-0.05, 0.002))
    system = boat((0.02,) * 3, late)
    steps = certificate(worked(system), system, "last")
    hand = 4.0 * 0.056 + 3.0 * math.sqrt(3.0) * 0.02
    assert float(by_calculator(steps)["last"]) == pytest.approx(hand, rel=1e-9)


SPEC = """
syncline: 1
name: harbour
catalogs: [own.yaml]
requirements:
  - {id: "TVU 1", kind: tvu, limit: {a: 1.25 m, b: 0.0075}}
  - {id: WC-1, kind: worst_case, limit: {a: 2 m, b: 0.05}}
  - {id: RMS-1, kind: rmse, axis: horizontal, limit: 2 m}
  - {id: SYNC-1, kind: sync, limit: 1000}
stages:
  - name: Schiff 1
    platform: {v_max: 5 m/s, omega_max: 17 deg/s, baseline: 1 m, acceleration: 0.5 m/s^2,
               angular_acceleration: 5 deg/s^2}
    distance: 10 m .. 40 m
    look: {elevation: -90 deg .. -30 deg}
    position: {sensor: gnss, lever_arm: [0.5 m, 0 m, -3 m]}
    attitude: {sensor: ins}
    ranging: {sensor: mbes}
timestamping: own
monte_carlo: {samples: 2000}
"""
CATALOG = """
sensors:
  gnss:
    {modality: position, type: lps, sigma_position: 2 cm, rate: 5 Hz, primitives: [pps]}
  ins: {modality: attitude, type: ins, sigma_attitude: 0.03 deg, rate: 50 Hz, primitives: [pps]}
  mbes:
    modality: ranging
    type: mbes
    corrects: []
    sigma_range: {at: {5 m: 1 cm, 40 m: 3 cm}}
    sigma_bearing: {at: {0 deg: 0.1 deg, 60 deg: 0.2 deg}}
    primitives: [pps]
timestamping:
  own: {primitives: [pps], timeline: host, error: {distribution: uniform, low: -4 ms, high: 0 s}}
"""


def test_the_command_works_figures_out(tmp_path: Path) -> None:
    """Sound under way, interpolation, noise by range and by angle, limits by distance: text, HTML
    and JSON; the last line is the verdict's value, the limit is that of its distance."""
    (tmp_path / "own.yaml").write_text(CATALOG)
    (tmp_path / "s.yaml").write_text(SPEC)
    asked = [text for one in ("TVU 1", "WC-1", "RMS-1") for text in ("--explain", one)]
    outputs = [text for one in ("json", "html") for text in ("-o", f"{one}:{tmp_path / one}")]
    run = ["check", str(tmp_path / "s.yaml"), *asked, *outputs]
    done = CliRunner().invoke(app, run)
    assert done.exit_code == 0
    verdict = json.loads((tmp_path / "json").read_text())
    jsonschema.Draft202012Validator(result_schema("verdict")).validate(verdict)
    rows = {one["id"]: one for one in verdict["requirements"]}
    page = (tmp_path / "html").read_text()
    for one in verdict["explained"]:
        known, row = by_calculator(one["steps"]), rows[one["id"]]
        last = one["steps"][-1]["name"]
        assert float(known[last]) == pytest.approx(row["value"], rel=1e-10)
        assert last in done.stdout
        assert last in page
        if one["id"] == "RMS-1":
            continue
        a, b = (1.25, 0.0075) if one["id"] == "TVU 1" else (2.0, 0.05)
        limit = math.hypot(a, b * row["at_distance_m"])
        assert float(known[one["steps"][0]["name"]]) == pytest.approx(limit, rel=1e-12)
        assert row["limit"] == pytest.approx(limit, rel=1e-9)
    (tvu,) = (one["steps"] for one in verdict["explained"] if one["id"] == "TVU 1")
    known = by_calculator(tvu)
    d = float(known["d_Schiff_1"])
    assert d == pytest.approx(rows["TVU 1"]["at_distance_m"], rel=1e-9)
    by_range = 0.01 + 0.02 * (d - 5.0) / 35.0
    assert float(known["s_range_Schiff_1"]) == pytest.approx(by_range, rel=1e-9)
    assert float(known["echo_Schiff_1"]) == pytest.approx(2.0 * d / 1500.0, rel=1e-9)
    assert float(known["path_Schiff_1"]) == pytest.approx(0.5 * 0.2**2 / 8.0, rel=1e-9)
    assert float(known["std_1"]) == pytest.approx(0.004 / math.sqrt(12.0), rel=1e-9)
    assert float(known["beyond"]) == pytest.approx(1.0, abs=5e-3)
    worst = next(one for one in verdict["figures"]["worst_at"] if one["figure"] == "tvu95_m")
    assert math.hypot(*worst["stages"][0]["path_bends"]) == pytest.approx(1.0, rel=1e-9)
    assert math.hypot(*worst["stages"][0]["turn_bends"]) == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize(
    "numbers", ["'a' + 'b'", "x.y", "__import__('os')", "[1]", "1 if 2 else 3"]
)
def test_a_line_is_arithmetic_or_nothing(numbers: str) -> None:
    with pytest.raises((ValueError, KeyError)):
        worked_out(numbers, {"x": 1.0})


def test_a_table_of_noise_is_told_by_its_own_rows() -> None:
    """Rows at 10 and 100 m, looked at from 60 m, where the stage's distances end: the line is that
    of both rows, and what it gives is NumPy's interpolation."""
    shape = ((10.0, 0.02 / 0.058), (40.0, 0.03 / 0.058), (60.0, 1.0), (100.0, 0.114 / 0.058))
    for place in (5.0, 10.0, 20.0, 40.0, 55.0, 60.0, 90.0, 100.0, 120.0):
        told = between_rows(shape, 0.058, place, "d")
        expected = np.interp(place, (10.0, 40.0, 60.0, 100.0), (0.02, 0.03, 0.058, 0.114))
        assert worked_out(told, {"d": place}) == pytest.approx(expected, rel=1e-9)
    assert "0.114" in between_rows(shape, 0.058, 60.0, "d")
    assert "0.058" not in between_rows(shape, 0.058, 60.0, "d")
    assert between_rows((), 0.058, 60.0, "d") == ""
