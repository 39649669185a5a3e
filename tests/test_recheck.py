"""The recheck against 80-digit formulas written down again, its limits, and its independence."""

from __future__ import annotations

import itertools
import tomllib
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import mpmath
import pytest

from syncline_design.choice.evaluate import evaluate
from syncline_design.choice.front import front
from syncline_design.choice.problem import build_problem, selection_of, sole_design
from syncline_design.choice.ranked import iter_best
from syncline_design.model.known import Known
from syncline_design.spec.case import Case
from syncline_design.spec.load import load, load_text
from syncline_design.spec.selection import ClockSelection, Selection
from syncline_design.verdict.recheck import IMPLIED_SYNC, NotADesign, recheck

ROOT = Path(__file__).parent.parent
SPECS = sorted((ROOT / "specs").glob("*.yaml"))

CHAIN = """\
syncline: 1
name: A chain by hand
requirements:
  - {{id: ACC, kind: accuracy, limit: {limit}}}
sync_model: {model}
stages:
  - name: ship
    platform: {{name: s, v_max: 4 m/s, omega_max: 17 deg/s, distance: 1000 m, baseline: 10 m}}
    clock: near
    position:
      sensor: {{modality: position, sigma_position: [8 mm, 8 mm, 16 mm], primitives: [pps]}}
      timestamping: {{error: {{distribution: uniform, low: -10 ns, high: 30 ns}}, timeline: utc}}
    attitude:
      sensor: {{modality: attitude, sigma_attitude: 0.002 deg, primitives: [pps]}}
      timestamping: {{error: {{distribution: normal, mean: -7 us, std: 2 us}}}}
    ranging:
      sensor:
        {{modality: ranging, sigma_range: 15 mm, sigma_bearing: [0.04 deg, 0.05 deg],
         primitives: [pps]}}
      timestamping: {{error: {{distribution: constant, value: 5 us}}}}
  - name: diver
    platform: {{name: d, v_max: 2 m/s, omega_max: 8.7 deg/s, distance: 30 m, baseline: 5 m}}
    clock: far
    attitude:
      sensor: {{modality: attitude, sigma_attitude: 0.1 deg, primitives: [pps]}}
      timestamping: {{error: {{distribution: empirical, values: [1 us, -9 us, 2 us]}}}}
    ranging:
      sensor:
        {{modality: ranging, sigma_range: 1 mm, sigma_bearing: 0.45 deg, primitives: [pps]}}
      timestamping:
        {{error: {{distribution: uniform, low: 0 ms, high: 2 ms, calibrated: 50 us}}}}
coverage_factor: 2.5
catalogs: [clocks.yaml]
"""
CLOCKS = """\
clocks:
  near: {offset: {distribution: normal, mean: 1 us, std: 2 us}}
  far: {offset: {distribution: constant, value: 3 us}, drift: 1.5 ppm, holdover: 10 min}
"""


def chain(folder: Path, model: str, limit: str = "5 m") -> Case:
    (folder / "clocks.yaml").write_text(CLOCKS)
    path = folder / "spec.yaml"
    path.write_text(CHAIN.format(model=model, limit=limit))
    return load(path)


