"""Frames of GNSS receivers in a stream of bytes: NMEA sentences, UBX messages, RTCM passed over.

NMEA 0183: `$`, text, `*` and the exclusive or of the text as two hexadecimal digits.  UBX: B5 62,
class, id, length (2 bytes), payload, and the 8-bit Fletcher sum of all behind B5 62 (u-blox
interface descriptions).  RTCM 3: D3, length (10 bits), payload, 3 bytes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import reduce
from operator import xor
from typing import BinaryIO, Literal

import numpy as np

from syncline_design.machine.quick_dataclass import dataclass

BLOCK = 1 << 20
LONGEST_SENTENCE = 1024
START = re.compile(rb"[$!][A-Z]|\xb5b|\xd3[\x00-\x03]|\n#")
SENTENCE = re.compile(rb"[$!]([\x20-\x23\x25-\x7e]*)\*([0-9A-Fa-f]{2})\s*\Z")
UBX = b"\xb5b"


@dataclass(slots=True)
class FrameCount:
    """What did not become a frame."""

    refused: int = 0  # sentences and messages whose checksum is wrong
    stray: int = 0  # bytes between frames
    cut: int = 0  # bytes of a last frame that is not whole


class FletcherSums:
    """The 8-bit Fletcher sum of any piece of a block at once, by running sums.

    Of x_i .. x_(j-1): a = sum x_k, b = sum (j - k) x_k, both modulo 256.  A file of heads that
    claim 64 kB each would else be summed over and over.
    """

    def __init__(self, block: bytes) -> None:
        figures = np.frombuffer(block, dtype=np.uint8).astype(np.int64)
        none = np.zeros(1, dtype=np.int64)
        self._plain = np.concatenate([none, np.cumsum(figures)])
        self._weighed = np.concatenate([none, np.cumsum(figures * np.arange(figures.shape[0]))])

    def of(self, first: int, end: int) -> bytes:
        plain = int(self._plain[end]) - int(self._plain[first])
        weighed = int(self._weighed[end]) - int(self._weighed[first])
        return bytes((plain & 0xFF, (end * plain - weighed) & 0xFF))


Frame = tuple[Literal["nmea", "ubx"], bytes]


def frames(file: BinaryIO, count: FrameCount) -> Iterator[Frame]:
    """Every good frame; UBX as class, id, length and payload, NMEA as its text without `$`."""
    held, ended = b"", False
    while not ended:
        more = file.read(BLOCK)
        ended = not more
        held += more
        at = 0
        sums = FletcherSums(held) if UBX in held else None
        while at < len(held):
            found, after = _at(held, at, ended, count, sums)
            if after < 0:
                break
            if found is not None:
                yield found
            at = after
        held = held[at:]
    if held:
        count.cut = len(held)


def _at(
    held: bytes, at: int, ended: bool, count: FrameCount, sums: FletcherSums | None
) -> tuple[Frame | None, int]:
    """A frame at a place, and the place behind it; negative where more bytes are wanted."""
    first = held[at]
    if first in b"$!":
        return _sentence(held, at, ended, count)
    if first == 0xB5:
        return _ubx(held, at, ended, count, sums)
    if first == 0xD3 and len(held) >= at + 3 and held[at + 1] < 4:
        after = at + 6 + ((held[at + 1] << 8) | held[at + 2])
        if after <= len(held) and (after == len(held) or START.match(held, after)):
            return None, after
    if first == 0x23:  # a comment of an archive
        end = held.find(b"\n", at)
        if end < 0 and not ended and len(held) - at < LONGEST_SENTENCE:
            return None, -1
        return None, end + 1 if end >= 0 else len(held)
    return None, _next(held, at, ended, count)


def _next(held: bytes, at: int, ended: bool, count: FrameCount) -> int:
    """Where the next frame may begin; one byte may be the half of a beginning."""
    found = START.search(held, at + 1)
    after = found.start() if found else max(at + 1, len(held) - (0 if ended else 1))
    if found and held[after] == 0x0A:
        after += 1
    count.stray += len(held[at:after].strip(b"\r\n\0\xff \t"))
    return after


def _sentence(held: bytes, at: int, ended: bool, count: FrameCount) -> tuple[Frame | None, int]:
    end = held.find(b"\n", at, at + LONGEST_SENTENCE)
    if end < 0:
        if not ended and len(held) - at < LONGEST_SENTENCE:
            return None, -1
        if ended and len(held) - at < LONGEST_SENTENCE:
            end = len(held)
        else:
            return None, _next(held, at, ended, count)
    text = sentence(held[at:end])
    if text is not None:
        return ("nmea", text), min(end + 1, len(held))
    if end == len(held) and held.find(b"$", at + 1) < 0:
        count.cut = end - at
        return None, len(held)
    count.refused += held[at + 1 : at + 3].isalpha()
    message = held.find(UBX, at, end)  # a damaged line is lost to its end, a message in it is not
    return None, message if message >= 0 else min(end + 1, len(held))


def sentence(raw: bytes) -> bytes | None:
    """The text between `$` and `*` of a sentence whose checksum is right."""
    found = SENTENCE.match(raw)
    if found is None or reduce(xor, found[1], 0) != int(found[2], 16):
        return None
    return found[1]


def _ubx(
    held: bytes, at: int, ended: bool, count: FrameCount, sums: FletcherSums | None
) -> tuple[Frame | None, int]:
    if not held.startswith(UBX, at) and len(held) > at + 1:
        return None, _next(held, at, ended, count)
    size = 8 + int.from_bytes(held[at + 4 : at + 6], "little") if len(held) >= at + 6 else 8
    if len(held) < at + size:
        if not ended:
            return None, -1
        if START.search(held, at + 2) is None:
            count.cut = len(held) - at
            return None, len(held)
        return None, _next(held, at, ended, count)
    end = at + size - 2
    if sums is not None and sums.of(at + 2, end) == held[end : end + 2]:
        return ("ubx", held[at + 2 : end]), at + size
    count.refused += 1
    return None, _next(held, at, ended, count)
