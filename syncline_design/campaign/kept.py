"""What is kept of one run (one log of a system): its sufficient statistics, no rows."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Final

import numpy as np

from syncline_design.campaign.column_sizes import column_sizes
from syncline_design.campaign.packing import PackingError, lower, packed, unpacked, whole
from syncline_design.diagnosis.result import Check, Estimate
from syncline_design.diagnosis.sufficient import Less, Sufficient, TermLabel
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, optional

EARLIEST_S: Final = 946_684_800.0  # 2000-01-01: a first stamp from here on is a time of day
LATEST_S: Final = 4_102_444_800.0  # 2100-01-01
MOST_PARAMETERS: Final = 2000
MOST_PARTS: Final = 64
ROUNDED: Final = 1e-6  # of the largest eigenvalue of a scaled matrix
LARGEST: Final = 1e60  # information [1 / SI^2] of a parameter, beyond which none is measured


@dataclass(frozen=True, slots=True)
class NamedAlone(Record):
    """What the log alone named: effect, sensor, stage, and all of it in words.

    parameters: of what was undone in the log, for no joint fit finds them again; None of a run that
    was kept before they were.
    """

    effect: str
    sensor: str
    stage: str
    words: str
    undone: bool
    parameters: Mapping[str, Estimate] | None = optional()


@dataclass(frozen=True, slots=True)
class PartsKept(Record):
    """The statistics without each of `count` parts of the log: normal, score and square packed."""

    count: int
    normal: str
    score: str
    square: str


@dataclass(frozen=True, slots=True)
class Run(Record):
    """One run of a system.

    files: names of the files it was read from, sha256 of their content.  first_s: its first stamp;
    date: the same as a date where it is one.  verdict, left_m: what the log alone was said to be,
    and the RMS [m] of what it left unexplained.  spec_m: RMS [m] that the spec's noise makes on it.
    white_factor: its noise over the spec's, by sensor.  parameters: `effect/sensor/stage/name`, in
    the order of the statistics (`diagnosis.sufficient`).  checks: where it contradicts itself or
    the platform's limits; None of a run that was kept before they were.
    """

    files: tuple[str, ...]
    sha256: str
    kind: str
    first_s: float
    date: str | None
    duration_s: float
    rows: int
    used: int
    rejected: Mapping[str, int]
    verdict: str
    left_m: float
    left_material: bool
    spec_m: float
    white_factor: Mapping[str, float]
    named: tuple[NamedAlone, ...]
    version: str
    parameters: tuple[str, ...]
    normal: str
    score: str
    square: float
    gram: str
    less: tuple[PartsKept, ...]
    checks: tuple[Check, ...] | None = optional()

    def statistics(self) -> Sufficient:
        """The statistics unpacked; PackingError where they are not what they say."""
        p = len(self.parameters)
        if p > MOST_PARAMETERS or any(part.count > MOST_PARTS for part in self.less):
            raise PackingError(f"{p} parameters")
        labels = tuple(label_of(text) for text in self.parameters)
        half = p * (p + 1) // 2
        less = tuple(
            Less(
                whole(unpacked(part.normal, (part.count, half)), p),
                unpacked(part.score, (part.count, p)),
                unpacked(part.square, (part.count,)),
            )
            for part in self.less
        )
        normal, gram = (whole(unpacked(one, (half,)), p) for one in (self.normal, self.gram))
        score = unpacked(self.score, (p,))
        for one in (normal, gram, score, *(a for part in less for a in (part.normal, part.score))):
            if np.max(np.abs(one), initial=0.0) > LARGEST:
                raise PackingError("a figure larger than any log's")
        if not _is_information(normal):
            raise PackingError("no information matrix")
        return Sufficient(labels, normal, score, self.square, gram, less)


def _is_information(normal: Array) -> bool:
    """Whether a matrix can be one: no eigenvalue below 0, but for rounding."""
    size = np.diag(normal)
    if np.any(size < 0.0):
        return False
    scale = column_sizes(size)
    scaled = normal / scale[:, None] / scale
    return not size.size or bool(np.linalg.eigvalsh(scaled)[0] > -ROUNDED)


def label_of(text: str) -> TermLabel:
    """`latency/position/0/latency_s` -> its parts; PackingError where it is none."""
    parts = text.split("/")
    if len(parts) != 4 or not parts[2].isdecimal():
        raise PackingError(f"a parameter called {text!r}")
    return parts[0], parts[1], int(parts[2]), parts[3]


def text_of(label: TermLabel) -> str:
    """A label as a run keeps it."""
    return "/".join(map(str, label))


def date_of(first_s: float) -> str | None:
    """A first stamp as a date where the log's timeline is a calendar's (UTC)."""
    if not EARLIEST_S <= first_s < LATEST_S:
        return None
    return datetime.fromtimestamp(first_s, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def parts_kept(less: Less) -> PartsKept:
    """Parts as they are kept."""
    return PartsKept(
        len(less.square), packed(lower(less.normal)), packed(less.score), packed(less.square)
    )


def statistics_of(found: Sufficient) -> dict[str, object]:
    """Statistics as the fields of a run that hold them."""
    return {
        "parameters": tuple(text_of(label) for label in found.labels),
        "normal": packed(lower(found.normal)),
        "score": packed(found.score),
        "square": float(found.square),
        "gram": packed(lower(np.asarray(found.gram))),
        "less": tuple(parts_kept(part) for part in found.less),
    }
