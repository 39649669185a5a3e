"""Real logs of others in flat formats: what their formats' own libraries find in them.

The files are not part of this repository; see `test_diagnose_real.py` for where they are sought.
"""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from pymap3d import geodetic2ned

from syncline_design.logs.readers import open_recording
from syncline_design.logs.readers.stream import UNSET, Recording, Stream

ROOT = Path(__file__).parents[1]
DATA = Path(os.environ.get("SYNCLINE_DATA", ROOT.parent / "shared" / "data")) / "formats"
SECOND = 10**9
NEAR_NS = 1_000_000  # iTOW is rounded to it

pytestmark = [
    pytest.mark.shared_data,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no real files in {DATA}"),
]


def streams_of(name: str) -> tuple[Recording, dict[str, Stream]]:
    recording = open_recording(DATA / name)
    return recording, {stream.name: stream for stream in recording.streams()}


def ends_of(stream: Stream) -> tuple[int, int]:
    assert stream.stamps is not None
    known = stream.stamps.primary_ns[stream.stamps.primary_ns != UNSET]
    return int(known[0]), int(known[-1])


def columns_of(recording: Recording, name: str) -> dict[str, np.ndarray]:
    pieces = list(recording.samples(name))
    return {key: np.concatenate([p.columns[key] for p in pieces]) for key in pieces[0].columns}


def utc(text: str) -> int:
    """An ISO time as its calendar reads [ns]."""
    moment = datetime.fromisoformat(text).replace(tzinfo=UTC)
    return int(moment.timestamp()) * SECOND + moment.microsecond * 1000


def week(number: int, seconds: float) -> int:
    """A GPS week and its seconds, by the calendar [ns]."""
    return utc("1980-01-06") + round((number * 604_800 + seconds) * 1000) * 1_000_000


class Fact(NamedTuple):
    """Of one stream: timeline, messages, first and last stamp [ns], None where it has no times."""

    timeline: str
    messages: int
    first: int | None = None
    last: int | None = None


