"""A kept verdict holds only while every file that entered it is as it was, to the last byte."""

from __future__ import annotations

import hashlib
import json
import math
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from syncline_design.report.studies import render_study
from syncline_design.studies import StudyResult, StudySettings, run_study
from tests.checked import check_file

SPEC = """\
syncline: 1
name: Track
catalogs: [own.yaml]
requirements:
  - {id: ACC-1, kind: accuracy, limit: 3 m}
  - {id: SYNC-1, kind: sync, limit: 1000}
  - {id: MC-1, kind: monte_carlo, quantile: 0.95, limit: 3 m}
stages:
  - name: uav
    platform: uav_fixed_wing
    position:
      sensor: receiver
      primitive: pps
      timestamping: {error: {distribution: empirical, file: delays.txt}}
    attitude: {sensor: sbg_apogee, primitive: pps, timestamping: logger}
    ranging: {sensor: riegl_vux1uav, primitive: pps, timestamping: hardware}
monte_carlo: {samples: 2000, envelope: trajectory, trajectory: {file: path.csv}}
"""
OWN = """\
catalogs: [more/below.yaml]
sensors:
  receiver: {name: Receiver, modality: position, type: gnss, sigma_position: 1.1 cm,
             primitives: [pps], cost: 100 EUR, mass: 50 g, power: 1 W, basis: assumption}
"""
BELOW = """\
timestamping:
  logger: {name: Logger, primitives: [pps], timeline: host, cost: 0 EUR, mass: 0 g, power: 0 W,
           error: {distribution: empirical, file: logger.txt}, basis: assumption}
"""
STUDY = """\
study: 1
name: delays
base: [spec.yaml]
grid:
  "requirements[ACC-1].limit": [2.5 m, 3.5 m]
"""
TIMING = '"stages[uav].position.timestamping"'
GRID = STUDY + (
    f"  {TIMING}: [{{error: {{distribution: empirical, file: delays.txt}}}},"
    " {error: {distribution: empirical, file: others.txt}}]\n"
)


def track(east: float = 4.0) -> str:
    rows = ["time_s,position_north_m,position_east_m,position_down_m,roll_deg,pitch_deg,yaw_deg"]
    rows += [f"{t},{20 * t},{east * t * (t % 3)},-100,0,0,{10 * t}" for t in range(12)]
    return "\n".join(rows) + "\n"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A study whose base names every kind of file that a check reads."""
    place = tmp_path / "project"
    (place / "more").mkdir(parents=True)
    for name, text in (
        ("spec.yaml", SPEC), ("own.yaml", OWN), ("more/below.yaml", BELOW), ("study.yaml", STUDY),
        ("delays.txt", "ms\n1.1\n2.1\n"), ("others.txt", "ms\n1.5\n"),
        ("more/logger.txt", "us\n7.1\n"), ("path.csv", track()),
    ):  # fmt: skip
        (place / name).write_text(text)
    return place


def run(folder: Path, store: str = "store") -> StudyResult:
    return run_study(folder / "study.yaml", StudySettings(workers=1, store=folder / store))


def edit(path: Path, old: str, new: str) -> None:
    """Change a file without a trace in its size or its times."""
    text, status = path.read_text(), path.stat()
    assert text.count(old) == 1
    assert len(old) == len(new)
    path.write_text(text.replace(old, new))
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


EDITS: dict[str, tuple[str, str, str]] = {
    "spec": ("spec.yaml", "quantile: 0.95", "quantile: 0.85"),
    "catalog": ("own.yaml", "1.1 cm", "1.9 cm"),
    "catalog of a catalog": ("more/below.yaml", "cost: 0 EUR", "cost: 9 EUR"),
    "delays of a role": ("delays.txt", "2.1", "9.1"),
    "delays of a catalog": ("more/logger.txt", "7.1", "9.9"),
    "trajectory": ("path.csv", ",10\n", ",19\n"),
}


@pytest.mark.parametrize(("name", "old", "new"), EDITS.values(), ids=EDITS.keys())
def test_one_changed_byte_of_any_file_is_computed_again(
    folder: Path, name: str, old: str, new: str
) -> None:
    first = run(folder)
    assert (first.computed, first.reused) == (2, 0)
    assert first.counts["meets"] == 2
    again = run(folder)
    assert (again.computed, again.reused) == (0, 2)
    before = render_study("json", first)
    assert render_study("json", again) == before
    edit(folder / name, old, new)
    changed = run(folder)
    assert (changed.computed, changed.reused) == (2, 0)
    records = [case.record for case in changed.cases()]
    assert records == [case.record for case in run(folder, "another store").cases()]
    assert records != [case.record for case in first.cases()]
    edit(folder / name, new, old)
    back = run(folder)
    assert (back.computed, back.reused) == (0, 2)  # what was there first is kept beside it
    assert render_study("json", back) == before


def test_files_that_only_the_grid_names_count_too(folder: Path) -> None:
    (folder / "study.yaml").write_text(GRID)
    assert run(folder).computed == 4
    edit(folder / "others.txt", "1.5", "1.6")
    changed = run(folder)
    assert (changed.computed, changed.reused) == (2, 2)
    assert [c.record for c in changed.cases()] == [c.record for c in run(folder, "b").cases()]


OVERRIDE = """\
study: 1
name: loggers
base: [spec.yaml]
grid:
  "catalog.timestamping[logger].error":
    - {distribution: empirical, file: logger.txt}
    - {distribution: empirical, file: slow.txt}
