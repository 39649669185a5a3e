"""One time limit for a whole command, and what it is doing when that runs long.

The limit is set once, by `within`, and every search, simulation and what-if asks the one in force,
however deep it is called: none can forget to hand it on.  Steps that cannot ask (a file that does
not come, a library at work) are ended by `overdue` a second later, as Ctrl-C would end them.
"""

from __future__ import annotations

import _thread
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from types import FrameType
from typing import NoReturn, TypeVar


class NoVerdict(Exception):  # noqa: N818 - an outcome with its own exit code, not a failure
    """No proven answer: a time limit, a missing solver, or roads that disagree."""


class OutOfTime(NoVerdict):
    """The time limit was reached; what is known by then still counts."""


Tick = Callable[[str, float], None]  # what is being done, for how long the command runs [s]


class Deadline:
    """A point in time after which everything gives up.

    tick: called at every check with what is being done, for a sign of progress.  doing: what that
    is at first.
    """

    def __init__(
        self, limit_s: float | None = None, tick: Tick | None = None, doing: str = ""
    ) -> None:
        self.limit_s = limit_s
        self._start = time.monotonic()
        self._end = math.inf if limit_s is None else self._start + limit_s
        self.tick = tick
        self._doing = doing

    def keep_back(self, seconds: float) -> None:
        """End earlier, by no more than a quarter of the limit, for what follows the search."""
        if self.limit_s is not None:
            self._end -= min(seconds, 0.25 * self.limit_s)

    def doing(self, what: str) -> None:
        """Say what comes next: `choosing`, `pricing accuracy`."""
        self._doing = what
        self.check()

    def check(self) -> None:
        """Raise OutOfTime once the time is over."""
        now = time.monotonic()
        if now > self._end:
            limit = f"{self.limit_s:g} s"
            raise OutOfTime(f"the time limit of {limit} was reached without a proof")
        if self.tick is not None:
            self.tick(self._doing, now - self._start)

    def passed(self) -> str:
        """That the time is over, and what was being done: a sentence without its stop."""
        during = f" while {self._doing}" if self._doing else ""
        return f"the time limit of {self.limit_s:g} s was reached{during}"

    def inner(self, limit_s: float | None) -> Deadline:
        """A deadline that begins now and ends no later than this one."""
        own = Deadline(limit_s, self.tick, self._doing)
        return self if self._end <= own._end else own

    def left_s(self) -> float | None:
        """Seconds left, None without a limit."""
        return None if self.limit_s is None else max(0.0, self._end - time.monotonic())

    @property
    def is_over(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() > self._end


_IN_FORCE: ContextVar[Deadline | None] = ContextVar("deadline", default=None)


def in_force() -> Deadline:
    """The deadline of the command; one without an end where there is none."""
    return _IN_FORCE.get() or Deadline()


@contextmanager
def within(deadline: Deadline) -> Iterator[Deadline]:
    """Put a deadline in force for everything that is called inside."""
    token = _IN_FORCE.set(deadline)
    try:
        yield deadline
    finally:
        _IN_FORCE.reset(token)


def within_s(limit_s: float | None) -> AbstractContextManager[Deadline]:
    """Put a time limit in force inside the one that is; None: that one alone."""
    return within(in_force().inner(limit_s))


_COMMAND: ContextVar[Deadline | None] = ContextVar("deadline of the command", default=None)


@contextmanager
def a_command() -> Iterator[None]:
    """One command from its start to its end; the limit that it sets ends with it."""
    token = _COMMAND.set(None)
    try:
        yield
    finally:
        _COMMAND.reset(token)


def limit_command(deadline: Deadline) -> Deadline:
    """Set the limit of the whole command, which counts where its work is done too."""
    _COMMAND.set(deadline)
    return deadline


def of_command() -> Deadline:
    """The limit of the whole command; one without an end where there is none."""
    return _COMMAND.get() or Deadline()


OVERDUE_S = 0.8  # how long work may go on without asking, after the time is over
AGAIN_S = 5.0  # until it is ended once more: tidying up takes less


@contextmanager
def overdue(deadline: Deadline) -> Iterator[None]:
    """End the block with OutOfTime where it goes on long after the end, whatever it is at.

    As with Ctrl-C it is the main thread that hears of it; elsewhere, and on systems without
    alarms, only asking helps.  Where the time is over from the start, the block still gets as long.
    """
    left = deadline.left_s()
    main = threading.current_thread() is threading.main_thread()
    if left is None or not main or not hasattr(signal, "setitimer"):
        yield
        return

    def end(_: int, __: FrameType | None) -> NoReturn:
        raise OutOfTime(deadline.passed())

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, left + OVERDUE_S, AGAIN_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


ONCE_MORE_S = 0.01  # after which a lost interrupt comes again


@contextmanager
def heard_again() -> Iterator[None]:
    """Send an interrupt again that strikes in a callback, from which no exception gets out.

    What Python runs while it collects garbage (finalizers, callbacks of weak references, closing
    generators) prints its exceptions and goes on: Ctrl-C and the alarm would be lost there, and a
    collection takes long enough to be struck.
    """
    before = sys.unraisablehook

    def again(lost: sys.UnraisableHookArgs) -> None:
        kind = lost.exc_type
        if kind is not None and issubclass(kind, KeyboardInterrupt):
            _interrupt_later()
        elif kind is not None and issubclass(kind, OutOfTime):
            _alarm_later()
        else:
            before(lost)

    sys.unraisablehook = again
    try:
        yield
    finally:
        sys.unraisablehook = before


def _alarm_later() -> None:
    """The alarm of `overdue` once more; nothing where none is set."""
    main = threading.current_thread() is threading.main_thread()
    if main and hasattr(signal, "setitimer") and any(signal.getitimer(signal.ITIMER_REAL)):
        signal.setitimer(signal.ITIMER_REAL, ONCE_MORE_S, AGAIN_S)


def _interrupt_later() -> None:
    """Ctrl-C once more, by a real signal: it has to wake what sleeps."""

    in_the_hook = threading.Lock()
    in_the_hook.acquire()

    def strike() -> None:
        in_the_hook.acquire()
        time.sleep(ONCE_MORE_S)
        if hasattr(signal, "pthread_kill"):
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        else:
            _thread.interrupt_main()

    _thread.start_new_thread(strike, ())
    in_the_hook.release()


T = TypeVar("T")
GRACE_S = 0.1  # what small work may take after the time is over


def unhurried(items: Iterable[T]) -> Iterator[T]:
    """The items; OutOfTime between two of them when the time is over and they take long.

    Small tables are always made, so that a pinned spec is judged however little time there was.
    """
    start = time.monotonic()
    for item in items:
        yield item
        if time.monotonic() - start > GRACE_S:
            in_force().check()


class Pieces:
    """What belongs to an answer besides its heart; a time limit leaves the later pieces out.

    cut_short: names of the pieces that are missing or not complete for that reason; gave_up: of
    those that lack designs because simulation was refused them, as `refusals` counts.
    """

    def __init__(self, refusals: Callable[[], int] = lambda: 0) -> None:
        self.cut_short: list[str] = []
        self.gave_up: list[str] = []
        self._refusals = refusals

    def _count(self, name: str, before: int) -> None:
        if self._refusals() > before:
            self.gave_up.append(name)

    def made(self, name: str, make: Callable[[], T], without: T) -> T:
        """A piece, or what stands for it when the time is over."""
        before = self._refusals()
        try:
            in_force().doing(name)
            return make()
        except OutOfTime:
            self.cut_short.append(name)
            return without
        finally:
            self._count(name, before)

    def listed(self, name: str, make: Callable[[], Iterable[T]]) -> list[T]:
        """A piece as a list, as far as the time goes."""
        found: list[T] = []
        before = self._refusals()
        try:
            in_force().doing(name)
            found.extend(make())
        except OutOfTime:
            self.cut_short.append(name)
        finally:
            self._count(name, before)
        return found

    @property
    def cautions(self) -> list[tuple[str, str]]:
        """What to warn of where something is missing: code and message."""
        out = []
        if self.cut_short:
            message = "the time limit ended this before it was complete: "
            out.append(("time-limit", message + ", ".join(self.cut_short)))
        if self.gave_up:
            message = "designs may be missing here, as the search for more gave up: "
            out.append(("search-gave-up", message + ", ".join(self.gave_up)))
        return out