BOOT_US = 1000
FACTS: dict[str, tuple[int, dict[str, Fact]]] = {  # streams, and facts of some
    "dataflash/sample.bin": (52, {
        "GPS": Fact("boot", 365, 208734295 * BOOT_US, 909334550 * BOOT_US),
        "GPA": Fact("boot", 365, 208734295 * BOOT_US, 909334550 * BOOT_US),
        "ATT": Fact("boot", 728, 208674420 * BOOT_US, 909274534 * BOOT_US),
        "IMU": Fact("boot", 1820, 208659484 * BOOT_US, 909299881 * BOOT_US),
    }),
    "nmea/hemi.log": (5, {
        "GPHDT": Fact("unknown", 215), "GPGGA": Fact("utc", 215), "GPVTG": Fact("unknown", 215),
        "GPZDA": Fact("utc", 108, utc("2018-09-07T19:39:13"), utc("2018-09-07T19:41:00")),
    }),
    "nmea/bundg_zeus_9.log": (23, {
        "SDHDG": Fact("unknown", 1457), "WIMWV": Fact("unknown", 300),
        "GPZDA": Fact("utc", 154, utc("2018-08-20T09:47:37"), utc("2018-08-20T09:50:03")),
    }),
    "nmea/gp-320fw_overflow.log": (8, {
        "GPRMC": Fact("utc", 20, utc("2019-04-06T23:57:24.02"), utc("2019-04-06T23:57:43.02")),
        "GPGGA": Fact("utc", 20), "GPGSV": Fact("unknown", 50), "GPZDA": Fact("utc", 2),
    }),
    "nmea/gp-320fw_coldboot.log": (8, {
        "GPRMC": Fact("utc", 12, utc("2019-04-07T00:03:45.03"), utc("1999-08-22T00:04:35")),
        "GPGGA": Fact("utc", 9), "GPGSV": Fact("unknown", 27), "GPVTG": Fact("unknown", 10),
    }),
    "nmea/skytraq-dgps.log": (12, {
        "GPRMC": Fact("utc", 96, utc("2016-04-07T21:31:21"), utc("2016-04-07T21:32:56")),
        "PSTI": Fact("unknown", 96), "BDGSV": Fact("unknown", 32), "fix": Fact("utc", 96),
    }),
    "nmea/ublox-zed-f9p-nmea.log": (13, {
        "GNRMC": Fact("utc", 29, utc("2019-04-12T00:39:56"), utc("2019-04-12T00:40:24")),
        "GNGST": Fact("utc", 29), "GNGSA": Fact("unknown", 116), "fix": Fact("utc", 29),
    }),
    "nmea/sounder.log": (3, {"SDDBT": Fact("unknown", 122), "ECGLL": Fact("unknown", 122)}),
    "nmea/tnt-revolution.log": (2, {
        "PTNTHTM": Fact("unknown", 50), "HCXDR": Fact("unknown", 10),
    }),
    "nmea/ac12.log": (6, {
        "GPRMC": Fact("utc", 7, utc("2007-12-23T19:32:21"), utc("2007-12-23T19:32:27")),
    }),
    "nmea/trimble_nmea.log": (16, {
        "PTNLAVR": Fact("utc", 2), "PTNLDG": Fact("unknown", 2), "PGPPADV": Fact("unknown", 2),
        "PTNLGGK": Fact("utc", 1, utc("2010-05-19T10:29:39"), utc("2010-05-19T10:29:39")),
    }),
    "ubx/SF-calibration.log": (9, {
        "NAV-PVAT": Fact("gps", 527, week(2415, 136153), week(2415, 136679)),
        "NAV-ATT": Fact("gps", 527, week(2415, 136153), week(2415, 136679)),
        "ESF-STATUS": Fact("gps", 527), "MGA-SF-INI2": Fact("unknown", 10),
    }),
    "ubx/mon_span.ubx": (61, {
        "HNR-PVT": Fact("gps", 13), "ESF-MEAS": Fact("boot", 19),
        "NAV-TIMEUTC": Fact("gps", 1, utc("2021-11-12T16:53:17"), utc("2021-11-12T16:53:17")),
    }),
    "ubx/serial-COM3.ubx": (14, {"GNGSA": Fact("unknown", 247), "GNRMC": Fact("utc", 90)}),
    "ubx/ublox-8-time.log": (5, {
        "NAV-SOL": Fact("gps", 89, week(1977, 494575), week(1977, 494663)),
        "NAV-DOP": Fact("gps", 89, week(1977, 494575), week(1977, 494663)),
        "NAV-TIMEGPS": Fact("gps", 88),
    }),
    "ubx/ublox-zed-f9p-hp.log": (11, {
        "NAV-PVT": Fact("gps", 29, week(2050, 163178), week(2050, 163206)),
        "NAV-HPPOSLLH": Fact("gps", 29), "NAV-SAT": Fact("gps", 3),
    }),
    "ubx/ubx_20080526.ubx": (11, {"RXM-RAW": Fact("gps", 242), "GPGSV": Fact("unknown", 869)}),
    "gpsd/hemi.json": (2, {
        "TPV": Fact("utc", 215, utc("2018-09-07T19:39:13"), utc("2018-09-07T19:41:00")),
        "ATT": Fact("unknown", 4),
    }),
    "gpsd/ublox-8-time.json": (2, {
        "TPV": Fact("utc", 132, utc("2017-12-01T17:22:37"), utc("2017-12-01T17:24:05")),
        "SKY": Fact("unknown", 9),
    }),
    "gpsd/ublox-zed-f9p-hp.json": (2, {
        "TPV": Fact("utc", 29, utc("2019-04-22T21:19:20"), utc("2019-04-22T21:19:48")),
        "SKY": Fact("unknown", 3),
    }),
    "pos/rover_1Hz_rtk.pos": (1, {
        "rover_1Hz_rtk":
            Fact("gps", 531, utc("2023-07-11T06:04:32"), utc("2023-07-11T06:25:00")),
    }),
    "pos/reference_1Hz.pos": (1, {
        "reference_1Hz":
            Fact("gps", 1231, utc("2023-07-11T06:04:30"), utc("2023-07-11T06:25:00")),
    }),
    "pos/reference.csv": (1, {
        "reference": Fact("gps", 6151, week(2270, 194670), week(2270, 195900)),
    }),
    "pos/static_rover_rtk.pos": (1, {
        "static_rover_rtk":
            Fact("gps", 301, utc("2024-06-24T08:20:00"), utc("2024-06-24T08:25:00")),
    }),
    "pos/demo5_b34f_f.pos": (1, {
        "demo5_b34f_f":
            Fact("gps", 4521, utc("2020-12-24T21:28:42"), utc("2020-12-24T22:44:02")),
    }),
    "pos/py_0315f.pos": (1, {
        "py_0315f": Fact("gps", 4521, week(2137, 422922), week(2137, 427442)),
    }),
    "pos/emlid.LLH": (1, {
        "emlid":
            Fact("gps", 6034, utc("2023-08-12T11:29:48.195"), utc("2023-08-12T11:50:00.800")),
    }),
    "sbet/sbet.out": (1, {"sbet": Fact("unknown", 200, 400825001312999, 400825996531678)}),
    "sbet/badfile.sbet": (1, {"badfile": Fact("unknown", 1)}),
    "las/points.las": (1, {"points": Fact("unknown", 1325, 400825805719320, 400825123609730)}),
    "las/4_6_crop.las": (1, {"4_6_crop": Fact("gps", 23875)}),
    "las/autzen_trim.laz": (1, {
        "autzen_trim": Fact("unknown", 110000, 245379398436825, 245385911121045),
    }),
    "las/warsaw_small.las": (1, {"warsaw_small": Fact("gps", 3000)}),
    "las/mvk-thin.las": (1, {"mvk-thin": Fact("unknown", 6280)}),
    "las/gps-time-nan.las": (1, {"gps-time-nan": Fact("unknown", 1)}),
    "las/1.2-with-color.copc.laz": (1, {
        "1.2-with-color.copc": Fact("unknown", 1065, 245385571273216, 249400700279548),
    }),
    "las/1_4_w_evlr.laz": (1, {"1_4_w_evlr": Fact("gps", 1000)}),
    "lidar/OS-1-32-G.pcap": (1, {
        "udp 7502 lidar": Fact("boot", 64, 3577133606620, 3577232055240),
    }),
    "lidar/OS-0-32-U1.pcap": (2, {
        "udp 7502 lidar": Fact("boot", 64, 515816892860, 515915224230),
        "udp 7503 imu": Fact("boot", 10, 515838794380),
    }),
    "lidar/OS-1-128.pcap": (2, {
        "udp 7502 lidar": Fact("boot", 8, 647839983424, 647850935832),
        "udp 7503 imu": Fact("boot", 2),
    }),
    "lidar/novatel_bestpos.pcap": (4, {"tcp 3001": Fact("utc", 66)}),
    "trajectory/v2_03_mono.txt": (1, {
        "v2_03_mono": Fact("utc", 1905, 1413394881555760384, 1413394996605760574),
    }),
    "trajectory/v2_03_stereo.txt": (1, {
        "v2_03_stereo": Fact("utc", 1921, 1413394881605760574, 1413394998305760384),
    }),
    "trajectory/mh_01_ba.txt": (1, {
        "mh_01_ba": Fact("utc", 107, 1403636580063560000, 1403636741713560000),
    }),
    "trajectory/kitti_example_1_09.txt": (1, {"kitti_example_1_09": Fact("unknown", 1591)}),
}  # fmt: skip