"""


def test_delays_that_a_catalog_entry_takes_from_the_grid_count_too(folder: Path) -> None:
    """The bound of an empirical error is its largest absolute value: 7.1 us, then 90 and 99 us."""
    (folder / "study.yaml").write_text(OVERRIDE)
    (folder / "more" / "slow.txt").write_text("us\n90\n")
    taus = []
    for text in ("90", "99"):
        edit(folder / "more" / "slow.txt", (folder / "more" / "slow.txt").read_text()[3:5], text)
        result = run(folder)
        assert result.counts["meets"] == 2
        stages = [case.record.design.stages[0] for case in result.cases()]
        taus.append([stage.roles["attitude"].tau_s for stage in stages])
    assert taus == [pytest.approx([7.1e-6, 90e-6]), pytest.approx([7.1e-6, 99e-6])]


def test_nothing_kept_is_believed_when_all_is_asked_anew(folder: Path) -> None:
    run(folder)
    settings = StudySettings(workers=1, store=folder / "store", fresh=True)
    again = run_study(folder / "study.yaml", settings)
    assert (again.computed, again.reused) == (2, 0)


def test_a_file_that_was_missing_is_looked_for_again(folder: Path) -> None:
    (folder / "study.yaml").write_text(GRID)
    (folder / "others.txt").rename(folder / "kept")
    assert run(folder).counts["refused"] == 2
    assert run(folder).reused == 4
    (folder / "kept").rename(folder / "others.txt")
    found = run(folder)
    assert (found.computed, found.counts["refused"]) == (2, 0)


@pytest.mark.parametrize("outside", [False, True])
def test_a_link_that_leads_elsewhere_is_followed_anew(folder: Path, outside: bool) -> None:
    (folder / "study.yaml").write_text(GRID)
    (folder / "first.txt").write_text("ms\n1.1\n")
    (folder / "others.txt").unlink()
    (folder / "others.txt").symlink_to("first.txt")
    assert run(folder).counts["meets"] == 4
    target = folder.parent / "second.txt" if outside else folder / "second.txt"
    target.write_text("ms\n1.1\n" if outside else "ms\n1.7\n")
    (folder / "others.txt").unlink()
    (folder / "others.txt").symlink_to(target)
    changed = run(folder)
    assert changed.computed == 2
    assert changed.counts["refused"] == (2 if outside else 0)


@pytest.mark.parametrize("links", [("now",), ("now", "further", "last")], ids=["one", "a chain"])
@pytest.mark.parametrize(("name", "old", "new"), [
    ("delays.txt", "2.1", "9.1"), ("path.csv", ",10\n", ",19\n"),
], ids=["delays", "trajectory"])  # fmt: skip
def test_a_folder_link_on_the_way_that_leads_elsewhere_is_followed_anew(
    folder: Path, links: tuple[str, ...], name: str, old: str, new: str
) -> None:
    for version in ("v1", "v2"):
        (folder / version).mkdir()
        shutil.copy(folder / name, folder / version)
    (folder / name).unlink()
    edit(folder / "v2" / name, old, new)
    for link, target in zip(links, (*links[1:], "v1"), strict=True):
        (folder / link).symlink_to(target)
    (folder / "spec.yaml").write_text(SPEC.replace(name, f"now/{name}"))
    assert (run(folder).computed, run(folder).computed) == (2, 0)
    (folder / links[-1]).unlink()
    (folder / links[-1]).symlink_to("v2")
    turned = run(folder)
    assert turned.computed == 2
    anew = run(folder, "another store")
    assert render_study("json", turned) == render_study("json", anew)
    (folder / links[-1]).unlink()
    (folder / links[-1]).symlink_to("v1")
    assert run(folder).computed == 0  # both are kept, each under its own content


def test_a_study_whose_folder_moved_with_its_links_computes_nothing_anew(folder: Path) -> None:
    (folder / "v1").mkdir()
    (folder / "delays.txt").rename(folder / "v1" / "delays.txt")
    (folder / "now").symlink_to("v1")
    (folder / "spec.yaml").write_text(SPEC.replace("delays.txt", "now/delays.txt"))
    assert run(folder).computed == 2
    moved = folder.parent / "elsewhere"
    folder.rename(moved)
    assert run(moved).computed == 0


def test_equal_specs_in_two_folders_with_other_files_are_two_cases(folder: Path) -> None:
    shutil.copytree(folder, folder / "b")
    (folder / "b" / "delays.txt").write_text("ms\n40\n")
    (folder / "study.yaml").write_text(STUDY.replace("[spec.yaml]", "[spec.yaml, b/spec.yaml]"))
    for expected in (4, 0):
        result = run(folder)
        assert result.computed == expected
        totals = [case.record.error_m for case in result.cases()]
        assert totals[0] == totals[1] < totals[2] == totals[3]
    shutil.copytree(folder, folder.parent / "moved")  # store and all
    assert run(folder.parent / "moved").reused == 4


def as_verdict(verdict: dict[str, Any]) -> Callable[[dict[str, Any]], None]:
    return lambda record: record.update(verdict)


def first_requirement(**keys: Any) -> Callable[[dict[str, Any]], None]:
    return lambda record: record["requirements"][0].update(keys)


def rewrite(folder: Path, forge: Callable[[dict[str, Any]], None]) -> None:
    """Change every record that is kept; write it as the store does, with a right hash."""
    for file in (folder / "store").glob("*/*.json"):
        record = json.loads(file.read_text())["record"]
        forge(record)
        plain = json.dumps(record, sort_keys=True, separators=(",", ":"))
        digest = hashlib.sha256(plain.encode()).hexdigest()
        file.write_text(f'{{"key":"{file.stem}","sha256":"{digest}","record":{plain}}}\n')


FORGERIES: dict[str, Callable[[dict[str, Any]], None]] = {
    "meets without a requirement": as_verdict({"verdict": "meets", "requirements": []}),
    "meets although one fails": as_verdict({"verdict": "meets"}),
    "another word": as_verdict({"verdict": "passed"}),
    "a limit without end": first_requirement(limit=math.inf),
    "a status for a verdict": first_requirement(status="meets"),
    "a figure that is text": first_requirement(value="1"),
    "no list": as_verdict({"requirements": {"ACC-1": "pass"}}),
    "other files": as_verdict({"inputs": []}),
}


def test_records_written_again_as_they_were_are_believed(folder: Path) -> None:
    run(folder)
    rewrite(folder, lambda record: None)
    assert (run(folder).computed, run(folder).reused) == (0, 2)


@pytest.mark.parametrize("record", ["[" * 200_000, '{"a":' * 50_000, "{}", "null", "[]", "1e999"])
def test_what_is_no_record_is_computed_again_whatever_its_hash(folder: Path, record: str) -> None:
    run(folder)
    digest = hashlib.sha256(record.encode()).hexdigest()
    for file in (folder / "store").glob("*/*.json"):
        file.write_text(f'{{"key":"{file.stem}","sha256":"{digest}","record":{record}}}\n')
    assert run(folder).computed == 2


def test_records_without_what_came_later_are_believed(folder: Path) -> None:
    """As an earlier state of the same version wrote them: nothing for what a case lacks."""

    def shorten(record: dict[str, Any]) -> None:
        for key in ("problems", "reason", "provisional"):
            assert not record.pop(key)

    run(folder)
    rewrite(folder, shorten)
    assert run(folder).computed == 0


@pytest.mark.parametrize("forge", FORGERIES.values(), ids=FORGERIES.keys())
def test_a_forged_record_with_a_right_hash_is_held_against_its_own_figures(
    folder: Path, forge: Callable[[dict[str, Any]], None]
) -> None:
    edit(folder / "spec.yaml", "accuracy, limit: 3 m", "accuracy, limit: 1 m")
    (folder / "study.yaml").write_text(STUDY.replace("[2.5 m, 3.5 m]", "[1 mm, 2 mm]"))
    assert run(folder).counts["fails"] == 2
    rewrite(folder, forge)
    again = run(folder)
    assert again.counts["fails"] == 2
    assert again.computed == 2


@pytest.mark.parametrize("text", ["[" * 200_000, '{"key":' * 50_000, "\x00", "{}", "[]", "1e999"])
def test_nested_and_broken_case_files_are_computed_again(folder: Path, text: str) -> None:
    run(folder)
    files = [*(folder / "store").glob("*/*.json"), *(folder / "store").glob("*/*.reads")]
    assert len(files) == 4
    for file in files:
        file.write_text(text)
    assert run(folder).computed == 2


def test_a_pipe_among_the_case_files_is_not_waited_for(folder: Path) -> None:
    run(folder)
    for file in list((folder / "store").glob("*/*.json")):
        file.unlink()
        os.mkfifo(file)
    assert run(folder).computed == 2


def test_a_verdict_names_every_file_that_entered_it(folder: Path) -> None:
    """Hashes by hashlib over the files; the shipped catalogs have their own key."""
    found = check_file(folder / "spec.yaml").to_json()["provenance"]["files"]
    names = ["delays.txt", "more/below.yaml", "more/logger.txt", "own.yaml", "path.csv"]
    assert [entry["file"] for entry in found] == names
    for entry in found:
        content = (folder / entry["file"]).read_bytes()
        assert entry["sha256"] == hashlib.sha256(content).hexdigest()
