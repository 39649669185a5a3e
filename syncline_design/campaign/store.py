"""The runs of one system on disk: a file of lines that only grows, each bound to all before it.

Lines are runs, baselines, what looks at the runs found (`looks`), and runs that are left out from
there on or taken back (`omissions`): a run stays in the file, whether it counts or not.

A line is {"previous": P, "sha256": H, "body": B}; P is the H of the line before (64 zeros at the
start), H the SHA-256 of P and of B in canonical JSON.  A line that was changed, taken out, put in
or moved breaks the chain, and the store is refused as damaged.  A last line without its end is what
a kill left: it was never acknowledged, so it is dropped, and said.
What the store trusts: whoever can write to the file and makes the whole chain anew, or takes lines
off its end, is believed; keep a copy, or the printed hash of the last line, where that matters.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any, Final

from syncline_design import __version__
from syncline_design.campaign import omissions
from syncline_design.campaign.chain import START, canonical, digest, line_of
from syncline_design.campaign.kept import Run
from syncline_design.campaign.looks import KeptLook
from syncline_design.campaign.omissions import Omission, OmissionError
from syncline_design.campaign.packing import PackingError
from syncline_design.campaign.twice import is_same
from syncline_design.diagnosis.same_system import description, differences
from syncline_design.diagnosis.sufficient import Sufficient
from syncline_design.machine.appended_files import append_line, whole_lines
from syncline_design.machine.input_files import UnsuitableError, read_plain
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import NotThisResultError, read_as
from syncline_design.model.system import System
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Flaw

SCHEMA: Final = "syncline-design/store/v1"
MOST_BYTES: Final = 2**30
MOST_DIFFERENCES: Final = 5
OVERLAP: Final = 0.1  # of the shorter run: two that share more are of one drive


@dataclass(frozen=True, slots=True)
class Entry:
    """A run in the store: its number from 1, and the start of the system that it belongs to.

    found: its statistics unpacked.  line: hash of its line, empty where it is in no store.
    """

    number: int
    start: str
    run: Run
    found: Sufficient
    line: str = ""


@dataclass(frozen=True, slots=True)
class Stored:
    """A store that was read.

    system: what it is a store of (`same_system.description`).  baselines: after how many runs a
    new baseline was set.  looks: what looks found, by their keys.  omitted: which runs were left
    out and taken back, in that order.  torn: bytes of a last line that a kill left without its end.
    last: hash of the last line.  content: all whole lines.
    """

    path: Path
    name: str
    system: Any
    entries: tuple[Entry, ...]
    baselines: tuple[int, ...]
    looks: Mapping[str, KeptLook]
    omitted: tuple[Omission, ...]
    torn: int
    last: str
    content: bytes = field(repr=False)

    @property
    def runs(self) -> tuple[Run, ...]:
        return tuple(one.run for one in self.entries)

    @property
    def left_out(self) -> Mapping[int, Omission]:
        """The runs that are counted no more, by their numbers."""
        return omissions.left_out(self.omitted)

    @property
    def counted(self) -> tuple[Entry, ...]:
        """The runs that are not left out."""
        out = self.left_out
        return tuple(one for one in self.entries if one.number not in out)

    def left_out_words(self) -> Iterator[str]:
        """What is left out and what was taken back, in sentences without their full stop."""
        return omissions.words(self.omitted, [run.files for run in self.runs])


def read_store(path: Path, known: Stored | None = None) -> Stored | None:
    """The store in a file; None where there is no file yet.  BadInput where it is damaged.

    known: the same store as it was read before: what is the same, byte for byte, is not read anew.
    """
    try:
        content = read_plain(path, MOST_BYTES)
    except FileNotFoundError:
        if not path.parent.is_dir():  # a mistyped place would begin a history of its own, unheard
            raise refused(path, f"there is no folder {path.parent}",
                          "the store's path, or that of a new one in a folder that is there",
                          ) from None  # fmt: skip
        return None
    except (OSError, UnsuitableError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise refused(path, f"cannot read the store: {reason}") from None
    return _stored(path, content, known)


def _stored(path: Path, content: bytes, known: Stored | None) -> Stored | None:
    kept = whole_lines(content)
    torn = len(content) - len(kept)
    if torn and not kept and not content.startswith(b'{"previous"'):
        raise refused(path, "no store", "a file that `watch` or `diagnose --joint --store` made", 1)
    first, rest = 1, kept
    name, system, last = "", None, START
    entries: list[Entry] = []
    baselines: list[int] = []
    looks: dict[str, KeptLook] = {}
    omitted: list[Omission] = []
    if known is not None and kept.startswith(known.content):
        first, rest = 1 + known.content.count(b"\n"), kept[len(known.content) :]
        name, system, last = known.name, known.system, known.last
        entries, baselines = list(known.entries), list(known.baselines)
        looks, omitted = dict(known.looks), list(known.omitted)
    for line, text in enumerate(rest.splitlines(), first):
        body, last = _checked(path, line, text, last)
        kind = body.get("kind")
        if line == 1:
            name, system = _head(path, body)
        elif kind == "run":
            entries.append(_entry(path, line, body, len(entries) + 1, last))
        elif kind == "baseline":
            baselines.append(len(entries))
        elif kind == "looks":
            looks |= _looks(path, line, body)
        elif kind in omissions.KINDS:
            omitted.append(_omission(path, line, body, omitted, len(entries)))
        else:
            expected = f"run, baseline, looks or {' or '.join(omissions.KINDS)}"
            raise refused(path, f"a line of kind {kind!r}", expected, line)
    if system is None:
        return None  # nothing but what a kill left of the first line
    return Stored(path, name, system, tuple(entries), tuple(baselines), looks,
                  tuple(omitted), torn, last, kept)  # fmt: skip


def _checked(path: Path, line: int, text: bytes, previous: str) -> tuple[dict[str, Any], str]:
    """The body of a line and its hash, once it follows from the line before."""
    try:
        whole = json.loads(text)
        body, own = whole["body"], whole["sha256"]
        found = whole["previous"] == previous and own == digest(previous, body)
    except (ValueError, TypeError, KeyError, RecursionError):
        raise refused(
            path, "damaged: no line of a store", "lines as `watch` wrote them", line
        ) from None
    if not found:
        raise refused(
            path,
            "damaged: this line is not what was written after the one before",
            "an unbroken chain of hashes",
            line,
            "take back a copy of the store, or begin a new one and add the logs again",
        )
    if not isinstance(body, dict):
        raise refused(path, "damaged: a line without a body", "lines as written", line)
    return body, own


def _head(path: Path, body: dict[str, Any]) -> tuple[str, Any]:
    if body.get("kind") != "store" or body.get("schema") != SCHEMA:
        found = body.get("schema", body.get("kind"))
        raise refused(
            path,
            f"a store of another kind ({found!r})",
            SCHEMA,
            1,
            "a store of another version is begun anew: add the logs again",
        )
    return str(body.get("name", "")), body.get("system")


def _entry(path: Path, line: int, body: dict[str, Any], number: int, own: str) -> Entry:
    try:
        run = read_as(Run, json.dumps(body["run"]))
        return Entry(number, str(body["start"]), run, run.statistics(), own)
    except (NotThisResultError, PackingError, KeyError) as error:
        raise _unreadable(path, line, "a run", error) from None


def _looks(path: Path, line: int, body: dict[str, Any]) -> dict[str, KeptLook]:
    try:
        found = [read_as(KeptLook, json.dumps(one)) for one in body["looks"]]
    except (NotThisResultError, KeyError, TypeError) as error:
        raise _unreadable(path, line, "looks", error) from None
    if not all(one.is_possible for one in found):
        raise refused(path, "damaged: a look that found what no runs can have", "", line)
    return {one.key: one for one in found}


def _omission(
    path: Path, line: int, body: dict[str, Any], known: Sequence[Omission], runs: int
) -> Omission:
    try:
        return omissions.omission_of(body, known, runs)
    except OmissionError as error:
        raise _unreadable(path, line, "an omission", error) from None


def _unreadable(path: Path, line: int, what: str, error: Exception) -> BadInput:
    first = (str(error).splitlines() or [""])[0]
    return refused(path, f"damaged: {what} that cannot be read ({first})", "", line)


def demand_system(stored: Stored, system: System, spec: str) -> None:
    """Refuse a spec that describes another system than the store's."""
    own = json.loads(canonical(description(system)))
    found = list(itertools.islice(differences(stored.system, own), MOST_DIFFERENCES))
    if found:
        raise refused(
            stored.path,
            f"a store of another system than {spec}: "
            + "; ".join(one.words("the store") for one in found),
            "",
            1,
            "use a store of its own for every system; a changed name or requirement is none",
        )


