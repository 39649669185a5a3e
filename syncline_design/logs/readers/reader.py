"""How a reader is found: by the first bytes of a file, and with its libraries at hand."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from syncline_design.logs.readers.stream import Recording
from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass

HEAD_BYTES = 1 << 16
EXTRA = "logs"

# how sure a reader is of a file
NO, BY_SHAPE, BY_MAGIC = 0, 1, 3  # 2 is for text with a header of its own


@dataclass(frozen=True, slots=True)
class FileHead:
    """What is seen of a file before any reader: its first bytes, or the names in a folder."""

    path: Path
    start: bytes
    size: int
    folder: bool = False
    names: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Reader:
    """A format: its name for people, how sure it is that a file is of it, and how it is opened."""

    format: str
    recognises: Callable[[FileHead], int]
    open: Callable[[Path], Recording]


def head_of(path: Path) -> FileHead:
    """The beginning of a file; refuses what cannot be read at all."""
    try:
        if path.is_dir():
            names = tuple(sorted(one.name for one in path.iterdir()))
            return FileHead(path, b"", 0, True, names)
        if not path.is_file():
            what = "no regular file" if path.exists() else "nothing"
            raise refuse(
                path, "cannot read the log", expected="a file or a bag's folder", found=what
            )
        with path.open("rb") as file:
            start = file.read(HEAD_BYTES)
        size = path.stat().st_size
    except OSError as error:
        raise refuse(path, f"cannot read the log: {error.strerror}") from None
    if not start:
        raise refuse(path, "the log is empty", line=1, column=1)
    return FileHead(path, start, size)


def library(name: str, path: Path, format: str) -> Any:  # noqa: A002
    """A module of an optional library; one clear line where it is not installed."""
    try:
        return import_module(name)
    except ImportError:
        own = name.partition(".")[0].replace("_", "-")
        raise refuse(
            path,
            f"reading a {format} needs the library {own}",
            hint=f"python -m pip install {own} (all formats: the extra `{EXTRA}`)",
        ) from None