@pytest.mark.parametrize("name", FACTS)
def test_what_the_formats_own_libraries_find(name: str) -> None:
    count, facts = FACTS[name]
    _, streams = streams_of(name)
    assert len(streams) == count
    for which, fact in facts.items():
        stream = streams[which]
        assert (stream.timeline, stream.messages) == (fact.timeline, fact.messages), which
        for expected, found in zip(
            (fact.first, fact.last), ends_of(stream) if fact.first else (0, 0), strict=True
        ):
            if expected is not None:
                near = NEAR_NS if name.startswith("ubx") else 0
                assert abs(found - expected) <= near, which


def test_counts_of_whole_logs() -> None:
    """Sentences, messages and packets in all, as the libraries count them."""
    found = {}
    for name in FACTS:
        if name.startswith(("nmea", "ubx", "dataflash")):
            streams = streams_of(name)[1].values()
            found[name] = sum(s.messages for s in streams if s.name != "fix")
    assert found == {
        **{"dataflash/sample.bin": 24837, "nmea/hemi.log": 753, "nmea/bundg_zeus_9.log": 4999},
        **{"nmea/gp-320fw_overflow.log": 141, "nmea/gp-320fw_coldboot.log": 86},
        **{"nmea/skytraq-dgps.log": 1024, "nmea/ublox-zed-f9p-nmea.log": 1015},
        **{"nmea/sounder.log": 244, "nmea/tnt-revolution.log": 60, "nmea/ac12.log": 51},
        "nmea/trimble_nmea.log": 21,
        **{"ubx/SF-calibration.log": 1621, "ubx/mon_span.ubx": 109, "ubx/ublox-8-time.log": 284},
        "ubx/serial-COM3.ubx": 951 + 27,  # and the commands sent (CFG-VALSET), which are valid too
        **{"ubx/ublox-zed-f9p-hp.log": 293, "ubx/ubx_20080526.ubx": 3647},
    }


