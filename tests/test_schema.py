"""The JSON Schema in the draft that editors read, and the starter spec of `init`."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, get_args

import jsonschema
import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.report.key_glossary import KEYS, STUDY_KEYS
from syncline_design.report.result_schemas import ResultName, result_schema_text
from syncline_design.report.scaffold import (
    SCHEMA_NAME,
    SPEC_NAME,
    STUDY_NAME,
    STUDY_SCHEMA_NAME,
    init_project,
)
from syncline_design.report.schema import json_schema, schema_text
from syncline_design.spec.load import BadInput, load
from syncline_design.spec.yaml_text import read

ROOT = Path(__file__).parent.parent
CORPUS = Path(__file__).parent / "corpus"
SPECS, CATALOGS = sorted(ROOT.glob("specs/*.yaml")), sorted(ROOT.glob("catalogs/**/*.yaml"))
EXPECTED: dict[str, dict[str, Any]] = read(CORPUS / "expected.yaml").data

# Slips that a schema alone can see: the shape of one value, not what it refers to.
VISIBLE = (
    "numbers/no_as_number", "numbers/quoted", "numbers/true_as_number", "numbers/zero",
    "numbers/number_as_name", "numbers/fraction_as_count", "units/megamolar", "units/bare_number",
    "units/seconds_for_length", "units/decimal_comma", "units/angle_without_unit",
    "units/tolerance_on_limit", "model/typo_key", "model/typo_key_nested", "model/unknown_kind",
    "model/quantile_missing", "model/quantile_on_accuracy", "model/quantile_out_of_range",
    "model/missing_stages", "model/lever_arm_two_axes", "model/format_version",
    "model/distribution_unknown", "model/sync_limit_with_unit", "yaml/list_at_top",
)  # fmt: skip


def plain(value: Any) -> Any:
    """As JSON has it: lists for tuples."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    return [plain(item) for item in value] if isinstance(value, tuple) else value


def validator(name: Any) -> jsonschema.Draft7Validator:
    return jsonschema.Draft7Validator(json.loads(schema_text(name)))


@pytest.mark.parametrize("name", ["spec", "catalog", "study"])
def test_the_schema_is_valid_draft_07(name: Any) -> None:
    schema = json_schema(name)
    assert schema["$schema"] == "http://json-schema.org/draft-07/schema#"
    jsonschema.Draft7Validator.check_schema(schema)
    text = json.dumps(schema)
    for newer in ("$defs", "prefixItems", "unevaluatedProperties", "dependentRequired"):
        assert newer not in text


def test_every_key_has_its_line_for_the_editor() -> None:
    used: set[str] = set()
    for name in ("spec", "catalog"):
        schema = json_schema(name)  # type: ignore[arg-type]
        for part in (schema, *schema["definitions"].values()):
            for key, node in part.get("properties", {}).items():
                if part is not schema["definitions"].get("Requirement") or "description" in node:
                    assert node["description"] == KEYS[key]
                used.add(key)
    assert used == set(KEYS)


@pytest.mark.parametrize("path", SPECS, ids=lambda p: p.stem)
def test_shipped_specs_satisfy_it(path: Path) -> None:
    validator("spec").validate(plain(read(path).data))


@pytest.mark.parametrize("path", CATALOGS, ids=lambda p: p.stem)
def test_shipped_catalogs_satisfy_it(path: Path) -> None:
    validator("catalog").validate(plain(read(path).data))


def test_accepted_files_of_the_corpus_satisfy_it() -> None:
    check = validator("spec")
    for name, case in EXPECTED.items():
        if case["outcome"] == "accepted":
            check.validate(plain(read(CORPUS / f"{name}.yaml").data))


@pytest.mark.parametrize("name", VISIBLE)
def test_slips_of_shape_do_not(name: str) -> None:
    data = plain(read(CORPUS / f"{name}.yaml").data)
    assert not validator("spec").is_valid(data)


def test_a_wrong_catalog_does_not_satisfy_it() -> None:
    check = validator("catalog")
    data = plain(read(CATALOGS[0]).data)
    section, entries = next((k, v) for k, v in data.items() if isinstance(v, dict))
    entries[next(iter(entries))]["costt"] = "1 EUR"
    assert not check.is_valid({section: entries})


