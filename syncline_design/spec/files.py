"""Catalog files: the built-in ones and a spec's own, checked, drawn together, hashed."""

from __future__ import annotations

import functools
import hashlib
import re
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import field
from importlib.resources import files
from pathlib import Path
from typing import Any

from syncline_design.machine.frozen import frozen
from syncline_design.machine.input_files import note_place
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.quantity import UNITS, Dimension, Quantity, UnitError, parse_quantity
from syncline_design.spec.catalog import SECTIONS, Catalog, CatalogFile
from syncline_design.spec.fields import did_you_mean
from syncline_design.spec.validation import validate
from syncline_design.spec.yaml_text import (
    Flaw,
    KeyPath,
    ParsedFile,
    StopReadingError,
    printable,
    read,
    read_bytes,
    show_path,
)

BUILTIN_PACKAGE = "syncline_design.catalogs"
_LINE = re.compile(
    r"^(?:(?P<section>[a-z]+):|  (?P<id>[^\s:#-][^\s:]*):"
    r"|    (?P<key>modality|type): (?P<word>\S+))"
)
MOST_PATH = 4096  # characters; following a longer one takes seconds


@dataclass(frozen=True, slots=True)
class Unread:
    """An entry of a shipped family that no spec has asked for yet: its file, what a query sees."""

    file: str
    place: str
    modality: str = ""
    type: str = ""


@dataclass
class Collection:
    """Catalog entries as they are drawn together, with where each came from.

    families: whether those of the package may be drawn in; unread: their entries, by id and place,
    once something is asked for that the other files do not have.
    """

    entries: dict[str, dict[str, Any]] = field(default_factory=lambda: {s: {} for s in SECTIONS})
    origins: dict[tuple[str, str], str] = field(
        default_factory=dict
    )  # (section, id) -> file:line:col
    documents: dict[tuple[str, str], tuple[ParsedFile, KeyPath]] = field(default_factory=dict)
    problems: list[Flaw] = field(default_factory=list)
    digests: list[str] = field(default_factory=list)
    unread: dict[tuple[str, str], Unread] = field(default_factory=dict)
    families: bool = False

    def catalog(self) -> Catalog:
        """The merged catalog; its entries have been validated one by one."""
        merged = {section: frozen(found) for section, found in self.entries.items()}
        return Catalog.model_construct(**merged)  # type: ignore[arg-type]

    def copy(self) -> Collection:
        """A copy to which problems, digests and entries can be added."""
        return Collection(
            {section: dict(found) for section, found in self.entries.items()},
            dict(self.origins),
            dict(self.documents),
            list(self.problems),
            list(self.digests),
            dict(self.unread),
            self.families,
        )

    def note_families(self) -> None:
        """Learn which entries the shipped families hold, once."""
        if self.families:
            self.families = False
            self.unread.update(_families())
            self.origins.update((key, one.place) for key, one in self.unread.items())

    def draw(self, wanted: Iterable[tuple[str, str]]) -> None:
        """Read the shipped families that hold these entries, as far as they are unread."""
        wanted = [key for key in wanted if key not in self.documents]
        if not wanted:
            return
        self.note_families()
        for shown in sorted({self.unread[key].file for key in wanted if key in self.unread}):
            family = _family(shown)
            for section, found in family.entries.items():
                self.entries[section].update(found)
            self.documents.update(family.documents)
            self.problems.extend(family.problems)
            self.digests.extend(family.digests)
            self.unread = {key: one for key, one in self.unread.items() if one.file != shown}

    def draw_types(self, types: Container[tuple[str, str]]) -> None:
        """Read the shipped families that hold a sensor of one of these modalities and types."""
        self.note_families()
        self.draw([key for key, one in self.unread.items() if (one.modality, one.type) in types])

    def draw_all(self) -> None:
        """Read every shipped family."""
        self.note_families()
        self.draw(list(self.unread))

    def sha256(self) -> str:
        """One hash over all files, in the order they were drawn in."""
        return hashlib.sha256("\n".join(self.digests).encode()).hexdigest()


def problem_at(
    document: ParsedFile, path: KeyPath, message: str, expected: str = "", found: str = "",
    hint: str = "",
) -> Flaw:  # fmt: skip
    """A problem at the place of a key path."""
    line, column = document.position(path)
    return Flaw(
        document.file, line, column, show_path(path), message, expected, printable(found, 80), hint
    )


def add_builtin(collection: Collection) -> None:
    """Draw in the catalog files of the package.

    A family (a file in a folder of the package) is read once a spec asks for one of its entries:
    most specs name a few, and reading all would take longer than checking such a spec.
    """
    shipped = _shipped(tuple((path, _content(path)) for path in sorted(_package().glob("*.yaml"))))
    collection.problems.extend(shipped.problems)
    collection.digests.extend(shipped.digests)
    collection.origins.update(shipped.origins)
    collection.documents.update(shipped.documents)
    for section, found in shipped.entries.items():
        collection.entries[section].update(found)
    collection.families = True


