"""How often `audit` names a planted fault, and how often it accuses a sound stream.

    python -m benchmarks.audit [--seed 1] [--each 8] [--sound 24] [--write docs/audit.md]
                               [--peers FOLDER]

Every recording is written as a file first, in turn as CSV of several units and separators and as
MCAP of ROS 2 messages, and read back by the product.  A planted fault is named where its name is
among those found; a sound stream is accused where anything that counts is found.  --peers: a folder
with `clockdoctor` and `rosbag-doctor` (`pip install --target FOLDER ...`), run on MCAP files of the
same recordings.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from types import ModuleType

from benchmarks import audit_corpus, audit_corpus_other, audit_recordings, audit_together
from benchmarks.audit_corpus import Made, MadeRecording
from syncline_design import __version__
from syncline_design.auditing.result import StreamAudit
from syncline_design.auditing.run import audit

BEGIN, END = "<!-- corpus -->", "<!-- end of corpus -->"
SCHEMA = "std_msgs/Header header\nfloat64 value\n" + 80 * "=" + (
    "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n" + 80 * "="
    + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
)  # fmt: skip
MOST_MESSAGES = 4000  # of a stream that is written as MCAP, by a writer in Python
# which flag of clockdoctor is a name for which faults
NAMES = {
    "clock_offset": ("epoch_offset",),
    "clock_drift": ("drift",),
    "out_of_order": ("backward_jump", "counter_wrap"),
    "gap": ("gap", "lost_messages"),
    "coarse_resolution": ("truncated_stamps", "packetised"),
    "duplicate_timestamp": ("duplicates",),
    "buffering": ("batched_by_recorder",),
}


# ---- files ----------------------------------------------------------------------------------


def written(recording: MadeRecording, folder: Path, turn: int) -> list[Path]:
    """The recording as files, the form by turns."""
    small = sum(one.stamp_ns.size for one in recording.streams) <= MOST_MESSAGES
    fits = all(one.stamp_ns.min() >= 0 and one.stamp_ns.max() < 2**31 * 10**9 and one.factor == 1
               for one in recording.streams)  # fmt: skip
    in_order = all((one.receive_ns[1:] >= one.receive_ns[:-1]).all() for one in recording.streams)
    if turn % 4 == 3 and small and fits and in_order:
        return [as_mcap(recording, folder / f"{recording.name}.mcap")]
    return [as_csv(one, folder, turn % 3) for one in recording.streams]


def as_csv(one: Made, folder: Path, form: int) -> Path:
    """Seconds with commas, nanoseconds with semicolons, or seconds with decimal commas and tabs."""
    path = folder / f"{one.name}.csv"
    unit, mark = (("s", ","), ("ns", ";"), ("s", "\t"))[form]
    with path.open("w", encoding="utf-8") as file:
        file.write(f"stamp_{unit}{mark}receive_{unit}\n")
        for stamp, receive in zip(one.stamp_ns.tolist(), one.receive_ns.tolist(), strict=True):
            cells = [_cell(value, form) for value in (stamp * one.factor, receive)]
            file.write(mark.join(cells) + "\n")
    return path


def _cell(value: int, form: int) -> str:
    if form == 1:
        return str(value)
    whole, rest = divmod(abs(value), 10**9)
    return f"{'-' if value < 0 else ''}{whole}{',' if form == 2 else '.'}{rest:09d}"


def as_mcap(recording: MadeRecording, path: Path) -> Path:
    from mcap_ros2.writer import Writer

    rows = [
        (receive, stamp, one.name)
        for one in recording.streams
        for stamp, receive in zip(one.stamp_ns.tolist(), one.receive_ns.tolist(), strict=True)
    ]
    with path.open("wb") as file:
        writer = Writer(file)
        schema = writer.register_msgdef("audit_msgs/msg/Sample", SCHEMA)
        for receive, stamp, name in sorted(rows, key=lambda row: row[0]):
            head = {"stamp": {"sec": stamp // 10**9, "nanosec": stamp % 10**9}, "frame_id": ""}
            writer.write_message("/" + name, schema, {"header": head, "value": 0.0}, receive,
                                 receive)  # fmt: skip
        writer.finish()
    return path


# ---- scores ---------------------------------------------------------------------------------


@dataclass
class Score:
    """Counts of one corpus."""

    named: Counter[str] = field(default_factory=Counter)
    planted: Counter[str] = field(default_factory=Counter)
    accused: Counter[str] = field(default_factory=Counter)
    sound: Counter[str] = field(default_factory=Counter)
    bounds: list[float] = field(default_factory=list)
    beside: int = 0  # names besides those planted, of streams with a fault
    misses: list[str] = field(default_factory=list)


def scored(corpus: ModuleType, seed: int, each: int, sound: int) -> Score:
    score = Score()
    with tempfile.TemporaryDirectory() as name:
        for turn, recording in enumerate(corpus.corpus(seed, each, sound)):
            paths = written(recording, Path(name), turn)
            rows = {row.name.lstrip("/"): row for row in audit(paths).streams}
            for one in recording.streams:
                _add(score, recording, one, rows[one.name])
            for path in paths:
                path.unlink()
    return score


def _add(score: Score, recording: MadeRecording, one: Made, row: StreamAudit) -> None:
    names = {fault.fault for fault in row.faults if fault.counts}
    names -= set(getattr(one, "allowed", ())) - set(one.planted)
    planted = set(one.planted)
    if "batched_by_recorder" in recording.planted:
        planted = {"batched_by_recorder"}
        names |= {f.fault for f in row.faults if f.fault == "batched_by_recorder"}
    for fault in planted:
        score.planted[fault] += 1
        score.named[fault] += fault in names
        if fault not in names:
            score.misses.append(f"{one.name}: {sorted(names) or 'nothing'}")
    if planted:
        score.beside += len(names - planted)
    else:
        score.sound[one.sound_as] += 1
        score.accused[one.sound_as] += bool(names)
        if names:
            score.misses.append(f"{one.name} (sound): {sorted(names)}")
    if one.bound_s and row.residual_s.bound is not None:
        ratio = row.residual_s.bound / one.bound_s
        score.bounds.append(ratio)
        if abs(ratio - 1.0) > 0.1:
            score.misses.append(f"{one.name}: bound {ratio:.2f} of the planted one")


# ---- peers ----------------------------------------------------------------------------------


@dataclass
class PeerScore:
    """What another tool says of the same files."""

    named: int = 0
    planted: int = 0
    flagged: int = 0
    sound: int = 0
    failed: int = 0


def peers(folder: Path, seed: int, each: int, sound: int) -> dict[str, PeerScore]:
    scores: dict[str, PeerScore] = defaultdict(PeerScore)
    with tempfile.TemporaryDirectory() as name:
        for recording in audit_corpus.corpus(seed, each, sound):
            if len(recording.streams) > 1 or recording.streams[0].stamp_ns.size > MOST_MESSAGES:
                continue
            one = recording.streams[0]
            if one.stamp_ns.min() < 0 or one.stamp_ns.max() >= 2**31 * 10**9 or one.factor != 1:
                continue
            path = as_mcap(recording, Path(name) / f"{recording.name}.mcap")
            ours = audit([path]).streams[0]
            found = {f.fault for f in ours.faults if f.counts}
            _count(scores["syncline-design"], one, found)
            _count(scores["clockdoctor"], one, _clockdoctor(folder, path))
            _count(scores["rosbag-doctor"], one, _rosbag_doctor(folder, path))
    return scores


def _count(score: PeerScore, one: Made, names: set[str] | None) -> None:
    if names is None:
        score.failed += 1
        names = set()
    if one.planted:
        score.planted += len(one.planted)
        score.named += sum(fault in names for fault in one.planted)
    else:
        score.sound += 1
        score.flagged += bool(names)


def _run(folder: Path, module: str, *words: str) -> subprocess.CompletedProcess[str]:
    here = os.pathsep.join([str(folder), *(p for p in sys.path if p)])
    return subprocess.run(
        [sys.executable, "-c", f"import sys; from {module} import main; sys.exit(main())", *words],
        env={**os.environ, "PYTHONPATH": here}, capture_output=True, text=True, check=False,
        timeout=120,
    )  # fmt: skip


def _clockdoctor(folder: Path, path: Path) -> set[str] | None:
    """Its flags, each as the faults that it is a name for."""
    out = path.parent / "clockdoctor"
    out.mkdir(exist_ok=True)
    _run(folder, "clockdoctor.cli", str(path), "--out-dir", str(out))
    files = sorted(out.glob("*.json"))
    if not files:
        return None
    data = json.loads(files[0].read_text("utf-8"))
    for file in out.iterdir():
        file.unlink()
    found: set[str] = set()
    for flag in _flags(data):
        found |= set(NAMES.get(flag, (flag,)))
    return found


def _flags(data: object) -> Iterator[str]:
    """Every `type` of a flag, wherever it stands."""
    if isinstance(data, dict):
        if "severity" in data and "type" in data:
            yield str(data["type"])
        for value in data.values():
            yield from _flags(value)
    elif isinstance(data, list):
        for value in data:
            yield from _flags(value)


def _rosbag_doctor(folder: Path, path: Path) -> set[str] | None:
    """Codes of its issues; none of them names a cause of the stamps."""
    done = _run(folder, "rosbag_doctor.cli", str(path), "--format", "json")
    try:
        data = json.loads(done.stdout)
    except json.JSONDecodeError:
        return None
    issues = data.get("issues", [])
    codes = {str(issue.get("code", "")) for issue in issues if issue.get("severity") != "info"}
    known = {"gap": "gap", "large-gap": "gap"}
    return {known.get(code, code) for code in codes}


# ---- the table ------------------------------------------------------------------------------


def page(scores: Sequence[tuple[str, Score]], beside: dict[str, PeerScore], words: str) -> str:
    lines = [words, "", "| planted | " + " | ".join(name for name, _ in scores) + " |",
             "|---|" + "---|" * len(scores)]  # fmt: skip
    kinds = list(dict.fromkeys(kind for _, score in scores for kind in score.planted))
    for kind in kinds:
        cells = [_ratio(score.named[kind], score.planted[kind]) for _, score in scores]
        lines.append(f"| `{kind}` | " + " | ".join(cells) + " |")
    lines.append("| **all** | " + " | ".join(
        f"**{_ratio(sum(s.named.values()), sum(s.planted.values()), share=True)}**"
        for _, s in scores) + " |")  # fmt: skip
    lines += ["", "| sound, but odd | " + " | ".join(f"{name}: accused" for name, _ in scores)
              + " |", "|---|" + "---|" * len(scores)]  # fmt: skip
    odd = list(dict.fromkeys(kind for _, score in scores for kind in score.sound))
    for kind in odd:
        cells = [_ratio(score.accused[kind], score.sound[kind]) for _, score in scores]
        lines.append(f"| {kind.replace('_', ' ')} | " + " | ".join(cells) + " |")
    lines.append("| **all** | " + " | ".join(
        f"**{_ratio(sum(s.accused.values()), sum(s.sound.values()), share=True)}**"
        for _, s in scores) + " |")  # fmt: skip
    for name, score in scores:
        near = sum(abs(ratio - 1.0) <= 0.1 for ratio in score.bounds)
        lines += ["", f"Bound within 10 % of the planted delays' ({name}): "
                  f"{_ratio(near, len(score.bounds), share=True)}; {score.beside} names besides "
                  "the planted ones on streams with faults."]  # fmt: skip
    if beside:
        lines += ["", "The same MCAP files of the first corpus, by other tools:", "",
                  "| tool | causes named | sound streams flagged |", "|---|---|---|"]  # fmt: skip
        for name, peer in beside.items():
            lines.append(f"| {name} | {_ratio(peer.named, peer.planted)} | "
                         f"{_ratio(peer.flagged, peer.sound)} |")  # fmt: skip
    return "\n".join(lines)


def _ratio(part: int, whole: int, *, share: bool = False) -> str:
    if not whole:
        return ""
    return f"{part} of {whole}" + (f" ({100.0 * part / whole:.1f} %)" if share else "")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--each", type=int, default=8)
    parser.add_argument("--sound", type=int, default=24)
    parser.add_argument("--write", type=Path)
    parser.add_argument("--peers", type=Path)
    given = parser.parse_args()
    scores = [
        ("first corpus", scored(audit_corpus, given.seed, given.each, given.sound)),
        ("second corpus", scored(audit_corpus_other, given.seed, given.each, given.sound)),
        ("recordings", scored(audit_recordings, given.seed, given.each // 2, given.sound // 2)),
        ("out of order", scored(audit_together, given.seed, given.each // 2, given.sound // 4)),
    ]
    beside = peers(given.peers, given.seed, 2, 2) if given.peers else {}
    logs = sum(sum(s.planted.values()) + sum(s.sound.values()) for _, s in scores)
    today = datetime.now(UTC).date().isoformat()
    words = f"{today}, version {__version__}, seed {given.seed}, {logs} streams and faults."
    text = page(scores, beside, words)
    print(text)
    for _, score in scores:
        print("\n".join(score.misses))
    if given.write:
        whole = given.write.read_text("utf-8")
        head, tail = whole.split(BEGIN)[0], whole.split(END)[1]
        given.write.write_text(f"{head}{BEGIN}\n{text}\n{END}{tail}", "utf-8")


if __name__ == "__main__":
    main()
