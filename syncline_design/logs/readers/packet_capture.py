"""Captures of network packets (pcap, pcapng): what lidars and receivers stamped, and the capture.

dpkt unpacks capture, Ethernet and IP; fragments are joined here.  Every flow is a stream; its
packets' own time is the stamp, the capture's time is when they arrived.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import field
from decimal import Decimal
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from syncline_design.logs.readers import lidar_packets
from syncline_design.logs.readers.batches import Batch, BatchRecording, StreamFacts, Tally
from syncline_design.logs.readers.epochs import held as held_ns
from syncline_design.logs.readers.lidar_packets import NovatelStream, Packet, packet_of
from syncline_design.logs.readers.reader import BY_MAGIC, NO, FileHead, Reader, library
from syncline_design.logs.readers.stream import PointTimes, Recording, Timeline
from syncline_design.logs.readers.timelines import timeline_of
from syncline_design.logs.refusals import refuse
from syncline_design.machine.quick_dataclass import dataclass

FORMAT = "packet capture"
MAGICS = frozenset(
    bytes.fromhex(text) for text in ("d4c3b2a1", "a1b2c3d4", "4d3cb2a1", "a1b23c4d", "0a0d0d0a")
)
MOST_PACKET = 1 << 20  # bytes; the largest that IP allows is a sixteenth of it
MOST_PARTS = 64  # datagrams of which fragments are held
MOST_ROWS = 20_000
ETHERNET, LOOPBACK, RAW, SLL = 1, (0, 108), (12, 14, 101), (113, 276)
CAPTURED = "capture time"
MODE = re.compile(rb'"timestamp_mode"\s*:\s*"([A-Z_0-9]+)"')
LOCKED = 2  # Velodyne's PPS status: 0 absent, 1 attempting, 2 locked, 3 error
IMU_COLUMNS = (
    *(f"acceleration_{a}_mps2" for a in "xyz"),
    *(f"rate_{a}_degps" for a in "xyz"),
    *("clock_gyro_ns", "clock_system_ns"),
)
WORDS = {
    "ouster": ("lidar", "Ouster lidar packet"),
    "ouster_imu": ("imu", "Ouster IMU packet"),
    "velodyne": ("lidar", "Velodyne data packet"),
    "velodyne_position": ("position", "Velodyne position packet"),
}


class CappedFile:
    """A file that gives no absurd piece; short: whether it ended within a piece."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self.short = False
        self.absurd = 0
        self.name = getattr(file, "name", "")

    def read(self, size: int = -1) -> bytes:
        if size > MOST_PACKET or size < 0:
            self.absurd = size
            return b""
        raw = self._file.read(size)
        self.short = self.short or 0 < len(raw) < size or (not raw and size > 0 and self._within)
        self._within = bool(raw) and size <= 24  # the head of a packet was read, its data follow
        return raw

    _within = False

    def seek(self, *where: int) -> int:
        return self._file.seek(*where)

    def tell(self) -> int:
        return self._file.tell()


@dataclass(slots=True)
class _Rows:
    stamps: list[int] = field(default_factory=list)
    captured: list[int] = field(default_factory=list)
    values: list[tuple[float, ...]] = field(default_factory=list)


@dataclass(slots=True)
class _Seen:
    """What is known of a stream after a pass."""

    kind: str
    own: bool  # whether the packets say a time
    first: list[int] = field(default_factory=list)  # some stamps
    spans: list[int] = field(default_factory=list)  # of packets, first to last column [ns]
    locked: bool = False


