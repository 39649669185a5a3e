"""Studies under faults: killed workers and parents, damaged and missing files, no room, Dask."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from study_specs import STUDY, write
from syncline_design.machine.records import read_as
from syncline_design.report.studies import render_study
from syncline_design.studies import (
    Progress,
    StudyError,
    StudyResult,
    StudySettings,
    StudyStoppedError,
    run_study,
)
from syncline_design.studies.case import CaseSettings, case_keys
from syncline_design.studies.loading import load_study
from syncline_design.studies.pool import MAX_DEATHS, WorkerPool
from syncline_design.studies.record import CaseRecord
from syncline_design.studies.store import Store

FORMATS = ("csv", "json", "junit", "sarif", "github", "markdown")
# Limits that can be met: explaining an infeasible case takes many times longer than a check.
WIDER = STUDY.replace("[40 m, 60 m, 100 m]", "{low: 40 m, high: 95 m, count: 12}").replace(
    "[0.15 m, 0.3 m]", "[0.3 m, 0.4 m]"
)


def bytes_of(result: StudyResult) -> dict[str, str | bytes]:
    return {name: render_study(name, result) for name in FORMATS}


def children_of(pid: int) -> list[int]:
    """Worker processes of a parent (Linux), the resource tracker left out."""
    found = []
    for folder in Path("/proc").iterdir():
        if not folder.name.isdigit():
            continue
        try:
            parent = int(folder.joinpath("stat").read_text().rpartition(")")[2].split()[1])
            command = folder.joinpath("cmdline").read_bytes()
        except (OSError, IndexError):
            continue
        if parent == pid and b"spawn_main" in command:
            found.append(int(folder.name))
    return found


def command(path: Path, store: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "syncline_design.cli", "study", str(path), "--store", str(store)],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


needs_proc = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="needs Linux /proc")


# Sources that change while the tests run would be another program, with other cases.
FIXED = "from syncline_design.studies import case\ncase.engine_sha256 = lambda: 'fixed'\n"


@pytest.fixture(autouse=True, scope="module")
def _fixed_program() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("syncline_design.studies.case.engine_sha256", lambda: "fixed")
        yield


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str | bytes]]:
    """The study run in one process without any fault: what every other way has to equal."""
    path = write(tmp_path_factory.mktemp("plain"), WIDER)
    return path, bytes_of(run_study(path, StudySettings(workers=1)))


def test_two_processes_give_the_same_bytes_as_one(plain: Any, tmp_path: Path) -> None:
    path, wanted = plain
    two = run_study(path, StudySettings(workers=2, store=tmp_path / "store"))
    assert two.computed == 24
    assert bytes_of(two) == wanted


@needs_proc
def test_a_killed_worker_is_replaced_and_the_numbers_stay(plain: Any, tmp_path: Path) -> None:
    path, wanted = plain
    killed: list[int] = []

    def kill_one(progress: Progress) -> None:
        if progress.done in (4, 10) and len(killed) < (1 if progress.done == 4 else 2):
            victim = children_of(os.getpid())[0]
            os.kill(victim, signal.SIGKILL)
            killed.append(victim)

    settings = StudySettings(workers=2, store=tmp_path / "store")
    result = run_study(path, settings, kill_one)
    assert len(killed) == 2
    assert result.retried >= 1
    assert result.counts["indeterminate"] == 0
    assert bytes_of(result) == wanted


@needs_proc
def test_a_killed_parent_resumes_and_ends_with_the_same_bytes(plain: Any, tmp_path: Path) -> None:
    path, wanted = plain
    store = tmp_path / "store"
    script = (
        f"import sys\n{FIXED}"
        "from pathlib import Path\n"
        "from syncline_design.studies import StudySettings, run_study\n"
        "if __name__ == '__main__':\n"
        "    run_study(sys.argv[1], StudySettings(workers=2, store=Path(sys.argv[2])))\n"
    )
    runner = tmp_path / "runner.py"
    runner.write_text(script, encoding="utf-8")
    process = subprocess.Popen([sys.executable, str(runner), str(path), str(store)])
    deadline = time.monotonic() + 60
    while len(list(store.glob("*/*.json"))) < 5 and time.monotonic() < deadline:
        time.sleep(0.01)
    workers = children_of(process.pid)
    process.kill()
    process.wait()
    kept = {file.name: file.read_bytes() for file in store.glob("*/*.json")}
    assert 5 <= len(kept) < 24, "the parent was to be killed half-way"
    resumed = run_study(path, StudySettings(workers=2, store=store))
    assert resumed.reused == len(kept)
    assert resumed.computed == 24 - len(kept)
    assert bytes_of(resumed) == wanted
    for name, content in kept.items():
        assert (store / name[:2] / name).read_bytes() == content
    while any(Path(f"/proc/{pid}").exists() for pid in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not [pid for pid in workers if Path(f"/proc/{pid}").exists()], "orphaned workers"


@needs_proc
def test_an_interrupt_ends_at_once_and_keeps_what_is_done(plain: Any, tmp_path: Path) -> None:
    path, wanted = plain
    store = tmp_path / "store"
    script = tmp_path / "command.py"
    start = "from syncline_design.cli import main\nif __name__ == '__main__':\n    main()\n"
    script.write_text(FIXED + start, encoding="utf-8")
    process = subprocess.Popen(
        [sys.executable, str(script), "study", str(path), "--store", str(store)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 60
    while len(list(store.glob("*/*.json"))) < 4 and time.monotonic() < deadline:
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    stdout, stderr = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "Traceback" not in stdout + stderr
    assert "interrupted" in stderr
    kept = len(list(store.glob("*/*.json")))
    assert 4 <= kept < 24
    resumed = run_study(path, StudySettings(workers=2, store=store))
    assert resumed.reused == kept
    assert bytes_of(resumed) == wanted


def test_unchanged_cases_are_not_computed_again(plain: Any) -> None:
    path, wanted = plain
    again = run_study(path, StudySettings(workers=2))
    assert (again.computed, again.reused) == (0, 24)
    assert bytes_of(again) == wanted


def test_a_wider_grid_computes_only_what_is_new(tmp_path: Path) -> None:
    path = write(tmp_path)
    run_study(path)
    path.write_text(STUDY.replace("100 m]", "100 m, 120 m]"), encoding="utf-8")
    wider = run_study(path)
    assert (wider.computed, wider.reused) == (2, 6)


@pytest.mark.parametrize("change", ["spec", "seed", "check", "catalog"])
def test_what_changes_a_result_changes_the_key(tmp_path: Path, change: str) -> None:
    path = write(tmp_path)
    settings = CaseSettings.now(0, None)
    before = case_keys(load_study(path), settings)
    assert len(set(before)) == 6
    spec = tmp_path / "spec.yaml"
    if change == "spec":
        spec.write_text(spec.read_text().replace("100000 EUR", "100001 EUR"), encoding="utf-8")
    elif change == "catalog":
        (tmp_path / "own.yaml").write_text("infrastructure: {box: {channels: 2}}\n")
        spec.write_text(spec.read_text() + "catalogs: [own.yaml]\n", encoding="utf-8")
    elif change == "check":
        path.write_text(STUDY + "check: {monte_carlo: true}\n", encoding="utf-8")
    if change == "seed":
        settings = CaseSettings.now(1, None)
    assert not set(before) & set(case_keys(load_study(path), settings))


def test_damaged_case_files_are_computed_again(tmp_path: Path) -> None:
    path = write(tmp_path)
    first = run_study(path)
    wanted = bytes_of(first)
    files = sorted(first.store.folder.glob("*/*.json"))
    files[0].write_bytes(b"")
    files[1].write_bytes(files[1].read_bytes()[:200])
    content = json.loads(files[2].read_text())
    content["record"]["verdict"] = "meets?"
    files[2].write_text(json.dumps(content))
    files[3].write_bytes(files[4].read_bytes())
    again = run_study(path)
    assert (again.computed, again.reused) == (4, 2)
    assert bytes_of(again) == wanted


def test_no_room_for_a_case_keeps_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(tmp_path)
    write_case, written = Store.write, []

    def full(self: Store, key: str, encoded: str) -> None:
        if len(written) == 3:
            monkeypatch.setattr(Path, "replace", _no_space)
        write_case(self, key, encoded)
        written.append(key)

    monkeypatch.setattr(Store, "write", full)
    with pytest.raises(StudyStoppedError, match=r"No space left on device.*run again"):
        run_study(path, StudySettings(workers=1))
    monkeypatch.undo()
    store = tmp_path / ".syncline-cases"
    assert len(list(store.glob("*/*.json"))) == 3
    assert not list(store.glob("*/*.part"))
    assert run_study(path).reused == 3


def _no_space(*_: Any) -> None:
    raise OSError(28, "No space left on device")


def test_a_folder_that_cannot_be_written_is_a_clear_error(tmp_path: Path) -> None:
    path = write(tmp_path)
    (tmp_path / "file").write_text("")
    store = tmp_path / "file" / "store"
    with pytest.raises(StudyStoppedError, match="cannot keep the results"):
        run_study(path, StudySettings(store=store))
    done = command(path, store)
    assert done.returncode == 3
    assert done.stderr.startswith("syncline-design: ")
    assert done.stderr.count("\n") == 1


def test_a_case_without_verdict_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from syncline_design.verdict import verify

    path = write(tmp_path)
    check = verify.check_loaded

    def broken(loaded: Any, settings: Any) -> Any:
        if float(loaded.spec.stages[0].platform.distance or 0) == 60.0:
            raise RuntimeError("lost")
        return check(loaded, settings)

    monkeypatch.setattr(verify, "check_loaded", broken)
    first = run_study(path, StudySettings(workers=1))
    assert first.counts["indeterminate"] == 2
    assert first.verdict == "fails"
    assert "RuntimeError: lost" in str(render_study("csv", first))
    monkeypatch.undo()
    second = run_study(path, StudySettings(workers=1))
    assert (second.computed, second.reused) == (2, 4)
    assert second.counts["indeterminate"] == 0


@needs_proc
def test_a_case_that_kills_every_worker_ends_without_verdict(tmp_path: Path) -> None:
    study = load_study(write(tmp_path))
    pool = WorkerPool(study, CaseSettings.now(0, None), 1)
    stop = threading.Event()

    def kill_all() -> None:
        while not stop.is_set():
            for worker in list(pool._workers):
                if worker.started and worker.cases and worker.cases[0] == 0:
                    worker.process.kill()
            time.sleep(0.0005)

    killer = threading.Thread(target=kill_all)
    killer.start()
    try:
        records = dict(pool.run(range(3)))
    finally:
        stop.set()
        killer.join()
    assert sorted(records) == [0, 1, 2]
    kept = read_as(CaseRecord, records[0])
    assert kept == CaseRecord(
        verdict="indeterminate", reason=f"its worker process died {MAX_DEATHS} times"
    )
    assert not kept.is_final
    assert '"verdict":"indeterminate"' not in records[1] + records[2]


def test_a_script_without_main_guard_gets_an_error_not_a_hang(tmp_path: Path) -> None:
    script = tmp_path / "unguarded.py"
    path = write(tmp_path, WIDER)
    script.write_text(
        f"from syncline_design.studies import run_study\nrun_study({str(path)!r})\n",
        encoding="utf-8",
    )
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode != 0
    assert "__name__ == '__main__'" in done.stderr


def test_a_dask_cluster_gives_the_same_bytes_with_a_worker_killed(
    plain: Any, tmp_path: Path
) -> None:
    distributed = pytest.importorskip("distributed")
    path, wanted = plain
    with (
        distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = client.run(os.getpid)
        killed: list[int] = []

        def kill_one(progress: Progress) -> None:
            if progress.done == 4 and not killed:
                killed.append(next(iter(pids.values())))
                os.kill(killed[0], signal.SIGKILL)

        settings = StudySettings(scheduler=cluster.scheduler_address, store=tmp_path / "store")
        result = run_study(path, settings, kill_one)
    assert len(killed) == 1
    assert len(set(pids.values())) == 3
    assert result.counts["indeterminate"] == 0
    assert bytes_of(result) == wanted


STOPPED = """
import asyncio, logging
from syncline_design.studies.cluster import _quiet_when_stopped

async def lost():
    raise KeyError("a worker that has gone")

async def stopped():
    try:
        with _quiet_when_stopped():
            task = asyncio.get_running_loop().create_task(lost())
            await asyncio.sleep(0)
            raise KeyboardInterrupt
    except KeyboardInterrupt:
        pass

asyncio.run(stopped())
"""


def test_a_stopped_cluster_tells_of_no_task_that_failed_with_it() -> None:
    done = subprocess.run([sys.executable, "-c", STOPPED], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    told = STOPPED.replace("            raise KeyboardInterrupt\n", "")
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True)
    assert "KeyError" in done.stderr  # as it is where nobody stops it


def test_no_scheduler_is_a_clear_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("syncline_design.studies.cluster.TIMEOUT", "1s")
    with pytest.raises(StudyError, match="no Dask scheduler answers at"):
        run_study(write(tmp_path), StudySettings(scheduler="tcp://127.0.0.1:9"))


def test_without_dask_the_message_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(StudyError, match=r"syncline-design\[cluster\]"):
        run_study(write(tmp_path), StudySettings(dask=True))
