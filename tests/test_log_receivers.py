"""NMEA and u-blox logs, written with pynmeagps and pyubx2; times checked by the calendar."""

from __future__ import annotations

import struct
import time
from datetime import UTC, datetime, timedelta
from functools import reduce
from operator import xor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.receiver_frames import FletcherSums
from syncline_design.logs.readers.stream import UNSET, Recording, Stream
from syncline_design.spec.load import BadInput

pynmeagps = pytest.importorskip("pynmeagps")
pyubx2 = pytest.importorskip("pyubx2")

GPS_ZERO = datetime(1980, 1, 6, tzinfo=UTC)
SECOND = 10**9


def sentence(text: str) -> bytes:
    return f"${text}*{reduce(xor, text.encode(), 0):02X}\r\n".encode()


def unix_ns(*parts: int, micro: int = 0) -> int:
    moment = datetime(*parts, tzinfo=UTC)  # type: ignore[misc,arg-type]
    return int(moment.timestamp()) * SECOND + micro * 1000


def ubx(name: str, group: str, **fields: Any) -> bytes:
    message = pyubx2.UBXMessage(group, name, pyubx2.GET, **fields)
    return bytes(message.serialize())


def opened(tmp_path: Path, *parts: bytes) -> Recording:
    path = tmp_path / "receiver.log"
    path.write_bytes(b"".join(parts))
    return open_recording(path)


def by_name(recording: Recording) -> dict[str, Stream]:
    return {stream.name: stream for stream in recording.streams()}


def stamps_of(stream: Stream) -> list[int]:
    assert stream.stamps is not None
    return [int(at) for at in stream.stamps.primary_ns]


def columns_of(recording: Recording, name: str) -> dict[str, np.ndarray]:
    pieces = list(recording.samples(name))
    return {key: np.concatenate([p.columns[key] for p in pieces]) for key in pieces[0].columns}


def pvt(at: datetime, leaps: int = 18, **others: Any) -> bytes:
    """NAV-PVT as a receiver rounds it: to the next whole second, `nano` says by how much."""
    tow = at + timedelta(seconds=leaps) - GPS_ZERO
    whole = (at + timedelta(seconds=0.5)).replace(microsecond=0)
    micros = (at - whole) // timedelta(microseconds=1)
    fields: dict[str, Any] = {
        "iTOW": round(tow / timedelta(milliseconds=1)) % 604_800_000,
        **{"year": whole.year, "month": whole.month, "day": whole.day, "hour": whole.hour},
        **{"min": whole.minute, "second": whole.second, "validDate": 1, "validTime": 1},
        **{"fullyResolved": 1, "nano": micros * 1000, "fixType": 3, "numSV": 20},
        **{"lat": 47.3977418, "lon": -8.5455932, "height": 460_123, "hMSL": 412_023},
        **{"velN": 1234, "velE": -567, "velD": 89},
    }
    return ubx("NAV-PVT", "NAV", **(fields | others))


def test_a_fix_is_said_once_however_many_sentences_say_it(tmp_path: Path) -> None:
    epochs = []
    for k in range(5):
        at = f"2357{50 + k:02d}.50"
        epochs += [
            sentence(f"GNGGA,{at},4723.86451,N,00832.73559,W,4,20,0.6,412.0,M,48.1,M,,"),
            sentence(f"GNGST,{at},1.0,,,,0.011,0.012,0.021"),
            sentence(f"GNRMC,{at},A,4723.86451,N,00832.73559,W,10.0,090.0,311225,,,R"),
            sentence("GNVTG,090.0,T,,M,10.0,N,18.5,K,R"),
        ]
    recording = opened(tmp_path, *epochs)
    streams = by_name(recording)
    assert streams["fix"].messages == 5
    assert streams["fix"].quantity == ("position", "velocity")
    assert [name for name, s in streams.items() if "position" in s.quantity] == ["fix"]
    assert streams["GNVTG"].stamps is None  # it says no time
    expected = [unix_ns(2025, 12, 31, 23, 57, 50 + k, micro=500_000) for k in range(5)]
    assert stamps_of(streams["fix"]) == expected
    fix = columns_of(recording, "fix")
    assert np.allclose(fix["latitude_deg"], 47 + 23.86451 / 60, rtol=0, atol=1e-12)
    assert np.allclose(fix["longitude_deg"], -(8 + 32.73559 / 60), rtol=0, atol=1e-12)
    assert np.allclose(fix["height_m"], 460.1)  # above the ellipsoid
    assert np.allclose(fix["height_msl_m"], 412.0)
    assert np.allclose(fix["velocity_east_mps"], 10 * 1852 / 3600)
    assert np.allclose(fix["velocity_north_mps"], 0, atol=1e-12)
    assert np.allclose(fix["sigma_up_m"], 0.021)


