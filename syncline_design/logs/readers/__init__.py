"""Logs of every kind as recordings: one file a format; presence in this folder is registration.

A module of a format holds one `READER`.  Which reader opens a file is told by its content alone.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules

from syncline_design.logs.readers.reader import FileHead, Reader, head_of
from syncline_design.logs.readers.stream import Recording
from syncline_design.logs.refusals import refuse

WIDE = (b"\xff\xfe", b"\xfe\xff")  # byte order marks of UTF-16, which spreadsheets write
NOT_READERS = frozenset({"reader", "stream"})


@cache
def registry() -> dict[str, Reader]:
    """Every reader by its module's name, sorted."""
    found = {}
    for name in sorted(m.name for m in iter_modules(__path__)):
        module = import_module(f"{__name__}.{name}") if name not in NOT_READERS else None
        if hasattr(module, "READER"):  # others are parts of a reader
            found[name] = module.READER  # type: ignore[union-attr]
    return found


def reader_of(head: FileHead) -> Reader | None:
    """The reader that is surest of a file; None where no reader knows it."""
    sure = {reader: reader.recognises(head) for reader in registry().values()}
    best = max(sure, key=lambda reader: sure[reader], default=None)
    return best if best is not None and sure[best] > 0 else None


def open_recording(path: Path) -> Recording:
    """Open a log, or a folder that is one; raises BadInput."""
    head = head_of(path)
    reader = reader_of(head)
    if reader is None:
        raise refuse(
            path,
            "no log that can be read",
            expected="one of: " + ", ".join(sorted(r.format for r in registry().values())),
            found="a folder" if head.folder else repr(head.start[:16]),
            hint=_hint(head),
        )
    return reader.open(path)


def _hint(head: FileHead) -> str:
    if head.start.startswith(WIDE):
        return "the text is UTF-16: write it as UTF-8 (iconv -f UTF-16 -t UTF-8)"
    return "is it compressed, or of another kind?"
