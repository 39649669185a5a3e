"""No result takes the place of a file that the command reads, by whatever name it is called."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner

from syncline_design.cli.app import app
from syncline_design.machine.result_files import OutputError, clear_stale, replace_whole, write_file
from test_study_inputs import BELOW, GRID, OWN, SPEC, track

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(sys.executable).parent / "syncline-design"
LOG = "log: {files: [night.csv]}\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A project whose spec names every kind of file; catalogs need not be called .yaml."""
    (tmp_path / "more").mkdir()
    own = OWN.replace("more/below.yaml", "more/below.catalog")
    for name, text in (
        ("spec.yaml", SPEC.replace("own.yaml", "own.catalog") + LOG), ("own.catalog", own),
        ("more/below.catalog", BELOW), ("study.yaml", GRID), ("delays.txt", "ms\n1.1\n"),
        ("others.txt", "ms\n1.5\n"), ("more/logger.txt", "us\n7.1\n"), ("path.csv", track()),
        ("night.csv", "time_s\n0\n"), ("measured.csv", "time_s\n0\n"),
    ):  # fmt: skip
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    return tmp_path


READ = ("spec.yaml", "own.catalog", "more/below.catalog", "delays.txt", "more/logger.txt",
        "path.csv", "night.csv")  # fmt: skip
COMMANDS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "check": (("check", "spec.yaml"), READ),
    "optimize": (("optimize", "spec.yaml"), READ),
    "simulate": (("simulate", "spec.yaml"), READ),
    "diff": (("diff", "spec.yaml", "spec.yaml"), READ),
    "study": (("study", "study.yaml"), (*READ[:-1], "study.yaml", "others.txt")),
    "diagnose": (("diagnose", "spec.yaml", "measured.csv"), (*READ, "measured.csv")),
}
ALIASES: dict[str, Callable[[Path], str]] = {
    "its own name": str,
    "another spelling": lambda path: f"./more/../{path}",
    "from the root": lambda path: str(path.absolute()),
    "a symlink": lambda path: _made(Path("link.out"), lambda link: link.symlink_to(path)),
    "a link to a link": lambda path: _made(
        Path("second.out"), lambda link: link.symlink_to(ALIASES["a symlink"](path))
    ),
    "a hard link": lambda path: _made(Path("hard.out"), lambda link: link.hardlink_to(path)),
}


def _made(link: Path, make: Callable[[Path], object]) -> str:
    make(link)
    return str(link)


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def refused(folder: Path, arguments: tuple[str, ...]) -> str:
    before = contents(folder)
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == 2, result.output
    assert contents(folder) == before
    return str(result.output)


