"""Files as sources of columns: delimited text and Parquet, each by its literal path."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from syncline_design.logs.parquet_source import ParquetSource
from syncline_design.logs.refusals import refuse
from syncline_design.logs.row_source import RowSource
from syncline_design.logs.text_source import TextSource

if TYPE_CHECKING:
    pass

MOST_BYTES = 4 * 1024**3
PACKED = {b"\x1f\x8b": "gzip", b"\x28\xb5\x2f\xfd": "zstd", b"PK\x03\x04": "zip", b"BZh": "bzip2"}


def opened(path: Path) -> RowSource:
    """The file as a source; refuses what is no log."""
    demand_plain_file(path)
    if path.suffix.lower() in (".parquet", ".pq"):
        return ParquetSource(path)
    return TextSource(path)


def demand_plain_file(path: Path) -> None:
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
