"""A store on a full disk, taken away under a writer, forged with its chain made anew, or of another
version: nothing is half-written, nothing acknowledged is lost, and no answer is believed unseen."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest

from syncline_design.campaign.chain import START, line_of
from syncline_design.campaign.packing import packed
from syncline_design.campaign.store import add_looks, read_store
from syncline_design.campaign.watching import Watching, WatchRequest
from syncline_design.machine import appended_files
from syncline_design.machine.appended_files import append_line
from syncline_design.machine.result_files import OutputError
from syncline_design.spec.load import load
from tests.watched_series import BOUND, car_spec, kept, run_of, series, told, watch


@pytest.fixture(scope="module")
def spec(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return car_spec(tmp_path_factory.mktemp("faults") / "spec.yaml")


def with_looks(spec: Path, folder: Path, runs: int = 8) -> Path:
    """A store of runs of which the last two are nine bounds off, with all looks kept."""
    found = series(11, runs, np.array([9.0, 0, 0, 0, 0]) * BOUND, runs - 2)
    store = kept(spec, folder, [run_of(one, day) for day, one in enumerate(found)])
    stored = read_store(store)
    assert stored is not None
    add_looks(stored, Watching(load(spec), WatchRequest(store), stored, 0).fresh)
    return store


def made_anew(store: Path, change: object) -> None:
    """The store with the bodies of its lines changed, and a chain that holds."""
    bodies = [json.loads(line)["body"] for line in store.read_text("ascii").splitlines()]
    change(bodies)  # type: ignore[operator]
    last, lines = START, []
    for body in bodies:
        line, last = line_of(last, body)
        lines.append(line)
    store.write_bytes(b"".join(lines))


def test_a_full_disk_leaves_what_was_there_and_makes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "lines"

    def full(descriptor: int, content: bytes) -> None:
        os.write(descriptor, content[: len(content) // 2])
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(appended_files, "write_all", full)
        with pytest.raises(OutputError, match="nothing was written"):
            append_line(path, lambda _: b"first line\n")
    assert not path.exists()
    append_line(path, lambda _: b"first line\n")
    with monkeypatch.context() as patch:
        patch.setattr(appended_files, "write_all", full)
        with pytest.raises(OutputError, match="is unchanged"):
            append_line(path, lambda _: b"second line\n")
    assert path.read_bytes() == b"first line\n"


def test_a_line_that_is_refused_makes_no_file(tmp_path: Path) -> None:
    def refuse(_: bytes) -> bytes:
        raise ValueError("not this one")

    with pytest.raises(ValueError, match="not this one"):
        append_line(tmp_path / "lines", refuse)
    assert not (tmp_path / "lines").exists()


def test_a_writer_that_waited_for_a_file_that_went_writes_to_the_one_of_that_name(
    tmp_path: Path,
) -> None:
    """A store is moved aside while another writer has its lock: the waiting one would else write
    to the one that was moved, and say that it is done."""
    path, aside = tmp_path / "lines", tmp_path / "aside"
    path.write_bytes(b"old\n")
    with path.open("rb") as holder:
        fcntl.flock(holder, fcntl.LOCK_EX)
        writer = threading.Thread(target=append_line, args=(path, lambda kept: kept + b"new\n"))
        writer.start()
        time.sleep(0.3)  # it waits
        assert writer.is_alive()
        path.rename(aside)
        path.write_bytes(b"other\n")
    writer.join(10.0)
    assert not writer.is_alive()
    assert aside.read_bytes() == b"old\n"
    assert path.read_bytes() == b"other\nother\nnew\n"


def test_a_forged_last_look_is_not_believed(spec: Path, tmp_path: Path) -> None:
    """The one that today's answer rests on is computed again whenever it is looked at."""
    store = with_looks(spec, tmp_path)
    assert told(spec, store, tmp_path, 1)["cautions"] == []
    calm: list[dict] = []

    def forge(bodies: list[dict]) -> None:
        calm.extend(bodies[-1]["looks"][-2:])
        for look in calm:
            look["log_evidence"] = -1.0

    made_anew(store, forge)
    found = told(spec, store, tmp_path, 1)
    assert "computed anew" in found["cautions"][0]
    assert found["alarms"][0]["since"]["run"] == 7


def _indefinite(body: dict) -> None:
    size = len(body["run"]["parameters"])
    body["run"]["normal"] = packed(np.full(size * (size + 1) // 2, -1e6))


def _huge(body: dict) -> None:
    size = len(body["run"]["parameters"])
    body["run"]["score"] = packed(np.full(size, 1e200))


@pytest.mark.parametrize("forge", [_indefinite, _huge])
def test_statistics_that_no_log_has_are_refused(forge: object, spec: Path, tmp_path: Path) -> None:
    """In a chain made anew, by hand: exit 2 with the store's name, no traceback."""
    found = series(11, 6, 0.0 * BOUND, 9)
    store = kept(spec, tmp_path, [run_of(one, day) for day, one in enumerate(found)])

    def change(bodies: list[dict]) -> None:
        for body in bodies[1:]:
            forge(body)  # type: ignore[operator]

    made_anew(store, change)
    said = watch(store, spec)
    assert said.exit_code == 2, said.output
    assert "store.jsonl" in said.output + said.stderr
    assert "damaged" in said.output + said.stderr


def test_a_look_that_nothing_can_have_found_is_refused(spec: Path, tmp_path: Path) -> None:
    store = with_looks(spec, tmp_path)

    def change(bodies: list[dict]) -> None:
        bodies[-1]["looks"][2]["within"][0] = -1e9

    made_anew(store, change)
    said = watch(store, spec)
    assert said.exit_code == 2
    assert "damaged: a look" in said.output + said.stderr


def test_a_store_of_another_version_says_what_to_do(spec: Path, tmp_path: Path) -> None:
    store = with_looks(spec, tmp_path, 3)

    def older(bodies: list[dict]) -> None:
        bodies[0]["schema"] = "syncline-design/store/v0"

    made_anew(store, older)
    said = watch(store, spec)
    assert said.exit_code == 2
    words = " ".join((said.output + said.stderr).split())
    assert "store/v0" in words
    assert "add the logs again" in words


def test_a_store_with_a_figure_changed_by_hand_is_refused_wherever_it_lies(
    spec: Path, tmp_path: Path
) -> None:
    """Without the chain made anew: another date in any of the runs; a copy elsewhere is none."""
    store = with_looks(spec, tmp_path, 4)
    lines = store.read_bytes().splitlines(keepends=True)
    (tmp_path / "elsewhere").mkdir()
    copy = tmp_path / "elsewhere" / "copy.jsonl"
    for at in range(1, 5):
        forged = lines[at].replace(b"2026-", b"2025-", 1)
        assert forged != lines[at]
        copy.write_bytes(b"".join([*lines[:at], forged, *lines[at + 1 :]]))
        said = watch(copy, spec)
        assert said.exit_code == 2
        assert f"copy.jsonl:{at + 1}:1" in said.output + said.stderr
    copy.write_bytes(store.read_bytes())
    own, other = (replace_path(told(spec, one, tmp_path, 1)) for one in (store, copy))
    assert own == other


def replace_path(found: dict) -> dict:
    return {key: value for key, value in found.items() if key != "store"}
