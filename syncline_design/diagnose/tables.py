"""Files to columns of floats in SI; nothing here knows what the columns mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from syncline_design.diagnose.columns import TIME, known_names, si_columns
from syncline_design.effects.base import Array
from syncline_design.loading import BadInput
from syncline_design.yaml_reader import Problem

if TYPE_CHECKING:
    import polars as pl

MOST_BYTES = 4 * 1024**3
MOST_ROWS = 20_000_000
_NO_NOTES: tuple[str, ...] = ()
PACKED = {b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd", b"PK\x03\x04": "zip", b"BZh": "bzip2"}


@dataclass(frozen=True, slots=True)
class Table:
    """One file: SI name -> values (n,), with NaN where a value is missing."""

    path: Path
    columns: Mapping[str, Array]
    header: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return int(self.columns[TIME].shape[0])


def refuse(
    path: Path,
    message: str,
    *,
    line: int = 0,
    column: int = 0,
    field: str = "",
    expected: str = "",
    found: str = "",
    hint: str = "",
) -> BadInput:
    """The error for a log that cannot be read."""
    problem = Problem(str(path), line, column, field, message, expected, found, hint)
    return BadInput((problem,))


def read_table(path: Path, mapping: Mapping[str, str], stages: tuple[str, ...]) -> Table:
    """Read one CSV or Parquet file; raises BadInput."""
    _demand_plain_file(path)
    if path.suffix.lower() in (".parquet", ".pq"):
        frame, notes = _read_parquet(path), _NO_NOTES
    else:
        frame, notes = _read_csv(path)
    found = si_columns(frame.columns, mapping, known_names(stages))
    if TIME not in found:
        raise refuse(
            path,
            "no time column",
            line=1,
            column=1,
            field=TIME,
            expected="a column time_s (or time_ms, time_us, time_ns)",
            found=", ".join(frame.columns[:12]) or "no columns",
            hint="name it there, or map it in the spec: log: {columns: {time_s: theirs}}",
        )
    if frame.height == 0:
        raise refuse(path, "no rows below the header", line=2, column=1)
    columns = {
        si: _floats(path, frame, name) * factor for si, (name, factor) in sorted(found.items())
    }
    return Table(path, columns, tuple(frame.columns), notes)


def _demand_plain_file(path: Path) -> None:
    try:
        if not path.is_file():
            what = "a folder" if path.is_dir() else "no regular file"
            raise refuse(path, "cannot read the log", expected="a CSV or Parquet file", found=what)
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(4)
    except OSError as error:
        raise refuse(path, f"cannot read the log: {error.strerror}") from None
    for magic, name in PACKED.items():
        if head.startswith(magic):
            raise refuse(path, "the log is compressed", found=name, hint="unpack it first")
    if size > MOST_BYTES:
        raise refuse(path, "the log is too large", expected="at most 4 GiB", found=f"{size} bytes")
    if size == 0:
        raise refuse(path, "the log is empty", line=1, column=1, expected="a header and rows")


def _read_parquet(path: Path) -> pl.DataFrame:
    import polars as pl

    try:
        rows = int(pl.scan_parquet(path).select(pl.len()).collect().item())
        if rows > MOST_ROWS:
            raise refuse(path, "too many rows", expected=f"at most {MOST_ROWS}", found=str(rows))
        return pl.read_parquet(path)
    except BadInput:
        raise
    except Exception as error:  # polars raises many kinds, all of them the file's fault
        raise refuse(path, "no readable Parquet file", found=_first_line(error)) from None


def _read_csv(path: Path) -> tuple[pl.DataFrame, tuple[str, ...]]:
    import polars as pl

    header = _header(path)
    schema: dict[str, Any] = dict.fromkeys(header, pl.Float64)
    try:
        frame = pl.read_csv(path, schema_overrides=schema, null_values=["", "nan", "NaN", "NA"])
    except Exception:  # a torn end or text among numbers: read as text and look closer
        frame = _read_as_text(path)
    return _without_torn_end(path, frame)


def _header(path: Path) -> list[str]:
    with path.open("rb") as file:
        raw = file.readline(1 << 20)
    try:
        line = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise refuse(
            path, "not UTF-8", line=1, column=error.start + 1, hint="save the file as UTF-8"
        ) from None
    if "\x00" in line:
        raise refuse(path, "not a text file", line=1, column=line.index("\x00") + 1, found="NUL")
    names = [name.strip().strip('"') for name in line.rstrip("\r\n").split(",")]
    for k, name in enumerate(names):
        if name in names[:k]:
            raise refuse(path, "a column is there twice", line=1, column=k + 1, field=name)
    return names


def _read_as_text(path: Path) -> pl.DataFrame:
    import polars as pl

    try:
        return pl.read_csv(
            path, infer_schema=False, truncate_ragged_lines=True, null_values=["", "nan", "NaN"]
        )
    except Exception as error:
        raise refuse(path, "no readable CSV file", found=_first_line(error)) from None


def _without_torn_end(path: Path, frame: pl.DataFrame) -> tuple[pl.DataFrame, tuple[str, ...]]:
    """A file cut off in its last row: the rows before it are good, and the result says so."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 1))
        ends_well = file.read(1) in (b"\n", b"\r")
    if ends_well or frame.height == 0 or not any(v is None for v in frame.row(-1)):
        return frame, ()
    note = f"{path.name} is cut off in line {frame.height + 1}; the rows before it are used"
    return frame.head(frame.height - 1), (note,)


def _floats(path: Path, frame: pl.DataFrame, name: str) -> Array:
    import polars as pl

    series = frame.get_column(name)
    if series.dtype in (pl.String, pl.Categorical):
        text = series.str.strip_chars()
        number = text.cast(pl.Float64, strict=False)
        bad = (number.is_null() & text.is_not_null()).arg_true()
        if len(bad):
            raise _text_in_numbers(path, frame, name, int(bad[0]), str(text[int(bad[0])]))
        series = number
    elif not series.dtype.is_numeric():
        raise refuse(path, "not a column of numbers", field=name, found=str(series.dtype))
    values: Array = series.cast(pl.Float64).to_numpy().astype(float)
    values[~np.isfinite(values)] = np.nan
    return values


def _text_in_numbers(path: Path, frame: pl.DataFrame, name: str, row: int, text: str) -> BadInput:
    return refuse(
        path,
        "text among numbers",
        line=row + 2,
        column=frame.columns.index(name) + 1,
        field=name,
        expected="a number with a decimal point, or nothing",
        found=repr(text[:40]),
    )


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:160]