def demand_known(stored: Stored, sha256: str, files: Sequence[Path]) -> None:
    """Refuse files that hold, to the byte, what a run of the store was read from."""
    for one in stored.entries:
        if one.run.sha256 == sha256:
            raise _twice(stored, ", ".join(map(str, files)), one)


def _twice(stored: Stored, files: str, one: Entry) -> BadInput:
    out = stored.left_out.get(one.number)
    back = f"watch {stored.path} --take-back {one.number} --reason TEXT"
    return refused(
        stored.path,
        f"{files}: this run is in the store already, as number {one.number} "
        f"({', '.join(one.run.files)})"
        + (f", left out since {out.since}: {out.reason}" if out is not None else ""),
        "a log that was not added before",
        hint=f"where it is to count again: `{back}`" if out is not None else "",
    )


def demand_new(stored: Stored | None, run: Run, path: Path) -> None:
    """Refuse a run that the store holds, whatever its file looks like."""
    if stored is None:
        return
    found = run.statistics()
    for one in stored.entries:
        if run.sha256 == one.run.sha256 or is_same(found, one.found):
            raise _twice(stored, ", ".join(run.files), one)
    _demand_apart(stored, run, path)


def _demand_apart(stored: Stored, run: Run, path: Path) -> None:
    """Refuse a run of the time of another that counts."""
    for one in stored.counted:
        if _overlap_s(run, one.run) > OVERLAP * min(run.duration_s, one.run.duration_s):
            raise refused(
                path,
                f"{', '.join(run.files)} is of the same time as run {one.number} "
                f"({', '.join(one.run.files)}): what it tells would count twice",
                "a run of another time",
                hint=f"leave out the one that is wrong: `watch {path} --leave-out {one.number} "
                "--reason TEXT`",
            )


