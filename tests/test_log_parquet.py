"""Parquet of other types, zones and units."""

from __future__ import annotations

import base64
import os
import re
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from tests.table_logs import read
from tests.test_diagnose_log import columns, refusal, write


def test_parquet_of_other_types(tmp_path: Path) -> None:
    import polars as pl

    plain = read(write(tmp_path / "a.csv", columns()))
    frame = pl.DataFrame({k: np.round(v, 6) for k, v in columns().items()})
    text = frame.with_columns(pl.col("yaw_deg").cast(pl.String).cast(pl.Categorical))
    path = tmp_path / "log.parquet"
    for change in (
        text,
        frame.with_columns(pl.col("range_m").cast(pl.String)),
        frame.with_columns(pl.lit("tube").cast(pl.Categorical).alias("target_id")),
        frame.with_columns((pl.col("time_s") * 1e6).cast(pl.Duration("us"))),
        frame.with_columns(pl.col("range_m").cast(pl.Decimal(12, 6))),
    ):
        change.write_parquet(path)
        log = read(path)
        assert log.stages[0].range_m == pytest.approx(plain.stages[0].range_m, abs=1e-6)
        assert log.stages[0].euler_rad == pytest.approx(plain.stages[0].euler_rad, abs=1e-7)
    at = (pl.lit(datetime(2026, 3, 1)) + (pl.col("time_s") * 1e6).cast(pl.Duration("us"))).alias(
        "time"
    )
    frame.with_columns(at).drop("time_s").write_parquet(path)
    assert read(path).time_s == pytest.approx(plain.time_s, abs=1e-6)


def with_offset(path: Path, zone: str) -> None:
    """Puts an offset in the place of the zone `Israel` (as long) in the Arrow schema of a file.

    Arrow writes such files; polars writes none.
    """
    found = re.search(rb"ARROW:schema.{1,6}?([A-Za-z0-9+/]{40,}=*)", path.read_bytes(), re.DOTALL)
    assert found is not None
    coded = found[1][found[1].index(b"/////") :]
    schema = base64.b64decode(coded)
    assert b"Israel" in schema
    patched = base64.b64encode(schema.replace(b"Israel", zone.encode()))
    path.write_bytes(path.read_bytes().replace(coded, patched))


@pytest.mark.parametrize("zone", ["+05:30", "-03:30", "Europe/Oslo", "UTC"])
@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_parquet_times_of_any_zone_are_utc(tmp_path: Path, zone: str, unit: str) -> None:
    """Arrow keeps zoned stamps in UTC; offsets as zones made polars panic (exit code 1)."""
    import polars as pl

    per_second = {"ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    start = int(datetime(2026, 3, 1, 10, tzinfo=UTC).timestamp())
    made = pl.DataFrame(columns())
    counts = [start * per_second + i * per_second // 8 for i in range(made.height)]
    offset = zone[0] in "+-"
    kind = pl.Datetime(unit, "Israel" if offset else zone)  # type: ignore[arg-type]
    stamps = pl.Series("time", counts, dtype=pl.Int64).cast(kind)
    path = tmp_path / "log.parquet"
    made.drop("time_s").with_columns(stamps).write_parquet(path)
    if offset:
        with_offset(path, zone)
    log = read(path)
    assert log.time_s[0] == 10 * 3600.0
    assert np.allclose(np.diff(log.time_s), 0.125, atol=1e-9)
    assert log.notes == ("times are UTC, in seconds since 2026-03-01T00:00:00Z",)
    assert "POLARS_IGNORE_TIMEZONE_PARSE_ERROR" not in os.environ


@pytest.mark.parametrize("name", ["time", "time_s", "time_ms"])
def test_parquet_durations_carry_their_own_unit(tmp_path: Path, name: str) -> None:
    """`time` was refused as numbers without a unit, `time_ms` read as thousandths."""
    import polars as pl

    plain = read(write(tmp_path / "a.csv", columns()))
    spans = (pl.col("time_s") * 1e6).round().cast(pl.Int64).cast(pl.Duration("us")).alias(name)
    order = [name, *(key for key in columns() if key != "time_s")]
    path = tmp_path / "log.parquet"
    pl.DataFrame(columns()).with_columns(spans).select(order).write_parquet(path)
    assert read(path).time_s == pytest.approx(plain.time_s, abs=1e-6)


@pytest.mark.parametrize(
    ("unit", "counts"),
    [
        ("us", [-(2**63), *range(39)]),  # polars panicked over its own message: exit code 1
        ("ms", [253_370_764_800_000 + k for k in range(40)]),  # the year 9999
        ("us", [-62_135_596_800_000_000 + k for k in range(40)]),  # the year 1
    ],
)
def test_parquet_times_beyond_all_logs_are_refused(
    tmp_path: Path, unit: str, counts: list[int]
) -> None:
    import polars as pl

    stamps = pl.Series("time", counts, dtype=pl.Int64).cast(pl.Datetime(unit))  # type: ignore[arg-type]
    made = pl.DataFrame(columns()).drop("time_s").with_columns(stamps)
    made.write_parquet(tmp_path / "log.parquet")
    said = refusal(tmp_path / "log.parquet")
    assert "time: no time of a log in row 1" in said
    assert "1678 to 2261" in said


def test_parquet_times_may_miss(tmp_path: Path) -> None:
    import polars as pl

    day = [None, *(20_454 + k for k in range(39))]
    made = pl.DataFrame(columns()).drop("time_s")
    dates = made.with_columns(pl.Series("time", day, dtype=pl.Int32).cast(pl.Date))
    spans = made.with_columns(
        pl.Series("time_s", [None, *range(39)], dtype=pl.Int64).cast(pl.Duration("ms"))
    )
    for frame, step in ((dates, 86_400.0), (spans, 1e-3)):
        frame.write_parquet(tmp_path / "log.parquet")
        log = read(tmp_path / "log.parquet")
        assert log.time_s == pytest.approx(step * np.arange(39), abs=1e-9)
        assert log.rejected == {"no time stamp": 1}


@pytest.mark.parametrize("kind", ["categorical", "boolean", "list", "text", "time of day", "null"])
def test_parquet_that_holds_no_numbers_is_refused(tmp_path: Path, kind: str) -> None:
    import polars as pl

    column = pl.col("range_m")
    changed = {
        "categorical": pl.lit("near").cast(pl.Categorical),
        "boolean": column > 0,
        "list": pl.concat_list(column, column),
        "text": pl.lit("near"),
        "time of day": pl.lit(datetime(2026, 3, 1).time()),
        "null": pl.lit(None),
    }[kind].alias("range_m")
    pl.DataFrame(columns()).with_columns(changed).write_parquet(tmp_path / "a.parquet")
    said = refusal(tmp_path / "a.parquet")
    assert "range_m" in said or "too few complete rows" in said
