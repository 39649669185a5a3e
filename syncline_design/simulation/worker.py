"""Long runs on several processes: the parent hands out shares, each child counts its own.

A child runs `main` of this module by the same interpreter, which does not look for programs in the
working folder; it reads one pickled Share from standard input and writes its counts to standard
output.  The parent holds the child's input open: a child whose parent is gone ends.  Counts are
whole numbers and add up to the same sums whatever the number of children.
"""

from __future__ import annotations

import contextlib
import io
import pickle
import subprocess
import sys
import threading
from contextlib import ExitStack
from typing import IO

import numpy as np

from syncline_design.effects.record import Array
from syncline_design.machine.deadline import in_force
from syncline_design.machine.processes import end_with_stream, ended_by_signals, python_command
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.system import System
from syncline_design.simulation.distribution import Counts, add_counts, no_counts
from syncline_design.simulation.kernel import norm
from syncline_design.simulation.sampling import (
    JOB,
    job_errors,
    keep_freed_memory,
    run_jobs,
    workers,
)
from syncline_design.simulation.settings import SimulationSettings

WORTH_PROCESSES = 3_000_000  # samples from which starting processes pays


@dataclass(frozen=True, slots=True)
class Share:
    """Every `parts`-th job, beginning with number `part`, of the samples first .. last - 1."""

    system: System
    settings: SimulationSettings
    first: int
    last: int
    limit_m: float
    part: int
    parts: int


def tally(
    system: System, settings: SimulationSettings, first: int, last: int, limit_m: float
) -> tuple[Counts, int]:
    """(counts of |error| by bins, how many are at most limit_m) of the samples first .. last - 1.

    `first` must begin a job.
    """
    parts = workers(settings)
    if parts > 1 and last - first >= WORTH_PROCESSES:
        return _tally_on_processes(
            [Share(system, settings, first, last, limit_m, part, parts) for part in range(parts)]
        )
    counts, within = no_counts(), [0]
    lock = threading.Lock()

    def count(_: int, errors: Array) -> None:
        lengths = norm(errors)
        with lock:
            add_counts(counts, lengths)
            within[0] += int(np.count_nonzero(lengths <= limit_m))

    run_jobs(system, settings, first, last, count)
    return counts, within[0]


def _tally_on_processes(shares: list[Share]) -> tuple[Counts, int]:
    children: list[subprocess.Popen[bytes]] = []
    with ExitStack() as lifelines, ended_by_signals():
        try:
            children.extend(_started(share, lifelines) for share in shares)
            answers = [_answer(child) for child in children]
        finally:
            for child in children:
                child.kill()
                child.wait()
    for child, (_, complaint) in zip(children, answers, strict=True):
        if child.returncode != 0:
            raise RuntimeError(f"a simulation process failed: {complaint.decode(errors='replace')}")
    counts, within = no_counts(), 0
    for answer, _ in answers:
        numbers = np.frombuffer(answer, dtype=np.int64)
        counts += numbers[1:]
        within += int(numbers[0])
    return counts, within


def _answer(child: subprocess.Popen[bytes]) -> tuple[bytes, bytes]:
    """What a child says; OutOfTime when that takes too long."""
    deadline = in_force()
    while True:
        try:
            return child.communicate(timeout=deadline.left_s())
        except subprocess.TimeoutExpired:
            deadline.check()


def _started(share: Share, lifelines: ExitStack) -> subprocess.Popen[bytes]:
    """A child at work on its share; its input stays open until the stack is unwound."""
    pipe = subprocess.PIPE
    command = python_command(f"from {__name__} import main; main()")
    child = subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe)
    assert child.stdin is not None
    lifeline, child.stdin = child.stdin, None  # or `communicate` would close it
    lifelines.callback(_closed, lifeline)
    content = pickle.dumps(share)
    with contextlib.suppress(BrokenPipeError):  # its complaint is read with its answer
        lifeline.write(len(content).to_bytes(8, "little") + content)
        lifeline.flush()
    return child


def _closed(stream: IO[bytes]) -> None:
    with contextlib.suppress(OSError):
        stream.close()


def count_share(share: Share) -> tuple[Counts, int]:
    """(counts, within) of one share, in this process and thread."""
    keep_freed_memory()
    counts, within = no_counts(), 0
    jobs = range(share.first // JOB, -(-share.last // JOB))
    for job in jobs[share.part :: share.parts]:
        count = min(JOB, share.last - job * JOB)
        lengths = norm(job_errors(share.system, share.settings, job, count))
        add_counts(counts, lengths)
        within += int(np.count_nonzero(lengths <= share.limit_m))
    return counts, within


def _exactly(source: io.RawIOBase, size: int) -> bytes:
    """`size` bytes of an unbuffered stream (what is buffered would hold a lock at exit)."""
    parts: list[bytes] = []
    while size > 0:
        part = source.read(min(size, 2**20))
        if not part:
            raise EOFError("the parent is gone")
        parts.append(part)
        size -= len(part)
    return b"".join(parts)


def main() -> None:
    """Answer one share: the count within the limit, then the bins' counts, as int64."""
    source = io.FileIO(sys.stdin.fileno(), closefd=False)
    size = int.from_bytes(_exactly(source, 8), "little")
    share: Share = pickle.loads(_exactly(source, size))
    end_with_stream(sys.stdin.fileno())
    counts, within = count_share(share)
    sys.stdout.buffer.write(np.concatenate([[within], counts]).astype(np.int64).tobytes())
