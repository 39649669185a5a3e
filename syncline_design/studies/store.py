"""Results of cases on disk: one file per case, named by its content, whole or not there.

The store trusts whoever can write to its folder, as far as a file cannot be told from a true one:
it has to be named by the content it belongs to, match its own hash, and hold a verdict that follows
from its own figures.  Anything else is computed again.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Final, TypeVar

from syncline_design.machine.input_files import UnsuitableError, read_own
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import NotThisResultError, Record, read_as
from syncline_design.machine.result_files import clear_stale, replace_whole
from syncline_design.studies.inputs import Inputs, canonical
from syncline_design.studies.record import CaseRecord

R = TypeVar("R", bound=Record)
FOLDER = ".syncline-cases"
MOST_BYTES = 2**26
MOST_ALTERNATIVES = 32
# A file is {"key":"KEY","sha256":"DIGEST","record":RECORD} and a newline, RECORD in canonical JSON.
_MIDDLE: Final = '","record":'
_TAIL: Final = "}\n"
_SHARD = re.compile(r"[0-9a-f]{2}")


class StoreError(Exception):
    """The folder of case files cannot be used: what happened and what to do."""


class Store:
    """A folder of case files, shared by all studies that use it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def open(self) -> None:
        """Make the folder and clear away what a killed run left half-written.

        Only a folder made here is kept out of Git: one that was there may be under its care.
        """
        try:
            new = not self.folder.exists()
            self.folder.mkdir(parents=True, exist_ok=True)
            if new:
                replace_whole(self.folder / ".gitignore", b"*\n")
            for shard in self.folder.iterdir():
                if _SHARD.fullmatch(shard.name):
                    clear_stale(shard)
        except OSError as error:
            raise self._unusable(error) from None

    def path(self, key: str) -> Path:
        """Where the record of a case lies."""
        return self.folder / key[:2] / f"{key}.json"

    def read(self, key: str) -> CaseRecord | None:
        """The record, or None where there is none that is whole, right and believable."""
        encoded = _kept(key, _text(self.path(key)))
        record = None if encoded is None else _read(CaseRecord, encoded)
        return record if record is not None and record.is_believable else None

    def write(self, key: str, encoded: str) -> None:
        """Put a record (canonical JSON) in place in one step.

        No fsync: a file that a power cut tears does not match its own hash and is computed again.
        """
        self._put(self.path(key), f"{_head(key)}{_digest(encoded)}{_MIDDLE}{encoded}{_TAIL}")

    def reads(self, case_key: str) -> tuple[Inputs, ...]:
        """The files that a case has been seen to read, each time they were others."""
        found = _read(_Reads, _text(self._reads_path(case_key)))
        return () if found is None else found.reads

    def note_reads(self, case_key: str, inputs: Inputs) -> None:
        """Keep the names of what a case read; their content is in the key of its record."""
        names = tuple((kind, name, "") for kind, name, _ in inputs)
        known = self.reads(case_key)
        if names not in known:
            kept = _Reads((names, *known)[:MOST_ALTERNATIVES])
            self._put(self._reads_path(case_key), canonical(kept.to_json()) + "\n")

    def _reads_path(self, case_key: str) -> Path:
        return self.folder / case_key[:2] / f"{case_key}.reads"

    def _put(self, final: Path, text: str) -> None:
        try:
            final.parent.mkdir(exist_ok=True)
            replace_whole(final, text.encode("ascii"))
        except OSError as error:
            raise self._unusable(error) from None

    def _unusable(self, error: OSError) -> StoreError:
        reason = error.strerror or str(error)
        return StoreError(
            f"{self.folder}: cannot keep the results of cases: {reason}; cases written so far stay "
            "valid; choose another folder with --store, or make room and run again"
        )


@dataclass(frozen=True, slots=True)
class _Reads(Record):
    """What a case has been seen to read; without what was there."""

    reads: tuple[Inputs, ...]


def _text(path: Path) -> str:
    """What a file holds; nothing where it cannot be read."""
    try:
        return read_own(path, MOST_BYTES).decode("ascii")
    except (OSError, UnsuitableError, UnicodeDecodeError):
        return ""


def _read(kind: type[R], text: str) -> R | None:
    try:
        return read_as(kind, text)
    except NotThisResultError:
        return None


def _head(key: str) -> str:
    return f'{{"key":"{key}","sha256":"'


def _kept(key: str, text: str) -> str | None:
    """The encoded record in the text of its file; None where that is not as it was written."""
    head = _head(key)
    digest, middle, rest = text.removeprefix(head).partition(_MIDDLE)
    if not (text.startswith(head) and middle and rest.endswith(_TAIL)):
        return None
    encoded = rest.removesuffix(_TAIL)
    return encoded if digest == _digest(encoded) else None


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("ascii")).hexdigest()