def test_the_starter_spec_is_accepted_by_loader_and_schema(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "project"
    written = init_project(folder)
    names = [SPEC_NAME, SCHEMA_NAME, STUDY_NAME, STUDY_SCHEMA_NAME]
    assert [str(path.relative_to(folder)) for path in written] == names
    spec = load(folder / SPEC_NAME)
    assert spec.spec.stages
    assert spec.text.startswith(f"# yaml-language-server: $schema=./{SCHEMA_NAME}\n")
    schema = json.loads((folder / SCHEMA_NAME).read_text(encoding="utf-8"))
    jsonschema.Draft7Validator(schema).validate(plain(read(folder / SPEC_NAME).data))


def test_the_starter_study_runs_and_satisfies_its_schema(tmp_path: Path) -> None:
    from syncline_design.studies import load_study

    init_project(tmp_path)
    study = tmp_path / STUDY_NAME
    assert len(load_study(study)) == 9
    named = read(study).text.partition("$schema=")[2].partition("\n")[0]
    schema = json.loads((study.parent / named).read_text(encoding="utf-8"))
    jsonschema.Draft7Validator(schema).validate(plain(read(study).data))


@pytest.mark.parametrize("path", sorted(ROOT.glob("specs/studies/*.yaml")), ids=lambda p: p.stem)
def test_shipped_studies_satisfy_the_schema(path: Path) -> None:
    validator("study").validate(plain(read(path).data))


STUDY_PARTS: dict[str, tuple[dict[str, Any], bool]] = {
    "one base as text": ({"base": "a.yaml"}, True),
    "a range of the grid": ({"grid": {"x": {"low": "1 m", "high": "2 m", "count": 3}}}, True),
    "a range without a count": ({"grid": {"x": {"low": "1 m", "high": "2 m"}}}, False),
    "a value that is no list": ({"grid": {"x": "40 m"}}, False),
    "no values": ({"grid": {"x": []}}, False),
    "nothing to vary": ({"grid": {}}, False),
    "a sampled span": ({"sample": {"count": 5, "over": {"x": "1 m .. 2 m"}}}, True),
    "a sampled figure": ({"sample": {"count": 5, "over": {"x": "1 m"}}}, False),
    "a sample without a count": ({"sample": {"over": {"x": "1 m .. 2 m"}}}, False),
    "an unknown rule": ({"meets_when": "most"}, False),
    "a key that is none": ({"gird": {"x": [1]}}, False),
}


@pytest.mark.parametrize("what", STUDY_PARTS)
def test_the_study_schema_sees_slips_of_shape(what: str) -> None:
    part, fits = STUDY_PARTS[what]
    data = {"study": 1, "name": "x", "base": ["a.yaml"], **part}
    assert validator("study").is_valid(data) is fits


def test_every_key_of_a_study_has_its_line() -> None:
    schema = json_schema("study")
    used = {
        key: node["description"]
        for part in (schema, *schema["definitions"].values())
        for key, node in part.get("properties", {}).items()
        if "description" in node
    }
    assert {"grid", "sample", "over", "meets_when", "heat_map"} <= set(used)
    assert used == {key: {**KEYS, **STUDY_KEYS}[key] for key in used}


@pytest.mark.parametrize("taken", [SPEC_NAME, SCHEMA_NAME, STUDY_SCHEMA_NAME])
def test_init_never_overwrites(tmp_path: Path, taken: str) -> None:
    (tmp_path / taken).write_text("mine", encoding="utf-8")
    with pytest.raises(BadInput, match="there already"):
        init_project(tmp_path)
    assert [p.name for p in tmp_path.iterdir()] == [taken]
    assert (tmp_path / taken).read_text(encoding="utf-8") == "mine"


def test_init_leaves_nothing_when_it_cannot_write(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(BadInput, match="cannot write"):
        init_project(tmp_path / "file" / "inside")
    (tmp_path / SPEC_NAME).symlink_to(tmp_path / "dangling")
    with pytest.raises(BadInput, match="there already"):
        init_project(tmp_path)
    assert not os.path.lexists(tmp_path / SCHEMA_NAME)


@pytest.mark.parametrize("name", get_args(ResultName))
def test_the_schema_of_every_result_is_valid_and_printed(name: Any) -> None:
    """What real results satisfy is tested beside each of them."""
    text = result_schema_text(name)
    jsonschema.Draft202012Validator.check_schema(json.loads(text))
    printed = CliRunner().invoke(app, ["schema", name])
    assert (printed.exit_code, printed.stdout) == (0, text)
