"""What every test process shares: how it is set up, none of it visible to the tests themselves."""

from __future__ import annotations

import atexit
import contextlib
import functools
import gc
import importlib
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from once import SHARED

# Matrices are small and many: two threads of the linear algebra library cost more than they do, and
# the command sets the same.  Before numpy is imported; that threads change no digit is a test of
# its own (test_diagnose_checks), which starts its processes with a number of threads of its own.
for _library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{_library}_NUM_THREADS", "1")
os.environ["COLUMNS"] = "200"  # of the console, unless a test says another width
os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")

# Every command that a test starts in a process of its own would compile the package anew where
# Python is told to write no bytecode: it goes to a folder that the run removes again.
if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):
    _bytecode = tempfile.mkdtemp(prefix="bytecode-")
    os.environ["PYTHONPYCACHEPREFIX"] = _bytecode
    atexit.register(shutil.rmtree, _bytecode, ignore_errors=True)

# No test is timed: on a busy machine the making of examples is slow, and no fault.  All are seeded.
settings.register_profile(
    "any_machine",
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("any_machine")

# What the processes of a run make once for all of them (once.py): the first to start sets it.
if SHARED not in os.environ:
    os.environ[SHARED] = tempfile.mkdtemp(prefix="shared-")
    atexit.register(shutil.rmtree, os.environ[SHARED], ignore_errors=True)


@pytest.fixture(autouse=True, scope="session")
def one_parser() -> Iterator[None]:
    """The parser of the command line is made once, not for each command that a test invokes."""
    from typer import testing

    made = functools.cache(testing._get_command)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(testing, "_get_command", made)
        yield


@pytest.fixture(autouse=True, scope="module")
def one_search(request: pytest.FixtureRequest) -> Iterator[None]:
    """A diagnosis searches once in tests that do not look at the block that was kept from it."""
    text = Path(request.path).read_text("utf-8")
    with pytest.MonkeyPatch.context() as patch:
        if "diagnos" in text and "unseen" not in text:
            from syncline_design.diagnosis import unseen_block

            patch.setattr(unseen_block, "LEAST_ROWS", 10**9)
        yield


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    """A browser for the tests of a file; they are skipped where there is none."""
    from browsing import launched

    yield from launched()


@pytest.fixture
def figures_drawn_once() -> Iterator[object]:
    """Figures are drawn once a process, for tests of what is said beside them."""
    from drawn_once import kept

    yield from kept()


@pytest.hookimpl(tryfirst=True)
def pytest_collection(session: pytest.Session) -> None:
    """Workers that collect the whole suite begin at different files, and find the rest compiled.

    Each imports every file of tests; in one order they would all compile the same one at a time.
    """
    given: dict[str, str] = getattr(session.config, "workerinput", {})
    count, here = int(given.get("workercount", 1)), Path(__file__).parent
    if count == 1 or [Path(one).resolve() for one in session.config.args] != [here]:
        return
    files = sorted(here.glob("test_*.py"))
    first = len(files) * int(given["workerid"].removeprefix("gw")) // count
    sys.path.insert(0, str(here))  # as pytest does before it imports the first
    for file in (*files[first:], *files[:first]):
        with contextlib.suppress(Exception, pytest.skip.Exception):  # collecting it says why
            importlib.import_module(file.stem)


def pytest_collection_finish(session: pytest.Session) -> None:
    """Thousands of collected tests are no garbage: do not look through them again and again."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)