def by_hand(model: str) -> dict[str, Any]:
    """The chain above worked out term by term (call with 80 digits)."""
    mp, deg = mpmath.mpf, mpmath.pi / 180
    ship_turn, diver_turn = 1000 * 17 * deg, mp(30) * mp("8.7") * deg
    tau = {
        "gnss": mp("30e-9"),
        "ins": mp("7e-6") + mp("2.5") * mp("2e-6"),
        "usbl": mp("5e-6"),
        "imu": mp("9e-6"),
        "sonar": mp("1e-3") + mp("50e-6"),  # half the width, and what calibration leaves
    }
    near = mp("1e-6") + mp("2.5") * mp("2e-6")
    far = mp("3e-6") + mp("1.5e-6") * 600
    bounds = {
        "gnss": (tau["gnss"] + tau["usbl"] + near, mp(4)),  # utc against the ship's clock
        "ins": (tau["ins"] + tau["usbl"], ship_turn),
        "usbl": (tau["usbl"] + tau["sonar"] + near + far, mp(2)),  # two host clocks
        "imu": (tau["imu"] + tau["sonar"], diver_turn),
    }
    errors = {
        "gnss": mpmath.sqrt(2 * mp("0.008") ** 2 + mp("0.016") ** 2),
        "ins": mpmath.sqrt(3) * mp("0.002") * deg * 1000,
        "usbl": mp("0.015") + mpmath.sqrt(mp("0.04") ** 2 + mp("0.05") ** 2) * deg * 1000,
        "imu": mpmath.sqrt(3) * mp("0.1") * deg * 30,
        "sonar": mp("0.001") + mpmath.sqrt(2) * mp("0.45") * deg * 30,
    }
    rate = 4 + ship_turn + 2 + diver_turn
    largest = max(bound for bound, _ in bounds.values())
    sync = rate * largest
    if model == "per_sensor":
        sync = sum(bound * speed for bound, speed in bounds.values())
    own = {"gnss": 4, "ins": 4 + ship_turn, "usbl": 4 + ship_turn}
    own |= {"imu": 2 + diver_turn, "sonar": 2 + diver_turn}
    ratios = [tau[name] * own[name] / errors[name] for name in tau]
    sensor = sum(errors.values())
    return {
        "sensor_error_m": sensor,
        "tau_sys_s": largest,
        "sync_error_m": sync,
        "total_m": sensor + sync,
        "sync_ratio": max([rate * largest / sensor, *ratios]),
    }


def selected(loaded: Case) -> Selection:
    found = sole_design(build_problem(loaded))
    assert found is not None
    return selection_of(*found)


@pytest.mark.parametrize("model", ["syncline", "per_sensor"])
def test_chain_by_hand(model: str, tmp_path: Path) -> None:
    loaded = chain(tmp_path, model)
    found = recheck(loaded, selected(loaded))
    with mpmath.workdps(80):
        for name, expected in by_hand(model).items():
            exact = getattr(found, name)
            value = mpmath.mpf(exact.numerator) / exact.denominator
            assert abs(value / expected - 1) < mpmath.mpf(10) ** -50, name


@pytest.mark.parametrize(("part", "passes"), [("0", True), ("-1e-12", False), ("1e-12", True)])
def test_limit_printed_as_the_total_passes_and_1e_12_below_fails(
    part: str, passes: bool, tmp_path: Path
) -> None:
    with mpmath.workdps(80):
        total = by_hand("syncline")["total_m"] * (1 + mpmath.mpf(part))
        text = mpmath.nstr(total, 17)
    loaded = chain(tmp_path, "syncline", f"{text} m")
    accuracy = [r for r in recheck(loaded, selected(loaded)).requirements if r.kind == "accuracy"]
    assert [r.passed for r in accuracy] == [passes]


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_agrees_with_the_tables_on_shipped_specs(path: Path) -> None:
    """Two independent sets of formulas, 45 digits, every point of every front."""
    loaded = load(path)
    problem = build_problem(loaded)
    designs = [(problem, point.design) for point in front(problem)]
    sole = sole_design(problem)
    designs += [sole] if sole is not None else []
    for tables, design in designs:
        sums, found = evaluate(tables, design), recheck(loaded, selection_of(tables, design))
        assert (sums.cost, sums.mass, sums.power) == (found.cost, found.mass, found.power)
        for name in ("sensor_error_m", "tau_sys_s", "sync_error_m", "total_m"):
            assert abs(getattr(sums, name) - getattr(found, name)) < Fraction(1, 10**45), name
        assert float(sums.total_m) == float(found.total_m)


def test_chosen_designs_pass_and_the_first_refused_ones_do_not() -> None:
    """What the search yields passes; what it passes over on the way fails some requirement."""
    loaded = load(ROOT / "specs" / "uav_corridor.yaml")
    problem = build_problem(loaded)
    good = set(itertools.islice(iter_best(problem), 60))
    for design in good:
        assert recheck(loaded, selection_of(problem, design)).passed
    anything = replace(
        problem, limits=replace(problem.limits, accuracy_m=None, cost=None, mass=None)
    )
    first = next(iter(iter_best(problem)))
    refused = list(itertools.takewhile(lambda d: d != first, iter_best(anything)))[:25]
    assert refused
    assert not any(recheck(loaded, selection_of(problem, d)).passed for d in refused)