def test_the_day_of_a_sentence_without_one_is_the_nearest(tmp_path: Path) -> None:
    gga = "4723.86451,N,00832.73559,E,4,20,0.6,412.0,M,48.1,M,,"
    recording = opened(
        tmp_path,
        sentence(f"GPGGA,235958.00,{gga}"),  # before any date
        sentence("GPZDA,235959.00,28,02,2024,00,00"),
        sentence(f"GPGGA,235959.00,{gga}"),
        sentence(f"GPGGA,000000.00,{gga}"),  # 2024 has a 29th of February
        sentence(f"GPGGA,000001.00,{gga}"),
        sentence("GPZDA,000002.00,29,02,2024,00,00"),
        sentence(f"GPGGA,000002.00,{gga}"),
    )
    first = unix_ns(2024, 2, 28, 23, 59, 58)
    streams = by_name(recording)
    assert stamps_of(streams["GPGGA"]) == [first + k * SECOND for k in range(5)]
    assert streams["fix"].timeline == "utc"


def test_without_any_date_the_timeline_is_unknown(tmp_path: Path) -> None:
    times = ("235959", "000000", "000001")
    recording = opened(
        tmp_path, *(sentence(f"ECGLL,5119.881,N,00125.169,E,{t},A,D") for t in times)
    )
    stream = by_name(recording)["ECGLL"]
    assert stream.timeline == "unknown"
    midnight = 24 * 3600 * SECOND
    assert stamps_of(stream) == [midnight - SECOND, midnight, midnight + SECOND]
    assert any("without a day" in note for note in stream.notes)
    assert stream.stamps is not None
    assert stream.stamps.primary == "time of day (UTC)"


def test_a_rollover_of_the_week_is_named_and_not_mended(tmp_path: Path) -> None:
    recording = opened(
        tmp_path,
        sentence("GPRMC,000345.03,A,4808.9993,N,01135.0798,E,000.1,000.0,070419,003.0,E,A"),
        sentence("GPRMC,000435.00,V,0000.0000,N,00000.0000,E,,,220899,,,N"),
    )
    stream = by_name(recording)["GPRMC"]
    day = datetime(2019, 4, 7, tzinfo=UTC) - timedelta(weeks=1024)
    assert stamps_of(stream)[1] == unix_ns(day.year, day.month, day.day, 0, 4, 35)
    assert any("1024 weeks" in note for note in stream.notes)


def test_void_and_empty_sentences_are_no_fixes(tmp_path: Path) -> None:
    recording = opened(
        tmp_path,
        sentence("GPGGA,,,,,,0,,,,M,,M,,"),
        sentence("GPGGA,000001.00,0000.0000,N,00000.0000,E,0,00,0.0,,M,,M,,"),
        sentence("GPRMC,000001.00,V,0000.0000,N,00000.0000,E,,,161206,,,N"),
    )
    streams = by_name(recording)
    assert "fix" not in streams
    assert stamps_of(streams["GPGGA"])[0] == UNSET


def test_true_headings_and_their_lack_of_time(tmp_path: Path) -> None:
    recording = opened(
        tmp_path, sentence("GPHDT,123.456,T"), sentence("PTNL,AVR,212405.20,+52.1531,Yaw,"
        "-0.0806,Tilt,,,12.575,3,1.4,16"),
    )  # fmt: skip
    streams = by_name(recording)
    assert streams["GPHDT"].quantity == ("attitude",)
    assert streams["GPHDT"].stamps is None
    assert columns_of(recording, "GPHDT")["heading_deg"].tolist() == [123.456]
    avr = columns_of(recording, "PTNLAVR")
    assert (avr["heading_deg"][0], avr["pitch_deg"][0]) == (52.1531, -0.0806)


