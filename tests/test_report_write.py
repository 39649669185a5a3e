"""Writing results: all or nothing, and the old file stays when something goes wrong."""

from __future__ import annotations

import os
import resource
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from syncline_design.machine.deadline import Deadline, a_command, limit_command, of_command
from syncline_design.machine.result_files import write_file
from syncline_design.report.write import (
    OutputError,
    OutputTarget,
    apart,
    check_targets,
    parse_target,
    write_outputs,
)

KNOWN = ("json", "html")


def test_parse_target() -> None:
    assert parse_target("html:out/a.html", KNOWN) == OutputTarget("html", "out/a.html")
    assert parse_target("json:-", KNOWN) == OutputTarget("json", "-")
    assert parse_target("json", KNOWN) == OutputTarget("json", "-")
    assert parse_target("html:C:/x.html", KNOWN) == OutputTarget("html", "C:/x.html")


def test_a_page_without_a_path_replaces_only_pages_of_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert parse_target("html", KNOWN, "own-check") == OutputTarget("html", "own-check.html", False)
    page = tmp_path / "own-check.html"
    page.write_text('<meta name="generator" content="syncline-design">', encoding="utf-8")
    assert parse_target("html", KNOWN, "own-check").path == "own-check.html"
    page.write_text("<p>mine</p>", encoding="utf-8")
    with pytest.raises(OutputError, match=r"no page of syncline-design; name the file"):
        parse_target("html", KNOWN, "own-check")


@pytest.mark.parametrize("text", ["pdf:a.pdf", "html:", "", ":a", "a.html"])
def test_bad_targets_say_what_is_expected(text: str) -> None:
    with pytest.raises(OutputError, match="expected"):
        parse_target(text, KNOWN)


@pytest.mark.parametrize(
    ("path", "words"),
    [("new/", "is a folder"), ("deep/new/", "is a folder"), ("q" * 300, "name is too long")],
)
def test_names_that_no_file_can_have_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path: str, words: str
) -> None:
    """The first wrote a file `new`, the last was an internal error."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(OutputError, match=words):
        check_targets([OutputTarget("json", path)])


def test_a_spec_and_a_result_go_to_two_files(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("fixed.yaml")
    with pytest.raises(OutputError, match="two outputs go to"):
        apart(
            tmp_path / "fixed.yaml",
            [OutputTarget("json", "-"), OutputTarget("json", f"{tmp_path}/link")],
        )
    apart(
        tmp_path / "fixed.yaml",
        [OutputTarget("json", "-"), OutputTarget("json", f"{tmp_path}/other")],
    )


def test_writes_files_and_folders(tmp_path: Path) -> None:
    target = tmp_path / "new" / "deep" / "a.json"
    write_outputs(
        [(OutputTarget("json", str(target)), "{}\n"), (OutputTarget("html", f"{tmp_path}/b"), "µ")]
    )
    assert target.read_text() == "{}\n"
    assert (tmp_path / "b").read_bytes() == "µ".encode()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["b", "new"]


def test_permissions_are_those_of_a_new_or_of_the_old_file(tmp_path: Path) -> None:
    old, new = tmp_path / "old", tmp_path / "new"
    old.write_text("x")
    old.chmod(0o640)
    mask = os.umask(0o027)
    try:
        write_outputs(
            [(OutputTarget("json", str(old)), "y"), (OutputTarget("html", str(new)), "z")]
        )
    finally:
        os.umask(mask)
    assert stat.S_IMODE(old.stat().st_mode) == 0o640
    assert stat.S_IMODE(new.stat().st_mode) == 0o640  # 0666 without 027


def test_text_reaches_the_disk_before_it_takes_the_old_files_place(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.json"
    path.write_text("old")
    sync, seen = os.fsync, []

    def watched(descriptor: int) -> None:
        seen.append((os.fstat(descriptor).st_size, path.read_text()))
        sync(descriptor)

    monkeypatch.setattr(os, "fsync", watched)
    write_outputs([(OutputTarget("json", str(path)), "new text")])
    assert seen[0] == (len("new text"), "old")


def test_symlink_is_written_through(tmp_path: Path) -> None:
    real = tmp_path / "real.json"
    real.write_text("old")
    link = tmp_path / "link.json"
    link.symlink_to(real)
    write_outputs([(OutputTarget("json", str(link)), "new")])
    assert link.is_symlink()
    assert real.read_text() == "new"


def test_stdout_gets_utf8_and_a_final_newline(capfdbinary: pytest.CaptureFixture[bytes]) -> None:
    write_outputs([(OutputTarget("json", "-"), "τ")])
    sys.stdout.flush()
    assert capfdbinary.readouterr().out == "τ\n".encode()


def test_two_targets_must_not_collide(tmp_path: Path) -> None:
    same = [OutputTarget("json", str(tmp_path / "a")), OutputTarget("html", f"{tmp_path}/x/../a")]
    with pytest.raises(OutputError, match="two outputs"):
        check_targets(same)
    with pytest.raises(OutputError, match="standard output"):
        check_targets([OutputTarget("json", "-"), OutputTarget("html", "-")])


def test_a_folder_is_no_target(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="is a folder"):
        check_targets([OutputTarget("json", str(tmp_path))])


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(OutputError, match="is not a folder"):
        check_targets([OutputTarget("json", str(tmp_path / "file" / "a.json"))])


def test_devices_are_written_to() -> None:
    target = OutputTarget("json", os.devnull)
    check_targets([target])
    write_outputs([(target, "{}")])
    assert not Path(os.devnull).is_file()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_full_device_is_a_clear_error() -> None:
    with pytest.raises(OutputError, match=r"/dev/full: cannot write: No space left"):
        write_outputs([(OutputTarget("json", "/dev/full"), "{}")])


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_full_standard_output_is_a_clear_error_and_nothing_more() -> None:
    code = (
        "import sys\n"
        "from syncline_design.report.write import *\n"
        "try:\n"
        "    write_outputs([(OutputTarget('json', '-'), 'x' * 100000)])\n"
        "except OutputError as error:\n"
        "    print(error, file=sys.stderr)\n"
        "    sys.exit(3)\n"
    )
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-c", code],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            check=False,
        )
    assert done.returncode == 3
    assert done.stderr.strip() == "standard output: cannot write: No space left on device"


def _with_file_limit(
    size: int, pairs: list[tuple[OutputTarget, str]]
) -> pytest.ExceptionInfo[OutputError]:
    """Write while no file may grow beyond `size` bytes, as on a disk that fills up."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
        with pytest.raises(OutputError) as caught:
            write_outputs(pairs)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    return caught


