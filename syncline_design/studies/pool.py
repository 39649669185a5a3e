"""Cases on local worker processes; one that dies is replaced and its cases are done again.

Results do not depend on which process computes a case, so a retry gives the same numbers.  Each
worker holds a few cases in hand so that it never waits for the parent.  Workers end with
the parent, whatever ends it, and do not look for programs in the working folder.

Not `concurrent.futures`: when one of its workers dies, every case not yet done fails with it and
nothing says which case was to blame, and its workers outlive a parent that is killed.
"""

from __future__ import annotations

import contextlib
import signal
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import field
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from typing import Any

from syncline_design.machine.deadline import in_force
from syncline_design.machine.processes import (
    end_with_parent,
    ended_by_signals,
    interrupts_held_back,
    starting_safely,
)
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.studies.case import CaseSettings, check_case
from syncline_design.studies.inputs import canonical
from syncline_design.studies.loading import Study
from syncline_design.studies.record import lost

IN_HAND = 4
MAX_DEATHS = 3  # of workers on one and the same case, or before they start at all

Result = tuple[int, str]  # case index, its record as canonical JSON


class PoolError(Exception):
    """Worker processes cannot be started or kept."""


@dataclass
class _Worker:
    process: BaseProcess
    connection: Connection
    cases: deque[int] = field(default_factory=deque)  # in hand, the first one being worked on
    started: bool = False


def encoded_case(study: Study, index: int, settings: CaseSettings) -> str:
    """The record of one case as canonical JSON."""
    return canonical(check_case(study, index, settings).to_json())


def _work(connection: Connection) -> None:
    """Body of a worker: the study in, then indices in and records out, until the line closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent answers Ctrl-C
    end_with_parent()
    with contextlib.suppress(EOFError, BrokenPipeError, ConnectionResetError):
        connection.send(None)  # up and running
        study, settings = connection.recv()
        while True:
            index = connection.recv()
            connection.send((index, encoded_case(study, index, settings)))


class WorkerPool:
    """A fixed number of workers over one study."""

    def __init__(self, study: Study, settings: CaseSettings, workers: int) -> None:
        self._study, self._settings, self._count = study, settings, workers
        self._context = get_context("spawn")
        self._workers: list[_Worker] = []
        self._deaths: dict[int, int] = {}
        self._false_starts = 0
        self.retried = 0

    def run(self, indices: Iterable[int]) -> Iterator[Result]:
        """Records as they come in, in no particular order."""
        queue = deque(indices)
        with ended_by_signals():
            try:
                while len(self._workers) < min(self._count, len(queue)):
                    self._workers.append(self._start())
                while queue or any(worker.cases for worker in self._workers):
                    yield from self._collect(queue)
                    self._hand_out(queue)
            finally:
                self._end()

    def _start(self) -> _Worker:
        ours, theirs = self._context.Pipe()
        # The study goes over the connection later: as an argument, a process that dies while it
        # starts would leave the parent writing to nobody for ever.
        process = self._context.Process(target=_work, args=(theirs,), daemon=True)
        try:
            with starting_safely(), interrupts_held_back():  # also while it imports what it needs
                process.start()
        except OSError as error:
            reason = error.strerror or error
            raise PoolError(f"cannot start a worker process: {reason}") from None
        theirs.close()
        return _Worker(process, ours)

    def _hand_out(self, queue: deque[int]) -> None:
        # One each in turn, so that the last cases are spread over all workers.
        for depth in range(1, IN_HAND + 1):
            for worker in self._workers:
                if queue and worker.started and len(worker.cases) < depth:
                    worker.cases.append(queue.popleft())
                    self._send(worker, worker.cases[-1])

    def _send(self, worker: _Worker, message: Any) -> None:
        with contextlib.suppress(OSError):  # its end is noticed when its connection is read
            worker.connection.send(message)

    def _collect(self, queue: deque[int]) -> Iterator[Result]:
        deadline = in_force()
        ready = wait([worker.connection for worker in self._workers], deadline.left_s())
        deadline.check()
        for place, worker in enumerate(self._workers):
            if worker.connection not in ready:
                continue
            try:
                message: Any = worker.connection.recv()
            except (EOFError, OSError):
                yield from self._replace(place, queue)
                continue
            if message is None:
                worker.started = True
                self._send(worker, (self._study, self._settings))
            else:
                worker.cases.remove(message[0])
                yield message

    def _replace(self, place: int, queue: deque[int]) -> Iterator[Result]:
        """A new worker for one that died; a case that kills every worker gets no verdict."""
        worker = self._workers[place]
        worker.connection.close()
        worker.process.join()
        if not worker.started:
            self._false_starts += 1
            if self._false_starts >= MAX_DEATHS * self._count:
                raise PoolError(
                    "worker processes end before they begin; the messages above say why (a script "
                    "that calls run_study does so under `if __name__ == '__main__':`)"
                )
        elif worker.cases:
            guilty = worker.cases[0]
            self._deaths[guilty] = self._deaths.get(guilty, 0) + 1
            if self._deaths[guilty] >= MAX_DEATHS:
                worker.cases.popleft()
                reason = f"its worker process died {MAX_DEATHS} times"
                yield guilty, canonical(lost(reason).to_json())
        self.retried += len(worker.cases)
        queue.extendleft(reversed(worker.cases))
        self._workers[place] = self._start()

    def _end(self) -> None:
        for worker in self._workers:
            with contextlib.suppress(OSError):
                worker.connection.close()
        for worker in self._workers:
            worker.process.join(timeout=0.2)
            if worker.process.is_alive():
                worker.process.terminate()
                worker.process.join()
        self._workers.clear()