def pairs(count: int) -> list[tuple[str, str, str]]:
    """Every command with every file that it reads; the aliases take turns."""
    names = list(ALIASES)
    found = [(command, name) for command, (_, reads) in COMMANDS.items() for name in reads]
    return [(c, n, names[(i + k) % len(names)]) for i, (c, n) in enumerate(found)
            for k in range(0, len(names), len(names) // count)]  # fmt: skip


@pytest.mark.parametrize(("command", "name", "alias"), pairs(1))
def test_an_output_is_refused_in_the_place_of_an_input(
    folder: Path, command: str, name: str, alias: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def computed(*_: object, **__: object) -> None:
        raise AssertionError("computed before it was refused")

    for place in (
        "verdict.verify.check_loaded",
        "studies.run.run_loaded",
        "verdict.simulated_spec.simulate",
    ):
        monkeypatch.setattr(f"syncline_design.{place}", computed)
    if command == "diff":
        monkeypatch.undo()
        monkeypatch.chdir(folder)
    output = ALIASES[alias](Path(name))
    words = refused(folder, (*COMMANDS[command][0], "--output", f"json:{output}"))
    assert "is read by this command" in words or "a YAML file is there" in words


@pytest.mark.parametrize("name", READ[:-1])
@pytest.mark.parametrize("alias", ["a hard link", "a symlink"])
def test_no_chart_takes_the_place_of_an_input(folder: Path, name: str, alias: str) -> None:
    """`ledger.svg` in the folder for charts leads to a file that the command reads."""
    (folder / "charts").mkdir()
    place = folder / "charts" / "ledger.svg"
    if alias == "a hard link":
        place.hardlink_to(folder / name)
    else:
        place.symlink_to(Path("..") / name)
    words = " ".join(refused(folder, ("check", "spec.yaml", "--output", "svg:charts")).split())
    assert "ledger.svg: is read by this command" in words or "a YAML file is there" in words


def test_no_result_goes_where_a_chart_may_go(folder: Path) -> None:
    outputs = ("--output", "svg:charts", "--output", "json:charts/../charts/ledger.svg")
    assert "two outputs go to" in refused(folder, ("check", "spec.yaml", *outputs))


@pytest.mark.parametrize("option", [("optimize", "--write-design"), ("diagnose", "--write-spec")])
@pytest.mark.parametrize("name", READ)
@pytest.mark.parametrize("alias", ["its own name", "a hard link", "a symlink"])
def test_a_spec_is_not_written_in_the_place_of_an_input(
    folder: Path, option: tuple[str, str], name: str, alias: str
) -> None:
    command, flag = option
    output = ALIASES[alias](Path(name))
    words = refused(folder, (*COMMANDS[command][0], flag, output))
    assert "is read by this command" in words


def test_a_second_spec_is_read_before_the_first_is_computed(folder: Path) -> None:
    shutil.copy(ROOT / "specs" / "position_track.yaml", folder / "first.yaml")
    words = refused(folder, ("check", "first.yaml", "spec.yaml", "--output", "json:delays.txt"))
    assert "is read by this command" in words


def test_files_of_cases_are_no_place_for_results(folder: Path) -> None:
    done = CliRunner().invoke(app, ["study", "study.yaml", "--quiet"])
    assert done.exit_code in (0, 1), done.output
    kept = next((folder / ".syncline-cases").glob("*/*.json"))
    words = refused(folder, ("study", "study.yaml", "--output", f"json:{kept}"))
    assert "files of cases" in words


def write_design(folder: Path, target: str) -> subprocess.CompletedProcess[bytes]:
    shutil.copy(ROOT / "specs" / "position_track.yaml", folder / "open.yaml")
    return subprocess.run(
        ["bash", "-c", f"'{COMMAND}' optimize open.yaml --quiet --write-design {target}"],
        cwd=folder, capture_output=True, timeout=60, check=False,
    )  # fmt: skip


def test_devices_and_pipes_are_written_through(folder: Path) -> None:
    os.mkfifo(folder / "pipe")
    reader = subprocess.Popen(["cat", "pipe"], cwd=folder, stdout=subprocess.PIPE)
    assert write_design(folder, "pipe").returncode == 0
    through_pipe, _ = reader.communicate(timeout=30)
    assert (folder / "pipe").is_fifo()
    substituted = write_design(folder, ">(cat > through; touch ready)")
    assert substituted.returncode == 0, substituted.stderr
    while not (folder / "ready").exists():
        pass
    piped = write_design(folder, "/dev/stdout | cat")
    assert (folder / "through").read_bytes() == through_pipe == piped.stdout
    assert through_pipe.startswith(b"# ") or b"syncline: 1" in through_pipe
    assert write_design(folder, "/dev/null").returncode == 0
    assert not Path("/dev/null").is_file()
    full = write_design(folder, "/dev/full")
    assert full.returncode == 3
    assert b"No space left" in full.stderr


@pytest.mark.parametrize("target", ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1", "-"])
def test_standard_output_has_many_names(folder: Path, target: str) -> None:
    shutil.copy(ROOT / "specs" / "position_track.yaml", folder / "open.yaml")
    line = f"'{COMMAND}' check open.yaml --output json:{target}"
    for tail in ("| cat", "> file; cat file"):
        done = subprocess.run(
            ["bash", "-c", f"set -o pipefail; {line} {tail}"], cwd=folder, capture_output=True,
            timeout=60, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert done.stdout.startswith(b"{")
        assert done.stdout.rstrip().endswith(b"}")  # and no text beside it


def test_a_link_stays_and_what_it_leads_to_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "below").mkdir()
    (tmp_path / "link").symlink_to("below/real")
    write_file(tmp_path / "link", b"first")  # not there yet
    write_file(tmp_path / "link", b"second")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "below" / "real").read_bytes() == b"second"
    (tmp_path / "circle").symlink_to("circle")
    with pytest.raises(OutputError, match="circle"):
        write_file(tmp_path / "circle", b"x")
    assert (tmp_path / "circle").is_symlink()
    assert sorted(p.name for p in tmp_path.rglob("*")) == ["below", "circle", "link", "real"]


KILLED = """\
import os, signal, sys
from pathlib import Path
from syncline_design.machine import result_files
result_files.os.fsync = lambda _: os.kill(os.getpid(), signal.SIGKILL)
result_files.write_file(sys.argv[1], b"x" * 100)
"""
WAITING = KILLED.replace(
    "os.kill(os.getpid(), signal.SIGKILL)", "(print('on', flush=True), input())"
)


def test_what_killed_runs_left_is_cleared_away_and_nothing_else(tmp_path: Path) -> None:
    target = tmp_path / "result.json"
    target.write_bytes(b"old")
    others = [".result.json.abc", "a.part", ".syncline-design-xyz.part", "result.part",
              f".syncline-design-{'0' * 32}.part.txt"]  # fmt: skip
    for name in others:
        (tmp_path / name).write_text("not ours")
    (tmp_path / f".syncline-design-{'1' * 32}.part").mkdir()
    (tmp_path / f".syncline-design-{'2' * 32}.part").symlink_to("a.part")
    before = {p.name for p in tmp_path.iterdir()}
    for _ in range(3):
        subprocess.run([sys.executable, "-c", KILLED, str(target)], check=False)
    left = {p.name for p in tmp_path.iterdir()} - before
    assert len(left) in (1, 3)  # each run clears away what the one before left
    running = subprocess.Popen(
        [sys.executable, "-c", WAITING, str(target)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert running.stdout is not None
    assert running.stdout.readline() == b"on\n"
    write_file(target, b"new")
    assert target.read_bytes() == b"new"
    [alive] = {p.name for p in tmp_path.iterdir()} - before
    assert (tmp_path / alive).stat().st_size == 100
    running.communicate(b"\n\n", timeout=30)
    assert running.returncode == 0
    assert target.read_bytes() == b"x" * 100
    assert {p.name for p in tmp_path.iterdir()} == before
    assert (tmp_path / "a.part").read_text() == "not ours"


def test_a_store_keeps_its_hands_off_what_was_there(folder: Path) -> None:
    store = folder / "results"
    (store / "ab").mkdir(parents=True)
    others = [store / "ab" / "x.part", store / "ab" / "tmpabcd.part", store / "y.part",
              store / "notes.txt"]  # fmt: skip
    for path in others:
        path.write_text("mine")
        os.utime(path, (0, 0))
    replace_whole(store / "ab" / "whole", b"x")
    stale = store / "ab" / f".syncline-design-{'a' * 32}.part"
    stale.write_text("of a killed run")
    done = CliRunner().invoke(app, ["study", "study.yaml", "--quiet", "--store", "results"])
    assert done.exit_code in (0, 1), done.output
    assert all(path.read_text() == "mine" for path in others)
    assert not (store / ".gitignore").exists()
    assert not stale.exists()
    assert (store / "ab" / "whole").exists()
    CliRunner().invoke(app, ["study", "study.yaml", "--quiet", "--store", "new/store"])
    assert (folder / "new" / "store" / ".gitignore").read_text() == "*\n"


def test_clearing_needs_no_folder(tmp_path: Path) -> None:
    clear_stale(tmp_path / "absent")
    assert not (tmp_path / "absent").exists()