def _content(path: Path) -> bytes:
    """What a file holds, read each time so that every command notes it among what it reads."""
    try:
        return read_bytes(path)
    except (OSError, StopReadingError):
        return b""  # reading it as a catalog says why


@functools.lru_cache(maxsize=2)
def _shipped(contents: tuple[tuple[Path, bytes], ...]) -> Collection:
    """The files beside the families, looked over once a process as long as they hold the same."""
    alone = Collection()
    for path, _ in contents:
        shown = f"builtin:{path.name}"
        _add_document(alone, read(path, shown), path.parent, path.parent, shown)
    return alone


def _package() -> Path:
    return Path(str(files(BUILTIN_PACKAGE)))


def published_ids() -> Path:
    """The ids of all shipped entries that a release had, `SECTION ID` a line."""
    return _package() / "ids.txt"


@functools.cache
def _families() -> Mapping[tuple[str, str], Unread]:
    """What the shipped families hold, from their lines alone: they are indented by two spaces."""
    found: dict[tuple[str, str], Unread] = {}
    for path in sorted(_package().glob("*/*.yaml")):
        shown = f"builtin:{path.parent.name}/{path.name}"
        found.update(_listed(path.read_text("utf-8"), shown))
    return found


def _listed(text: str, shown: str) -> Iterator[tuple[tuple[str, str], Unread]]:
    section, identity, place, told = "", "", "", {"modality": "", "type": ""}
    for number, line in enumerate((*text.splitlines(), "end:"), 1):
        match = _LINE.match(line)
        if match is None:
            continue
        if match["key"]:
            told[match["key"]] = match["word"]
            continue
        if identity:
            yield (section, identity), Unread(shown, place, told["modality"], told["type"])
        section, identity = match["section"] or section, match["id"] or ""
        place, told = f"{shown}:{number}:3", {"modality": "", "type": ""}


@functools.cache
def _family(shown: str) -> Collection:
    """One shipped family, read once a process."""
    alone = Collection()
    path = _package() / shown.removeprefix("builtin:")
    _add_document(alone, read(path, shown), path.parent, _package(), shown)
    return alone


def add_file(collection: Collection, path: Path) -> ParsedFile:
    """Draw in one catalog file by itself, and those that it names."""
    document = read(path)
    collection.note_families()
    _add_document(collection, document, path.parent, path.parent.resolve(), str(path))
    _add_listed(collection, document, path.parent, path.parent.resolve(), (str(path),))
    return document


def add_own(collection: Collection, spec: ParsedFile, folder: Path) -> None:
    """Draw in the catalogs that a spec names, and those that these name."""
    if isinstance(spec.data, dict) and "catalogs" in spec.data:
        collection.note_families()  # their ids are taken
    _add_listed(collection, spec, folder, folder.resolve(), (spec.file,))


def _add_listed(
    collection: Collection, lister: ParsedFile, folder: Path, root: Path, chain: tuple[str, ...]
) -> None:
    listed = lister.data.get("catalogs", ()) if isinstance(lister.data, dict) else ()
    for index, name in enumerate(listed if isinstance(listed, tuple) else ()):
        if not isinstance(name, str) or not name:
            continue  # the model of the listing file says so
        inside = inside_folder(lister, ("catalogs", index), name, folder, root)
        if isinstance(inside, Flaw):
            collection.problems.append(inside)
            continue
        shown = str(Path(chain[0]).parent / inside.relative_to(root))
        if shown in chain or inside == (root / Path(chain[0]).name):
            circle = "catalogs include each other in a circle: " + " -> ".join((*chain, shown))
            collection.problems.append(problem_at(lister, ("catalogs", index), circle))
            continue
        # Named from the spec's folder: the hash is the same wherever the command is run.
        plain = inside.relative_to(root).as_posix()
        if any(plain == digest.partition(" ")[2] for digest in collection.digests):
            continue  # drawn in already by another file
        document = read(inside, shown)
        if not document.sha256:  # never opened: say where it is named
            reason = f"{shown}: {document.problems[0].message}"
            collection.problems.append(problem_at(lister, ("catalogs", index), reason))
            continue
        _add_document(collection, document, inside.parent, root, plain)
        _add_listed(collection, document, inside.parent, root, (*chain, shown))


