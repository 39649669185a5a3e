"""Records against `json`, `jsonschema` and plain dictionaries written by hand."""

from __future__ import annotations

import copy
import json
import math
import pickle
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import jsonschema
import numpy as np
import pytest

from syncline_design.machine.records import (
    NotThisResultError,
    Record,
    Unbounded,
    optional,
    read_as,
    schema_of,
    with_texts,
)
from syncline_design.spec.load import load
from syncline_design.verdict.tree import Verdict
from syncline_design.verdict.verify import CheckSettings, check_loaded

SPEC = Path(__file__).parent.parent / "specs" / "usv_wire_missing.yaml"


@dataclass(frozen=True, slots=True)
class Change(Record):
    """One change."""

    kind: Literal["limit", "distance"]
    from_: float | None
    to: float | str | None
    title: str
    text: str | None = optional()


@dataclass(frozen=True, slots=True)
class Whole(Record):
    """A result of the tests."""

    schema: str
    changes: tuple[Change, ...]
    sums: Mapping[str, float | None]
    passed: bool
    count: int


RESULT = Whole(
    "x/v1",
    (Change("limit", 0.1, "far", "a"), Change("distance", math.inf, None, "b", "said")),
    {"3d": 1.5, "horizontal": math.nan},
    True,
    3,
)
PLAIN: dict[str, Any] = {
    "schema": "x/v1",
    "changes": [
        {"kind": "limit", "from": 0.1, "to": "far", "title": "a"},
        {"kind": "distance", "from": None, "to": None, "title": "b", "text": "said"},
    ],
    "sums": {"3d": 1.5, "horizontal": None},
    "passed": True,
    "count": 3,
}


def test_json_holds_every_field_in_order_and_nothing_that_json_lacks() -> None:
    assert RESULT.to_json() == PLAIN
    assert json.dumps(RESULT.to_json(), allow_nan=False) == json.dumps(PLAIN)


def test_what_json_cannot_say_is_refused_not_guessed() -> None:
    with pytest.raises(TypeError, match="complex has no place"):
        Whole("x/v1", (), {"a": 1j}, True, 1).to_json()  # type: ignore[dict-item]


def test_figures_of_numpy_are_plain_figures() -> None:
    made = Whole("x/v1", (), {"a": np.float64(0.25)}, True, 1).to_json()
    assert type(made["sums"]["a"]) is float


def test_a_record_comes_back_from_its_json_and_later_keys_do_no_harm() -> None:
    text = json.dumps({**PLAIN, "added_later": [1]})
    assert read_as(Whole, text).to_json() == PLAIN


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"count": "3"}, "count: "),
        ({"changes": [{**PLAIN["changes"][0], "kind": "other"}]}, "changes[0].kind: "),
        ({"changes": [{"kind": "limit"}]}, "changes[0].from: Field required"),
        ({"sums": {"a": "1"}}, "sums.a"),
        ({"passed": 1}, "passed: "),
    ],
)
def test_other_json_is_refused_with_its_place(change: dict[str, Any], said: str) -> None:
    with pytest.raises(NotThisResultError) as refused:
        read_as(Whole, json.dumps(PLAIN | change))
    assert said in str(refused.value)


def test_text_that_is_no_json_is_refused() -> None:
    with pytest.raises(NotThisResultError, match="the file: Invalid JSON"):
        read_as(Whole, "{")


def test_the_schema_accepts_the_result_and_refuses_another() -> None:
    schema = schema_of(Whole, "x/v1", "a result")
    validator = jsonschema.Draft202012Validator(schema)
    validator.check_schema(schema)
    validator.validate(RESULT.to_json())
    validator.validate({**PLAIN, "added_later": 1})
    for wrong in (
        {**PLAIN, "schema": "x/v2"},
        {**PLAIN, "passed": "yes"},
        {key: value for key, value in PLAIN.items() if key != "sums"},
        {**PLAIN, "changes": [{"kind": "limit", "from_": 0.1, "to": 1, "title": "a"}]},
    ):
        assert not validator.is_valid(wrong), wrong
    assert "title" in schema["$defs"]["Change"]["properties"]


def test_texts_are_changed_everywhere_and_nothing_else() -> None:
    shouted = with_texts(RESULT, str.upper)
    assert shouted.changes[1].text == "SAID"
    assert shouted.sums["3D"] == 1.5
    assert RESULT.changes[1].text == "said"
    assert shouted.count == 3


@dataclass(frozen=True, slots=True)
class Open(Record):
    """A figure that may have no end."""

    high_m: Unbounded
    low_m: Unbounded = 0.0


def test_a_figure_without_end_is_null_and_infinite_again_when_read() -> None:
    assert Open(math.inf).to_json() == {"high_m": None, "low_m": 0.0}
    assert read_as(Open, '{"high_m": null, "low_m": 2}') == Open(math.inf, 2.0)
    validator = jsonschema.Draft202012Validator(schema_of(Open, "x/v1", "open"))
    validator.validate(Open(math.inf).to_json())
    assert not validator.is_valid({"high_m": "far"})
    with pytest.raises(NotThisResultError, match="high_m"):
        read_as(Open, '{"high_m": "inf"}')


@pytest.mark.parametrize("figure", ["1e999", "-1e999", "NaN", "Infinity", "1" + "0" * 400])
def test_figures_that_json_cannot_hold_are_refused(figure: str) -> None:
    text = json.dumps(PLAIN).replace("0.1", figure)
    assert figure in text
    with pytest.raises(NotThisResultError, match=r"changes\[0\]\.from: .*finite"):
        read_as(Whole, text)


def test_the_mappings_of_a_result_are_as_frozen_as_it_is() -> None:
    """`verdict.design.stages[0].roles.clear()` emptied a frozen verdict, and none had a hash."""
    verdict = check_loaded(load(SPEC), CheckSettings(monte_carlo=False))
    assert verdict.design is not None
    roles: Any = verdict.design.stages[0].roles
    known = dict(roles)
    for change in (
        roles.clear,
        lambda: roles.update(position=None),
        lambda: roles.setdefault("x", 1),
        lambda: roles.pop("position"),
        lambda: roles.__setitem__("x", 1),
        lambda: roles.__delitem__("position"),
    ):
        with pytest.raises(TypeError, match="frozen"):
            change()
    assert roles == known
    for again in (pickle.loads(pickle.dumps(verdict)), copy.deepcopy(verdict)):
        assert again == verdict
        assert hash(again) == hash(verdict)
        with pytest.raises(TypeError, match="frozen"):
            again.design.stages[0].roles.clear()
    assert read_as(Verdict, json.dumps(verdict.to_json())) == verdict


def test_a_case_is_not_emptied_by_who_looks_at_it() -> None:
    catalog: Any = load(SPEC).catalog
    with pytest.raises(TypeError, match="frozen"):
        catalog.sensors.clear()
    assert pickle.loads(pickle.dumps(catalog)) == catalog
