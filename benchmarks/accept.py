"""What `accept` says of made logs whose faults are known: what holds, breaks, and by how much.

    python -m benchmarks.accept [--sound 30] [--rounds 3] [--seed 0] [--write docs/accept.md]

Sound logs of every vehicle, motion and noise of `benchmarks/accept_world.py`, and logs with each
fault in turn.  A fault is found where its row is broken, or is of a group of which one row is; or
that of its twin (an error of the other lever arm, a turn of the other sensor).  Prints a line a log
and keeps it in out/accept.jsonl, where a run that was stopped goes on.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from benchmarks.accept_world import MOTIONS, NOISES, VEHICLES, Drive, Fault, Vehicle, write
from benchmarks.docs_tables import put
from benchmarks.study_scoring import proportion
from syncline_design import __version__

OUT = Path("out/accept.jsonl")
BEGIN, END = "<!-- accept: begin -->", "<!-- accept: end -->"
FAR_M = 0.08  # what a delay makes at the vehicle's limit of speed
Row = tuple[str, str]
Truths = dict[Row, float]
P, A, R = "position", "attitude", "ranging"
TWINS: dict[Row, Row] = {
    (P, "lever_arm"): (R, "lever_arm"), (R, "lever_arm"): (P, "lever_arm"),
    (A, "mounting"): (R, "mounting"), (R, "mounting"): (A, "mounting"),
}  # fmt: skip


@dataclass(frozen=True)
class Planted:
    """A fault of a vehicle, and the figures of the rows that it breaks."""

    name: str
    of: Callable[[Vehicle], tuple[Fault, Truths]]


def late(role: str, slopes: str = "") -> Planted:
    """slopes: the columns of motion that are as late, of one device."""

    def of(one: Vehicle) -> tuple[Fault, Truths]:
        size = 0.025 if role == A else FAR_M / one.v_max
        return Fault(late_s={role: size}, slopes_too=bool(slopes)), {(role, "latency"): size}

    return Planted(f"{role} and its {slopes} late" if slopes else f"{role} late", of)


def late_for_a_while(role: str) -> Planted:
    def of(one: Vehicle) -> tuple[Fault, Truths]:
        size = 2.0 * FAR_M / one.v_max
        inside = lambda t: np.where((t > 80.0) & (t < 115.0), size, 0.0)  # noqa: E731
        return Fault(late_s={role: inside}), {(role, "latency"): size}

    return Planted(f"{role} late for 35 s", of)


def arm(role: str, off: tuple[float, float, float]) -> Planted:
    truth = {(role, "lever_arm"): float(np.linalg.norm(off))}
    return Planted(f"arm of {role} off", lambda _: (Fault(arm_m={role: off}), truth))


def cancelling(role: str) -> Planted:
    """Forward, an arm that undoes a delay at seven tenths of the limit of speed."""

    def of(one: Vehicle) -> tuple[Fault, Truths]:
        size = FAR_M / one.v_max
        off = 0.7 * FAR_M * (1.0 if role == P else -1.0)
        fault = Fault(late_s={role: size}, arm_m={role: (off, 0.0, 0.0)})
        return fault, {(role, "latency"): size, (role, "lever_arm"): abs(off)}

    return Planted(f"{role} late, its arm off, undone", of)


def turned(role: str, off: tuple[float, float, float]) -> Planted:
    truth = {(role, "mounting"): float(np.radians(np.linalg.norm(off)))}
    axis = ("roll", "pitch", "yaw") if role == A else ("azimuth", "elevation", "")
    words = f"{role} turned in {axis[int(np.argmax(np.abs(off)))]}"
    return Planted(words, lambda _: (Fault(turn_deg={role: off}), truth))


def loud(role: str, keys: Sequence[str], times: float) -> Planted:
    truth = {(role, "noise"): times}
    words = f"{' and '.join(keys)} {times:g} times as noisy"
    return Planted(words, lambda _: (Fault(times=dict.fromkeys(keys, times)), truth))


def fast(times: float) -> Planted:
    return Planted(
        f"{times:g} times as fast", lambda _: (Fault(faster=times), {("platform", "speed"): 0.0})
    )


FAULTS = (
    late(P), late(A), late(R), late_for_a_while(P),
    arm(P, (0.15, 0.0, 0.05)), arm(R, (0.0, 0.18, 0.0)),
    cancelling(P), cancelling(R),
    turned(A, (0.0, 0.0, 0.5)), turned(A, (0.0, 0.35, 0.0)), turned(R, (0.5, 0.0, 0.0)),
    loud(P, ("position",), 2.5), loud(A, ("roll", "pitch", "yaw"), 2.5), loud(A, ("yaw",), 3.0),
    loud(R, ("range",), 3.0), loud(R, ("bearing",), 2.5), loud(R, ("range", "bearing"), 2.5),
    fast(1.9), late(P, "velocities"), late(A, "rates"),
)  # fmt: skip


@dataclass(frozen=True)
class Task:
    name: str
    drive: Drive
    planted: Planted | None


def tasks(sound: int, rounds: int, seed: int) -> Iterator[Task]:
    """Vehicles, motions and noises in turn, so that every pair of them comes up."""
    vehicles = tuple(VEHICLES)

    def drive(k: int, noise: str) -> Drive:
        return Drive(vehicles[k % 4], MOTIONS[(k // 4 + k) % 3], noise, 1000 * seed + k)

    for k in range(sound):
        noise = NOISES[k % len(NOISES)]
        yield Task(f"sound/{noise}/{seed}/{k}", drive(k, noise), None)
    for turn in range(rounds):
        for k, one in enumerate(FAULTS):
            noise = ("white", "slow", "white", "tails", "uneven")[(turn + k) % 5]
            number = 500 + len(FAULTS) * turn + k + turn
            yield Task(f"{one.name}/{seed}/{turn}", drive(number, noise), one)


def solved(task: Task) -> dict[str, Any]:
    """What `accept` says of one log, and what is true."""
    from syncline_design.comparison.accept import accept
    from syncline_design.spec.load import load

    begin = time.process_time()
    fault, truths = Fault(), dict[Row, float]()
    if task.planted is not None:
        fault, truths = task.planted.of(VEHICLES[task.drive.vehicle])
    with tempfile.TemporaryDirectory() as folder:
        spec, log = write(task.drive, fault, Path(folder))
        found = accept(load(spec), [log], seed=0).to_json()
    rows = {
        f"{row['role']}/{row['assumption']}": {
            "status": "one_of" if row.get("one_of") else row["status"],
            "measured": row["measured"], "words": row["evidence"],
        }
        for row in found["assumptions"]
        if row["assumption"] != "timing"
    }  # fmt: skip
    return {
        "name": task.name, "fault": None if task.planted is None else task.planted.name,
        "drive": list(astuple(task.drive)),
        "truths": {"/".join(row): value for row, value in truths.items()},
        "on_paper": found["spec"]["verdict"], "rows": rows,
        "seconds": time.process_time() - begin,
    }  # fmt: skip


def twin(row: str) -> str | None:
    role, _, name = row.partition("/")
    other = TWINS.get((role, name))
    return "/".join(other) if other else None


def inside(measured: dict[str, Any] | None, truth: float) -> bool | None:
    """Whether an interval holds the truth; None where there is none."""
    if measured is None or measured["low"] is None or measured["high"] is None:
        return None
    low, high = measured["low"], measured["high"]
    return bool(low <= truth <= high)


@dataclass(frozen=True)
class Score:
    """One log: planted rows that are broken, in a group of which one is, not shown, held; sound
    rows that are broken; groups without a planted row.
    """

    found: int
    grouped: int
    open: int
    held: int
    elsewhere: tuple[str, ...]
    intervals: tuple[bool, ...]
    held_inside: tuple[bool, ...]


def scored(one: dict[str, Any]) -> Score:
    rows, truths = one["rows"], one["truths"]
    twins = {t for row in truths if (t := twin(row))}
    status: dict[str, list[str]] = {s: [] for s in ("broken", "one_of", "not_shown", "holds")}
    intervals, held = [], []
    for row, truth in truths.items():
        other = twin(row)
        own = rows[row]
        said = own["status"]
        if other is not None and rows[other]["status"] == "broken":
            own, said = rows[other], "broken"
        elif other is not None and said != "broken" and rows[other]["status"] == "one_of":
            own, said = (own if said == "one_of" else rows[other]), "one_of"
        status[said].append(row)
        good = inside(own["measured"], truth) if truth else None
        if good is not None:
            told = said in ("broken", "one_of")
            (intervals if told else held if said == "holds" else []).append(good)
    allowed = set(truths) | twins
    if "35 s" in (one["fault"] or "") or "fast" in (one["fault"] or ""):
        allowed |= {"platform/rate"}
    elsewhere = tuple(
        r for r, row in rows.items() if row["status"] == "broken" and r not in allowed
    )
    in_groups = [r for r, row in rows.items() if row["status"] == "one_of"]
    if in_groups and not allowed.intersection(in_groups):
        elsewhere = (*elsewhere, " or ".join(in_groups))
    counts = [len(status[key]) for key in ("broken", "one_of", "not_shown", "holds")]
    return Score(*counts, elsewhere, tuple(intervals), tuple(held))


def line(one: dict[str, Any]) -> str:
    got = scored(one)
    counts = [sum(r["status"] == s for r in one["rows"].values())
              for s in ("holds", "not_shown", "one_of", "broken")]  # fmt: skip
    return (f"{one['name']}  {one['drive'][:3]}  holds/not shown/one of/broken {counts}  planted: "
            f"{got.found} found, {got.grouped} in a group, {got.open} open, {got.held} held; "
            f"elsewhere {got.elsewhere}; intervals {got.intervals} {got.held_inside}  "
            f"{one['seconds']:.0f} s")  # fmt: skip


def table(found: Sequence[dict[str, Any]], seed: int) -> str:
    """Sound logs by noise, logs with a fault by fault."""
    sound = [one for one in found if one["fault"] is None]
    broken = [one for one in found if one["fault"] is not None]
    scores = [scored(one) for one in broken]
    date = datetime.now(UTC).date().isoformat()
    lines = [
        f"Measured on {date} (version {__version__}, seed {seed}; `benchmarks/accept.py`): "
        f"{len(sound)} sound logs and {len(broken)} with a fault, of a world of its own "
        f"(4 vehicles, 3 motions, 200 s at 5 Hz, horizon of 10 min).",
        "",
        "| sound logs, noise | logs | rows that hold | not shown | one of several | broken |",
        "|---|--:|--:|--:|--:|--:|",
    ]
    for noise in NOISES:
        quiet = [one for one in sound if one["drive"][2] == noise]
        counts = [
            sum(row["status"] == s for one in quiet for row in one["rows"].values())
            for s in ("holds", "not_shown", "one_of", "broken")
        ]
        lines.append(f"| {noise} | {len(quiet)} | " + " | ".join(map(str, counts)) + " |")
    lines += [
        "",
        "| fault | logs | its rows: broken | one of several | not shown | held | others broken |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]
    for fault in dict.fromkeys(one["fault"] for one in broken):
        own = [s for one, s in zip(broken, scores, strict=True) if one["fault"] == fault]
        figures = [
            len(own),
            sum(s.found for s in own),
            sum(s.grouped for s in own),
            sum(s.open for s in own),
            sum(s.held for s in own),
            sum(len(s.elsewhere) for s in own),
        ]
        lines.append(f"| {fault} | " + " | ".join(map(str, figures)) + " |")
    intervals = [hit for s in scores for hit in s.intervals]
    held = [hit for s in scores for hit in s.held_inside]
    lines += [
        "",
        f"Intervals of these rows (broken, one of several) hold the truth in {sum(intervals)} of "
        f"{len(intervals)}: {proportion(intervals)}; those of rows that hold beside a fault that "
        f"does not turn the verdict in {sum(held)} of {len(held)}.",
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sound", type=int, default=30)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="")
    parser.add_argument("--kept", type=Path, default=OUT)
    parser.add_argument("--write", type=Path)
    asked = parser.parse_args()
    asked.kept.parent.mkdir(exist_ok=True, parents=True)
    lines = asked.kept.read_text("utf-8").splitlines() if asked.kept.exists() else []
    known = {one["name"]: one for one in map(json.loads, lines)}
    found = []
    for task in tasks(asked.sound, asked.rounds, asked.seed):
        if asked.only not in task.name:
            continue
        if task.name not in known:
            known[task.name] = solved(task)
            with asked.kept.open("a", encoding="utf-8") as out:
                out.write(json.dumps(known[task.name]) + "\n")
        found.append(known[task.name])
        print(line(found[-1]), flush=True)
    text = table(found, asked.seed)
    print(text)
    if asked.write is not None:
        put(asked.write, f"{text}\n", BEGIN, END)


if __name__ == "__main__":
    main()