def inside_folder(
    document: ParsedFile, path: KeyPath, name: str, folder: Path, root: Path
) -> Path | Flaw:
    """The file that a relative name means, if it is inside `root` after following symlinks."""
    wanted = "a file inside the spec's folder"
    if Path(name).is_absolute() or name.startswith(("~", "\\")) or ":" in name[:3]:
        return problem_at(document, path, "an absolute path", wanted, name, "write it relative")
    if len(name) > MOST_PATH:
        return problem_at(document, path, f"a path of {len(name)} characters", wanted, name)
    note_place(folder / name)
    try:
        target = (folder / name).resolve()
        there = target.exists()
    except (OSError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        return problem_at(document, path, f"a path that cannot be followed: {reason}", wanted, name)
    if not target.is_relative_to(root):
        return problem_at(document, path, "a path that leaves the spec's folder", wanted, name)
    if not there:
        near = [p.name for p in sorted(root.glob("*.yaml"))]
        return problem_at(document, path, "no such file", wanted, name, did_you_mean(name, near))
    if not target.is_file():
        kind = "a folder" if target.is_dir() else "not a regular file (a pipe, socket or device)"
        return problem_at(document, path, kind, wanted, name)
    return target


def _add_document(
    collection: Collection, document: ParsedFile, folder: Path, root: Path, name: str
) -> None:
    collection.digests.append(f"{document.sha256} {name}")
    collection.problems.extend(document.problems)
    if document.data is None:
        return
    if not isinstance(document.data, dict):
        collection.problems.append(
            problem_at(document, (), "not a catalog", f"a mapping of {', '.join(SECTIONS)}")
        )
        return
    filled = fill_empirical(document, folder, root, collection)
    model, problems = validate(CatalogFile, document, filled)
    collection.problems.extend(problems)
    for section in SECTIONS:
        raw = document.data.get(section)
        for identity in raw if isinstance(raw, dict) else ():
            _add_entry(collection, document, section, identity, model)


def _add_entry(
    collection: Collection, document: ParsedFile, section: str, identity: str, model: Catalog | None
) -> None:
    """Note one entry; a broken one keeps its id so that references to it are not unknown."""
    line, column = document.key_positions.get((section, identity), (1, 1))
    place = f"{document.file}:{line}:{column}"
    first = collection.origins.get((section, identity))
    if first is not None:
        message = f"this id is taken: {identity} is also at {first}"
        shown, hint = show_path((section, identity)), "rename one of them"
        problem = Flaw(document.file, line, column, shown, message, hint=hint)
        collection.problems.append(problem)
        return
    collection.origins[section, identity] = place
    collection.documents[section, identity] = (document, (section, identity))
    if model is not None:
        collection.entries[section][identity] = getattr(model, section)[identity]


def fill_empirical(document: ParsedFile, folder: Path, root: Path, collection: Collection) -> Any:
    """The document's data with the values of empirical error files put in.

    Their names are relative to `folder`, where the document lies, and stay inside `root`.
    """

    def filled(data: Any, path: KeyPath) -> Any:
        if isinstance(data, tuple):
            return tuple(filled(item, (*path, index)) for index, item in enumerate(data))
        if not isinstance(data, dict):
            return data
        if data.get("distribution") == "empirical" and isinstance(data.get("file"), str):
            values = _empirical_values(document, data, path, (folder, root.resolve()), collection)
            return data if values is None else {**data, "values": values}
        return {key: filled(item, (*path, key)) for key, item in data.items()}

    return filled(document.data, ())


def _empirical_values(
    document: ParsedFile, data: dict[str, Any], path: KeyPath, folders: tuple[Path, Path],
    collection: Collection,
) -> tuple[Quantity, ...] | None:  # fmt: skip
    at = (*path, "file")
    if "values" in data:
        error = problem_at(document, at, "both values and file", "one of them", hint="delete one")
        collection.problems.append(error)
        return None
    inside = inside_folder(document, at, data["file"], *folders)
    if isinstance(inside, Flaw):
        collection.problems.append(inside)
        return None
    try:
        content = read_bytes(inside)
        values = tuple(read_values(content.decode("utf-8-sig"), data["file"]))
    except (OSError, UnicodeDecodeError, StopReadingError, UnitError) as error:
        message = f"cannot read the values: {error}"
        collection.problems.append(problem_at(document, at, message))
        return None
    collection.digests.append(f"{hashlib.sha256(content).hexdigest()} {data['file']}")
    return values


def read_values(text: str, name: str) -> list[Quantity]:
    """Times of a file: `NUMBER UNIT` per line, or bare numbers under a header that is a unit."""
    lines = [(n, line.strip()) for n, line in enumerate(text.splitlines(), 1)]
    lines = [(n, line) for n, line in lines if line and not line.startswith("#")]
    if not lines:
        raise UnitError(f"{name} holds no values", "one time per line")
    unit = ""
    if lines[0][1].strip("[]") in UNITS:
        unit = " " + lines.pop(0)[1].strip("[]")
        parse_quantity(f"1{unit}", Dimension.TIME)
    values: list[Quantity] = []
    for number, line in lines:
        try:
            values.append(parse_quantity(line + unit, Dimension.TIME, tolerance=False))
        except UnitError as error:
            raise UnitError(f"{name} line {number}: {error}") from None
    if not values:
        raise UnitError(f"{name} holds no values", "one time per line")
    return values
