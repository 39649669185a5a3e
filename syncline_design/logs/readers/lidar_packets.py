"""Packets of lidars and receivers: their own times, told by what the bytes themselves show.

Ouster: firmware manuals (legacy packets: 16 columns of a 16-byte head, pixels of 12 bytes and a
4-byte status; configurable packets: 32 bytes, columns of a 12-byte head, 32 bytes; IMU packets of
48 bytes).  Velodyne: VLP-16 manual 63-9243 (1206 bytes: 12 blocks that begin with FF EE, then
microseconds of the hour; position packets of 512 bytes with an RMC sentence).  NovAtel: OEM7 logs
(AA 44 12, 28 bytes of head with GPS week and milliseconds).
"""

from __future__ import annotations

import struct
import zlib
from typing import Literal

import numpy as np

from syncline_design.logs.readers.epochs import NANO, WEEK_S, week_start_ns
from syncline_design.machine.quick_dataclass import dataclass

COLUMNS = 16  # of an Ouster packet
PIXELS = (16, 32, 64, 128)
PIXEL_BYTES = (4, 8, 12, 16)  # of the configurable profiles
LEGACY = {COLUMNS * (16 + 12 * pixels + 4): 16 + 12 * pixels + 4 for pixels in PIXELS}
CONFIGURABLE = {
    32 + COLUMNS * (12 + size * pixels) + 32: 12 + size * pixels
    for pixels in PIXELS
    for size in PIXEL_BYTES
}
OUSTER_IMU, VELODYNE, VELODYNE_POSITION = 48, 1206, 512
GRAVITY_MPS2 = 9.80665
HOUR_NS = 3600 * NANO
NOVATEL_SYNC = b"\xaaD\x12"
NOVATEL_HEAD = 28
NOVATEL_NAMES = {
    **{42: "BESTPOS", 99: "BESTVEL", 174: "PSRDOP", 1163: "PSRDOP2", 37: "RXSTATUS", 101: "TIME"},
    **{140: "RANGECMP", 43: "RANGE", 47: "PSRPOS", 241: "BESTXYZ", 507: "INSPVA", 508: "INSPVAS"},
    **{1465: "INSPVAX", 263: "INSATT", 265: "INSPOS", 267: "INSVEL", 325: "RAWIMUS"},
    **{268: "RAWIMU", 971: "HEADING", 1335: "HEADING2", 411: "BESTSATS", 1194: "BESTSATS"},
    **{726: "BESTUTM", 812: "CORRIMUDATA", 813: "CORRIMUDATAS"},
}
Kind = Literal["ouster", "ouster_imu", "velodyne", "velodyne_position"]


@dataclass(frozen=True, slots=True)
class Packet:
    """The times of one packet [ns]: of its first and last column, and more where it has them."""

    kind: Kind
    first_ns: int
    last_ns: int
    frame: int = -1
    figures: tuple[float, ...] = ()


def packet_of(payload: bytes) -> Packet | None:
    """What a UDP payload is; None where it is no packet of a lidar that is known here."""
    size = len(payload)
    if size == OUSTER_IMU:
        return _ouster_imu(payload)
    if size == VELODYNE:
        return _velodyne(payload)
    if size == VELODYNE_POSITION:
        return _velodyne_position(payload)
    if size in LEGACY:
        found = _ouster_columns(payload, 0, LEGACY[size], 16)
        if found is not None:
            return found
    if size in CONFIGURABLE:
        frame = struct.unpack_from("<H", payload, 2)[0]
        return _ouster_columns(payload, 32, CONFIGURABLE[size], 12, frame)
    return None


