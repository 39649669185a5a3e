"""Files of clock logs: opened within bounds, unpacked, rotations of a log told from other logs."""

from __future__ import annotations

import hashlib
import re
import zlib
from collections.abc import Sequence
from dataclasses import field
from pathlib import Path
from typing import Final

from syncline_design.clocks.damage import DamagedLines
from syncline_design.machine.deadline import in_force
from syncline_design.machine.input_files import UnsuitableError, read_plain
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Flaw

MOST_BYTES: Final = 2**28
MOST_UNPACKED: Final = 2**29
MOST_LINE: Final = 2**16  # characters; longer lines are no line of any of these logs
LINES_COMPARED: Final = 20  # before a last line without an end
_PIECE: Final = 2**22
_GZIP: Final = b"\x1f\x8b"
_OTHER_PACKING: Final = {b"\xfd7zXZ": "xz", b"BZh": "bzip2", b"PK\x03\x04": "zip",
                         b"(\xb5/\xfd": "zstd"}  # fmt: skip
_ENDS: Final = ("\n", "\r", "\x0b", "\x0c", "\x1c", "\x1d", "\x1e", "\x85", "\u2028", "\u2029")
# tracking.log.1, tracking.log-20261121, loopstats.20261121, each perhaps with .gz
_ROTATED: Final = re.compile(r"(?P<stem>.+?)[.-](?P<rank>[0-9]{8}(?:[-_]?[0-9]+)?|[0-9]{1,3})")


def refused(
    path: Path, message: str, *, line: int = 0, column: int = 1, expected: str = "",
    found: str = "", hint: str = "",
) -> BadInput:  # fmt: skip
    """The error for a log that cannot be used."""
    at = (line, column) if line else (0, 0)
    return BadInput((Flaw(str(path), *at, "", message, expected, found, hint),))


@dataclass(frozen=True, slots=True)
class LogFile:
    """One file as text.

    lines: by their number; a line that is no text is left empty.  log: name shared by all rotations
    of one log; order: theirs, the oldest first.  cut_short: what is missing at its end, in words.
    no_text: those lines.
    """

    path: Path
    sha256: str
    lines: tuple[str, ...]
    log: str
    order: tuple[int, str]
    cut_short: str = ""
    no_text: DamagedLines = field(default_factory=DamagedLines)


def read_files(paths: Sequence[Path]) -> list[LogFile]:
    """All files; one content given twice is refused."""
    found: list[LogFile] = []
    seen: dict[str, Path] = {}
    for path in paths:
        in_force().check()
        one = _read(path)
        digest = hashlib.sha256("\n".join(one.lines).encode("utf-8", "replace")).hexdigest()
        if digest in seen:
            what = f"the same log as {seen[digest]}"
            raise refused(path, what, hint="a session counts once: give each file once")
        seen[digest] = path
        found.append(one)
    return found


def _read(path: Path) -> LogFile:
    try:
        content = read_plain(path, MOST_BYTES)
    except (OSError, UnsuitableError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise refused(path, f"cannot read: {reason[:1].lower()}{reason[1:]}") from None
    digest = hashlib.sha256(content).hexdigest()
    for mark, packing in _OTHER_PACKING.items():
        if content.startswith(mark):
            raise refused(path, f"packed with {packing}", expected="text, or text in gzip",
                          hint="unpack it first")  # fmt: skip
    cut_short = ""
    if content.startswith(_GZIP):
        content, cut_short = _unpacked(path, content)
    text = _text(path, content)
    lines = tuple(text.splitlines())
    if not text.endswith(_ENDS) and not _is_whole(lines):
        lines = lines[:-1]
        cut_short = cut_short or "the last line is cut off and left out"
    lines, no_text = _lines_of_text(path, lines)
    log, order = _rotation(path)
    return LogFile(path, digest, lines, log, order, cut_short, no_text)


def _is_whole(lines: Sequence[str]) -> bool:
    """Whether a last line without an end is as long as those before it: a shorter one may have
    lost figures, and a number that has still reads as one."""
    before = lines[-1 - LINES_COMPARED : -1]
    return not before or len(lines[-1]) >= max(map(len, before))


def _unpacked(path: Path, content: bytes) -> tuple[bytes, str]:
    """What a gzip file holds, of every member; and what is wrong with its end."""
    pieces: list[bytes] = []
    total, rest = 0, content
    while rest.startswith(_GZIP):
        stream = zlib.decompressobj(wbits=31)
        data = rest
        while not stream.eof:
            in_force().check()
            try:
                piece = stream.decompress(data, _PIECE)
            except zlib.error:
                if not pieces:
                    raise refused(path, "damaged gzip file") from None
                return b"".join(pieces), "the gzip file is damaged: read up to there"
            data = stream.unconsumed_tail
            total += len(piece)
            if total > MOST_UNPACKED:
                most = f"at most {MOST_UNPACKED >> 20} MiB"
                raise refused(path, "too large once unpacked", expected=most)
            pieces.append(piece)
            if not piece and not data and not stream.eof:
                return b"".join(pieces), "the gzip file is cut off: read up to there"
        rest = stream.unused_data
    return b"".join(pieces), ""


def _text(path: Path, content: bytes) -> str:
    if not content.strip():
        raise refused(path, "an empty file", expected="lines of a clock's log")
    return content.decode("utf-8-sig", errors="replace")


def _lines_of_text(path: Path, lines: Sequence[str]) -> tuple[tuple[str, ...], DamagedLines]:
    """The lines, those that are no text left empty, and the damage that these are."""
    found, damage = list(lines), DamagedLines()
    for number, line in enumerate(lines, 1):
        if flaw := no_text(path, line, number):
            found[number - 1] = ""
            damage.add(flaw)
    if damage.first is not None and not any(line.strip() for line in found):
        raise damage.first
    return tuple(found), damage


def no_text(path: Path, line: str, number: int) -> BadInput | None:
    """Why a line is none of text; None where it is."""
    if "\x00" in line:
        return refused(path, "not text: NUL", line=number)
    if len(line) > MOST_LINE:
        most = f"at most {MOST_LINE} characters"
        return refused(path, "a line too long", line=number, expected=most, found=str(len(line)))
    return None


def _rotation(path: Path) -> tuple[str, tuple[int, str]]:
    """(log, order): dated rotations by date, numbered ones by falling number, the live one last."""
    name = path.name.removesuffix(".gz")
    found = _ROTATED.fullmatch(name)
    folder = str(path.absolute().parent)
    if found is None:
        return f"{folder}/{name}", (2, "")
    rank = found["rank"]
    order = (1, f"{999 - int(rank):03d}") if len(rank) <= 3 else (0, rank)
    return f"{folder}/{found['stem']}", order