def test_implied_sync_requirement_is_listed(tmp_path: Path) -> None:
    loaded = chain(tmp_path, "syncline")
    first = recheck(loaded, selected(loaded)).requirements[0]
    assert (first.id, first.kind, first.implied, first.limit) == (IMPLIED_SYNC, "sync", True, 1)
    assert first.passed == (first.value is not None and float(first.value) < 1.0)


def test_budgets_compare_as_written() -> None:
    text = (ROOT / "specs" / "usv_mapping.yaml").read_text()
    loaded = load_text(text, ROOT / "specs" / "usv_mapping.yaml")
    cost = recheck(loaded, selected(loaded)).cost
    assert cost is not None
    before = next(r for r in loaded.spec.requirements if r.kind == "cost").limit.text  # type: ignore[attr-defined]
    for shift, passes in ((Fraction(0), True), (Fraction(-1, 100), False)):
        limit = f"{float(cost + shift):.2f} EUR"
        other = load_text(text.replace(before, limit), ROOT / "specs" / "usv_mapping.yaml")
        found = [r for r in recheck(other, selected(other)).requirements if r.kind == "cost"]
        assert [r.passed for r in found] == [passes]


def test_shared_hardware_and_effects_count() -> None:
    path = ROOT / "specs" / "subsea_survey_large_sv.yaml"
    loaded = load(path)
    one = recheck(loaded, selected(loaded))
    role = ("vessel", "ranging")
    added = Fraction(0.25)
    other = recheck(loaded, selected(loaded), Known({role: 1e-3}, (("boresight", "vessel", 0.25),)))
    grown = other.sync_rate_mps * (other.tau_sys_s - one.tau_sys_s)
    assert abs(other.total_m - one.total_m - added - grown) < Fraction(1, 10**45)
    assert other.tau_sys_s > one.tau_sys_s


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"sensor": "kongsberg_mru5"}, "not open"),
        ({"method": "ptp"}, "cannot stamp"),
        ({"primitive": "network"}, "not open|cannot stamp"),
    ],
)
def test_what_the_spec_does_not_allow_is_refused(change: dict[str, str], message: str) -> None:
    loaded = load(ROOT / "specs" / "usv_mapping.yaml")
    selection = selected(loaded)
    roles = (replace(selection.roles[0], **change), *selection.roles[1:])  # type: ignore[arg-type]
    with pytest.raises(NotADesign, match=message):
        recheck(loaded, replace(selection, roles=roles))
    with pytest.raises(NotADesign, match="nothing is chosen"):
        recheck(loaded, replace(selection, roles=selection.roles[1:]))


def test_clock_that_the_spec_does_not_offer_is_refused(tmp_path: Path) -> None:
    loaded = chain(tmp_path, "syncline")
    selection = selected(loaded)
    clocks = (ClockSelection("ship", "far"), ClockSelection("diver", "far"))
    with pytest.raises(NotADesign, match="far is not open to vehicle ship"):
        recheck(loaded, replace(selection, clocks=clocks))


def test_shares_no_code_with_what_it_checks() -> None:
    """The import contract is in force, and names every room that the recheck must not use."""
    config = tomllib.loads((ROOT / "pyproject.toml").read_text())
    contracts = config["tool"]["importlinter"]["contracts"]
    own = [c for c in contracts if c.get("source_modules") == ["syncline_design.verdict.recheck"]]
    assert len(own) == 1
    forbidden = set(own[0]["forbidden_modules"])
    assert {
        f"syncline_design.{room}" for room in ("choice", "spec.exact", "model.budget")
    } <= forbidden
    text = (ROOT / "syncline_design" / "verdict" / "recheck.py").read_text()
    for room in sorted(forbidden):
        assert room not in text
