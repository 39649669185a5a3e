"""Exit codes and words when standard streams are closed, full or piped, and names are hostile."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import types
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from syncline_design import cli
from syncline_design.cli.app import app
from syncline_design.cli.shared import guarded
from syncline_design.comparison.diff import diff
from syncline_design.machine.streams import harmless
from syncline_design.report.on_diff import on_diff
from syncline_design.report.render_console import console
from syncline_design.spec.load import BadInput
from tests.checked import check_file

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(sys.executable).parent / "syncline-design"

pytestmark = pytest.mark.skipif(not COMMAND.exists(), reason="the package is not installed here")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, new in (("position_track", "good"), ("infeasible_example", "missed")):
        shutil.copy(ROOT / "specs" / f"{name}.yaml", tmp_path / f"{new}.yaml")
    (tmp_path / "bad.yaml").write_text("syncline: 1\nname: [\n")
    return tmp_path


def shell(folder: Path, line: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        ["bash", "-c", line.replace("DESIGN", f"'{COMMAND}'")], cwd=folder, capture_output=True,
        timeout=60, check=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("DESIGN check bad.yaml 2> /dev/full", 2),
        ("DESIGN check bad.yaml 2>&-", 2),
        ("DESIGN check bad.yaml >&- 2>&- <&-", 2),
        ("DESIGN check absent.yaml > /dev/full 2>&1", 2),
        ("DESIGN check --nonsense 2> /dev/full", 2),
        ("DESIGN check --nonsense 2>&-", 2),
        ("DESIGN check bad.yaml -o json:- >&-", 2),
        ("DESIGN check bad.yaml absent.yaml -o github:- >/dev/full", 2),
        ("DESIGN check bad.yaml good.yaml -o json:- >&-", 3),  # its verdict was not told
        ("DESIGN check missed.yaml --quiet >&-", 1),
        ("DESIGN check good.yaml --quiet >&- 2>&-", 0),
        ("DESIGN check good.yaml >&-", 3),
        ("DESIGN check good.yaml > /dev/full 2> /dev/full", 3),
        ("DESIGN catalog list > /dev/full", 3),
        ("DESIGN schema spec >&-", 3),
        ("DESIGN --version >&-", 3),
        ("DESIGN check good.yaml --quiet -o json:r.json >&- 2>&- <&-; tail -c 3 r.json >&2", 0),
    ],
)
def test_the_state_of_a_stream_is_no_verdict(folder: Path, line: str, code: int) -> None:
    done = shell(folder, line)
    assert done.returncode == code, (done.stdout, done.stderr)
    assert b"Traceback" not in done.stderr
    assert b"internal error" not in done.stderr
    assert b"Exception ignored" not in done.stderr
    if code == 3 and b"2>" not in line.encode():
        assert done.stderr.splitlines()[-1].startswith(
            b"syncline-design: standard output: cannot write: "
        )
    if "r.json" in line:
        assert json.loads((folder / "r.json").read_text())["verdict"] == "meets"


def test_messages_do_not_move_to_standard_output(folder: Path) -> None:
    done = shell(folder, "DESIGN check bad.yaml --output json 2>&-")
    assert json.loads(done.stdout)["verdict"] == "refused"


@pytest.mark.parametrize(
    "arguments",
    [("check", ""), ("optimize", ""), ("simulate", ""), ("study", "s.yaml", "--store", ""),
     ("study", "s.yaml", "--store="), ("diff", "", ""), ("init", ""), ("diagnose", "", "x.csv"),
     ("optimize", "good.yaml", "--write-design", ""), ("catalog", "show", "")],
)  # fmt: skip
def test_an_empty_argument_is_not_the_working_folder(
    folder: Path, arguments: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    before = sorted(folder.iterdir())
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == 2
    assert "empty argument" in result.output
    assert sorted(folder.iterdir()) == before


HOSTILE = (
    "\x1b[2J\x1b]0;owned\x07.yaml", "::error file=x::owned.yaml", "a\n::error::owned.yaml",
    "a\r::warning::owned.yaml", "##[error]owned.yaml", "  ::add-mask::x.yaml", "\x9b31m.yaml",
    "\u202egpj.yaml", os.fsdecode(b"\xff\xfe.yaml"),
)  # fmt: skip
_ORDERS = ("\x1b", "\x07", "\r", "\x9b", "\u202e", "##[")


def demand_harmless(text: str) -> None:
    assert not [order for order in _ORDERS if order in text]
    assert not [line for line in text.split("\n") if line.lstrip().startswith("::")]
    assert "Traceback" not in text
    assert "internal error" not in text


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_the_name_of_a_file_gives_no_orders(
    folder: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    for content, code in (("good", 0), ("bad", 2)):
        shutil.copy(f"{content}.yaml", name)
        for command in (["check"], ["optimize"], ["simulate", "--samples", "100"]):
            result = CliRunner().invoke(app, [*command, "--", f"./{name}"])
            assert result.exit_code == code, result.output
            demand_harmless(result.output.replace("./", ""))
    os.unlink(name)  # noqa: PTH108  a name that is no text
    for arguments in (["check", "--", name], ["diff", "--", name, name], ["study", "--", name],
                      ["check", "good.yaml", "-o", f"json:good.yaml/{name}"]):  # fmt: skip
        result = CliRunner().invoke(app, arguments)
        assert result.exit_code == 2
        demand_harmless(result.output)


@pytest.mark.parametrize("name", ["::error::owned", "##[error]owned", "  ::stop-commands::x"])
def test_nor_does_the_name_of_a_spec(
    folder: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    text = (folder / "good.yaml").read_text().split("\n")
    at = next(i for i, line in enumerate(text) if line.startswith("name:"))
    text[at] = f"name: {json.dumps(name)}"
    (folder / "named.yaml").write_text("\n".join(text))
    for command in (["check"], ["optimize"], ["simulate", "--samples", "100"]):
        result = CliRunner().invoke(app, [*command, "named.yaml"])
        assert result.exit_code == 0, result.output
        assert "owned" in result.output or "stop-commands" in result.output
        demand_harmless(result.output)


def test_what_harmless_leaves_alone() -> None:
    assert harmless("5 µs at a::b\n  next\tline – ok") == "5 µs at a::b\n  next\tline – ok"
    assert harmless("a\nb", one_line=True) == "a\\nb"


def places(data: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    found = [path] if path else []
    if isinstance(data, dict | list):
        pairs = data.items() if isinstance(data, dict) else enumerate(data)
        for key, item in pairs:
            found += places(item, (*path, key))
    return found


def test_broken_verdict_files_are_refused_not_stumbled_over(folder: Path) -> None:
    """300 random places of a verdict, each set to something else: a difference or bad input."""
    verdict = json.loads(json.dumps(check_file(folder / "missed.yaml").to_json()))
    rng, values = random.Random(5), [None, "x", [], {}, [1], True, -1, 1e308, 10**400, [None]]
    good, broken = folder / "good.json", folder / "broken.json"
    good.write_text(json.dumps(check_file(folder / "good.yaml").to_json()))
    found = [p for p in places(verdict) if p[0] not in ("choice", "infeasibility")]
    refused = 0
    for _ in range(300):
        data = json.loads(json.dumps(verdict))
        *way, last = rng.choice(found)
        node = data
        for step in way:
            node = node[step]
        node[last] = rng.choice(values)
        broken.write_text(json.dumps(data))
        for old, new in ((good, broken), (broken, good)):
            try:
                console(on_diff(diff(old, new)))
            except BadInput:
                refused += 1
    assert 0 < refused < 600


@pytest.mark.parametrize("text", ["[" * 100_000, '{"verdict": NaN}', "{}", "[]", "1", '"meets"'])
def test_files_that_are_no_verdicts_are_refused(folder: Path, text: str) -> None:
    (folder / "broken.json").write_text(text)
    with pytest.raises(BadInput, match=r"broken\.json:1"):
        diff(folder / "broken.json", folder / "good.yaml")


@pytest.mark.parametrize("seconds", [1.0, 3.0])
def test_an_interrupted_cluster_ends_with_one_line(folder: Path, seconds: float) -> None:
    pytest.importorskip("distributed")
    (folder / "study.yaml").write_text(
        "study: 1\nname: s\nbase: good.yaml\ncheck: {monte_carlo: true}\n"
        'grid: {"requirements[ACC-1].limit": {low: 1 cm, high: 9 cm, count: 500}}\n'
    )
    process = subprocess.Popen(
        [str(COMMAND), "study", "study.yaml", "--dask", "--workers", "1"], cwd=folder,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    time.sleep(seconds)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to every process
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"Traceback" not in said, said.decode()
    assert said.decode().splitlines()[-1] == "syncline-design: interrupted"


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["check", "--help"]])
def test_help_that_nobody_reads_is_no_verdict(arguments: list[str]) -> None:
    """It ended with 1: does not meet."""
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run([str(COMMAND), *arguments], stdout=writing, stderr=subprocess.PIPE)
    os.close(writing)
    assert done.returncode == 3
    said = b"syncline-design: standard output: cannot write: closed by the reader\n"
    assert done.stderr == said


def test_an_interrupt_while_a_command_imports_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Interrupted(types.ModuleType):
        def __getattr__(self, _: str) -> Any:
            raise KeyboardInterrupt

    name = "syncline_design.cli.app"
    monkeypatch.setitem(sys.modules, name, Interrupted(name))
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 130
    assert capsys.readouterr().err == "syncline-design: interrupted\n"


def test_an_interrupt_while_the_arguments_are_read_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The parser turns one of its own time into an exit without a word."""

    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(sys, "argv", ["syncline-design", "--version"])
    monkeypatch.setattr("typer.core.TyperGroup.make_context", interrupted)
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 130
    assert capsys.readouterr().err == "syncline-design: interrupted\n"


