"""Which column of a file is read for which quantity, and what is said of the others.

The oracle is the plain file: the same figures under the names of the documentation.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from syncline_design.diagnosis.system import measured
from syncline_design.logs.reading import read_log
from syncline_design.spec.load import BadInput, load
from tests.test_diagnose_log import columns, read, refusal, write

ROOT = Path(__file__).parents[1]


def renamed(old: str, new: str, factor: float = 1.0) -> dict[str, np.ndarray]:
    made = columns()
    return {(new if n == old else n): v * (factor if n == old else 1) for n, v in made.items()}


@pytest.mark.parametrize(
    ("si", "theirs", "factor"),
    [
        ("time_s", "Time [ms]", 1e3),
        ("range_m", "r [mm]", 1e3),
        ("roll_deg", "att.phi [rad]", np.pi / 180),
        ("azimuth_deg", "beam [0] [deg]", 1.0),
    ],
)
def test_a_name_with_its_unit_in_brackets_is_mapped_as_it_stands(
    tmp_path: Path, si: str, theirs: str, factor: float
) -> None:
    plain = read(write(tmp_path / "plain.csv", columns()))
    log = read(write(tmp_path / "a.csv", renamed(si, theirs, factor)), {si: theirs})
    assert log.time_s == pytest.approx(plain.time_s, abs=1e-9)
    assert log.stages[0].range_m == pytest.approx(plain.stages[0].range_m, rel=1e-8)
    assert log.stages[0].euler_rad == pytest.approx(plain.stages[0].euler_rad, rel=1e-8)


def test_a_quantity_given_twice_alike_differs_in_nothing(tmp_path: Path) -> None:
    made = columns()
    log = read(write(tmp_path / "a.csv", made | {"yaw_rad": np.pi / 180.0 * made["yaw_deg"]}))
    assert "yaw_rad was not read, as yaw_deg is there too" in log.notes
    assert not any("differ" in one for one in log.notes)


def test_a_mapped_column_that_is_nowhere_is_not_replaced_by_another(tmp_path: Path) -> None:
    path = write(tmp_path / "a.csv", columns())
    said = refusal(path, {"range_m": "range_corected [m]"})
    assert "log.columns.range_m: no file has a column 'range_corected [m]'" in said
    assert "the file has range_m" in said
    absent = {n: v for n, v in columns().items() if not n.startswith("rate_")}
    log = read(write(tmp_path / "b.csv", absent), {"rate_x_degps": "gyro.x"})
    assert any("no file has a column 'gyro.x'" in note for note in log.notes)


def test_a_mapped_column_may_be_in_another_file(tmp_path: Path) -> None:
    made = columns()
    turned = {n: made.pop(n) for n in ("roll_deg", "pitch_deg", "yaw_deg")}
    one = write(tmp_path / "a.csv", made)
    two = write(
        tmp_path / "b.csv",
        {
            "time_s": made["time_s"],
            "phi": turned["roll_deg"],
            **{n: turned[n] for n in ("pitch_deg", "yaw_deg")},
        },
    )
    log = read_log([one, two], ["uav"], {"roll_deg": "phi"})
    assert np.degrees(log.stages[0].euler_rad[1:-1, 0]) == pytest.approx(turned["roll_deg"][1:-1])


@pytest.mark.parametrize(
    ("other", "of", "apart"),
    [
        ("heading_deg", "yaw_deg", "30 deg"),
        ("heading_rad", "yaw_deg", "30 deg"),
        ("range_mm", "range_m", "30 m"),
    ],
)
def test_a_quantity_given_twice_is_said(tmp_path: Path, other: str, of: str, apart: str) -> None:
    per = {"heading_rad": np.pi / 180.0, "range_mm": 1000.0}.get(other, 1.0)
    made = columns() | {other: per * (columns()[of] + 30.0)}
    log = read(write(tmp_path / "a.csv", made))
    assert f"{other} was not read, as {of} is there too" in log.notes
    assert f"{of} and {other} differ by {apart} in the median" in log.notes
    plain = read(write(tmp_path / "plain.csv", columns()))
    assert log.stages[0].euler_rad == pytest.approx(plain.stages[0].euler_rad)
    assert log.stages[0].range_m == pytest.approx(plain.stages[0].range_m)
    assert not plain.notes
    mapped = read(tmp_path / "a.csv", {of: of})
    assert not any("was not read" in note for note in mapped.notes)


def test_a_quantity_in_two_files_is_said(tmp_path: Path) -> None:
    made = columns()
    one = write(tmp_path / "a.csv", made)
    again = {"time_s": made["time_s"], "range_m": made["range_m"] + 3}
    two = write(tmp_path / "b.csv", again)
    log = read_log([one, two], ["uav"])
    assert "b.csv: not read, as another file gives it: range_m" in log.notes
    assert log.stages[0].range_m == pytest.approx(read(one).stages[0].range_m)


def test_a_second_whole_log_is_no_part_of_the_first(tmp_path: Path) -> None:
    """Its rows would be left out in silence: several runs are not one."""
    files = [write(tmp_path / name, columns()) for name in ("a.csv", "b.csv")]
    with pytest.raises(BadInput, match=r"a second log of .* that are in a.csv already") as found:
        read_log(files, ["uav"])
    assert "--joint" in str(found.value)


def test_a_mapping_of_what_is_no_column_is_refused_at_its_line(tmp_path: Path) -> None:
    text = (ROOT / "examples" / "hidden_latency.yaml").read_text(encoding="utf-8")
    spec = tmp_path / "spec.yaml"
    spec.write_text(text + "log: {columns: {ranger_m: r}}\n", encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        measured(load(spec), [ROOT / "examples" / "hidden_latency.csv"])
    line = len(text.splitlines()) + 1
    assert f"spec.yaml:{line}:" in str(caught.value)
    assert "log.columns.ranger_m: no such column" in str(caught.value)
    assert "did you mean range_m?" in str(caught.value)
