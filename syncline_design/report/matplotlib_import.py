"""matplotlib, imported without a look at the working folder.

As it is imported, matplotlib reads `matplotlibrc` from the working folder before any other, and
keeps its font list where MPLCONFIGDIR says.  In a repository under check these are somebody's data.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import sys
import threading
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

_LOCK = threading.Lock()


def load_matplotlib() -> None:
    """Import matplotlib with its own settings, unless that has been done."""
    with _LOCK:
        if "matplotlib.figure" in sys.modules:
            return
        found = find_spec("matplotlib")
        if found is None or found.origin is None:
            raise ModuleNotFoundError("matplotlib is not installed")
        _drop_settings_of_the_working_folder()
        with _working_in(Path(found.origin).parent / "mpl-data"):
            for name in ("matplotlib", "matplotlib.font_manager", "matplotlib.figure"):
                importlib.import_module(name)


def _drop_settings_of_the_working_folder() -> None:
    given = os.environ.get("MPLCONFIGDIR")
    with contextlib.suppress(OSError):
        if given and Path(given).resolve().is_relative_to(Path.cwd()):
            del os.environ["MPLCONFIGDIR"]


@contextlib.contextmanager
def _working_in(folder: Path) -> Iterator[None]:
    """The working folder changed for a moment, and back, even where it has no path any more."""
    before = os.open(".", os.O_RDONLY)
    try:
        os.chdir(folder)
        yield
    finally:
        os.fchdir(before)
        os.close(before)
