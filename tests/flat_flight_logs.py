"""Writers of the simulated flight of `flight_logs` in flat formats: receivers, trajectories, SBET.

By the formats' own libraries where they have one that writes (pyubx2), else by their public
descriptions; conventions are those of the formats.
"""

from __future__ import annotations

import struct
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from tests.flight_logs import TO_ENU as ENU
from tests.flight_logs import Flight, geodetic, ros_quaternion
from tests.test_log_dataflash import Kind, fmt, message
from tests.test_log_receivers import sentence

LEAPS = 18
GPS_ZERO = datetime(1980, 1, 6, tzinfo=UTC)
GEOID_M = 48.125
BOOT_NS = 12_345_678_000
WANDER_RAD = 0.7
GPS_ZERO_NS = int(GPS_ZERO.timestamp()) * 10**9
WEEK_NS = 604_800 * 10**9


def moment(ns: int) -> datetime:
    """A UTC stamp, to the microsecond."""
    return datetime.fromtimestamp(ns // 10**9, UTC) + timedelta(microseconds=ns % 10**9 // 1000)


def gps_week(ns: int) -> tuple[int, int]:
    """Week and nanoseconds of it of a UTC stamp."""
    return divmod(ns + LEAPS * 10**9 - GPS_ZERO_NS, WEEK_NS)


def _minutes(degrees: float, width: int) -> str:
    """`4723.8645123`: degrees and minutes with seven decimals."""
    whole = int(abs(degrees))
    return f"{whole:0{width}d}{(abs(degrees) - whole) * 60:010.7f}"


def write_nmea(path: Path, made: Flight) -> Path:
    """GGA and RMC of each epoch, whose times have microseconds."""
    out = []
    for ns, (lat, lon, height), v in zip(
        made.stamp_ns.tolist(), geodetic(made.place).tolist(), made.velocity, strict=True
    ):
        at = moment(ns)
        clock = f"{at:%H%M%S}.{at.microsecond:06d}"
        place = f"{_minutes(lat, 2)},N,{_minutes(lon, 3)},E"
        knots = np.hypot(v[0], v[1]) / (1852 / 3600)
        course = np.degrees(np.arctan2(v[1], v[0])) % 360
        msl = f"{height - GEOID_M:.4f},M,{GEOID_M:.3f},M"
        out.append(sentence(f"GNGGA,{clock},{place},4,20,0.6,{msl},,"))
        out.append(sentence(f"GNRMC,{clock},A,{place},{knots:.6f},{course:.6f},{at:%d%m%y},,,R"))
    path.write_bytes(b"".join(out))
    return path


def write_ubx(path: Path, made: Flight, fine: bool = True) -> Path:
    """NAV-PVT, and NAV-HPPOSLLH beside it; times rounded to the next millisecond and second."""
    from pyubx2 import GET, UBXMessage

    out = []
    for ns, place, v in zip(
        made.stamp_ns.tolist(), geodetic(made.place), made.velocity, strict=True
    ):
        itow = round(gps_week(ns)[1] / 10**6)
        second = round(ns / 10**9)
        at, nano = moment(second * 10**9), ns - second * 10**9
        steps = np.round(place[[1, 0]] * 1e9).astype(int)
        coarse = np.round(steps / 100).astype(int)
        tenths = [round(place[2] * 1e4), round((place[2] - GEOID_M) * 1e4)]
        mm = [round(t / 10) for t in tenths]
        payload = struct.pack(
            "<IHBBBBBBIiBBBBiiiiIIiiiiiIIHHIihH", itow, at.year, at.month, at.day, at.hour,
            at.minute, at.second, 7, 20, nano, 3, 1, 0, 20, *coarse.tolist(), *mm, 14, 20,
            *np.round(v * 1e3).astype(int).tolist(), 0, 0, 50, 0, 100, 0, 0, 0, 0, 0,
        )  # fmt: skip
        out.append(UBXMessage("NAV", "NAV-PVT", GET, payload=payload).serialize())
        if fine:
            rest = [int(s - 100 * c) for s, c in zip(steps, coarse, strict=True)]
            rest += [t - 10 * m for t, m in zip(tenths, mm, strict=True)]
            payload = bytes(4) + struct.pack("<I4i4b2I", itow, *coarse.tolist(), *mm, *rest, 1, 1)
            out.append(UBXMessage("NAV", "NAV-HPPOSLLH", GET, payload=payload).serialize())
    path.write_bytes(b"".join(out))
    return path


def write_pos(path: Path, made: Flight) -> Path:
    """RTKLIB's columns in GPST, with velocity."""
    rows = [
        "% (lat/lon/height=WGS84/ellipsoidal,Q=1:fix,2:float)",
        "%  GPST  latitude(deg) longitude(deg)  height(m)  Q  ns  sdn(m)  sde(m)  sdu(m)  sdne(m)"
        "  sdeu(m)  sdun(m) age(s)  ratio  vn(m/s)  ve(m/s)  vu(m/s)",
    ]
    for ns, (lat, lon, height), v in zip(
        made.stamp_ns.tolist(), geodetic(made.place).tolist(), made.velocity, strict=True
    ):
        at = moment(ns + LEAPS * 10**9)
        clock = f"{at:%Y/%m/%d %H:%M:%S}.{ns % 10**9:09d}"
        rest = "1 19 0.01 0.01 0.02 0 0 0 0.0 5.9"
        speed = f"{v[0]:.5f} {v[1]:.5f} {-v[2]:.5f}"
        rows.append(f"{clock} {lat:.9f} {lon:.9f} {height:.4f} {rest} {speed}")
    path.write_text("\n".join(rows) + "\n", "utf-8")
    return path


def write_sbet(path: Path, made: Flight) -> Path:
    """Seconds of the week by GPS, velocities and heading in the wander frame (x, left, up)."""
    globe = geodetic(made.place)
    euler = made.turn.as_euler("ZYX")
    table = np.zeros((len(made), 17))
    table[:, 0] = [gps_week(ns)[1] / 1e9 for ns in made.stamp_ns.tolist()]
    table[:, 1], table[:, 2], table[:, 3] = *np.radians(globe[:, :2]).T, globe[:, 2]
    # x of the frame at azimuth -wander, y to its left, z up
    north, east, down = made.velocity.T
    table[:, 4] = north * np.cos(WANDER_RAD) - east * np.sin(WANDER_RAD)
    table[:, 5] = -north * np.sin(WANDER_RAD) - east * np.cos(WANDER_RAD)
    table[:, 6] = -down
    table[:, 7], table[:, 8] = euler[:, 2], euler[:, 1]
    heading = euler[:, 0] + WANDER_RAD
    table[:, 9] = np.arctan2(np.sin(heading), np.cos(heading))
    table[:, 10] = WANDER_RAD
    table[:, 14:17] = made.rate
    path.write_bytes(table.astype("<f8").tobytes())
    return path


def write_tum(path: Path, made: Flight) -> Path:
    """Seconds and xyzw, in east, north, up of a body forward, left, up."""
    rows = [
        f"{ns // 10**9}.{ns % 10**9:09d} " + " ".join(f"{v:.9f}" for v in (*place, *q))
        for ns, place, q in zip(
            made.stamp_ns.tolist(), ENU.apply(made.place), ros_quaternion(made.turn), strict=True
        )
    ]
    path.write_text("# timestamp tx ty tz qx qy qz qw\n" + "\n".join(rows) + "\n", "utf-8")
    return path


def write_euroc(path: Path, made: Flight) -> Path:
    """Nanoseconds and wxyz, velocity behind; the same axes."""
    head = "#timestamp, " + ", ".join(f"p_RS_R_{a} [m]" for a in "xyz")
    head += ", " + ", ".join(f"q_RS_{a} []" for a in "wxyz")
    head += ", " + ", ".join(f"v_RS_R_{a} [m s^-1]" for a in "xyz")
    rows = [
        f"{ns}," + ",".join(f"{v:.9f}" for v in (*place, *q[[3, 0, 1, 2]], *speed))
        for ns, place, q, speed in zip(
            made.stamp_ns.tolist(),
            ENU.apply(made.place),
            ros_quaternion(made.turn),
            ENU.apply(made.velocity),
            strict=True,
        )
    ]
    path.write_text(head + "\n" + "\n".join(rows) + "\n", "utf-8")
    return path


def write_german_csv(path: Path, made: Flight) -> Path:
    """Semicolons, decimal commas, ISO times, a BOM and CRLF."""
    names = "time;Latitude (deg);Longitude (deg);height_mm;roll_deg;pitch_deg;yaw_deg;"
    names += "velocity_north_mps;velocity_east_mps;velocity_down_mps"
    euler = np.degrees(made.turn.as_euler("ZYX"))[:, ::-1]
    rows = ["# a flight", names]
    for k, ns in enumerate(made.stamp_ns.tolist()):
        lat, lon, height = geodetic(made.place[k : k + 1])[0].tolist()
        at = f"{moment(ns):%Y-%m-%dT%H:%M:%S},{ns % 10**9:09d}Z"
        figures = [lat, lon, height * 1e3, *euler[k], *made.velocity[k]]
        rows.append(";".join([at, *(f"{v:.10f}".replace(".", ",") for v in figures)]))
    path.write_bytes(b"\xef\xbb\xbf" + "\r\n".join(rows).encode() + b"\r\n")
    return path


def write_parquet(path: Path, made: Flight) -> Path:
    """The names of a receiver's export, times by their type."""
    import polars as pl

    globe, euler = geodetic(made.place), np.degrees(made.turn.as_euler("ZYX"))
    columns = {"time": pl.Series(made.stamp_ns).cast(pl.Datetime("ns", time_zone="UTC"))}
    for name, values in (
        *zip(("Latitude (deg)", "Longitude (deg)", "height_m"), globe.T, strict=True),
        *zip(("yaw_deg", "pitch_deg", "roll_deg"), euler.T, strict=True),
        *zip((f"velocity_{a}_mps" for a in ("north", "east", "down")), made.velocity.T,
             strict=True),
    ):  # fmt: skip
        columns[name] = pl.Series(values)
    pl.DataFrame(columns).write_parquet(path)
    return path


GPS: Kind = (
    *(130, "GPS", "QBIHBcLLefffB"),
    "TimeUS,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,U",
)
SIM: Kind = (131, "SIM", "QccCfLLffff", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng,Q1,Q2,Q3,Q4")
IMU: Kind = (132, "IMU", "Qffffff", "TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ")


def write_dataflash(path: Path, made: Flight, fixes: Flight) -> Path:
    """A simulation's log: GPS as the receiver says, SIM as it is, both on one boot clock."""
    out = [fmt((128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"))]
    out += [fmt(kind) for kind in (GPS, SIM, IMU)]
    seen, true = geodetic(fixes.place), geodetic(made.place)
    euler = np.degrees(made.turn.as_euler("ZYX"))
    for k, ns in enumerate(made.stamp_ns.tolist()):
        boot = (ns - int(made.stamp_ns[0]) + BOOT_NS) // 1000
        week, tow = gps_week(ns)
        north, east, down = made.velocity[k]
        course = np.degrees(np.arctan2(east, north)) % 360
        place = np.round(seen[k, :2] * 1e7).astype(int).tolist()
        out.append(message(
            GPS, boot, 6, tow // 10**6, week, 20, 60, *place,
            round((seen[k, 2] - GEOID_M) * 100), np.hypot(north, east), course, down, 1,
        ))  # fmt: skip
        turn = np.round(euler[k, ::-1] * 100).astype(int).tolist()
        at = np.round(true[k, :2] * 1e7).astype(int).tolist()
        quaternion = made.turn[k].as_quat()[[3, 0, 1, 2]]
        out.append(message(
            SIM, boot, turn[0], turn[1], turn[2] % 36_000, true[k, 2] - GEOID_M, *at, *quaternion
        ))  # fmt: skip
        out.append(message(IMU, boot, *made.rate[k], 0.0, 0.0, -9.81))
    path.write_bytes(b"".join(out))
    return path
