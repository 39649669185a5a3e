"""A store whose writers are killed at moments nobody chose: what was acknowledged is there, whole.

Every writer adds runs of its own and says each once it is on the disk; it is killed (SIGKILL)
while it writes, others beside it.  Oracles: the chain walked by plain SHA-256, and counting.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from syncline_design.campaign.kept import Run, statistics_of
from syncline_design.campaign.looks import KeptLook
from syncline_design.campaign.store import add_looks, add_run, read_store
from syncline_design.diagnosis.sufficient import Less, Sufficient
from syncline_design.diagnosis.system import pinned_system
from syncline_design.machine.records import read_as
from syncline_design.spec.load import BadInput, load
from tests.world import make_log, scenario

WRITER = """\
import sys, itertools, json
from dataclasses import replace
from pathlib import Path
from syncline_design.campaign.kept import Run
from syncline_design.campaign.store import add_run
from syncline_design.diagnosis.system import pinned_system
from syncline_design.machine.records import read_as
from syncline_design.spec.load import load

store, spec, sample, name = Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]), sys.argv[4]
system, run = pinned_system(load(spec)), read_as(Run, sample.read_bytes())
print("ready", flush=True)
sys.stdin.readline()
for k in itertools.count():
    own = replace(run, files=(f"{name}-{k}.csv",), sha256=f"{name}{k:060d}", square=float(k),
                  parameters=(f"latency/position/0/{name}_{k}_s",))
    add_run(store, "car", system, own)
    print(f"{name}-{k}.csv", flush=True)