def test_wrong_checksums_are_counted_and_left_out(tmp_path: Path) -> None:
    good = sentence("GPHDT,1.0,T")
    recording = opened(
        tmp_path, good, good.replace(b"1.0", b"7.0"), good, b"\x01\x02\x03\r\n", good
    )
    assert by_name(recording)["GPHDT"].messages == 3
    assert recording.incomplete is not None
    assert "1 sentences or messages refused" in recording.incomplete.reason
    assert "3 bytes" in recording.incomplete.reason


def test_a_negative_nano_is_a_moment_before_the_rounded_second(tmp_path: Path) -> None:
    at = datetime(2019, 4, 22, 21, 19, 19, 999_872, tzinfo=UTC)
    recording = opened(tmp_path, pvt(at), pvt(at + timedelta(seconds=0.25)))
    stream = by_name(recording)["NAV-PVT"]
    assert stream.timeline == "gps"
    truth = [unix_ns(2019, 4, 22, 21, 19, 19, micro=999_872) + 18 * SECOND]
    assert stamps_of(stream) == [truth[0], truth[0] + SECOND // 4]


def test_figures_of_nav_pvt(tmp_path: Path) -> None:
    recording = opened(tmp_path, pvt(datetime(2026, 5, 4, 10, 0, 0, tzinfo=UTC)))
    row = {name: float(column[0]) for name, column in columns_of(recording, "NAV-PVT").items()}
    assert row["latitude_deg"] == 47.3977418
    assert row["longitude_deg"] == -8.5455932
    assert (row["height_m"], row["height_msl_m"]) == (460.123, 412.023)
    assert row["separation_m"] == pytest.approx(48.1)
    assert (row["velocity_north_mps"], row["velocity_east_mps"]) == (1.234, -0.567)
    assert row["velocity_down_mps"] == 0.089


def high_precision(itow: int) -> bytes:
    """NAV-HPPOSLLH by the interface description: 1e-7 deg and mm, and steps of 1e-9 deg, 0.1 mm."""
    figures = (-85_455_932, 473_977_418, 460_123, 412_023, -17, 49, 4, -3, 100, 200)
    payload = bytes(4) + struct.pack("<I4i4b2I", itow, *figures)
    return bytes(pyubx2.UBXMessage("NAV", "NAV-HPPOSLLH", pyubx2.GET, payload=payload).serialize())


@pytest.mark.parametrize("before", [True, False])
def test_high_precision_positions_join_by_itow(tmp_path: Path, before: bool) -> None:
    start = datetime(2026, 5, 4, 10, 0, 0, tzinfo=UTC)
    parts = []
    for k in range(3):
        at = start + timedelta(seconds=k)
        tow = (at + timedelta(seconds=18) - GPS_ZERO) / timedelta(milliseconds=1)
        fine = high_precision(round(tow) % 604_800_000)
        pair = [fine, pvt(at)] if before else [pvt(at), fine]
        parts += pair if k != 1 else [pvt(at)]  # one epoch lacks its high precision message
    recording = opened(tmp_path, *parts)
    joined = columns_of(recording, "NAV-PVT")
    assert joined["latitude_deg"].tolist() == [47.397741849, 47.3977418, 47.397741849]
    assert joined["height_m"].tolist() == [460.1234, 460.123, 460.1234]
    fine_places = columns_of(recording, "NAV-HPPOSLLH")
    read = pyubx2.UBXReader.parse(high_precision(0))
    assert fine_places["longitude_deg"][0] == pytest.approx(read.lon, abs=1e-12) == -8.545593217
    assert fine_places["height_msl_m"][0] == 412.0227
    assert fine_places["sigma_up_m"][0] == 0.02
    assert any("joined" in note for note in by_name(recording)["NAV-PVT"].notes)


def test_the_week_comes_from_any_message_that_says_it(tmp_path: Path) -> None:
    itow = 604_799_000
    att = ubx("NAV-ATT", "NAV", iTOW=itow, roll=1.5, pitch=-2.5, heading=270.25)
    later = ubx("NAV-ATT", "NAV", iTOW=1000, roll=0.0, pitch=0.0, heading=0.0)
    week = ubx("NAV-TIMEGPS", "NAV", iTOW=itow, fTOW=-127, week=2388, towValid=1, weekValid=1)
    recording = opened(tmp_path, att, week, later)
    streams = by_name(recording)
    start = GPS_ZERO + timedelta(weeks=2388)
    end = int(start.timestamp()) * SECOND + itow * 10**6
    assert stamps_of(streams["NAV-ATT"]) == [end, end + 2 * SECOND]  # over the end of the week
    assert stamps_of(streams["NAV-TIMEGPS"]) == [end - 127]
    assert streams["NAV-ATT"].quantity == ("attitude",)
    turn = columns_of(recording, "NAV-ATT")
    found = [float(turn[name][0]) for name in ("roll_deg", "pitch_deg", "yaw_deg")]
    assert found == pytest.approx([1.5, -2.5, 270.25], abs=2e-5)  # the writer cuts at 1e-5 deg


def test_week_seconds_alone_have_no_timeline(tmp_path: Path) -> None:
    parts = [ubx("NAV-ATT", "NAV", iTOW=1000 * k) for k in range(3)]
    stream = by_name(opened(tmp_path, *parts))["NAV-ATT"]
    assert stream.timeline == "unknown"
    assert stream.stamps is not None
    assert stream.stamps.primary == "seconds of the GPS week"
    assert stamps_of(stream) == [0, SECOND, 2 * SECOND]


def test_leap_seconds_before_the_almanac_are_told(tmp_path: Path) -> None:
    at = datetime(2026, 5, 4, 10, 0, 0, tzinfo=UTC)
    wrong = by_name(opened(tmp_path, pvt(at, leaps=16)))["NAV-PVT"]
    assert any("leap seconds" in note for note in wrong.notes)
    right = by_name(opened(tmp_path, pvt(at)))["NAV-PVT"]
    assert not any("leap seconds" in note for note in right.notes)


def test_an_invalid_date_gives_no_week(tmp_path: Path) -> None:
    at = datetime(2026, 5, 4, 10, 0, 0, tzinfo=UTC)
    stream = by_name(opened(tmp_path, pvt(at, validDate=0)))["NAV-PVT"]
    assert stream.timeline == "unknown"


def test_a_log_of_both_kinds_cut_within_a_message(tmp_path: Path) -> None:
    at = datetime(2026, 5, 4, 10, 0, 0, tzinfo=UTC)
    recording = opened(
        tmp_path, sentence("GPHDT,1.0,T"), pvt(at), sentence("GPHDT,2.0,T"), pvt(at)[:-9]
    )
    streams = by_name(recording)
    assert (streams["GPHDT"].messages, streams["NAV-PVT"].messages) == (2, 1)
    assert recording.incomplete is not None
    assert "cut" in recording.incomplete.reason
    assert streams["GPHDT"].partial


def test_comments_of_an_archive_and_rtcm_are_passed_over(tmp_path: Path) -> None:
    rtcm = b"\xd3\x00\x13" + bytes(19) + b"abc"
    comments = b"# Name: a receiver\n# Date: today $\n"
    recording = opened(tmp_path, comments, sentence("GPHDT,1.0,T"), rtcm, sentence("GPHDT,2.0,T"))
    assert by_name(recording)["GPHDT"].messages == 2
    assert recording.incomplete is None


def test_the_sum_of_a_message_is_that_of_the_library() -> None:
    block = bytes(np.random.default_rng(1).integers(0, 256, 70_000, dtype=np.uint8))
    sums = FletcherSums(block)
    for first, end in ((0, 0), (0, 1), (5, 97), (69_000, 70_000), (3, 65_000)):
        assert sums.of(first, end) == pyubx2.calc_checksum(block[first:end])


def test_heads_that_claim_much_cost_little(tmp_path: Path) -> None:
    """Each of 50 000 heads claims 64 kB: summed one by one, that would be 3 GB."""
    at = datetime(2026, 5, 4, 10, 0, 0, tzinfo=UTC)
    hostile = b"\xb5b\x01\x07\xff\xff" * 50_000
    start = time.process_time()
    recording = opened(tmp_path, pvt(at), hostile, pvt(at))
    assert by_name(recording)["NAV-PVT"].messages == 2
    assert time.process_time() - start < 5


@pytest.mark.parametrize("name", ["GPRMC,000345.03,A,4808", "GPGGA,2561"])
def test_nothing_good_in_it_is_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(BadInput):
        opened(tmp_path, f"${name}*00\r\n".encode() * 3)


def test_an_absurd_length_does_not_swallow_what_follows(tmp_path: Path) -> None:
    at = datetime(2026, 5, 4, 10, 0, 0, tzinfo=UTC)
    absurd = b"\xb5b\x01\x07\xff\xff"
    recording = opened(tmp_path, pvt(at), absurd, pvt(at), pvt(at))
    assert by_name(recording)["NAV-PVT"].messages == 3


# gpsd


TPV = (
    '{"class":"TPV","mode":3,"time":"2026-05-04T10:00:00.250Z","lat":47.5,"lon":-8.25,'
    '"altHAE":460.5,"altMSL":412.5,"geoidSep":48.0,"track":30.0,"speed":2.0,"climb":0.5}\n'
)


def test_reports_of_gpsd_between_its_nmea(tmp_path: Path) -> None:
    other = '{"class":"TPV","mode":1}\n{"class":"ATT","heading":274.0}\n'
    recording = opened(tmp_path, sentence("GPHDT,1.0,T"), other.encode(), TPV.encode())
    streams = by_name(recording)
    assert recording.format == "gpsd JSON log"
    assert stamps_of(streams["TPV"]) == [UNSET, unix_ns(2026, 5, 4, 10, micro=250_000)]
    assert (streams["TPV"].timeline, streams["TPV"].frame) == ("utc", "wgs84")
    assert any("1 reports have no time" in note for note in streams["TPV"].notes)
    assert streams["ATT"].stamps is None
    assert columns_of(recording, "ATT")["yaw_deg"].tolist() == [274.0]
    row = {name: float(column[1]) for name, column in columns_of(recording, "TPV").items()}
    assert (row["latitude_deg"], row["longitude_deg"], row["height_m"]) == (47.5, -8.25, 460.5)
    assert (row["height_msl_m"], row["separation_m"]) == (412.5, 48.0)
    assert row["velocity_north_mps"] == pytest.approx(3**0.5)
    assert row["velocity_east_mps"] == pytest.approx(1.0)
    assert row["velocity_down_mps"] == -0.5


def test_a_time_after_many_reports_without(tmp_path: Path) -> None:
    before = '{"class":"ATT","heading":274.0}\n' * 40_000  # more than a block of lines
    after = '{"class":"ATT","time":"2026-05-04T10:00:00Z","heading":1.0}\n'
    stamps = stamps_of(by_name(opened(tmp_path, before.encode(), after.encode()))["ATT"])
    assert len(stamps) == 40_001
    assert stamps[-2:] == [UNSET, unix_ns(2026, 5, 4, 10)]


def test_damaged_reports_are_counted(tmp_path: Path) -> None:
    recording = opened(tmp_path, TPV.encode(), TPV.encode()[:70] + b"\n", TPV.encode()[:-20])
    assert by_name(recording)["TPV"].messages == 1
    assert recording.incomplete is not None
    assert recording.incomplete.reason.startswith("1 damaged line was left out, line 2: no report")
    assert "the last line is cut" in recording.incomplete.reason
    with pytest.raises(BadInput, match="no time of a report"):
        opened(tmp_path, TPV.replace("10:00", "25:00").encode()).streams()


@pytest.mark.parametrize("micros", [439_666, 439_200, 0, 999_999, 500_500])
def test_a_time_of_the_week_may_be_cut_off_at_milliseconds(tmp_path: Path, micros: int) -> None:
    """iTOW of some receivers is not rounded; UTC with `nano` tells the moment all the same."""
    at = datetime(2026, 5, 4, 10, 0, 7, micros, tzinfo=UTC)
    tow = (at + timedelta(seconds=18) - GPS_ZERO) // timedelta(milliseconds=1) % 604_800_000
    stream = by_name(opened(tmp_path, pvt(at, iTOW=tow)))["NAV-PVT"]
    assert stamps_of(stream) == [unix_ns(2026, 5, 4, 10, 0, 25, micro=micros)]
