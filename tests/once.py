"""What is costly to make and asked for by tests in several processes: made once a run of them."""

from __future__ import annotations

import fcntl
import functools
import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

SHARED = "SYNCLINE_TESTS_SHARED"  # the folder of this run, set by conftest.py
T = TypeVar("T")


def once(make: Callable[[], T]) -> Callable[[], T]:
    """As functools.cache, across the processes of one run: the first to ask makes it.

    The others wait for it and read back what it wrote; what fails is tried by each.
    """

    @functools.cache
    def made() -> T:
        path = Path(os.environ[SHARED]) / f"{make.__module__}.{make.__qualname__}"
        with path.open("a+b") as file:
            fcntl.flock(file, fcntl.LOCK_EX)  # let go when the file is closed
            file.seek(0)
            kept = file.read()
            if kept:
                return pickle.loads(kept)
            found = make()
            file.write(pickle.dumps(found))
            return found

    return functools.update_wrapper(made, make)