"""


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A spec, and a run as a store keeps one, beside it."""
    folder = tmp_path_factory.mktemp("kills")
    log = make_log(scenario("car_stops", 4, 20.0, 5.0), ())
    (folder / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    labels = (("latency", "position", 0, "latency_s"),)
    parts = 400 * np.eye(1)
    less = Less(np.tile(parts, (16, 1, 1)), np.ones((16, 1)), np.ones(16))
    found = Sufficient(labels, parts, np.ones(1), 1.0, parts, (less,))
    run = Run(("a.csv",), "0" * 64, "georeference", 0.0, None, 60.0, 10, 10, {}, "agrees", 0.0,
              False, 0.05, {"car/position": 1.0}, (), "0", **statistics_of(found))  # fmt: skip
    (folder / "run.json").write_text(json.dumps(run.to_json()), encoding="utf-8")
    return folder


def begun(sample: Path, store: Path, name: str) -> subprocess.Popen[str]:
    words = [sys.executable, "-c", WRITER, store, sample / "spec.yaml", sample / "run.json", name]
    return subprocess.Popen(list(map(str, words)), stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                            text=True)  # fmt: skip


def another(run: Run, name: str) -> Run:
    """A run of its own, that tells of another parameter."""
    return replace(run, sha256=name.rjust(64, "0"), parameters=(f"latency/position/0/x{name}_s",))


def bodies(store: Path) -> list[dict]:
    """All lines of a store, each hash worked out anew."""
    last, found = "0" * 64, []
    for line in store.read_text("ascii").splitlines():
        whole = json.loads(line)
        text = json.dumps(whole["body"], sort_keys=True, separators=(",", ":"))
        assert whole["previous"] == last
        assert whole["sha256"] == hashlib.sha256((last + text).encode()).hexdigest()
        last = whole["sha256"]
        found.append(whole["body"])
    return found


def test_runs_that_were_acknowledged_outlive_their_writers(sample: Path, tmp_path: Path) -> None:
    """Two writers at once, killed at a moment drawn; then two more go on with what is left."""
    rng, store = np.random.default_rng(18), tmp_path / "store.jsonl"
    told: list[str] = []
    for turn in range(2):
        writers = [begun(sample, store, f"{turn}{name}") for name in "ab"]
        for one in writers:
            assert one.stdout is not None
            assert one.stdin is not None
            assert one.stdout.readline() == "ready\n"
            one.stdin.write("go\n")
            one.stdin.flush()
        first = writers[0].stdout
        assert first is not None
        told.append(first.readline().strip())
        time.sleep(float(rng.uniform(0.0, 0.3)))
        for one in writers:
            one.kill()
        for one in writers:
            told += (one.communicate()[0] or "").split()
    found = read_store(store)
    assert found is not None
    names = [entry.run.files[0] for entry in found.entries]
    whole = tmp_path / "whole.jsonl"
    whole.write_bytes(store.read_bytes()[: len(store.read_bytes()) - found.torn])
    assert [b["run"]["files"][0] for b in bodies(whole) if b["kind"] == "run"] == names
    assert set(told) <= set(names)
    assert len(set(names)) == len(names) >= 2
    case = load(sample / "spec.yaml")
    last = found.entries[-1].run
    with pytest.raises(BadInput, match="in the store already"):
        add_run(store, "car", pinned_system(case), last)


def test_a_writer_that_stops_at_any_byte_of_its_lines_loses_no_other(
    sample: Path, tmp_path: Path
) -> None:
    """Every byte of the last two lines, a run and its look: all runs acknowledged before are there,
    what is left of the line is said by its length, and the next writer begins in its place."""
    store, case = tmp_path / "store.jsonl", load(sample / "spec.yaml")
    run = read_as(Run, (sample / "run.json").read_bytes())
    system = pinned_system(case)
    for k in range(3):
        add_run(store, "car", system, another(run, str(k)))
    before = read_store(store)
    assert before is not None
    add_looks(before, [KeptLook("a" * 64, 0.5, (1.0,), (1.0,))])
    whole = store.read_bytes()
    lines = whole.splitlines(keepends=True)
    assert [body["kind"] for body in bodies(store)] == ["store", "run", "run", "run", "looks"]
    cut, ends = tmp_path / "cut.jsonl", np.cumsum([len(line) for line in lines])
    for at in range(int(ends[-3]), len(whole) + 1):
        cut.write_bytes(whole[:at])
        found, kept = read_store(cut), int(np.sum(ends <= at))
        assert found is not None
        assert [e.run.sha256 for e in found.entries] == [
            f"{k:064d}" for k in range(min(kept - 1, 3))
        ]
        assert found.torn == at - ends[kept - 1]
        assert len(found.looks) == (kept == len(lines))
    for at in (ends[-3] + 1, ends[-2] - 1, ends[-2], ends[-1] - 1):
        cut.write_bytes(whole[: int(at)])
        add_run(
            cut,
            "car",
            system,
            replace(run, sha256="9" * 64, parameters=("latency/position/0/y_s",)),
        )
        kinds = [body["kind"] for body in bodies(cut)]
        assert kinds == ["store", *["run"] * (2 + int(at >= ends[-2])), "run"]


def test_lines_that_were_moved_copied_or_joined_are_refused(sample: Path, tmp_path: Path) -> None:
    """Whole lines of true stores, in an order in which they were not written; a store that ends
    earlier is believed, as docs/joint.md says."""
    case = load(sample / "spec.yaml")
    run = read_as(Run, (sample / "run.json").read_bytes())
    texts = []
    for name in "ab":
        store = tmp_path / f"{name}.jsonl"
        for k in range(3):
            own = replace(
                run, sha256=f"{name}{k:063d}", parameters=(f"latency/position/0/{name}{k}_s",)
            )
            add_run(store, "car", pinned_system(case), own)
        texts.append(store.read_bytes().splitlines(keepends=True))
    (head, *runs), (_, *others) = texts
    odd = tmp_path / "odd.jsonl"
    for lines in (
        [head, runs[1], runs[0], runs[2]],
        [head, runs[0], runs[2]],
        [head, *runs, runs[2]],
        [head, *runs, runs[0]],
        [head, *runs, head, *runs],
        [head, *runs, *others],
        [head, runs[0], others[1], runs[2]],
        runs,
    ):
        odd.write_bytes(b"".join(lines))
        with pytest.raises(BadInput, match="damaged"):
            read_store(odd)
    odd.write_bytes(b"".join([head, *runs[:2]]))
    found = read_store(odd)
    assert found is not None
    assert (len(found.entries), found.torn) == (2, 0)


def test_every_cut_of_a_store_is_whole_lines_or_refused(sample: Path, tmp_path: Path) -> None:
    """Cut after any byte, as a kill or a full disk leaves it: runs before the cut, and no others;
    with a byte of a whole line changed it is refused, by its line."""
    store, case = tmp_path / "store.jsonl", load(sample / "spec.yaml")
    run = read_as(Run, (sample / "run.json").read_bytes())
    for k in range(3):
        own = replace(run, sha256=f"{k:064d}", parameters=(f"latency/position/0/x{k}_s",))
        add_run(store, "car", pinned_system(case), own)
    whole = store.read_bytes()
    assert [body["kind"] for body in bodies(store)] == ["store", "run", "run", "run"]
    ends = [i + 1 for i, byte in enumerate(whole) if byte == 10]
    rng = np.random.default_rng(19)
    for at in {*map(int, rng.integers(1, len(whole), 40)), *ends, *(end - 1 for end in ends)}:
        cut = tmp_path / "cut.jsonl"
        cut.write_bytes(whole[:at])
        found = read_store(cut)
        kept = sum(end <= at for end in ends)
        assert (0 if found is None else len(found.entries)) == max(kept - 1, 0)
        if found is not None:
            assert found.torn == at - ends[kept - 1]
    for at in {*map(int, rng.integers(0, len(whole) - 1, 40)), *(end - 1 for end in ends[:-1])}:
        forged = tmp_path / "forged.jsonl"
        forged.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        with pytest.raises(BadInput):
            read_store(forged)
