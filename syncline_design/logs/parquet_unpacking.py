"""Columns of Parquet files, unpacked in a process of its own: damaged ones may end it.

polars 2.1.0 panics over damaged pages, with a trace on the error stream, and asks for any memory
that they claim; where there is none, it aborts.  All files share one process, which ends with the
last of them; columns come over as Arrow's stream format.
"""

from __future__ import annotations

import io
import json
import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final
from weakref import WeakValueDictionary

from syncline_design.machine.outside import Outside

if TYPE_CHECKING:
    import polars as pl

CRASH: Final = "the library that unpacks it crashes there"
ZONE_CHECK: Final = "POLARS_IGNORE_TIMEZONE_PARSE_ERROR"
_WORDS: Final = 160  # characters of what polars says
_at_work: WeakValueDictionary[int, Outside] = WeakValueDictionary()  # by the process it works for
_lock = threading.Lock()
_opened: dict[str, pl.LazyFrame] = {}  # in the process that unpacks


class UnreadableError(Exception):
    """What is wrong with a file."""


@contextmanager
def any_zone() -> Iterator[None]:
    """Lets polars open columns whose zone is an offset (`+05:30`, as Arrow writes it).

    Without it polars panics over any zone that is no name of the time zone database.
    """
    before = os.environ.get(ZONE_CHECK)
    os.environ[ZONE_CHECK] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[ZONE_CHECK]
        else:
            os.environ[ZONE_CHECK] = before


class UnpackedColumns:
    """The columns of one file; schema: their types, rows: how many; UnreadableError of damage."""

    def __init__(self, path: Path) -> None:
        self._path = str(path.absolute())
        self._outside = _unpacking()
        none, rows = self._asked(None)
        self.schema, self.rows = none.schema, int(rows)

    def column(self, name: str, start: int, rows: int | None) -> pl.Series:
        """Some rows of a column; rows: None for all from the first on."""
        return self._asked((name, start, rows))[0].to_series(0)

    def _asked(self, wanted: tuple[str, int, int | None] | None) -> tuple[pl.DataFrame, bytes]:
        import polars as pl

        request = json.dumps((self._path, wanted)).encode()
        with _lock:
            if self._outside.gone:  # another file brought it down
                self._outside = _unpacking()
            pieces = list(self._outside.pieces(request))
        if self._outside.gone:
            raise UnreadableError(CRASH)
        wrong, *found = pieces
        if wrong:
            raise UnreadableError(wrong.decode())
        with any_zone():
            return pl.read_ipc_stream(found[0]), found[1]


def _unpacking() -> Outside:
    """The process that unpacks, started where none is."""
    found = _at_work.get(os.getpid())
    if found is None or found.gone:
        _at_work[os.getpid()] = found = Outside(f"{__name__}:unpacked")
    return found


def unpacked(request: bytes) -> Iterator[bytes]:
    """What is wrong (or nothing), then some rows of a column and how many the file has.

    Without a column: a table without rows, which has the types of all.
    """
    import polars as pl

    path, wanted = json.loads(request)
    try:
        with any_zone():
            answer = _schema(path) if wanted is None else _rows(path, *wanted)
    except pl.exceptions.PanicException:  # its words are for those who write polars
        answer = [CRASH]
    except Exception as error:  # whatever it is, the file's fault
        answer = [(str(error).splitlines() or [""])[0][:_WORDS] or type(error).__name__]
    yield from (part.encode() if isinstance(part, str) else part for part in answer)


def _schema(path: str) -> list[str | bytes]:
    import polars as pl

    frame = _opened[path] = pl.scan_parquet(Path(path), glob=False, hive_partitioning=False)
    none = frame.collect_schema().to_frame(eager=True)
    return ["", _arrow(none), str(frame.select(pl.len()).collect().item())]


def _rows(path: str, name: str, start: int, rows: int | None) -> list[str | bytes]:
    if path not in _opened:  # another process had opened it
        _schema(path)
    return ["", _arrow(_opened[path].slice(start, rows).select(name).collect()), ""]


def _arrow(frame: pl.DataFrame) -> bytes:
    stream = io.BytesIO()
    frame.write_ipc_stream(stream)
    return stream.getvalue()
