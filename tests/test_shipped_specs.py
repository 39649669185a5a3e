"""The shipped specs end as their header says: by plain enumeration, and by `check`."""

from __future__ import annotations

import functools
import json
import math
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from plain_enumeration import Enumeration, Outcome, failed, limits_of, number, read_spec
from syncline_design.cli.app import app
from syncline_design.spec.load import load

SPECS = sorted((Path(__file__).parent.parent / "specs").glob("*.yaml"))
EXIT_CODES = {"meets": 0, "fails": 1, "infeasible": 1}
by_spec = pytest.mark.parametrize("path", SPECS, ids=lambda p: p.stem)


@functools.cache
def header(path: Path) -> dict[str, list[str]]:
    """`# Key: value` lines at the top of a spec."""
    found: dict[str, list[str]] = {}
    for line in path.read_text("utf-8").splitlines():
        if not line.startswith("#"):
            break
        key, colon, value = line.removeprefix("# ").partition(": ")
        if colon and key in ("Expect", "Cost", "Fails", "Alone"):
            found.setdefault(key, []).append(value)
    return found


@functools.cache
def enumerated(path: Path) -> tuple[Outcome, ...]:
    return tuple(Enumeration(read_spec(path)))


@functools.cache
def checked(path: Path) -> tuple[int, dict[str, Any]]:
    """Exit code and JSON of `check`."""
    result = CliRunner().invoke(app, ["check", str(path), "--output", "json:-"])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    data: dict[str, Any] = json.loads(result.stdout)
    return result.exit_code, data


def cheapest(path: Path) -> list[Outcome]:
    """The designs of least cost that meet every requirement."""
    spec = read_spec(path)
    good = [outcome for outcome in enumerated(path) if not failed(spec, outcome)]
    least = min(outcome.cost for outcome in good)
    return [outcome for outcome in good if outcome.cost <= least + 1e-6]


def requirement_limits(path: Path) -> dict[str, tuple[str, float]]:
    return limits_of(read_spec(path))


def test_there_are_pinned_specs_for_one_two_and_three_stages_and_every_outcome() -> None:
    pinned = {len(enumerated(p)[0].options) for p in SPECS if len(enumerated(p)) == 1}
    assert {3, 5, 7} <= pinned
    assert {header(p)["Expect"][0] for p in SPECS} == set(EXIT_CODES)


@by_spec
def test_a_spec_loads(path: Path) -> None:
    loaded = load(path)
    assert loaded.spec.name
    assert len(loaded.spec.stages) == len(read_spec(path)["stages"])


@by_spec
def test_the_header_is_what_plain_enumeration_finds(path: Path) -> None:
    spec, said = read_spec(path), header(path)
    outcomes = enumerated(path)
    good = [outcome for outcome in outcomes if not failed(spec, outcome)]
    if good:
        assert said["Expect"] == ["meets"]
        assert cheapest(path)[0].cost == pytest.approx(number(said["Cost"][0]), abs=1e-6)
    elif len(outcomes) == 1:
        assert said["Expect"] == ["fails"]
        assert failed(spec, outcomes[0]) == set(said["Fails"][0].split())
    else:
        assert said["Expect"] == ["infeasible"]


@by_spec
def test_the_smallest_change_alone_is_what_the_header_says(path: Path) -> None:
    """`# Alone: ID LIMIT`: with that limit, and no smaller change, the spec can be met."""
    spec = read_spec(path)
    kinds = {name: kind for name, (kind, _) in limits_of(spec).items()}
    for line in header(path).get("Alone", []):
        name, _, limit = line.partition(" ")
        others = [o for o in enumerated(path) if failed(spec, o) <= {name}]
        values = [o.cost if kinds[name] == "cost" else o.total_m for o in others]
        assert min(values) == pytest.approx(number(limit), rel=1e-3)


@by_spec
def test_check_says_what_the_header_says(path: Path) -> None:
    code, data = checked(path)
    assert data["verdict"] == header(path)["Expect"][0]
    assert code == EXIT_CODES[data["verdict"]]
    missed = {r["id"] for r in data["requirements"] if r["status"] == "fail"}
    if data["verdict"] != "infeasible":
        assert missed == set(" ".join(header(path).get("Fails", [])).split())


@by_spec
def test_check_chooses_a_design_that_enumeration_finds_cheapest(path: Path) -> None:
    _, data = checked(path)
    if data["verdict"] == "infeasible":
        assert data["infeasibility"]
        return
    among = list(enumerated(path)) if data["verdict"] == "fails" else cheapest(path)
    chosen = [
        (role["sensor"], role["primitive"], role["timestamping"])
        for stage in data["design"]["stages"]
        for name in ("position", "attitude", "ranging")
        for role in [stage["roles"].get(name)]
        if role is not None
    ]
    same = [
        outcome
        for outcome in among
        if [(o.sensor, o.primitive, o.method) for o in outcome.options] == chosen
    ]
    assert same, chosen
    totals = [outcome.total_m for outcome in same]
    assert any(data["syncline"]["total_m"] == pytest.approx(t, rel=1e-9) for t in totals)
    outcome = min(same, key=lambda o: abs(o.total_m - data["syncline"]["total_m"]))
    assert data["design"]["cost"] == pytest.approx(outcome.cost, abs=1e-6)
    for key, total in (("mass", outcome.mass_kg), ("power", outcome.power_w)):
        found = data["design"][key]  # null where an entry of the design gives none
        assert found is None if math.isnan(total) else found == pytest.approx(total, rel=1e-9)
    assert data["syncline"]["tau_s"] == pytest.approx(outcome.tau_s, rel=1e-9)
    assert data["syncline"]["tau_crit_s"] == pytest.approx(outcome.tau_crit_s, rel=1e-9)
    assert data["syncline"]["sensor_error_m"] == pytest.approx(outcome.sensor_error_m, rel=1e-9)


@pytest.mark.parametrize("name", ["subsea_survey_large_sv", "usv_mapping"])
def test_assumptions_of_the_catalog_are_named(name: str) -> None:
    path = next(p for p in SPECS if p.stem == name)
    result = CliRunner().invoke(app, ["check", str(path)])
    assert "assumption" in result.stdout.lower()


def test_the_paper_payload_gives_the_papers_survey_figures() -> None:
    """16 ms for the large vessel (printed), 1.4127 m for the roof (its own formula and tables)."""
    path = next(p for p in SPECS if p.stem == "subsea_survey_large_sv")
    outcome = enumerated(path)[0]
    assert outcome.tau_crit_s == pytest.approx(16.11e-3, abs=5e-6)
    assert outcome.sensor_error_m == pytest.approx(1.4127, abs=5e-5)
