"""`audit` as a user calls it: exit codes, text, JSON against its schema, pages, refusals."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from typer.testing import CliRunner, Result

from syncline_design.auditing.run import audit
from syncline_design.cli.app import app
from syncline_design.report.result_schemas import result_schema
from tests.flight_logs import flight, write_ros2

START = 1_700_000_000_000_000_000
TAI_AHEAD = 37


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, ["audit", *map(str, words)])


def audited(*words: str | Path) -> dict[str, Any]:
    found = run(*words, "--output", "json:-")
    data: dict[str, Any] = json.loads(found.stdout)
    jsonschema.Draft202012Validator(result_schema("audit")).validate(data)
    assert found.exit_code == (0 if data["verdict"] == "sound" else 1)
    return data


def written(path: Path, stamp_ns: np.ndarray, receive_ns: np.ndarray) -> Path:
    rows = [
        f"{s // 10**9}.{s % 10**9:09d},{r // 10**9}.{r % 10**9:09d}"
        for s, r in zip(stamp_ns.tolist(), receive_ns.tolist(), strict=True)
    ]
    path.write_text("stamp_s,receive_s\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def stream(seed: int, rate: float = 50.0, length: float = 40.0) -> tuple[np.ndarray, np.ndarray]:
    """A sound stream: an even rhythm, gamma delays of 0.5 ms."""
    rng = np.random.default_rng(seed)
    true = START + np.round(np.arange(int(rate * length)) / rate * 1e9).astype(np.int64)
    late = np.round(rng.gamma(2.0, 5e5, true.size)).astype(np.int64)
    return true, np.maximum.accumulate(true + late)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A lidar in TAI, a GNSS with a second's slip, a serial sensor in packets, a sound IMU."""
    stamp, receive = stream(1)
    written(tmp_path / "imu.csv", stamp, receive)
    stamp, receive = stream(2)
    written(tmp_path / "lidar.csv", stamp + TAI_AHEAD * 10**9, receive)
    stamp, receive = stream(3, 10.0)
    slipped = stamp.copy()
    slipped[100:180] += 10**9
    written(tmp_path / "gnss.csv", slipped, receive)
    stamp, receive = stream(4, 130.0)
    ticks = 16_000_000
    arrival = -(-(stamp - START) // ticks) * ticks + START
    written(tmp_path / "serial.csv", arrival, arrival + 20_000 + (receive - stamp) // 100)
    return tmp_path


def test_three_faults_are_named_and_the_sound_stream_is_left_alone(folder: Path) -> None:
    data = audited(*sorted(folder.glob("*.csv")))
    found = {row["name"]: row["faults"] for row in data["streams"]}
    assert [f["fault"] for f in found["lidar"]] == ["epoch_offset"]
    assert found["lidar"][0]["parameters"] == {"seconds": 37.0, "kind": "tai"}
    assert [f["fault"] for f in found["gnss"]] == ["whole_second_slip"]
    slip = found["gnss"][0]
    assert (slip["parameters"]["seconds"], slip["parameters"]["count"]) == (1.0, 80.0)
    assert slip["from_s"] == pytest.approx(10.0, abs=0.02)
    assert slip["to_s"] == pytest.approx(18.0, abs=0.02)
    assert [f["fault"] for f in found["serial"]] == ["packetised"]
    assert found["serial"][0]["parameters"]["interval_s"] == 0.016
    assert found["imu"] == []
    assert data["verdict"] == "faults"


def test_the_residual_is_the_delays_alone(folder: Path) -> None:
    data = audited(folder / "lidar.csv", folder / "imu.csv")
    for row, seed in zip(sorted(data["streams"], key=lambda r: r["name"]), (1, 2), strict=True):
        stamp, receive = stream(seed)
        late = (receive - stamp) / 1e9
        assert row["residual_s"]["bound"] == pytest.approx(late.max() - late.min(), rel=1e-6)
        assert row["residual_s"]["p95"] == pytest.approx(
            np.percentile(late - late.min(), 95.0), rel=1e-6
        )


def test_text_page_and_exit_codes(folder: Path, tmp_path: Path) -> None:
    sound = run(folder / "imu.csv")
    assert sound.exit_code == 0
    assert "Sound" in sound.stdout
    assert "constant latency" in sound.stdout
    page = tmp_path / "audit.html"
    faulty = run(folder / "gnss.csv", folder / "imu.csv", "-o", f"html:{page}")
    assert faulty.exit_code == 1
    assert "whole_second_slip" in faulty.stdout
    text = page.read_text("utf-8")
    assert text.count("<svg") == 1
    assert "whole_second_slip" in text[text.index("<svg") :]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "empty"),
        (b"stamp_s,receive_s\n", ""),
        (b"stamp_s,stamp_ms,receive_s\n1,1000,1\n2,2000,2\n", "stamp"),
        (b"stamp_s,receive_s\n1.0,1.1\nhello,2.1\n3.0,3.1\n", ":3:1:"),
        (b"\x00\x01\x02\x03" * 64, ""),
        (b"range_m\n1\n2\n", ""),
    ],
)
def test_what_is_no_log_is_refused_and_nothing_is_written(
    tmp_path: Path, content: bytes, said: str
) -> None:
    bad = tmp_path / "bad.csv"
    bad.write_bytes(content)
    out = tmp_path / "out.json"
    found = run(bad, "-o", f"json:{out}")
    assert found.exit_code == 2, found.output
    assert "bad.csv" in found.stderr
    assert said in found.stderr
    assert "Traceback" not in found.stderr
    assert found.stdout == ""
    assert not out.exists()


