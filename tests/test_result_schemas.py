"""Schemas of results, made from their types, against real results."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import get_args

import jsonschema
import pytest

from syncline_design.machine.records import NotThisResultError, Record, read_as
from syncline_design.paper.reproduce import Reproduction, reproduce
from syncline_design.report.json_out import json_text
from syncline_design.report.result_schemas import RESULTS, ResultName, result_schema
from syncline_design.simulation import Simulation, SimulationSettings, simulate
from syncline_design.spec.load import load
from syncline_design.verdict.simulated_spec import simulate_spec
from tests.simulation_systems import fixed_wing

ROOT = Path(__file__).parent.parent


def of_a_spec() -> Simulation:
    return simulate_spec(load(ROOT / "specs" / "position_track.yaml"), samples=500, seed=0).result


def with_few_samples() -> Simulation:
    """Quantiles that no sample bounds, and no spec."""
    settings = SimulationSettings(samples=40, limit_m=0.3, tau_grid_s=(0.0, 1e-3))
    return simulate(fixed_wing(), settings)


def along_a_manoeuvre() -> Simulation:
    settings = SimulationSettings(samples=40, envelope="trajectory", tau_grid_s=(1e-3,))
    return simulate(fixed_wing(), settings)


def reproduction() -> Reproduction:
    return reproduce(seed=3)


def reproduction_without_simulation() -> Reproduction:
    return reproduce(simulate=False, seed=0)


REAL: Mapping[ResultName, tuple[Callable[[], Record], ...]] = {
    "reproduction": (reproduction, reproduction_without_simulation),
    "simulation": (of_a_spec, with_few_samples, along_a_manoeuvre),
}
CASES = [(name, made) for name, all_made in REAL.items() for made in all_made]


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case[0]}-{case[1].__name__}")
def test_the_schema_accepts_real_results_and_they_read_back(
    case: tuple[ResultName, Callable[[], Record]],
) -> None:
    name, made = case
    result = made()
    text = json_text(result.to_json())
    schema = result_schema(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    jsonschema.Draft202012Validator(schema).validate(json.loads(text))
    assert schema["properties"]["schema"] == {"const": json.loads(text)["schema"]}
    assert json_text(read_as(type(result), text).to_json()) == text


def test_what_a_simulation_lacks_is_seen() -> None:
    found = with_few_samples().to_json()
    validator = jsonschema.Draft202012Validator(result_schema("simulation"))
    for path, wrong in (
        (("monte_carlo", "quantiles"), {"0.5": {"value_m": 1.0}}),
        (("monte_carlo", "envelope"), "wide"),
        (("monte_carlo", "worst_case"), None),
        (("syncline", "tau_s"), None),
        (("grid",), [{"tau_s": 1.0}]),
    ):
        changed = json.loads(json.dumps(found))
        node = changed
        for key in path[:-1]:
            node = node[key]
        node[path[-1]] = wrong
        assert not validator.is_valid(changed), path
        with pytest.raises(NotThisResultError, match=path[0]):
            read_as(Simulation, json.dumps(changed))


def test_an_open_quantile_is_infinite_again_when_read() -> None:
    result = with_few_samples()
    again = read_as(Simulation, json_text(result.to_json()))
    assert again == replace(result, grid=again.grid)
    assert again.monte_carlo.quantile(0.997).high_m == float("inf")


@pytest.mark.parametrize("name", get_args(ResultName))
def test_a_result_is_read_by_its_own_name_alone(name: ResultName) -> None:
    """Another version, or another kind, is none: the schema says `const`, so does reading."""
    kind, schema = RESULTS[name]
    for one in get_args(kind) or (kind,):
        with pytest.raises(NotThisResultError) as caught:
            read_as(one, json.dumps({"schema": f"{schema}0"}))
        assert f"schema: Input should be '{schema}'" in str(caught.value)


def _loose(node: object, path: str = "") -> Iterator[str]:
    """Where a schema says `object` and nothing of what is in it."""
    if isinstance(node, list):
        for k, one in enumerate(node):
            yield from _loose(one, f"{path}[{k}]")
    elif isinstance(node, dict):
        told = {"properties", "$ref", "anyOf", "allOf", "oneOf"} & node.keys()
        if node.get("type") == "object" and not told and node.get("additionalProperties") in (
            None, True, {},
        ):  # fmt: skip
            yield path
        for key, one in node.items():
            yield from _loose(one, f"{path}.{key}")


def test_a_loose_object_is_seen() -> None:
    inner = {"type": "object", "additionalProperties": True}
    assert list(_loose({"properties": {"a": [inner]}})) == [".properties.a[0]"]
    assert list(_loose({"type": "object", "additionalProperties": {"type": "number"}})) == []


@pytest.mark.parametrize("name", get_args(ResultName))
def test_every_object_of_a_result_says_what_is_in_it(name: ResultName) -> None:
    assert list(_loose(result_schema(name))) == []