def test_full_disk_leaves_every_old_file(tmp_path: Path) -> None:
    first, second = tmp_path / "a.json", tmp_path / "b.html"
    first.write_text("old a")
    second.write_text("old b")
    pairs = [
        (OutputTarget("json", str(first)), "small"),
        (OutputTarget("html", str(second)), "x" * 100_000),
    ]
    caught = _with_file_limit(4096, pairs)
    assert "b.html: cannot write" in str(caught.value)
    assert "the file that was there is unchanged" in str(caught.value)
    assert first.read_text() == "old a"  # although its own text would have fitted
    assert second.read_text() == "old b"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.json", "b.html"]


def test_full_disk_leaves_nothing_half_written(tmp_path: Path) -> None:
    caught = _with_file_limit(
        4096, [(OutputTarget("html", str(tmp_path / "n.html")), "x" * 100_000)]
    )
    assert "nothing was written" in str(caught.value)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_unwritable_folder_is_a_clear_error(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    try:
        with pytest.raises(OutputError, match="no permission"):
            check_targets([OutputTarget("json", str(tmp_path / "a.json"))])
    finally:
        tmp_path.chmod(0o700)


def test_a_folder_that_cannot_be_made_is_a_clear_error() -> None:
    with pytest.raises(OutputError, match="cannot write"):
        write_outputs([(OutputTarget("json", "/proc/no/such/a.json"), "{}")])


def test_a_pipe_that_nobody_reads_ends_with_the_time_limit(tmp_path: Path) -> None:
    """Opening such a pipe waits for a reader: it waited for ever, whatever limit was set."""
    os.mkfifo(tmp_path / "pipe")
    start = time.monotonic()
    with a_command():
        limit_command(Deadline(0.2))
        with pytest.raises(OutputError, match=r"nobody reads it, and the time limit of 0\.2 s"):
            write_file(tmp_path / "pipe", b"all")
    assert time.monotonic() - start < 3.0
    assert of_command().limit_s is None


@pytest.mark.parametrize("limit_s", [0.2, None])
def test_a_slow_reader_of_a_pipe_gets_everything(tmp_path: Path, limit_s: float | None) -> None:
    """Long after the limit, as long as it goes on reading."""
    os.mkfifo(tmp_path / "pipe")
    content = bytes(range(256)) * 800  # three times what a pipe holds
    slow = (
        "import sys, time\ngot = b''\nwith open(sys.argv[1], 'rb', buffering=0) as pipe:\n"
        "    while piece := pipe.read(40_000):\n        got += piece\n        time.sleep(0.3)\n"
        "sys.stdout.buffer.write(got)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", slow, str(tmp_path / "pipe")], stdout=subprocess.PIPE
    ) as reader:
        with (tmp_path / "pipe").open("wb"), a_command():  # the reader is there
            limit_command(Deadline(limit_s))
            write_file(tmp_path / "pipe", content)
        assert reader.stdout is not None
        assert reader.stdout.read() == content


def test_a_reader_that_stops_reading_does_not_hold_a_command(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    try:
        with a_command():
            limit_command(Deadline(0.1))
            with pytest.raises(OutputError, match="nobody reads it"):
                write_file(tmp_path / "pipe", bytes(300_000))
    finally:
        os.close(reader)
