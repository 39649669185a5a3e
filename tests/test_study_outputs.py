"""Outputs of a study: every format well-formed, places right, hostile text harmless."""

from __future__ import annotations

import csv
import html
import io
import json
import re
import time
from dataclasses import replace
from datetime import date
from pathlib import Path
from xml.etree import ElementTree

import jsonschema
import pytest

from html_page import Page
from report_samples import HOSTILE
from study_specs import SPEC, STUDY, write
from syncline_design.machine.records import read_as, schema_of
from syncline_design.report.on_study import on_study
from syncline_design.report.progress_line import ProgressLine, StepLine, busy, progress_text
from syncline_design.report.render_console import console, paragraph, table_lines
from syncline_design.report.result_schemas import result_schema
from syncline_design.report.studies import STUDY_FORMATS, render_study
from syncline_design.report.study_words import stored_text
from syncline_design.report.table import table
from syncline_design.studies import Progress, StudyResult, StudySettings, run_study
from syncline_design.studies.data import StudyData, study_data
from syncline_design.studies.record import SCHEMA as CASE_SCHEMA
from syncline_design.studies.record import CaseRecord

LINE_OF_ACC = 4
STAMPED = "primitive: pps, timestamping: gpio"
PINNED = (  # every case has the payload of 33 362 EUR
    SPEC.replace("candidates: [ublox_f9p_rtk, ublox_f9p_pvt]", f"sensor: ublox_f9p_rtk, {STAMPED}")
    .replace("candidates: [sbg_apogee, sbg_ellipse]", f"sensor: sbg_ellipse, {STAMPED}")
    .replace("candidates: [velodyne_hdl32e, riegl_vux1uav]", f"sensor: velodyne_hdl32e, {STAMPED}")
    .replace("timestamping: {candidates: [hardware, gpio]}", "")
)


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    return run_study(write(tmp_path_factory.mktemp("outputs")), StudySettings(workers=1))


def text_of(name: str, result: StudyResult) -> str:
    content = render_study(name, result)
    assert isinstance(content, str)
    return content


def test_every_format_repeats_its_bytes(result: StudyResult) -> None:
    again = run_study(result.study.path)
    for name in STUDY_FORMATS:
        assert render_study(name, result) == render_study(name, again), name


def test_junit_has_a_test_per_case(result: StudyResult) -> None:
    root = ElementTree.fromstring(text_of("junit", result))
    tests = list(root.iter("testcase"))
    missing = [t for t in tests if t.find("failure") is not None]
    assert len(tests) == len(result) == int(root.get("tests", "0"))
    assert len(missing) == len(result) - result.counts["meets"] == int(root.get("failures", "0"))
    assert missing
    assert {t.get("line") for t in missing} == {str(LINE_OF_ACC)}


def test_allowed_misses_are_skipped_tests(tmp_path: Path) -> None:
    done = run_study(write(tmp_path, STUDY + "meets_when: any\n"))
    root = ElementTree.fromstring(text_of("junit", done))
    assert (done.verdict, done.exit_code) == ("meets", 0)
    assert root.get("failures") == "0"
    assert int(root.get("skipped", "0")) == len(done) - done.counts["meets"] > 0
    assert "::error" not in text_of("github", done)


WAIVED = """\
  - id: COST-1
    kind: cost
    limit: 30000 EUR
    waiver: {reason: next budget, expires: 2027-03-31}
"""


@pytest.mark.parametrize(("today", "over"), [(date(2026, 11, 30), False), (date(2027, 4, 1), True)])
def test_waivers_and_what_fails_are_said_wherever_cases_are(
    tmp_path: Path, today: date, over: bool
) -> None:
    """A payload of 33 362 EUR against 30 000 EUR: waived, then no more."""
    spec = re.sub(r"  - \{id: COST-1.*\n", WAIVED, PINNED)
    done = run_study(write(tmp_path, STUDY, spec), StudySettings(workers=1, today=today))
    failing = [case.number for case in done.cases() if case.verdict != "meets"]
    rows = list(csv.DictReader(io.StringIO(text_of("csv", done))))
    shown = console(on_study(done), colour=False)
    page = Page(str(render_study("html", done))).text
    told = json.loads(text_of("sarif", done))["runs"][0]["results"]
    kept = [one for one in told if "suppressions" in one]
    assert all("COST-1" in row["failing"] for row in rows)
    assert {row["waived"] for row in rows if row["verdict"] == "meets"} == (
        set() if over else {"COST-1"})  # fmt: skip
    for text in (shown, page):
        assert ("waiver of COST-1 expired" in text) == over
        assert ("waiver expired on 2027-03-31: next budget" in " ".join(text.split())) == over
        assert ("waived until 2027-03-31: next budget" in " ".join(text.split())) != over
        assert f"{len(rows)} of {len(rows)}" in text.replace("\u00a0", " ")
    assert len(failing) == (len(rows) if over else sum("ACC-1" in row["failing"] for row in rows))
    assert (len(kept), [one["ruleId"] for one in kept]) == ((0, []) if over else (1, ["cost"]))