def test_a_store_that_is_a_file_is_a_slip_of_the_user(folder: Path) -> None:
    (folder / "study.yaml").write_text("study: 1\nname: s\nbase: good.yaml\n")
    (folder / "file").touch()
    (folder / "circle").symlink_to("circle")
    for store in ("file", "circle"):
        found = CliRunner().invoke(
            app, ["study", str(folder / "study.yaml"), "--store", str(folder / store)]
        )
        assert found.exit_code == 2
        assert "is no folder" in found.stderr


def started_workers(parent: int) -> list[str]:
    """Command lines of the processes that multiprocessing has started below one."""
    children = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    lines = [Path(f"/proc/{pid}/cmdline").read_bytes().decode() for pid in children]
    return [line for line in lines if "spawn_main" in line]


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
@pytest.mark.parametrize("seconds", [0.05, 0.3])
def test_workers_that_are_still_starting_hear_of_no_interrupt(folder: Path, seconds: float) -> None:
    """Interrupted while they imported, each wrote a traceback ("Fatal Python error") of its own."""
    (folder / "study.yaml").write_text(
        "study: 1\nname: s\nbase: good.yaml\n"
        'grid: {"requirements[ACC-1].limit": {low: 1 cm, high: 9 cm, count: 500}}\n'
    )
    process = subprocess.Popen(
        [str(COMMAND), "study", "study.yaml", "--workers", "3"], cwd=folder,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    end = time.monotonic() + 60
    while len(started_workers(process.pid)) < 3 and time.monotonic() < end:
        time.sleep(0.01)
    time.sleep(seconds)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to every process
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert b"Error" not in said, said.decode()
    assert b"Traceback" not in said, said.decode()
    assert said.decode().splitlines()[-1] == "syncline-design: interrupted"


def test_a_panic_in_a_library_is_no_verdict(capsys: pytest.CaptureFixture[str]) -> None:
    """Panics in Rust are no `Exception`: one ended with a traceback and code 1, a verdict."""
    panic = type("PanicException", (BaseException,), {})

    @guarded
    def command() -> int:
        raise panic("invalid or out-of-range datetime")

    with pytest.raises(typer.Exit) as ended:
        command()
    assert ended.value.exit_code == 3
    assert "internal error, no verdict: PanicException" in capsys.readouterr().err