def _ouster_columns(
    payload: bytes, start: int, step: int, head: int, frame: int = -1
) -> Packet | None:
    """Times of the columns, if their numbers count up by one and their times do not fall."""
    places = start + step * np.arange(COLUMNS)
    raw = np.frombuffer(payload, dtype=np.uint8)
    heads = raw[places[:, None] + np.arange(head)]
    times = np.ascontiguousarray(heads[:, :8]).view("<u8")[:, 0]
    numbers = np.ascontiguousarray(heads[:, 8:10]).view("<u2")[:, 0].astype(int)
    if head == 16:
        frame = int(np.ascontiguousarray(heads[:, 10:12]).view("<u2")[0, 0])
    if np.any(np.diff(numbers) != 1) or numbers[-1] > 4096:
        return None
    # a column that was lost on the way has no time
    known = times[times > 0]
    if not known.shape[0] or np.any(np.diff(known.astype(np.int64)) < 0):
        return None
    if times[0] == 0 or int(known.max()) >= 2**63:
        return None
    return Packet("ouster", int(times[0]), int(known[-1]), frame)


def _ouster_imu(payload: bytes) -> Packet | None:
    system, acceleration, gyro = struct.unpack_from("<3Q", payload, 0)
    figures = struct.unpack_from("<6f", payload, 24)
    spread = max(system, acceleration, gyro) - min(system, acceleration, gyro)
    if not 0 < max(system, acceleration, gyro) < 2**63 or spread > NANO:
        return None
    if not all(np.isfinite(figures)) or max(abs(f) for f in figures) > 1e4:
        return None
    return Packet("ouster_imu", acceleration, gyro, figures=(system, *figures))


def _velodyne(payload: bytes) -> Packet | None:
    if any(payload[100 * k : 100 * k + 2] != b"\xff\xee" for k in range(12)):
        return None
    (micros,) = struct.unpack_from("<I", payload, 1200)
    if micros >= 3_600_000_000 + 1_000_000:  # a second 60 at the end of the hour
        return None
    return Packet("velodyne", micros * 1000, micros * 1000)


def _velodyne_position(payload: bytes) -> Packet | None:
    (micros,) = struct.unpack_from("<I", payload, 198)
    if b"$GPRMC" not in payload[206:] or micros >= 3_600_000_000 + 1_000_000:
        return None
    return Packet("velodyne_position", micros * 1000, micros * 1000, figures=(payload[202],))


def of_hour(of_hour_ns: int, captured_ns: int) -> int:
    """Time of the hour with the hour that is nearest to when the packet was captured [ns]."""
    hour = captured_ns - captured_ns % HOUR_NS + of_hour_ns
    return hour + HOUR_NS * round((captured_ns - hour) / HOUR_NS)


@dataclass(slots=True)
class NovatelStream:
    """Binary logs of NovAtel receivers in the bytes of a connection."""

    _held: bytes = b""

    def feed(self, payload: bytes) -> list[tuple[str, int]]:
        """Name and GPS time [ns] of every log that is whole now."""
        self._held += payload
        found: list[tuple[str, int]] = []
        while True:
            at = self._held.find(NOVATEL_SYNC)
            if at < 0:
                self._held = self._held[-2:]
                return found
            log = self._held[at:]
            if len(log) < NOVATEL_HEAD:
                self._held = log
                return found
            number, length = struct.unpack_from("<H2xH", log, 4)
            size = log[3] + length + 4
            if log[3] < NOVATEL_HEAD:
                self._held = log[3:]
                continue
            if len(log) < size:
                self._held = log
                return found
            if _crc32(log[: size - 4]) == int.from_bytes(log[size - 4 : size], "little"):
                name = NOVATEL_NAMES.get(number, f"log {number}")
                found.append((name, _gps_ns(*struct.unpack_from("<HI", log, 14))))
                self._held = log[size:]
            else:
                self._held = log[NOVATEL_HEAD:]


def _gps_ns(week: int, milliseconds: int) -> int:
    return week_start_ns(week) + min(milliseconds, WEEK_S * 1000) * 1_000_000


def _crc32(raw: bytes) -> int:
    """CRC-32 with the reflected polynomial EDB88320, begun at 0 and not inverted."""
    return zlib.crc32(raw, 0xFFFFFFFF) ^ 0xFFFFFFFF
