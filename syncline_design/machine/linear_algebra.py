"""One thread for the linear algebra library, so that digits do not depend on the machine's cores.

With several threads sums are split, and their last bits follow the number of threads.  numpy and
scipy from the Python package index each bring an OpenBLAS of their own, which can be told while it
runs; another library is told by the environment (`OMP_NUM_THREADS=1`) before Python starts.
"""

from __future__ import annotations

import ctypes
import importlib.util
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

_NAMES = tuple(
    (f"{prefix}openblas_get_num_threads{suffix}", f"{prefix}openblas_set_num_threads{suffix}")
    for prefix in ("scipy_", "")
    for suffix in ("64_", "")
)
Library = tuple[Callable[[], int], Callable[[int], None]]


@contextmanager
def one_thread() -> Iterator[None]:
    """Let the libraries of numpy and scipy work on one thread, and give them back theirs."""
    before = [(give, int(take())) for take, give in _libraries()]
    for give, _ in before:
        give(1)
    try:
        yield
    finally:
        for give, count in before:
            give(count)


@cache
def _libraries() -> tuple[Library, ...]:
    """How to read and set the threads of every OpenBLAS beside numpy and scipy."""
    found = []
    for package in ("numpy", "scipy"):
        spec = importlib.util.find_spec(package)
        if spec is None or spec.origin is None:
            continue
        home = Path(spec.origin).parent
        for folder in (home.parent / f"{package}.libs", home / ".dylibs"):
            for path in sorted(folder.glob("*openblas*")):
                found += _controls(path)
    return tuple(found)


def _controls(path: Path) -> list[Library]:
    try:
        library = ctypes.CDLL(str(path))
    except OSError:
        return []
    for take, give in _NAMES:
        if hasattr(library, take) and hasattr(library, give):
            getter, setter = getattr(library, take), getattr(library, give)
            getter.restype, setter.argtypes, setter.restype = ctypes.c_int, [ctypes.c_int], None
            return [(getter, setter)]
    return []