class CaptureRecording(BatchRecording):
    """One capture, packet by packet."""

    format = FORMAT

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._dpkt = library("dpkt", path, FORMAT)
        self._seen: dict[str, _Seen] = {}
        self._single: set[str] = set()
        self._mode = _timestamp_mode(path)

    def _tallied(self) -> dict[str, Tally]:
        """One source alone needs no address."""
        tallies = super()._tallied()
        if not tallies:
            raise refuse(self.path, "no packet with data in the capture")
        flows = [name.partition(" from ")[0] for name in tallies]
        self._single = {flow for flow in flows if flows.count(flow) == 1}
        return {self._named(name): tally for name, tally in tallies.items()}

    def _named(self, name: str) -> str:
        flow = name.partition(" from ")[0]
        return flow if flow in self._single else name

    def _batches(self, wanted: str | None) -> Iterator[Batch]:
        self._seen = {}
        held: dict[str, _Rows] = {}
        flows: dict[tuple[bytes, bytes, int, int], NovatelStream] = {}
        for count, one in enumerate(self._payloads(), start=1):
            captured_ns, protocol, ports, ends, payload = one
            source = f" from {_address(ends[0])}"
            if protocol == "udp":
                self._take_datagram(f"udp {ports[1]}", source, payload, captured_ns, held)
            else:
                self._take_capture(f"tcp {ports[0]}{source}", "TCP segment", captured_ns, held)
                flow = flows.setdefault((*ends, *ports), NovatelStream())
                for log, stamp in flow.feed(payload):
                    name = f"tcp {ports[0]} {log}{source}"
                    seen = self._seen.setdefault(name, _Seen(f"NovAtel {log}", True))
                    self._add(seen, held.setdefault(name, _Rows()), stamp, captured_ns, ())
            if count % MOST_ROWS == 0:
                yield from self._emptied(held, wanted)
        yield from self._emptied(held, wanted)

    def _emptied(self, held: dict[str, _Rows], wanted: str | None) -> Iterator[Batch]:
        for name in list(held):
            rows = held.pop(name)
            if wanted is not None and self._named(name) != wanted:
                continue
            primary = np.array(rows.stamps, dtype=np.int64)
            captured = np.array(rows.captured, dtype=np.int64) if self._seen[name].own else None
            columns = _columns(self._seen[name].kind, rows)
            shown = name if wanted is None else self._named(name)
            yield Batch(shown, primary.shape[0], primary, captured, columns)

    def _take_datagram(
        self, flow: str, source: str, payload: bytes, captured_ns: int, held: dict[str, _Rows]
    ) -> None:
        packet = packet_of(payload)
        if packet is None:
            self._take_capture(flow + source, "UDP datagram", captured_ns, held)
            return
        name = f"{flow} {WORDS[packet.kind][0]}{source}"
        seen = self._seen.setdefault(name, _Seen(packet.kind, True))
        stamp = packet.first_ns
        if packet.kind.startswith("velodyne"):
            stamp = lidar_packets.of_hour(stamp, captured_ns)
        if packet.kind == "velodyne_position":
            locked = int(packet.figures[0]) == LOCKED
            for other in self._seen.values():
                other.locked = other.locked or (locked and other.kind.startswith("velodyne"))
        if packet.kind == "ouster" and len(seen.spans) < 1000:
            seen.spans.append(packet.last_ns - packet.first_ns)
        self._add(seen, held.setdefault(name, _Rows()), stamp, captured_ns, _values(packet))

    def _take_capture(self, name: str, kind: str, captured_ns: int, held: dict[str, _Rows]) -> None:
        """Packets that say nothing of their time."""
        seen = self._seen.setdefault(name, _Seen(kind, False))
        self._add(seen, held.setdefault(name, _Rows()), captured_ns, captured_ns, ())

    def _add(
        self, seen: _Seen, rows: _Rows, stamp: int, captured_ns: int, values: tuple[float, ...]
    ) -> None:
        if len(seen.first) < 1000:
            seen.first.append(held_ns(stamp))
        rows.stamps.append(held_ns(stamp))
        rows.captured.append(held_ns(captured_ns))
        rows.values.append(values)

    def _payloads(
        self,
    ) -> Iterator[tuple[int, str, tuple[int, int], tuple[bytes, bytes], bytes]]:
        """Capture time, protocol, ports, addresses and data of every packet that carries any."""
        fragments = _Fragments()
        packets = damaged = 0
        with self.path.open("rb") as raw:
            file = CappedFile(raw)
            for captured_ns, link, frame in self._frames(file):
                packets += 1
                try:
                    found = _unpacked(self._dpkt, link, frame, fragments)
                except Exception:  # dpkt raises many kinds on bytes that are no packet
                    damaged += 1
                    continue
                if found is not None and found[3]:
                    yield (captured_ns, *found)
        if file.absurd:
            self._cut(f"a packet of {file.absurd} bytes", packets)
        elif file.short:
            self._cut("the last packet is cut", packets)
        elif damaged and not self._ended:
            self._cut(f"{damaged} packets could not be unpacked", packets)

    def _frames(self, file: CappedFile) -> Iterator[tuple[int, int, bytes]]:
        count = 0
        try:
            reader = self._dpkt.pcap.UniversalReader(file)
            link = int(reader.datalink())
            for at, frame in reader:
                if file.short or file.absurd:
                    return
                count += 1
                yield _nanoseconds(at), link, bytes(frame)
        except Exception as error:  # the file's fault, whichever way dpkt says it
            said = (str(error).splitlines() or [type(error).__name__])[0][:120]
            if not count and not file.short:
                raise refuse(self.path, "no readable packet capture", found=said) from None
            if not file.short:
                self._cut(f"the capture cannot be read on: {said}", count)

    def _facts(self, name: str) -> StreamFacts:
        full = next(n for n in self._seen if self._named(n) == name)
        seen = self._seen[full]
        first = np.array(seen.first, dtype=np.int64)
        if not seen.own:
            timeline, notes = timeline_of(first, "utc")
            told = ("its packets say no time that is known here: stamps are those of the capture",)
            return StreamFacts(
                timeline=timeline, primary=CAPTURED, notes=(*told, *notes), kind=seen.kind
            )
        timeline, notes = self._timeline(seen, first)
        points = None
        if seen.spans:
            points = PointTimes(0.0, float(np.median(seen.spans)) / 1e9, len(seen.spans))
        imu = seen.kind == "ouster_imu"
        return StreamFacts(
            quantity=("rate", "acceleration", "clock") if imu else (),
            timeline=timeline,
            primary="acceleration time" if imu else "GPS time" if timeline == "gps" else "packet",
            secondary=CAPTURED,
            notes=notes,
            kind=WORDS.get(seen.kind, ("", seen.kind))[1],
            nature="measured" if imu else "unknown",
            points=points,
        )

    def _timeline(self, seen: _Seen, first: NDArray[np.int64]) -> tuple[Timeline, tuple[str, ...]]:
        if seen.kind.startswith("NovAtel"):
            return "gps", ("stamps are the GPS times of the logs, arrival is UTC of the capture",)
        if seen.kind.startswith("velodyne"):
            hour = "packets say microseconds of the hour: the hour is that nearest to the capture"
            if seen.locked:
                return "utc", (hour, "position packets say that the PPS is locked")
            return "unknown", (hour, "no position packet says that a PPS is locked")
        if self._mode == "TIME_FROM_INTERNAL_OSC":
            return "boot", ("timestamp_mode TIME_FROM_INTERNAL_OSC, by the metadata beside it",)
        claimed: Timeline = "tai" if self._mode == "TIME_FROM_PTP_1588" else "unknown"
        timeline, notes = timeline_of(first, claimed)
        if self._mode:
            notes = (*notes, f"timestamp_mode {self._mode}, by the metadata beside it")
        return timeline, notes