def test_the_faults_that_are_in_the_files_are_said() -> None:
    def notes(name: str, stream: str) -> str:
        return "; ".join(streams_of(name)[1][stream].notes)

    assert "1024 weeks" in notes("nmea/gp-320fw_coldboot.log", "GPRMC")
    assert "values are larger than any" in notes("las/4_6_crop.las", "4_6_crop")
    assert "1 points have no finite time" in notes("las/gps-time-nan.las", "gps-time-nan")
    assert "767 steps back" in notes("las/points.las", "points")
    assert "TIME_FROM_INTERNAL_OSC" in notes("lidar/OS-1-128.pcap", "udp 7502 lidar")
    assert "names no time system" in notes("pos/emlid.LLH", "emlid")
    assert "without a day" in notes("nmea/sounder.log", "ECGLL")
    for name, reason in (
        ("sbet/badfile.sbet", "135 bytes at the end"),
        ("nmea/gp-320fw_coldboot.log", "checksum is wrong"),
        ("ubx/ublox-8-time.log", "cut"),
    ):
        recording, streams = streams_of(name)
        assert all(stream.partial for stream in streams.values())
        assert recording.incomplete is not None
        assert reason in recording.incomplete.reason


def test_days_of_clouds_with_standard_time() -> None:
    """The first stamps of the sorted times, by the calendar of GPS."""
    for name, day in (
        ("las/4_6_crop.las", "2014-04-15T16:56:41"),
        ("las/warsaw_small.las", "2018-04-04T07:04:05"),
        ("las/1_4_w_evlr.laz", "2014-05-03T18:37:00"),
    ):
        (stream,) = streams_of(name)[1].values()
        assert stream.stamps is not None
        assert int(stream.stamps.primary_ns.min()) // SECOND == utc(day) // SECOND


def test_the_boot_clock_of_a_flight_against_gps() -> None:
    recording, _ = streams_of("dataflash/sample.bin")
    gps = np.concatenate([p.columns["clock_gps_ns"] for p in recording.samples("GPS")])
    boot = np.concatenate([p.primary_ns for p in recording.samples("GPS")])
    apart = (gps - utc("1980-01-06") - boot) / SECOND
    assert np.median(apart) == pytest.approx(1237733407.866, abs=0.02)
    assert np.ptp(apart) == pytest.approx(0.040, abs=0.002)


def test_velocities_of_an_sbet_are_the_slope_of_its_positions() -> None:
    recording, _ = streams_of("sbet/sbet.out")
    f = columns_of(recording, "sbet")
    origin = (f["latitude_deg"][0], f["longitude_deg"][0], f["height_m"][0])
    ned = np.stack(geodetic2ned(f["latitude_deg"], f["longitude_deg"], f["height_m"], *origin))
    stamps = next(iter(recording.samples("sbet"))).primary_ns
    slope = (ned[:, -1] - ned[:, 0]) / ((stamps[-1] - stamps[0]) / SECOND)
    velocity = [f[f"velocity_{axis}_mps"].mean() for axis in ("north", "east", "down")]
    assert np.allclose(slope, velocity, atol=4e-3)


def test_two_notations_of_one_drive_are_the_same_moments() -> None:
    by_date = streams_of("pos/demo5_b34f_f.pos")[1]["demo5_b34f_f"].stamps
    by_week = streams_of("pos/py_0315f.pos")[1]["py_0315f"].stamps
    assert by_date is not None
    assert by_week is not None
    assert np.array_equal(by_date.primary_ns, by_week.primary_ns)


def test_high_precision_positions_are_joined_in_a_real_log() -> None:
    recording, _ = streams_of("ubx/ublox-zed-f9p-hp.log")
    joined, fine = columns_of(recording, "NAV-PVT"), columns_of(recording, "NAV-HPPOSLLH")
    assert np.array_equal(joined["latitude_deg"], fine["latitude_deg"])
    assert np.any(np.abs(joined["latitude_deg"] * 1e7 % 1 - 0.5) < 0.4)  # digits beyond 1e-7


def test_what_a_receiver_sends_and_when_it_arrived() -> None:
    _, streams = streams_of("lidar/novatel_bestpos.pcap")
    stamps = streams["tcp 3001 BESTPOS"].stamps
    assert stamps is not None
    assert stamps.secondary_ns is not None
    late_s = (stamps.secondary_ns - stamps.primary_ns) / SECOND + 18  # GPS is ahead of UTC
    assert np.all((late_s > 0) & (late_s < 0.02))
