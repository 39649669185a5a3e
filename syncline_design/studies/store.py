"""Results of cases on disk: one file per case, named by its content, whole or not there.

The store trusts whoever can write to its folder, as far as a file cannot be told from a true one:
it has to be named by the content it belongs to, match its own hash, and hold a verdict that follows
from its own figures.  Anything else is computed again.
"""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

from syncline_design.machine.input_files import UnsuitableError, read_plain
from syncline_design.machine.result_files import clear_stale, replace_whole
from syncline_design.studies.case import canonical
from syncline_design.studies.inputs import Inputs, is_inputs
from syncline_design.studies.record import is_believable

Json = dict[str, Any]
FOLDER = ".syncline-cases"
MOST_BYTES = 2**26
MOST_ALTERNATIVES = 32
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

    def read(self, key: str) -> Json | None:
        """The record, or None where there is none that is whole, right and believable."""
        content = _read_json(self.path(key))
        if not isinstance(content, dict) or content.get("key") != key:
            return None
        record = content.get("record")
        if not isinstance(record, dict) or content.get("sha256") != _digest_of(record):
            return None
        return record if is_believable(record) else None

    def write(self, key: str, encoded: str) -> None:
        """Put a record (canonical JSON) in place in one step.

        No fsync: a file that a power cut tears does not match its own hash and is computed again.
        """
        text = f'{{"key":"{key}","sha256":"{_digest(encoded)}","record":{encoded}}}\n'
        self._put(self.path(key), text)

    def reads(self, case_key: str) -> list[Inputs]:
        """The files that a case has been seen to read, each time they were others."""
        data = _read_json(self._reads_path(case_key))
        kept = data.get("reads") if isinstance(data, dict) else None
        return [item for item in kept if is_inputs(item)] if isinstance(kept, list) else []

    def note_reads(self, case_key: str, inputs: Inputs) -> None:
        """Keep the names of what a case read; their content is in the key of its record."""
        names = [[kind, name, ""] for kind, name, _ in inputs]
        known = self.reads(case_key)
        if names not in known:
            kept = [names, *known][:MOST_ALTERNATIVES]
            self._put(self._reads_path(case_key), canonical({"reads": kept}) + "\n")

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


def _read_json(path: Path) -> Any:
    """What a JSON file holds; None where it cannot be read or is nested beyond reason."""
    try:
        return json.loads(read_plain(path, MOST_BYTES))
    except (OSError, ValueError, UnsuitableError, RecursionError):
        return None


def _digest_of(record: Json) -> str | None:
    try:
        return _digest(canonical(record))
    except (ValueError, RecursionError):  # no JSON of ours
        return None


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("ascii")).hexdigest()
