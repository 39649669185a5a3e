"""Text in Parquet logs is read in pieces: the same answer whatever the pieces, little memory."""

from __future__ import annotations

import itertools
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from syncline_design.logs import parquet_source
from syncline_design.logs.parquet_footer import chunks
from syncline_design.logs.row_source import RowSource
from syncline_design.logs.sources import opened
from syncline_design.spec.load import BadInput

PEAK = """
import resource, sys
import numpy as np
from pathlib import Path
from syncline_design.logs.sources import opened
keep = np.ones(2_500_000, dtype=bool)
opened(Path(sys.argv[1])).numbers(["number"], keep)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
labels = opened(Path(sys.argv[1])).labels("target_id", keep)
assert len(set(labels[:5000])) == 50
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
"""


@pytest.fixture
def pieces_of_seven(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parquet_source, "PIECE", 7)


def written(path: Path, **columns: list[object]) -> RowSource:
    pl.DataFrame(columns).write_parquet(path)
    return opened(path)


def test_long_names_of_targets_take_little_memory(tmp_path: Path) -> None:
    path, rows = tmp_path / "log.parquet", 2_500_000
    names = pl.Series([f"{k:03d}" + "q" * 190 for k in range(50)])
    ids = names.gather(np.arange(rows) % 50)
    pl.DataFrame({"number": np.zeros(rows), "target_id": ids}).write_parquet(path)
    assert path.stat().st_size < 5_000_000
    done = subprocess.run(
        [sys.executable, "-c", PEAK, str(path)], capture_output=True, text=True, check=True
    )
    assert int(done.stdout) < 320_000  # kB; the names are 483 MB of text


@pytest.mark.usefixtures("pieces_of_seven")
def test_labels_differ_where_the_names_do(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    figures = [str(k) for k in rng.integers(0, 5, 12)]  # the first piece looks like figures
    names = [*figures, *(f"T{k}" for k in rng.integers(0, 9, 48)), None, " T3 "]
    source = written(tmp_path / "log.parquet", target_id=names)
    keep = rng.random(len(names)) < 0.8
    labels = source.labels("target_id", keep)
    told = [None if n is None else n.strip() for n, k in zip(names, keep, strict=True) if k]
    assert len(labels) == len(told)
    for (a, x), (b, y) in itertools.combinations(zip(told, labels, strict=True), 2):
        assert (a == b) == (x == y or (np.isnan(x) and np.isnan(y)))


@pytest.mark.usefixtures("pieces_of_seven")
def test_figures_and_times_as_text_are_the_same_in_pieces(tmp_path: Path) -> None:
    numbers = [f" {k / 7:.9f}" for k in range(40)]
    times = [f"2026-03-01T12:{k:02d}:07.5Z" for k in range(40)]
    source = written(tmp_path / "log.parquet", time=times, range_m=numbers, id=["4.5"] * 40)
    keep = np.arange(40) % 3 != 0
    expected = np.array([float(t) for t in numbers])[keep]
    assert np.array_equal(source.numbers(["range_m"], keep)["range_m"], expected)
    assert np.array_equal(source.labels("id", keep), np.full(int(keep.sum()), 4.5))
    stamps = source.clock("time").nanoseconds
    since = np.array([t.removesuffix("Z") for t in times], "datetime64[ns]").astype(np.int64)
    assert stamps is not None
    assert np.array_equal(stamps, since)


@pytest.mark.usefixtures("pieces_of_seven")
def test_times_may_begin_with_empty_cells(tmp_path: Path) -> None:
    times = [*[None] * 16, *["2026-03-01T12:00:00.5Z"] * 9]
    stamps = written(tmp_path / "log.parquet", time=times).clock("time").nanoseconds
    assert stamps is not None
    assert np.all(stamps[:16] == np.iinfo(np.int64).min)
    assert np.all(stamps[16:] == 1_772_366_400_500_000_000)


@pytest.mark.usefixtures("pieces_of_seven")
@pytest.mark.parametrize("place", [0, 6, 7, 23])
def test_a_bad_cell_is_named_with_its_row(tmp_path: Path, place: int) -> None:
    cells = ["1.5"] * 30
    cells[place] = "broken"
    source = written(tmp_path / "log.parquet", range_m=cells)
    with pytest.raises(BadInput, match=f"in row {place + 1}; .*'broken'"):
        source.numbers(["range_m"], np.ones(30, dtype=bool))


@pytest.mark.usefixtures("pieces_of_seven")
def test_zones_agree_between_pieces(tmp_path: Path) -> None:
    times = ["2026-03-01T12:00:00Z"] * 10 + ["2026-03-01T12:00:01"] * 10
    source = written(tmp_path / "log.parquet", time=[*times[:7], *times[13:20]])
    with pytest.raises(BadInput, match="a zone"):
        source.clock("time")


def test_text_that_unpacks_to_gigabytes_is_refused_unopened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "log.parquet"
    cells = ["z" * 30_000 + str(k) for k in range(300)]
    pl.DataFrame({"target_id": cells}).write_parquet(path, compression="zstd")
    assert path.stat().st_size < 200_000
    source = opened(path)
    # not a byte of it is unpacked
    monkeypatch.setattr(parquet_source.ParquetSource, "_column", None)
    with pytest.raises(BadInput, match="text too long; expected at most 200 characters a cell"):
        source.labels("target_id", np.ones(300, dtype=bool))


@pytest.mark.parametrize("compression", ["zstd", "snappy", "gzip", "uncompressed"])
@pytest.mark.parametrize("rows", [1, 999, 5000])
def test_sizes_in_the_footer_bound_the_text(tmp_path: Path, rows: int, compression: str) -> None:
    path = tmp_path / "log.parquet"
    cells = [f"{k:0150d}" for k in range(rows)]  # all of them different: no dictionary helps
    frame = pl.DataFrame({"a": np.zeros(rows), "id": cells, "flag": [True] * rows})
    frame.write_parquet(path, compression=compression, row_group_size=1000)
    found = list(chunks(path, "id"))
    assert [values for values, _ in found] == [min(1000, rows - k) for k in range(0, rows, 1000)]
    for values, size in found:
        assert 150 * values <= size <= 2 * 160 * values + 2000
    labels = opened(path).labels("id", np.ones(rows, dtype=bool))
    assert len(set(labels)) == rows
