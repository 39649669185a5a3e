"""The same cases on a Dask cluster: the scheduler retries what a lost worker had in hand."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from typing import Any

from syncline_design.machine.processes import (
    ended_by_signals,
    interrupts_held_back,
    starting_safely,
)
from syncline_design.studies.case import CaseSettings
from syncline_design.studies.inputs import canonical
from syncline_design.studies.loading import Study
from syncline_design.studies.pool import Result, encoded_case
from syncline_design.studies.record import lost

IN_HAND = 8  # cases given to the scheduler per thread of the cluster
RETRIES = 5
TIMEOUT = "15s"
_TALKATIVE = (  # asyncio tells of tasks whose failure nobody waited for any more
    "distributed", "distributed.scheduler", "distributed.nanny", "tornado", "asyncio",
)  # fmt: skip


class ClusterError(Exception):
    """No cluster to run on: Dask is missing, or no scheduler answers."""


def run_on_cluster(
    study: Study, settings: CaseSettings, indices: Iterable[int], *, address: str | None,
    workers: int,
) -> Iterator[Result]:  # fmt: skip
    """Records as they come in; without an address on a cluster of local processes."""
    try:
        dask: Any = import_module("distributed")
    except ImportError:
        raise ClusterError(
            "Dask is not installed; install syncline-design[cluster], or leave out --scheduler "
            "and --dask to use local processes"
        ) from None

    with ExitStack() as stack, ended_by_signals(), _quiet_when_stopped():
        target: Any = address
        if address is None:
            with (
                starting_safely(),
                interrupts_held_back(),
            ):  # the threads and processes that it starts get none
                target = stack.enter_context(
                    # its workers' own logs are silent: when the scheduler ends first, as it does
                    # on Ctrl-C, a worker tells of its missed heartbeat with a traceback
                    dask.LocalCluster(
                        n_workers=workers,
                        threads_per_worker=1,
                        dashboard_address=None,
                        silence_logs=logging.CRITICAL,
                    )
                )
        try:
            client = stack.enter_context(dask.Client(target, timeout=TIMEOUT))
        except (OSError, TimeoutError, ValueError) as error:
            raise ClusterError(f"no Dask scheduler answers at {address}: {error}") from None
        yield from run_with_client(client, study, settings, indices)


@contextmanager
def _quiet_when_stopped() -> Iterator[None]:
    """Spare the user what the parts of a cluster log about each other when it is stopped."""
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        for name in _TALKATIVE:
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
        raise


def run_with_client(
    client: Any, study: Study, settings: CaseSettings, indices: Iterable[int]
) -> Iterator[Result]:
    """The cases on the cluster of a client, a bounded number of them at a time."""
    dask: Any = import_module("distributed")
    shared = client.scatter(study, broadcast=True)
    left = iter(indices)

    def submit(index: int) -> Any:
        future = client.submit(encoded_case, shared, index, settings, pure=False, retries=RETRIES)
        future.case_index = index
        return future

    window = IN_HAND * max(1, sum(client.nthreads().values()))
    first = [submit(index) for _, index in zip(range(window), left, strict=False)]
    running = dask.as_completed(first)
    for future in running:
        yield future.case_index, _record(future)
        following = next(left, None)
        if following is not None:
            running.add(submit(following))


def _record(future: Any) -> str:
    error = future.exception() if future.status == "error" else None
    if error is None:
        return str(future.result())
    return canonical(lost(f"lost on the cluster: {error}").to_json())
