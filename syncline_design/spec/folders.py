"""Which files of a folder are specs: those with `syncline:` at their top; the rest is named."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.catalog import SECTIONS
from syncline_design.spec.load import BadInput
from syncline_design.spec.yaml_text import Flaw, ParsedFile, read

SUFFIXES: Final = (".yaml", ".yml")
NOT_ENTERED: Final = "a folder with specs that are not checked; name it too"
# Keys that only a spec has: a file with one of them is a spec, even if its first line is missing.
_OF_SPECS: Final = ("syncline", "stages", "requirements")
_CONTENT: Final = re.compile(r"^[ \t]*[^#\s]", re.MULTILINE)
_TOP_KEY: Final = re.compile(r"^(?:\{[ \t]{0,8})?[\"']?(\w{1,40})[\"']?[ \t]{0,8}:", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Skipped:
    """A file that is no spec, and what it is instead."""

    file: str
    what: str


@dataclass(frozen=True, slots=True)
class SpecFiles:
    """The specs to check, in the order given, folders by name; what was passed over on the way."""

    files: tuple[Path, ...]
    skipped: tuple[Skipped, ...] = ()


def spec_files(paths: Sequence[Path], *, skip_others: bool = False) -> SpecFiles:
    """Files as given; of folders the specs directly in them, by name.

    skip_others: whether files given by name are passed over too where they are no specs.
    """
    files: list[Path] = []
    skipped: list[Skipped] = []
    for path in paths:
        if path.is_dir():
            inside, others = _in_folder(path)
            skipped += others
            files += inside
            continue
        what = other_kind(path) if skip_others else None
        if what is None:
            files.append(path)
        else:
            skipped.append(Skipped(str(path), what))
    return SpecFiles(tuple(files), tuple(skipped))


def _in_folder(folder: Path) -> tuple[list[Path], list[Skipped]]:
    try:
        inside = sorted(folder.iterdir())
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        message = f"cannot read the folder: {reason}"
        raise BadInput((Flaw(str(folder), 0, 0, "", message),)) from None
    found = [path for path in inside if path.suffix.lower() in SUFFIXES]
    judged = [(path, _folder_kind(path) if path.is_dir() else other_kind(path)) for path in found]
    others = [Skipped(str(path), what) for path, what in judged if what is not None]
    others += [Skipped(str(p), NOT_ENTERED) for p in inside if p not in found and _holds_spec(p)]
    specs = [path for path, what in judged if what is None]
    if not specs:
        raise BadInput((Flaw(str(folder), 0, 0, "", _no_spec_text(others)),))
    return specs, others


def _folder_kind(folder: Path) -> str:
    return NOT_ENTERED if _holds_spec(folder) else "a folder"


def _holds_spec(folder: Path) -> bool:
    """Whether a folder inside has specs that nobody asked to check; hidden ones are no business."""
    if folder.name.startswith(".") or not folder.is_dir():
        return False
    try:
        inside = [p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and p.is_file()]
    except OSError:
        return True  # what cannot be looked at is named
    return any(other_kind(path) is None for path in inside)


def _no_spec_text(others: Sequence[Skipped]) -> str:
    if not others:
        return "no spec (*.yaml) in this folder"
    named = ", ".join(f"{Path(one.file).name} ({one.what})" for one in others[:5])
    more = f" and {len(others) - 5} more" if len(others) > 5 else ""
    return f"no spec in this folder: no file has `syncline:` at its top; found {named}{more}"


def other_kind(path: Path) -> str | None:
    """What a YAML file is that is no spec; None for a spec, and for what cannot be told.

    A spec that is broken, or that forgot its first line, must not pass as something else: it is
    kept, and reading it says what is wrong.
    """
    document = read(path)
    if document.data is None and not document.text:
        return None if document.problems and not _is_empty(path) else "empty"
    keys = set(_top_keys(document))
    if keys & set(_OF_SPECS) or _misspelt(keys):
        return None
    if "study" in keys:
        return "a study"
    if keys & set(SECTIONS):
        return "a catalog"
    if not keys:
        return "no mapping" if _CONTENT.search(document.text) else "empty"
    return "no `syncline:` at its top"


def _misspelt(keys: set[str]) -> bool:
    return any(get_close_matches("syncline", [key.lower()], 1, 0.8) for key in keys)


def _is_empty(path: Path) -> bool:
    try:
        return path.is_file() and path.stat().st_size == 0
    except OSError:
        return False


def _top_keys(document: ParsedFile) -> Iterator[str]:
    """The keys at the top; of a text that is not YAML as specs have it, what looks like keys."""
    if isinstance(document.data, Mapping):
        yield from (str(key) for key in document.data)
        return
    yield from (found[1] for found in _TOP_KEY.finditer(document.text))
