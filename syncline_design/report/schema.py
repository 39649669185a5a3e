"""JSON Schema of specs, catalogs and studies, for editors.

Draft-07, which yaml-language-server reads.  The schema is the models' own, put into that draft:
quantities become shared definitions, keys that may be absent lose their `null`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, Final

from pydantic import BaseModel

from syncline_design.model.quantity import Dimension
from syncline_design.report.formats import FileName
from syncline_design.report.key_glossary import KEYS, STUDY_KEYS
from syncline_design.spec.catalog import CatalogFile
from syncline_design.spec.fields import quantity_schema
from syncline_design.spec.requirement import KEYS_OF, LIMIT_DIMENSIONS, STATED_KINDS
from syncline_design.spec.spec import Spec
from syncline_design.studies.definition import StudyFile

_TITLES: Final = {"spec": "system spec", "catalog": "catalog", "study": "trade study"}
DRAFT = "http://json-schema.org/draft-07/schema#"


def json_schema(name: FileName) -> dict[str, Any]:
    """The schema of one kind of file as plain data."""
    model = _model(name)
    words = {**KEYS, **STUDY_KEYS} if name == "study" else KEYS
    raw = model.model_json_schema(mode="validation", ref_template="#/definitions/{model}")
    definitions = raw.pop("$defs", {})
    if "Requirement" in definitions:
        _limit_by_kind(definitions["Requirement"])
        definitions["DistanceLimit"] = _by_distance()
    quantities: dict[str, Any] = {}
    body = _draft_07(raw, quantities, words)
    parts = {key: _draft_07(value, quantities, words) for key, value in definitions.items()}
    return {
        "$schema": DRAFT,
        **body,
        "title": f"syncline-design {_TITLES[name]}",
        "definitions": dict(sorted({**parts, **quantities}.items())),
    }


def _model(name: FileName) -> type[BaseModel]:
    models: dict[str, type[BaseModel]] = {"spec": Spec, "catalog": CatalogFile, "study": StudyFile}
    return models[name]


def schema_text(name: FileName) -> str:
    """The schema as JSON text."""
    return json.dumps(json_schema(name), indent=2, ensure_ascii=False) + "\n"


def _limit_by_kind(requirement: dict[str, Any]) -> None:
    """The limit's dimension and the keys besides follow from the kind."""
    share = {"type": "number", "exclusiveMinimum": 0, "exclusiveMaximum": 1}
    for key in ("quantile", "confidence", "p"):
        requirement["properties"][key] = share
    requirement["properties"]["limit"] = {}
    requirement["allOf"] = [
        {
            "if": {"properties": {"kind": {"const": kind}}, "required": ["kind"]},
            "then": _of_kind(kind, dimension),
        }
        for kind, dimension in LIMIT_DIMENSIONS.items()
    ]


def _of_kind(kind: str, dimension: Dimension) -> dict[str, Any]:
    limit: dict[str, Any] = {"type": "number", "exclusiveMinimum": 0}
    if dimension is not Dimension.DIMENSIONLESS:
        limit = quantity_schema(dimension)
    if kind in STATED_KINDS:
        limit = {"anyOf": [limit, {"$ref": "#/definitions/DistanceLimit"}]}
    own = KEYS_OF.get(kind, ())
    due = [key.lower() for key in own if key.isupper()]
    others = {key.lower() for keys in KEYS_OF.values() for key in keys}
    refused = sorted(others - {key.lower() for key in own})
    rule: dict[str, Any] = {"properties": {"limit": limit}}
    if due:
        rule["required"] = due
    return {**rule, "not": {"anyOf": [{"required": [key]} for key in refused]}}


def _by_distance() -> dict[str, Any]:
    """`{a: 0.15 m, b: 0.0075, of: 40 m}`."""
    length = quantity_schema(Dimension.LENGTH)
    return {
        "type": "object",
        "properties": {"a": length, "b": {"type": "number", "minimum": 0}, "of": length},
        "required": ["a", "b"],
        "additionalProperties": False,
    }


def _draft_07(node: Any, quantities: dict[str, Any], words: Mapping[str, str]) -> Any:
    """One schema node in draft-07; quantities are moved out into shared definitions."""
    if isinstance(node, list):
        return [_draft_07(item, quantities, words) for item in node]
    if not isinstance(node, dict):
        return node
    if "pattern" in node and ", NUMBER UNIT" in node.get("description", ""):
        key = node["description"].partition(", NUMBER UNIT")[0].replace(" ", "_")
        quantities[key] = {k: v for k, v in node.items() if k not in ("title", "default")}
        return {"$ref": f"#/definitions/{key}"}
    result: dict[str, Any] = {}
    for key, value in node.items():
        if key == "properties":
            result[key] = {
                name: _described(words[name], _draft_07(item, quantities, words))
                for name, item in value.items()
            }
        elif key == "anyOf":
            choices = [_draft_07(c, quantities, words) for c in value if c != {"type": "null"}]
            result.update(choices[0] if len(choices) == 1 else {"anyOf": choices})
        elif not (key == "default" and value is None) and not (key == "title" and _is_field(node)):
            result[key] = _draft_07(value, quantities, words)
    return result


def _described(description: str, node: dict[str, Any]) -> dict[str, Any]:
    """A property with the line that an editor shows; draft-07 ignores what stands beside $ref."""
    if "$ref" in node:
        reference = {"$ref": node["$ref"]}
        rest = {key: value for key, value in node.items() if key != "$ref"}
        return {"description": description, "allOf": [reference], **rest}
    return {**node, "description": description}


def _is_field(node: dict[str, Any]) -> bool:
    """Whether a title is only the field's name again, put there by pydantic."""
    return "properties" not in node