class _Fragments:
    """IP datagrams in parts, until they are whole."""

    def __init__(self) -> None:
        self._parts: dict[tuple[bytes, bytes, int, int], dict[int, bytes]] = {}
        self._ends: dict[tuple[bytes, bytes, int, int], int] = {}

    def joined(self, ip: Any) -> bytes | None:
        """The data of a datagram; None while parts are missing."""
        offset, more = 8 * int(ip.offset), bool(ip.mf)
        data = bytes(ip.data)
        if not offset and not more:
            return data
        key = (bytes(ip.src), bytes(ip.dst), int(ip.id), int(ip.p))
        if key not in self._parts and len(self._parts) >= MOST_PARTS:
            oldest = next(iter(self._parts))
            self._parts.pop(oldest)
            self._ends.pop(oldest, None)
        parts = self._parts.setdefault(key, {})
        parts[offset] = data
        if not more:
            self._ends[key] = offset + len(data)
        end = self._ends.get(key)
        if end is None or sum(len(part) for part in parts.values()) < end:
            return None
        whole = b"".join(parts[at] for at in sorted(parts))
        self._parts.pop(key)
        self._ends.pop(key)
        return whole[:end]


def _unpacked(
    dpkt: Any, link: int, frame: bytes, fragments: _Fragments
) -> tuple[str, tuple[int, int], tuple[bytes, bytes], bytes] | None:
    """Protocol, ports, addresses and data of a frame; None where it is neither UDP nor TCP."""
    ip: Any
    if link == ETHERNET:
        ip = dpkt.ethernet.Ethernet(frame).data
    elif link in SLL:
        ip = (dpkt.sll.SLL if link == SLL[0] else dpkt.sll2.SLL2)(frame).data
    elif link in LOOPBACK:
        ip = dpkt.loopback.Loopback(frame).data
    elif link in RAW:
        ip = (dpkt.ip6.IP6 if frame[0] >> 4 == 6 else dpkt.ip.IP)(frame)
    else:
        return None
    if isinstance(ip, dpkt.ip.IP):
        data = fragments.joined(ip)
        protocol = int(ip.p)
    elif isinstance(ip, dpkt.ip6.IP6):
        data, protocol = bytes(ip.data), int(ip.nxt)
    else:
        return None
    if data is None:
        return None
    ends = (bytes(ip.src), bytes(ip.dst))
    if protocol == dpkt.ip.IP_PROTO_UDP:
        udp = dpkt.udp.UDP(data)
        return "udp", (udp.sport, udp.dport), ends, bytes(udp.data)
    if protocol == dpkt.ip.IP_PROTO_TCP:
        tcp = dpkt.tcp.TCP(data)
        return "tcp", (tcp.sport, tcp.dport), ends, bytes(tcp.data)
    return None