def test_one_bad_file_among_good_ones_is_2_and_the_others_are_audited(folder: Path) -> None:
    bad = folder / "bad.csv"
    bad.write_bytes(b"")
    found = run(folder / "gnss.csv", bad)
    assert found.exit_code == 2
    assert "whole_second_slip" in found.stdout
    assert "bad.csv" in found.stderr


def test_a_spec_gives_tau_crit_and_metres_only_where_stamps_are_arrivals(
    folder: Path, tmp_path: Path
) -> None:
    """error = residual * sensor error / tau_crit, from the verdict's own figures."""
    spec = tmp_path / "track.yaml"
    text = (
        "syncline: 1\nname: track\nrequirements: [{id: A, kind: accuracy, limit: 10 m}, "
        "{id: S, kind: sync, limit: 1000}]\nstages:\n  - name: car\n"
        "    platform: {v_max: 20 m/s, omega_max: 0 deg/s, distance: 1 m, baseline: 1 m}\n"
        "    position: {sensor: ublox_f9p_rtk, primitive: PRIMITIVE, timestamping: METHOD}\n"
    )
    spec.write_text(text.replace("PRIMITIVE", "arrival").replace("METHOD", "arrival"), "utf-8")
    (row,) = audited(folder / "gnss.csv", "--spec", spec)["streams"]
    verdict = json.loads(CliRunner().invoke(app, ["check", str(spec), "-o", "json:-"]).stdout)
    role = verdict["design"]["stages"][0]["roles"]["position"]
    assert row["role"] == "car.position"
    assert row["tau_crit_s"] == role["tau_crit_s"]
    assert row["error_m"] == pytest.approx(20.0 * row["residual_s"]["bound"], rel=1e-12)
    spec.write_text(text.replace("PRIMITIVE", "pps").replace("METHOD", "hardware"), "utf-8")
    (row,) = audited(folder / "gnss.csv", "--spec", spec)["streams"]
    assert row["error_m"] is None
    assert any("hardware" in line for line in row["cannot_show"])


def test_the_residual_is_written_into_a_spec_on_request_and_marked(
    folder: Path, tmp_path: Path
) -> None:
    import yaml

    spec, out = tmp_path / "track.yaml", tmp_path / "audited.yaml"
    spec.write_text(
        "syncline: 1\nname: track\nrequirements: [{id: A, kind: accuracy, limit: 10 m}, "
        "{id: S, kind: sync, limit: 1000}]\nstages:\n  - name: car\n"
        "    platform: {v_max: 20 m/s, omega_max: 0 deg/s, distance: 1 m, baseline: 1 m}\n"
        "    position: {sensor: ublox_f9p_rtk, primitive: arrival, timestamping: arrival}\n",
        "utf-8",
    )  # fmt: skip
    found = run(folder / "gnss.csv", "--spec", spec, "--write-spec", out)
    assert found.exit_code == 1, found.output
    role = yaml.safe_load(out.read_text("utf-8"))["stages"][0]["position"]
    bound = audited(folder / "gnss.csv")["streams"][0]["residual_s"]["bound"]
    assert float(role["timestamping"]["error"]["low"].split()[0]) == pytest.approx(-bound, rel=1e-5)
    assert role["timestamping"]["error"]["high"] == "0 s"
    said = "upper bound from audit of gnss once whole_second_slip is mended, transport included"
    assert said in role["note"]
    assert CliRunner().invoke(app, ["check", str(out)]).exit_code == 0
    assert run(folder / "gnss.csv", "--write-spec", out).exit_code == 2


