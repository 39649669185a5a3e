"""`check FOLDER`: specs are checked, the rest is named; the same words in the same order."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import command
from syncline_design.spec.folders import other_kind, spec_files
from syncline_design.spec.load import BadInput

ROOT = Path(__file__).parent.parent
TRACK = (ROOT / "specs" / "position_track.yaml").read_text("utf-8")
CATALOG = "sensors:\n  mine: {modality: position, sigma_position: 1 cm, primitives: [pps]}\n"
STUDY = 'study: 1\nname: x\nbase: [a.yaml]\ngrid: {"stages[0].distance": [1 m, 2 m]}\n'


def check(*arguments: str) -> subprocess.CompletedProcess[str]:
    return command.run("check", *arguments)


def check_seeded(folder: Path, seed: int) -> subprocess.CompletedProcess[str]:
    """In an interpreter of that hash seed."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONHASHSEED": str(seed)}
    return subprocess.run(
        [sys.executable, "-m", "syncline_design.cli", "check", str(folder)],
        env=environment, capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip


def test_a_folder_with_a_catalog_and_a_study_of_its_own(tmp_path: Path) -> None:
    for name, text in (("b.yaml", TRACK), ("a.yml", TRACK), ("mine.yaml", CATALOG),
                       ("vary.yaml", STUDY), ("pipeline.yml", "jobs: {a: 1}\n")):  # fmt: skip
        (tmp_path / name).write_text(text, "utf-8")
    (tmp_path / "folder.yaml").mkdir()
    done = check(str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "2 specs: 2 meet their requirements."
    assert done.stdout.index("a.yml") < done.stdout.index("b.yaml")
    named = [line.removeprefix(f"skipped, no spec: {tmp_path}/") for line in
             done.stderr.splitlines()]  # fmt: skip
    assert named == [
        "folder.yaml (a folder)", "mine.yaml (a catalog)",
        "pipeline.yml (no `syncline:` at its top)", "vary.yaml (a study)",
    ]  # fmt: skip
    out = tmp_path / "out.json"
    assert check(str(tmp_path), "--quiet", "-o", f"json:{out}").stderr == ""
    assert [v["spec"]["file"] for v in json.loads(out.read_text())["verdicts"]] == [
        str(tmp_path / "a.yml"), str(tmp_path / "b.yaml"),
    ]  # fmt: skip


def test_specs_in_a_folder_inside_are_named_where_they_are_not_checked(tmp_path: Path) -> None:
    """A job must not look green because its specs moved one folder down."""
    (tmp_path / "good.yaml").write_text(TRACK, "utf-8")
    for folder in ("boats", "cars.yaml", ".cache", "studies", "empty"):
        (tmp_path / folder).mkdir()
    (tmp_path / "boats" / "b.yml").write_text(TRACK, "utf-8")
    (tmp_path / "cars.yaml" / "broken.yaml").write_text("syncline: 1\nname: [\n", "utf-8")
    (tmp_path / ".cache" / "c.yaml").write_text(TRACK, "utf-8")
    (tmp_path / "studies" / "vary.yaml").write_text(STUDY, "utf-8")
    (tmp_path / "boats" / "deeper").mkdir()
    found = spec_files([tmp_path])
    assert found.files == (tmp_path / "good.yaml",)
    named = {Path(one.file).name: one.what for one in found.skipped}
    assert set(named) == {"boats", "cars.yaml"}
    assert all("not checked" in what for what in named.values())
    done = check(str(tmp_path))
    assert (done.returncode, done.stderr.count("not checked")) == (0, 2)


def test_a_broken_spec_is_not_passed_over(tmp_path: Path) -> None:
    """A job must not turn green because a spec lost its first line or does not parse."""
    (tmp_path / "good.yaml").write_text(TRACK, "utf-8")
    broken = {
        "indent.yaml": TRACK.replace("requirements:", "  requirements:"),
        "headless.yaml": TRACK.replace("syncline: 1", "# version"),
        "typo.yaml": "synclin: 1\n",
        "twice.yaml": TRACK + "syncline: 1\n",
        "flow.yaml": "{syncline: 1, name: [}\n",
        "latin.yaml": None,
    }
    for name, text in broken.items():
        raw = TRACK.replace("name: ", "name: \u00e9").encode("latin-1")
        (tmp_path / name).write_bytes(raw if text is None else text.encode("utf-8"))
    assert {p.name for p in spec_files([tmp_path]).files} == {"good.yaml", *broken}
    done = check(str(tmp_path))
    assert done.returncode == 2
    assert done.stdout.splitlines()[-1] == ("7 specs: 1 meets its requirements and 6 are refused.")
    assert all(name in done.stderr for name in broken)


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        (TRACK, None),
        ("\ufeff" + TRACK, None),
        ('{"syncline": 1}', None),
        ("# syncline: 1\n", "empty"),
        ("", "empty"),
        (CATALOG, "a catalog"),
        ("clocks: {}\n", "a catalog"),
        ("infrastructure: {b: {cost: 3\n", "a catalog"),
        (STUDY, "a study"),
        ("- a\n- b\n", "no mapping"),
        ("a: &x 1\nb: *x\n", "no `syncline:` at its top"),
        ("services:\n  syncline: 1\n", "no `syncline:` at its top"),
    ],
)
def test_what_a_file_is(tmp_path: Path, text: str, kind: str | None) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(text, "utf-8")
    assert other_kind(path) == kind


def test_a_folder_without_a_spec_says_what_is_there(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text(CATALOG, "utf-8")
    with pytest.raises(BadInput, match=r"no file has `syncline:` at its top; found mine\.yaml \(a"):
        spec_files([tmp_path])
    done = check(str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")


def test_named_files_are_passed_over_on_request_only(tmp_path: Path) -> None:
    """As pre-commit names them: whatever was staged in the folder of specs."""
    mine = tmp_path / "mine.yaml"
    mine.write_text(CATALOG, "utf-8")
    assert check(str(mine)).returncode == 2
    done = check("--skip-others", str(mine))
    assert (done.returncode, done.stdout) == (0, "No spec to check.\n")
    assert "mine.yaml (a catalog)" in done.stderr


def test_error_lines_come_in_the_same_order_whatever_the_hash_seed(tmp_path: Path) -> None:
    """Several problems at one place: the platform's missing figures."""
    bare = TRACK.replace("platform: usv", "platform: {name: x}")
    (tmp_path / "a.yaml").write_text(
        bare.replace("- name: usv", "- name: usv\n    colour: 3"), "utf-8"
    )
    (tmp_path / "b.yaml").write_text("syncline: 1\n", "utf-8")
    runs = {check_seeded(tmp_path, seed).stderr for seed in range(5)}
    assert len(runs) == 1
    assert len(runs.pop().splitlines()) >= 4