def test_several_bases_are_told_apart_where_their_least_is_shown(tmp_path: Path) -> None:
    (tmp_path / "dear.yaml").write_text(
        PINNED.replace("100000 EUR", "30000 EUR").replace("Small UAV", "Dear"), "utf-8"
    )
    study = write(tmp_path, STUDY.replace("[spec.yaml]", "[spec.yaml, dear.yaml]"), PINNED)
    shown = " ".join(console(on_study(run_study(study)), colour=False).split())
    assert "Of all values of base the case that costs least." in shown
    assert "Dear (none of 6 meets)" in shown


def test_sarif_points_at_the_requirement_once(result: StudyResult) -> None:
    log = json.loads(text_of("sarif", result))
    found = log["runs"][0]["results"]
    assert found[0]["ruleId"] == "accuracy"
    place = found[0]["locations"][0]["physicalLocation"]
    assert place["region"]["startLine"] == LINE_OF_ACC
    assert place["artifactLocation"]["uri"].endswith("/spec.yaml")
    missed = len(result) - result.counts["meets"]
    assert f"missed in {missed} of {len(result)} cases" in found[0]["message"]["text"]


def test_github_annotates_the_requirement(result: StudyResult) -> None:
    lines = text_of("github", result).splitlines()
    errors = [line for line in lines if line.startswith("::error ")]
    assert f"line={LINE_OF_ACC}," in errors[0]
    assert lines[-1].startswith("::notice ::")


def test_json_says_what_the_table_says(result: StudyResult) -> None:
    data = json.loads(text_of("json", result))
    rows = list(csv.DictReader(io.StringIO(text_of("csv", result))))
    assert data["schema"] == "syncline-design/study/v1"
    assert [c["verdict"] for c in data["cases"]] == [r["verdict"] for r in rows]
    assert data["counts"] == result.counts
    assert data["factors"][0]["values"] == ["40 m", "60 m", "100 m"]


def test_a_study_satisfies_its_schema_and_reads_back(result: StudyResult, tmp_path: Path) -> None:
    """Real ones: a grid with fronts and ends; cases that cannot be as combined."""
    combined = STUDY.partition("grid:")[0] + (
        'grid:\n  "stages[uav].position.sensor": [ublox_f9p_rtk]\n'
        '  "stages[uav].position.timestamping": [gpio, ptp]\n'
    )
    schema = result_schema("study-result")
    for done in (result, run_study(write(tmp_path, combined))):
        text = text_of("json", done)
        jsonschema.validate(json.loads(text), schema)
        assert read_as(StudyData, text) == study_data(done, done.summary)
    assert {case.verdict for case in done.cases()} == {"meets", "refused"}


def test_every_case_that_is_kept_satisfies_its_schema(result: StudyResult) -> None:
    schema = schema_of(CaseRecord, CASE_SCHEMA, "case")
    files = list(result.store.folder.glob("*/*.json"))
    assert len(files) == len(result)
    for file in files:
        kept = json.loads(file.read_text())["record"]
        jsonschema.validate({**kept, "schema": CASE_SCHEMA}, schema)


def test_the_page_is_offline_and_complete(result: StudyResult) -> None:
    page = text_of("html", result)
    assert "default-src 'none'" in html.unescape(page)
    assert "<script src" not in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    for heading in ("Least cost", "What wins where", "Where feasibility ends", "front by case"):
        assert heading in page
    assert len(page) < 3_000_000


def test_the_console_summary_names_counts_and_table(result: StudyResult) -> None:
    text = console(on_study(result))
    assert f"{result.counts['meets']} of {len(result)} cases meet their requirements" in text
    assert "Least cost of a payload" in text
    assert "uav.attitude" in text


