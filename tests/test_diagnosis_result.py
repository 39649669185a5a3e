"""Real diagnoses as data: their schema, the way back from JSON, and every output of them."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import jsonschema
import pytest

from html_page import Page
from once import once
from syncline_design.comparison.meaning import DiagnosisAndDesign, meaning, with_design
from syncline_design.diagnosis import DiagnosisSettings, diagnose
from syncline_design.machine.records import read_as
from syncline_design.report.diagnoses import render_diagnose
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.render_console import console
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.load import load
from tests.world import WorldLog, hidden, make_log, scenario

EXAMPLES = Path(__file__).parents[1] / "examples"
IRON = hidden("heading_hard_iron", "attitude", sin_rad=0.015, cos_rad=0.01)
TURNED = hidden("frame_convention", "attitude", convention="yaw_sign")


def of(log: WorldLog, *exclude: str) -> DiagnosisAndDesign:
    with TemporaryDirectory() as folder:
        spec = Path(folder) / "spec.yaml"
        spec.write_text(log.spec_yaml(), encoding="utf-8")
        data = log.to_csv(Path(folder) / "log.csv")
        found = diagnose(spec, [data], DiagnosisSettings(exclude_effects=exclude))
        means = meaning(load(spec), found.effects_entries(), seed=0)
    return with_design(found, means)


@once
def example() -> DiagnosisAndDesign:
    """The shipped example, the first minute and a half of it."""
    spec = EXAMPLES / "hidden_latency.yaml"
    lines = (EXAMPLES / "hidden_latency.csv").read_text("utf-8").splitlines(keepends=True)
    with TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        log.write_text("".join(lines[:901]), "utf-8")
        found = diagnose(spec, [log])
    means = meaning(load(spec), found.effects_entries(), seed=0)
    assert means is not None
    return with_design(found, means)


@once
def clean() -> DiagnosisAndDesign:
    return of(make_log(scenario("multirotor_lines", 7, 60.0, 5.0), ()))


@once
def unexplained() -> DiagnosisAndDesign:
    return of(make_log(scenario("multirotor_lines", 12, 80.0, 5.0), (IRON,)), "heading_hard_iron")


@once
def turned() -> DiagnosisAndDesign:
    return of(make_log(scenario("car_stops", 31, 60.0, 5.0), (TURNED,)))


VERDICTS = {example: "explained", clean: "agrees", unexplained: "unexplained", turned: "explained"}
REAL = pytest.mark.parametrize("make", VERDICTS, ids=lambda make: make.__name__)


@REAL
def test_it_is_what_its_schema_says(make: object) -> None:
    found = make()  # type: ignore[operator]
    assert found.verdict == VERDICTS[make]  # type: ignore[index]
    schema = result_schema("diagnosis")
    jsonschema.Draft202012Validator.check_schema(schema)
    written = json.loads(render_diagnose("json", found))
    jsonschema.Draft202012Validator(schema).validate(written)
    assert written == found.to_json()
    assert list(written) == list(found.to_json())


@REAL
def test_it_reads_back_as_it_was(make: object) -> None:
    """But for figures without end, which JSON has no number for."""
    found = make()  # type: ignore[operator]
    again = read_as(DiagnosisAndDesign, render_diagnose("json", found))
    assert again.to_json() == found.to_json()
    assert again.findings == found.findings
    assert again.exit_code == found.exit_code


@REAL
def test_every_output_says_it(make: object) -> None:
    found = make()  # type: ignore[operator]
    page = Page(render_diagnose("html", found))
    assert page.unbalanced == []
    texts = {"page": page.text, "markdown": render_diagnose("markdown", found),
             "console": console(on_diagnosis(found))}  # fmt: skip
    for kind, text in texts.items():
        said = (
            text.replace("\u00a0", " ")
            .replace("\u2212", "-")
            .replace("\u00b5", "u")
            .replace("\\", "")
        )
        for finding in found.findings:
            for estimate in finding.parameters.values():
                assert estimate.text in said, (kind, estimate)
        # As words: the name of a temporary folder, which the console prints, may hold "nan".
        assert kind == "page" or not re.search(r"\b(None|nan)\b|Record|Estimate\(", said)
    read = render_diagnose("json", found)
    assert ("held_rows" in read) == (found.gap.regime.held_rows is not None)


def test_a_key_that_is_not_there_is_not_read_as_one() -> None:
    """What is missing is no error of later states, what has another type is."""
    data = clean().to_json()
    assert read_as(DiagnosisAndDesign, json.dumps(data | {"added_later": 1})).verdict == "agrees"
    with pytest.raises(ValueError, match="remaining"):
        read_as(DiagnosisAndDesign, json.dumps(data | {"remaining": "nothing"}))


def test_a_log_that_differs_more_than_white_noise_agrees_as_far_as_it_can_tell() -> None:
    """A constant of three standard deviations in a short log may be slow noise: 1.4 times."""
    agreed = clean()
    assert agreed.gap.held_out is not None
    assert agreed.gap.expected_rms_m is not None
    assert on_diagnosis(agreed).outcome.tone == "good"
    large = replace(agreed.gap.held_out.after, rms_m=1.4 * agreed.gap.expected_rms_m)
    gap = replace(agreed.gap, held_out=replace(agreed.gap.held_out, after=large))
    told = on_diagnosis(replace(agreed, gap=gap))
    assert told.outcome.tone == "warn"
    assert "1.4 times what white noise of the spec's size makes" in told.outcome.word
    assert any("slow noise" in str(one) for one in told.sentences)
