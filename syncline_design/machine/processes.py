"""Helper processes: none imports from the working folder, none outlives the one that started it.

What lies in the working folder is data under check, never a program: Python puts the folder first
on the search path of `python -c` (and so of every process that multiprocessing starts) unless it
is told not to (`-P`, PYTHONSAFEPATH).
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

_PACKAGE_ROOT = Path(__file__).resolve().parents[2]
_ENDING = ("SIGTERM", "SIGHUP")


def trusted_path() -> list[str]:
    """`sys.path` without the working folder, unless that is where this package itself lies."""
    return [entry for entry in sys.path if _is_trusted(entry)]


def _is_trusted(entry: str) -> bool:
    try:
        folder = Path(entry).resolve()
        return folder != Path.cwd() or folder == _PACKAGE_ROOT
    except OSError:  # the working folder is gone
        return bool(entry)


def forget_working_folder() -> None:
    """Take the working folder off the search path of this process and of those it starts."""
    sys.path[:] = trusted_path()
    os.environ["PYTHONSAFEPATH"] = "1"
    given = os.environ.get("PYTHONPATH")
    if given is not None:
        kept = [e for e in given.split(os.pathsep) if e and _is_trusted(e)]
        os.environ["PYTHONPATH"] = os.pathsep.join(kept)


@contextlib.contextmanager
def starting_safely() -> Iterator[None]:
    """Processes that multiprocessing starts in the block do not search the working folder."""
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONSAFEPATH"]
        else:
            os.environ["PYTHONSAFEPATH"] = before


def python_command(code: str) -> list[str]:
    """The command that runs `code` in a new interpreter with this one's trusted search path."""
    return [sys.executable, "-P", "-c", f"import sys; sys.path[:] = {trusted_path()!r}; {code}"]


def _raise_exit(number: int, _: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)


@contextlib.contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP unwind the block, so that its `finally` ends what it started.

    By default they end this process alone.  Python delivers signals to the main thread only, and
    handlers of the caller's own stay as they are.
    """
    before: dict[signal.Signals, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for name in _ENDING:
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is signal.SIG_DFL:
                before[number] = signal.signal(number, _raise_exit)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextlib.contextmanager
def interrupts_held_back() -> Iterator[None]:
    """Ctrl-C and alarms wait until the block is done; what is started in it hears of neither."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    with starting_safely():  # when it starts by itself, it lets signals through again
        resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGALRM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_parent() -> None:
    """In a process of multiprocessing: end at once when the one that started it is gone."""
    from multiprocessing import parent_process
    from multiprocessing.connection import wait

    parent = parent_process()
    if parent is not None:
        sentinel = parent.sentinel
        _watch(lambda: wait([sentinel]))


def end_with_stream(descriptor: int) -> None:
    """End this process at once when the other end of a pipe is closed."""
    _watch(lambda: os.read(descriptor, 1))


def _watch(end: Any) -> None:
    def watch() -> None:
        with contextlib.suppress(OSError):
            end()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