def _overlap_s(one: Run, other: Run) -> float:
    """Time that both runs are of, where a calendar's stamps tell."""
    if one.date is None or other.date is None:
        return 0.0
    ends = (run.first_s + run.duration_s for run in (one, other))
    return min(ends) - max(one.first_s, other.first_s)


def add_run(
    path: Path,
    name: str,
    system: System,
    run: Run,
    start: str | None = None,
    known: Stored | None = None,
) -> None:
    """Append a run; the first one makes the store.  start: None for a start of its own.

    What another process appended meanwhile is looked at again.  known: the store as it was read.
    """

    def lines(kept: bytes) -> bytes:
        stored = _stored(path, kept, known) if kept else None
        last, text = START, b""
        if stored is None:
            head = {"kind": "store", "schema": SCHEMA, "name": name, "version": __version__,
                    "system": description(system)}  # fmt: skip
            text, last = line_of(last, head)
        else:
            demand_system(stored, system, name)
            demand_new(stored, run, path)
            last = stored.last
        number = 1 + (len(stored.entries) if stored is not None else 0)
        own = start if start is not None else f"#{number}"
        return text + line_of(last, {"kind": "run", "start": own, "run": run.to_json()})[0]

    append_line(path, lines)


def add_baseline(path: Path) -> None:
    """Append that the runs so far are done with: what comes is held against what comes."""

    def line(kept: bytes) -> bytes:
        stored = _stored(path, kept, None)
        if stored is None:
            raise refused(path, "no store to accept", "a store with runs")
        return line_of(stored.last, {"kind": "baseline", "after": len(stored.entries)})[0]

    append_line(path, line)


def add_omission(path: Path, number: int, reason: str, *, back: bool = False) -> None:
    """Append that a run is counted no more (back: counts again), and why."""
    one = omissions.begun_now(number, reason, back=back)

    def line(kept: bytes) -> bytes:
        stored = _stored(path, kept, None)
        if stored is None:
            raise refused(path, "no runs", "a store that `watch` added runs to")
        try:
            omissions.demand_following(one, stored.omitted, len(stored.entries))
        except OmissionError as error:
            expected = f"a run that is {'' if back else 'not '}left out"
            raise refused(path, str(error), expected) from None
        if back:
            _demand_apart(stored, stored.runs[number - 1], path)
        return line_of(stored.last, one.body)[0]

    append_line(path, line)


def add_looks(known: Stored, looks: Sequence[KeptLook]) -> Stored:
    """Append what looks found; the store with it."""

    def line(kept: bytes) -> bytes:
        stored = _stored(known.path, kept, known)
        if stored is None:
            raise refused(known.path, "the store was taken away meanwhile", "a store with runs")
        return line_of(stored.last, {"kind": "looks", "looks": [one.to_json() for one in looks]})[0]

    append_line(known.path, line)
    found = read_store(known.path, known)
    assert found is not None
    return found


def refused(
    path: Path, message: str, expected: str = "", line: int = 0, hint: str = ""
) -> BadInput:
    """A store that cannot be used, by place and reason."""
    return BadInput((Flaw(str(path), line, 1 if line else 0, "", message, expected, hint=hint),))


def by_date(entries: tuple[Entry, ...]) -> Iterator[Entry]:
    """Runs in the order of their first stamps where all have a date, else as they were added."""
    if all(one.run.date is not None for one in entries):
        yield from sorted(entries, key=lambda one: (one.run.first_s, one.number))
    else:
        yield from entries
