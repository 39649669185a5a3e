"""Results of cases on disk: one file per case, named by its content, whole or not there."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import tempfile
import time
from pathlib import Path
from typing import Any

from syncline_design.study.case import canonical

Json = dict[str, Any]
FOLDER = ".syncline-cases"
_TEMPORARY = ".part"
_STALE_S = 3600.0


class StoreError(Exception):
    """The folder of case files cannot be used: what happened and what to do."""


class Store:
    """A folder of case files, shared by all studies that use it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def open(self) -> None:
        """Make the folder and clear away what a killed run left half-written."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            ignore = self.folder / ".gitignore"
            if not ignore.exists():
                ignore.write_text("*\n", encoding="utf-8")
            for part in self.folder.glob(f"*/*{_TEMPORARY}"):
                if time.time() - part.stat().st_mtime > _STALE_S:
                    part.unlink(missing_ok=True)
        except OSError as error:
            raise self._unusable(error) from None

    def path(self, key: str) -> Path:
        """Where the record of a case lies."""
        return self.folder / key[:2] / f"{key}.json"

    def read(self, key: str) -> Json | None:
        """The record, or None where there is none that is whole and right."""
        try:
            content = json.loads(self.path(key).read_bytes())
        except (OSError, ValueError):
            return None
        if not isinstance(content, dict) or content.get("key") != key:
            return None
        record = content.get("record")
        if not isinstance(record, dict) or content.get("sha256") != _digest(canonical(record)):
            return None
        return record

    def write(self, key: str, encoded: str) -> None:
        """Put a record (canonical JSON) in place in one step.

        No fsync: a file that a power cut tears does not match its own hash and is computed again.
        """
        text = f'{{"key":"{key}","sha256":"{_digest(encoded)}","record":{encoded}}}\n'
        final = self.path(key)
        temporary = None
        try:
            final.parent.mkdir(exist_ok=True)
            descriptor, temporary = tempfile.mkstemp(suffix=_TEMPORARY, dir=final.parent)
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(text.encode("ascii"))
            Path(temporary).replace(final)
        except OSError as error:
            if temporary is not None:
                with contextlib.suppress(OSError):
                    Path(temporary).unlink()
            raise self._unusable(error) from None

    def _unusable(self, error: OSError) -> StoreError:
        reason = error.strerror or str(error)
        return StoreError(
            f"{self.folder}: cannot keep the results of cases: {reason}; cases written so far stay "
            "valid; choose another folder with --store, or make room and run again"
        )


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("ascii")).hexdigest()
