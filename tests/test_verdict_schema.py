"""The schema of a verdict, made from its type, against the verdicts of every shipped spec."""

from __future__ import annotations

import functools
import json
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from syncline_design.machine.deadline import within_s
from syncline_design.machine.records import NotThisResultError, Record, read_as, schema_of
from syncline_design.report.checks import render_checks
from syncline_design.report.json_out import json_text
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.load import load_text
from syncline_design.verdict.tree import SCHEMA, Checked, Refused, Verdict, Verdicts
from syncline_design.verdict.verify import CheckSettings, check_files, check_loaded
from tests.checked import check_file

ROOT = Path(__file__).parent.parent
SPECS = sorted(ROOT.glob("specs/*.yaml"))
SIMULATED = ROOT / "specs" / "position_track.yaml"
VALIDATOR = jsonschema.Draft202012Validator(result_schema("verdict"))


@functools.cache
def verdict_of(spec: Path) -> Verdict:
    simulated = spec == SIMULATED
    return check_file(
        spec, CheckSettings(monte_carlo=simulated, explain=("ACC-1",) if simulated else ())
    )


def assert_written_as_the_schema_says(verdict: Verdict) -> None:
    text = json_text(verdict.to_json())
    VALIDATOR.validate(json.loads(text))
    assert json.loads(render_checks("json", [verdict])) == json.loads(text)
    assert json_text(read_as(Verdict, text).to_json()) == text


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(VALIDATOR.schema)
    assert VALIDATOR.schema["properties"]["schema"] == {"const": SCHEMA}


@pytest.mark.parametrize("spec", SPECS, ids=lambda path: path.stem)
def test_the_verdict_of_a_shipped_spec_is_as_the_schema_says_and_reads_back(spec: Path) -> None:
    assert_written_as_the_schema_says(verdict_of(spec))


def test_the_shipped_specs_show_every_part_of_a_verdict() -> None:
    """So the tests above test them all; `fails` is among the words, `meets` and `infeasible`."""
    found = [verdict_of(spec) for spec in SPECS]
    assert {verdict.verdict for verdict in found} >= {"meets", "fails", "infeasible"}
    # by a user's own logs, earlier verdicts, missions and intervals: test_measured_entries.py,
    # test_baseline.py, test_missions.py and test_choose_for.py write and read them
    elsewhere = ("measured", "baseline", "missions", "robustness")
    for part in fields(Verdict):
        assert part.name in elsewhere or any(
            getattr(verdict, part.name) is not None for verdict in found
        ), part.name


def test_a_verdict_that_time_left_open_is_as_the_schema_says() -> None:
    text = SIMULATED.read_text("utf-8")
    case = load_text(text, SIMULATED)
    with within_s(0.0):
        verdict = check_loaded(case, CheckSettings())
    assert (verdict.verdict, verdict.exit_code) == ("indeterminate", 3)
    assert_written_as_the_schema_says(verdict)


def test_a_waived_requirement_is_as_the_schema_says() -> None:
    text = SIMULATED.read_text("utf-8")
    limited = text.replace("limit:", "waiver: {reason: trial, expires: 2999-01-01}, limit:", 1)
    assert limited != text
    verdict = check_loaded(load_text(limited, SIMULATED), CheckSettings(monte_carlo=False))
    assert sum(row.waiver is not None for row in verdict.requirements) == 1
    assert_written_as_the_schema_says(verdict)


def test_a_refused_file_among_others_is_a_record_too(tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text("syncline: 1\nname: bad\n", encoding="utf-8")
    refused, verdict = check_files([bad, SIMULATED], CheckSettings(monte_carlo=False))
    assert isinstance(refused, Refused)
    assert isinstance(verdict, Verdict)
    schema = schema_of(Refused, SCHEMA, "a refused file")
    both: list[Checked] = [refused, verdict]
    several = json.loads(render_checks("json", both))
    jsonschema.Draft202012Validator(result_schema("verdicts")).validate(several)
    assert read_as(Verdicts, json.dumps(several)).verdicts == (refused, verdict)
    written = several["verdicts"]
    jsonschema.Draft202012Validator(schema).validate(written[0])
    VALIDATOR.validate(written[1])
    assert read_as(Refused, json.dumps(written[0])) == refused
    VALIDATOR.validate(written[0])  # alone it goes by the name of a verdict
    with pytest.raises(NotThisResultError):
        read_as(Verdict, json.dumps(written[0]))


@pytest.mark.parametrize(
    ("path", "wrong"),
    [
        (("verdict",), "perhaps"),
        (("spec", "stages"), None),
        (("requirements", 0, "limit"), "0.3 m"),
        (("requirements", 0, "status"), "passed"),
        (("syncline", "total_m"), None),
        (("syncline", "ledger", 0, "kind"), "noise"),
        (("warnings",), [{"code": "x"}]),
        (("provenance", "seed"), 1.5),
    ],
)
def test_what_is_no_verdict_is_seen(path: tuple[Any, ...], wrong: Any) -> None:
    data = json.loads(json_text(verdict_of(SIMULATED).to_json()))
    node = data
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = wrong
    assert not VALIDATOR.is_valid(data)
    with pytest.raises(NotThisResultError, match=str(path[0])):
        read_as(Verdict, json.dumps(data))


def test_later_keys_do_no_harm_and_earlier_verdicts_still_read() -> None:
    """Keys are added within a version: one too many is passed over, an added one may be missing."""
    data = verdict_of(SIMULATED).to_json()
    later = json.loads(json_text(data | {"weather": "fair"}))
    VALIDATOR.validate(later)
    assert json_text(read_as(Verdict, json.dumps(later)).to_json()) == json_text(data)
    for key in ("figures", "assumptions", "sources", "effects", "choice"):
        del later[key]
    VALIDATOR.validate(later)
    assert read_as(Verdict, json.dumps(later)).choice is None


def test_no_record_of_a_verdict_can_be_changed() -> None:
    def records(value: Any) -> list[Record]:
        if isinstance(value, tuple):
            return [found for entry in value for found in records(entry)]
        if not isinstance(value, Record):
            return []
        assert is_dataclass(value)
        return [value, *(r for f in fields(value) for r in records(getattr(value, f.name)))]

    found = records(verdict_of(SIMULATED))
    assert len({type(record) for record in found}) > 12
    for record in found:
        with pytest.raises(AttributeError):
            setattr(record, fields(record)[0].name, None)  # type: ignore[arg-type]
