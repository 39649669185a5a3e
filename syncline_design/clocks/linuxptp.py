"""Lines of ptp4l, phc2sys and ts2phc: on standard output, in syslog, in the journal.

`master offset`, `phc offset` and `sys offset` are local minus reference, in nanoseconds.  A summary
line gives the `rms` and `max` of an interval: max is taken as one sample, its sign is not known.
Stamps are seconds since boot, or whole Unix seconds; the date that syslog puts before has no year.
"""

from __future__ import annotations

import re
from dataclasses import field, replace
from typing import Final

from syncline_design.clocks.series import Row, SourceKind, TimeBase
from syncline_design.machine.quick_dataclass import dataclass

_PROGRAM: Final = re.compile(r"(ptp4l|phc2sys|ts2phc)(?=\[|: )")
_STAMP: Final = re.compile(r"\[(\d{1,12}(?:\.\d+)?)\]")
_TAG: Final = re.compile(r"\[([\w.@-]+?)(?::\d)?\]")
_INTEGER: Final = r"([-+]?\d{1,18})"
# Every repeat has an end: a hostile line costs no more than its length.
_GAP: Final = r"\s{1,16}"
_SAMPLE: Final = re.compile(
    rf"(?:(?P<what>[\w/.-]{{1,64}})\s{{1,4}})?(?:(?P<against>master|phc|sys)\s{{1,4}})?offset{_GAP}{_INTEGER}"
    rf"{_GAP}s(\d)(?:{_GAP}freq{_GAP}{_INTEGER})?(?:{_GAP}(?:path{_GAP})?delay{_GAP}{_INTEGER})?"
)
_SUMMARY: Final = re.compile(
    rf"(?:(?P<what>[\w/.-]{{1,64}})\s{{1,4}})?rms{_GAP}{_INTEGER}{_GAP}max{_GAP}{_INTEGER}"
    rf"(?:{_GAP}freq{_GAP}{_INTEGER}{_GAP}\+/-{_GAP}\d{{1,18}})?(?:{_GAP}delay{_GAP}{_INTEGER})?"
)
_LOST: Final = re.compile(r"port \d{1,5}[^:]{0,64}: SLAVE to (?!SLAVE)|link down")
_STARTED: Final = re.compile(r"INITIALIZING to LISTENING on INIT_COMPLETE|selected /dev/ptp\d+ as")
_MASTER: Final = re.compile(r"selected best master clock ([0-9a-f.:-]{1,40})")
_CARD: Final = "selected /dev/ptp"
_UNIX: Final = 1e9
SYSTEM: Final = "phc2sys CLOCK_REALTIME"
FOLLOWS_SYSTEM: Final = " by the system clock"  # the name's end of a card in a `sys offset` line
RESOLUTION_S: Final = 0.5e-9  # of whole nanoseconds
_MOST: Final = 512  # characters behind a program's name
_NAMES: Final = 4  # of programs in one line: syslog's and the program's own, twice
_RANKS: Final = {"phc2sys": 1, "ptp4l": 2, "ts2phc": 3}