@pytest.mark.parametrize("hostile", [t for t in HOSTILE if "\ud800" not in t and "\x00" not in t])
def test_hostile_names_stay_text(tmp_path: Path, hostile: str) -> None:
    quoted = json.dumps(hostile)
    if "\u202e" in hostile:
        pytest.skip("refused by the reader (bidirectional override)")
    study = STUDY.replace("name: Height and accuracy", f"name: {quoted}")
    study = study.replace("[40 m, 60 m, 100 m]", "[60 m]").replace("[0.15 m, 0.3 m]", "[0.3 m]")
    study = study.replace("stages[uav]", "stages[0]")
    spec = SPEC.replace("name: Small UAV", f"name: {quoted}").replace(
        "- name: uav", f"- name: {quoted}"
    )
    spec = spec.replace("ACC-1", "ACC")
    done = run_study(write(tmp_path, study.replace("[ACC-1]", "[0]"), spec))
    assert done.counts["meets"] == 1
    page = text_of("html", done)
    assert page.count("<script>") == 1
    assert "<img" not in page
    ElementTree.fromstring(text_of("junit", done))
    assert all(line.startswith("::notice ::") for line in text_of("github", done).splitlines())
    for line in csv.reader(io.StringIO(text_of("csv", done))):
        assert not any(cell.startswith(("=", "@", "+")) for cell in line)
    assert "\x1b" not in console(on_study(done)) + text_of("markdown", done) + page


def test_progress_says_what_is_left() -> None:
    assert progress_text(Progress(0, 10, 0, 0.0)) == "0 of 10 cases, estimating"
    assert progress_text(Progress(6, 10, 2, 80.0)) == "6 of 10 cases, 2 already there, 01:20 left"
    assert progress_text(Progress(5, 9999, 0, 9.0)) == "5 of 9 999 cases, estimating"  # 5 h
    assert progress_text(Progress(10, 10, 0, 3725.0)) == "10 of 10 cases, took 1:02:05"
    assert "1 done again" in progress_text(Progress(1, 2, 0, 1.0, retried=1))


def test_what_was_computed_fits_the_terminal_with_its_thousands_grouped(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    found = run_study(write(tmp_path, STUDY), StudySettings(workers=1))
    many = replace(found, computed=10_000, reused=1_234_567, retried=2_000)
    monkeypatch.setenv("COLUMNS", "60")
    said = paragraph(stored_text(many))
    assert said.endswith("\n")
    folder = str(found.store.folder)
    assert all(len(line) <= 60 for line in said.splitlines() if folder not in line)
    flat = " ".join(said.split())
    assert flat.startswith("10 000 cases computed, 1 234 567 already there, 2 000 done again")
    assert paragraph(stored_text(replace(found, computed=1))).startswith("1 case computed")


def test_progress_in_a_log_is_written_now_and_then() -> None:
    stream = io.StringIO()
    line = ProgressLine(stream)
    for done in range(1001):
        line(Progress(done, 1000, 0, done / 100))
    assert len(stream.getvalue().splitlines()) <= 3
    assert stream.getvalue().endswith("1 000 of 1 000 cases, took 00:10\n")


def test_console_tables_line_up() -> None:
    shown = table_lines(table("T", ("a", "b #"), [("x", "1"), ("long", "22")]))
    assert list(shown) == ["T", "  a      b", "  x      1", "  long  22"]


def test_what_takes_long_says_what_it_does_in_a_log_too() -> None:
    """Once in ten seconds there; within a second nothing is said, and nothing where it is quiet."""
    log, silent = io.StringIO(), io.StringIO()
    line, quiet = StepLine(log), StepLine(silent, quiet=True)
    for elapsed_s in (0.5, 5.0, 10.5, 12.0, 21.0):
        line("choosing", elapsed_s)
        quiet("choosing", elapsed_s)
    line.clear()
    assert log.getvalue() == "choosing (10 s)\nchoosing (21 s)\n"
    assert silent.getvalue() == ""


def test_drawing_says_so_where_it_takes_longer_than_a_second(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("syncline_design.report.progress_line.SILENT_S", 0.01)
    monkeypatch.setattr("syncline_design.report.progress_line.IN_LOG_S", 0.01)
    monkeypatch.setattr("syncline_design.report.progress_line.ON_TERMINAL_S", 0.01)
    with busy("writing results"):
        time.sleep(0.2)
    assert capsys.readouterr().err.startswith("writing results (0 s)\n")