def _nanoseconds(at: float | Decimal) -> int:
    """dpkt gives floats where a capture counts microseconds, decimals where nanoseconds."""
    if isinstance(at, Decimal):
        return int(at * 1_000_000_000)
    return round(at * 1_000_000) * 1000


def _values(packet: Packet) -> tuple[float, ...]:
    if packet.kind == "ouster_imu":
        system, *figures = packet.figures
        return (*figures, packet.last_ns, system)
    if packet.kind == "ouster":
        return (packet.frame, packet.last_ns)
    return ()


def _columns(kind: str, rows: _Rows) -> dict[str, NDArray[Any]]:
    if kind == "ouster":
        frames = np.array([values[0] for values in rows.values], dtype=float)
        last = np.array([values[1] for values in rows.values], dtype=np.int64)
        return {"frame_id": frames, "clock_last_column_ns": last}
    if kind == "ouster_imu":
        columns: dict[str, NDArray[Any]] = {}
        for k, name in enumerate(IMU_COLUMNS):
            column = [values[k] for values in rows.values]
            columns[name] = np.array(column, dtype=np.int64 if name.endswith("_ns") else float)
            if name.startswith("acceleration"):
                columns[name] *= lidar_packets.GRAVITY_MPS2
        return columns
    return {}


def _address(raw: bytes) -> str:
    if len(raw) == 4:
        return ".".join(str(part) for part in raw)
    return raw.hex(":", 2)


def _timestamp_mode(path: Path) -> str:
    """Of an Ouster's metadata beside the capture; empty where there is none."""
    beside = path.with_suffix(".json")
    if not beside.is_file():  # a pipe would be waited for
        return ""
    try:
        with beside.open("rb") as file:
            found = MODE.search(file.read(1 << 20))
    except OSError:
        return ""
    return found[1].decode() if found else ""


def _recognises(head: FileHead) -> int:
    return BY_MAGIC if head.start[:4] in MAGICS else NO


def _open(path: Path) -> Recording:
    return CaptureRecording(path)


READER = Reader(FORMAT, _recognises, _open)