@pytest.mark.parametrize("other", [True, False])
def test_a_role_that_is_stamped_in_hardware_keeps_its_error(tmp_path: Path, other: bool) -> None:
    """Receipts show transport: 4 ms here, of stamps that the spec knows to 10 ns."""
    import yaml

    spec, out = tmp_path / "a.yaml", tmp_path / "b.yaml"
    error = "timestamping: {error: {distribution: uniform, low: -10 ns, high: 10 ns}}"
    spec.write_text(
        "syncline: 1\nname: a\nrequirements: [{id: A, kind: accuracy, limit: 10 m}]\n"
        "stages:\n  - name: car\n"
        "    platform: {v_max: 20 m/s, omega_max: 40 deg/s, distance: 1 m, baseline: 1 m}\n"
        "    position: {sensor: ublox_f9p_rtk, primitive: arrival, timestamping: arrival}\n"
        "    attitude:\n      sensor: {modality: attitude, type: ins, primitives: [pps],\n"
        f"        sigma_attitude: 0.1 deg}}\n      primitive: pps\n      {error}\n",
        "utf-8",
    )  # fmt: skip
    delay = np.random.default_rng(6).uniform(1e-3, 5e-3, 99)
    rows = [f"{1_750_000_000 + k / 10:.3f},{1_750_000_000 + k / 10 + delay[k]:.6f}"
            for k in range(99)]  # fmt: skip
    files = [tmp_path / f"{name}.csv" for name in (("attitude", "gnss") if other else ["attitude"])]
    for path in files:
        path.write_text("\n".join(["stamp_s,receive_s", *rows, ""]), "utf-8")
    found = run(*files, "--spec", spec, "--write-spec", out)
    assert "car.attitude: stamped in hardware" in found.stderr
    assert out.exists() == other
    if other:
        stage = yaml.safe_load(out.read_text("utf-8"))["stages"][0]
        assert stage["attitude"]["timestamping"] == yaml.safe_load(error)["timestamping"]
        assert stage["position"]["timestamping"]["error"]["high"] == "0 s"


@pytest.mark.parametrize(("names", "taken"), [
    (("attitude", "imu"), "attitude"), (("imu", "ins"), None), (("imu",), "imu"),
])  # fmt: skip
def test_a_role_is_given_by_its_own_word_before_others_and_never_in_silence(
    tmp_path: Path, names: tuple[str, ...], taken: str | None
) -> None:
    spec = tmp_path / "a.yaml"
    spec.write_text(
        "syncline: 1\nname: a\nrequirements: [{id: A, kind: accuracy, limit: 10 m}]\n"
        "stages:\n  - name: car\n"
        "    platform: {v_max: 20 m/s, omega_max: 40 deg/s, distance: 1 m, baseline: 1 m}\n"
        "    position: {sensor: ublox_f9p_rtk, primitive: arrival, timestamping: arrival}\n"
        "    attitude:\n      sensor: {modality: attitude, type: ins, primitives: [arrival],\n"
        "        sigma_attitude: 0.1 deg}\n"
        "      primitive: arrival\n"
        "      timestamping: {error: {distribution: uniform, low: -1 ms, high: 0 ms}}\n",
        "utf-8",
    )  # fmt: skip
    rows = [f"{1_750_000_000 + k / 10:.3f},{1_750_000_000 + k / 10 + 0.004:.3f}" for k in range(99)]
    files = [tmp_path / f"{name}.csv" for name in names]
    for path in files:
        path.write_text("\n".join(["stamp_s,receive_s", *rows, ""]), "utf-8")
    found = audited(*files, "--spec", spec)
    roles = {row["name"]: row.get("role") for row in found["streams"]}
    assert [name for name, role in roles.items() if role] == ([taken] if taken else [])
    said = [note for note in found["notes"] if "each may be car.attitude" in note]
    assert len(said) == (0 if taken else 1)


def test_a_table_of_no_numbers_is_not_sound(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("stamp_s,receive_s\n" + "nan,nan\n" * 100, encoding="utf-8")
    found = run(log)
    assert found.exit_code == 2
    assert "no message in it has a time" in found.stderr


def test_every_file_of_a_bag_s_folder_is_evidence(tmp_path: Path) -> None:
    """Each by its content, as a plain file is."""
    bag = write_ros2(tmp_path / "bag", flight(2.0))
    found = {Path(one.file).name: one.sha256 for one in audit([bag]).evidence}
    inside = {one.name: hashlib.sha256(one.read_bytes()).hexdigest() for one in bag.iterdir()}
    assert len(inside) > 1
    assert found == inside


def test_stamps_beyond_64_bits_are_far_years_and_no_unit(tmp_path: Path) -> None:
    """2**70 ns are 37 411 years; the rhythm and what else stamps show is told all the same."""
    receive = START + np.cumsum(np.full(400, 100_000_000))
    rows = [f"{2**70 + k * 100_000_000},{r + 2_000_000}" for k, r in enumerate(receive.tolist())]
    path = tmp_path / "huge.csv"
    path.write_text("stamp_ns,receive_ns\n" + "\n".join(rows) + "\n", encoding="utf-8")
    (row,) = audited(path)["streams"]
    (fault,) = row["faults"]
    assert (fault["fault"], fault["parameters"]["kind"]) == ("epoch_offset", "unknown")
    assert fault["parameters"]["seconds"] == pytest.approx((2**70 - START) / 1e9, rel=1e-9)
    assert "years after" in fault["evidence"]
    assert row["rate_hz"] == pytest.approx(10.0, rel=1e-3)