@dataclass(slots=True)
class PtpReader:
    """One file; states say between which lines lock was lost or the program began anew."""

    began: set[tuple[str, str]] = field(default_factory=set)
    last: dict[tuple[str, str], SourceKind] = field(default_factory=dict)
    processes: dict[str, str] = field(default_factory=dict)
    master: str = ""
    on_card: bool | None = None  # None: no line says what ptp4l steers

    def row(self, line: str) -> tuple[SourceKind, Row, str] | None:
        """A line of any of the three programs that holds an offset, or says that lock was lost."""
        # the last name first: of a cut line that the next one is joined to, only that one is whole
        named = list(_PROGRAM.finditer(line[: 2 * _MOST]))[-_NAMES:]
        rows = (self._said(program, line) for program in reversed(named))
        return next((row for row in rows if row is not None), None)

    def _said(self, program: re.Match[str], line: str) -> tuple[SourceKind, Row, str] | None:
        """What a line says behind a program's name."""
        rest = line[program.end() : program.end() + _MOST]
        stamps = list(_STAMP.finditer(rest))[:2]
        if not stamps:
            return None
        # `ptp4l[812]: [1234.567]` of syslog: the first bracket is the process
        at = stamps[1] if len(stamps) > 1 and "." not in stamps[0][1] else stamps[0]
        if "." not in at[1] and float(at[1]) < _UNIX:
            return None
        time_s, said = float(at[1]), rest[at.end() :]
        tag = _TAG.search(said)
        key = (program[1], tag[1] if tag else "")
        if at is not stamps[0]:
            self._of_process(program[1], stamps[0][1])
        body = said[tag.end() :] if tag else said
        return self._state(key, time_s, body) or self._sample(key, time_s, body)

    def _of_process(self, program: str, process: str) -> None:
        """Another process of a program is another run of it."""
        if self.processes.setdefault(program, process) != process:
            self.began |= {key for key in self.last if key[0] == program}
        self.processes[program] = process

    def _state(
        self, key: tuple[str, str], time_s: float, body: str
    ) -> tuple[SourceKind, Row, str] | None:
        started = _STARTED.search(body)
        if started:
            self.began.add(key)
            # a start that opens no card steers the system clock (software time stamps)
            if key[0] == "ptp4l":
                self.on_card = started[0].startswith(_CARD) or bool(self.on_card)
        if chosen := _MASTER.search(body):
            self.master = chosen[1]
        kind = self.last.get(key)
        if kind is not None and _LOST.search(body):
            return kind, Row(time_s, float("nan"), locked=False), ""
        return None

    def _sample(
        self, key: tuple[str, str], time_s: float, body: str
    ) -> tuple[SourceKind, Row, str] | None:
        if "offset" not in body and "rms" not in body:
            return None
        found = _SAMPLE.search(body)
        summary = None if found else _SUMMARY.search(body)
        if found is not None:
            _, against, offset, state, freq, delay = found.groups()
            locked = int(state) >= 2
        elif summary is not None:
            _, _, offset, freq, delay = summary.groups()
            against = None
            locked = True
        else:
            return None
        what = ((found or summary) or found)["what"]  # type: ignore[index]
        offset_s = 1e-9 * int(offset)
        hard = (
            abs(offset_s)
            + RESOLUTION_S
            + 1e-9 * abs(int(delay or 0)) * (0.5 if key[0] == "phc2sys" else 1.0)
        )
        if key[0] == "phc2sys" and (what or "phc").strip() == "phc":
            what = "CLOCK_REALTIME"  # older versions name only the side that they compare with
        kind = _kind(key, what, time_s, by_system="sys" in (what, against))
        if key[0] == "ptp4l":
            kind = replace(kind, of_host=self.on_card is False)
        self.last[key] = kind
        restart = key in self.began
        self.began.discard(key)
        rate = 1e-9 * int(freq) if freq else float("nan")
        return (
            kind,
            Row(time_s, offset_s, hard, locked, rate, restart=restart, unsigned=found is None),
            (self.master if key[0] == "ptp4l" else ""),
        )


def _kind(key: tuple[str, str], what: str | None, time_s: float, *, by_system: bool) -> SourceKind:
    """by_system: whether the card follows the system clock, which most are held against."""
    program, tag = key
    named = (what or "").strip()
    if program == "ptp4l" or named in ("master", "phc", "sys"):
        named = tag
    stamps: TimeBase = "utc" if time_s >= _UNIX else "boot"
    name = f"{program} {named}".strip()
    if program == "phc2sys" and by_system:
        name += FOLLOWS_SYSTEM
    # phc2sys: the card's own error; ts2phc: the delay and the edge of the pulse that it steers by
    whole = program == "ptp4l"
    of_host = name == SYSTEM
    return SourceKind(name, "linuxptp", _RANKS[program], "servo", stamps, "", whole, of_host)
