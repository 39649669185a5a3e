"""Files that a case reads besides its spec and catalogs: noted as they are read, hashed by content.

Which files a case reads is known once it has been computed; a later run looks at the content of the
same files before it believes what is kept.  Names are relative to the base spec's folder, so that a
study may move with its files.
"""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from syncline_design.machine.input_files import FilesRead, content_of, place_of

Inputs = tuple[tuple[str, str, str], ...]  # kind, name from the base's folder, what is there
CONTENT, PLACE = "content", "place"


def canonical(data: Any) -> str:
    """JSON of one form only: sorted keys, no spaces, ASCII, no NaN."""
    return json.dumps(
        data, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False
    )


def inputs_of(found: FilesRead, folder: Path) -> Inputs:
    """What a case read, in one order."""
    real, named = folder.resolve(), folder.absolute()
    read = [(CONTENT, _name(path, real), digest) for path, digest in found.contents.items()]
    sought = [
        (PLACE, _name(path, named), there.seen_from(real)) for path, there in found.places.items()
    ]
    return tuple(sorted(read + sought))


def _name(path: str, folder: Path) -> str:
    return Path(os.path.relpath(path, folder)).as_posix()


class Looked:
    """What the files of a study hold now; each is looked at once in a run."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str, str], str] = {}

    def now(self, sought: Inputs, folder: Path) -> Inputs:
        """The same files, with what is there now."""
        return tuple((kind, name, self._there(kind, name, folder)) for kind, name, _ in sought)

    def _there(self, kind: str, name: str, folder: Path) -> str:
        key = kind, name, str(folder)
        if key not in self._known:
            if kind == CONTENT:
                self._known[key] = content_of(folder.resolve() / name)
            else:
                self._known[key] = place_of(folder.absolute() / name).seen_from(folder)
        return self._known[key]


def full_key(case_key: str, inputs: Inputs) -> str:
    """The key of a case with the content of every file that it reads."""
    if not inputs:
        return case_key
    return hashlib.sha256(f"{case_key}{canonical(inputs)}".encode("ascii")).hexdigest()
