"""Catalog files looked over as a whole: format, sources, conversions, siblings, ids, lifecycle.

What loading refuses is wrong; what is found here besides may be right and has to be said: a source,
a successor, why a figure stands apart.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Annotated, Any, Final, Literal

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional
from syncline_design.model.conversion import conversion_of, printed_value
from syncline_design.model.figure_text import format_like, to_digits
from syncline_design.model.quantity import UnitError
from syncline_design.spec.catalog import SECTIONS, Catalog, EntryKeys, Product, SensorEntry
from syncline_design.spec.facts import (
    AXES,
    PARTS,
    SIGMA_DIMENSIONS,
    Lifecycle,
    PrintedFigure,
    Reach,
    split_figure,
)
from syncline_design.spec.fields import did_you_mean
from syncline_design.spec.files import Collection, add_builtin, add_file, published_ids
from syncline_design.spec.measured import MeasuredKeys
from syncline_design.spec.references import unknown_requirements
from syncline_design.spec.validation import validate
from syncline_design.spec.yaml_text import Flaw, KeyPath, ParsedFile

SCHEMA: Final = "syncline-design/catalog-check/v1"
FACTOR: Final = 5.0  # further than this from the siblings' median is asked about
FEWEST_SIBLINGS: Final = 4
CLOSE: Final = 0.02  # between a figure and what its conversion gives: three digits are written
_ID = re.compile(r"[a-z][a-z0-9]*(?:_[a-z0-9]+)*")
Code = Literal[
    "format",
    "duplicate",
    "id",
    "unsourced",
    "conversion",
    "siblings",
    "successor",
    "published",
    "measured",
]
# Words about an entry, what its type says anyway, and what a figure is of: they need no source.
_PLAIN: Final = frozenset(
    {"name", "source", "basis", "note", "figures", "unusual", "modality", "type", "medium"}
    | {"needs", "corrects", "lifecycle", "timeline", "requires", "lead_time", "offset_after"}
)  # fmt: skip
_COMPARED: Final = (*SIGMA_DIMENSIONS, "reach", "rate", "cost", "mass", "power")


@dataclass(frozen=True, slots=True)
class CatalogFlaw(Record):
    """One thing to mend, or to say: where, what, what to do."""

    code: Code
    file: str
    line: int
    column: int
    message: str
    hint: str
    section: str | None = optional()
    entry: str | None = optional()
    key: str | None = optional()

    def __str__(self) -> str:
        """`file:line:col: section.entry.key: message; hint`."""
        path = ".".join(part for part in (self.section, self.entry, self.key) if part)
        words = f"{path}: {self.message}" if path else self.message
        told = f"{words}; {self.hint}" if self.hint else words
        return f"{self.file}:{self.line}:{self.column}: {told}"


@dataclass(frozen=True, slots=True)
class CatalogCheck(Record):
    """What was looked at and what was found."""

    schema: Annotated[str, SchemaName(SCHEMA)]
    files: tuple[str, ...]
    entries: int
    findings: tuple[CatalogFlaw, ...]

    @property
    def exit_code(self) -> int:
        """0 without findings, else 1."""
        return 1 if self.findings else 0


@dataclass(frozen=True, slots=True)
class _Place:
    """One entry with the document that it stands in."""

    section: str
    id: str
    entry: Any
    document: ParsedFile

    def finding(self, code: Code, key: str, message: str, hint: str) -> CatalogFlaw:
        path: KeyPath = (self.section, self.id, *([key] if key else []))
        line, column = self.document.key_positions.get(path, self.document.position(path))
        return CatalogFlaw(
            code, self.document.file, line, column, message, hint, self.section, self.id,
            key or None,
        )  # fmt: skip


def check_catalogs(paths: Sequence[Path] = ()) -> CatalogCheck:
    """Look over catalog files, each with what it names; without paths, the shipped ones."""
    collection = Collection()
    add_builtin(collection)
    own = [add_file(collection, path) for path in paths]
    collection.draw_all()
    every = list(_entries(collection, own))
    looked_at = [one for one in every if not own or not one.document.file.startswith("builtin:")]
    flaws = collection.problems + unknown_requirements(collection)
    findings = [_refused(flaw) for flaw in flaws]
    findings += [] if paths else list(_withdrawn(collection))
    known = {section: {one.id for one in every if one.section == section} for section in SECTIONS}
    sizes = _sizes(every)
    for one in looked_at:
        findings += [*_ids(one), *_sources(one), *_conversions(one), *_successor(one, known)]
        findings += [*_siblings(one, sizes), *_altered(one)]
    findings += _same_names(looked_at, every)
    found = sorted(set(findings), key=lambda f: (f.file, f.line, f.column, f.code, f.message))
    read = (*own, *(one.document for one in looked_at))
    files = tuple(dict.fromkeys(document.file for document in read))
    return CatalogCheck(SCHEMA, files, len(looked_at), tuple(found))


def _entries(collection: Collection, own: Sequence[ParsedFile]) -> Iterator[_Place]:
    """Every entry that can be read, by itself where something else in its file cannot.

    An id that is taken already is looked at all the same.
    """
    for (section, identity), (document, _) in collection.documents.items():
        entry = collection.entries[section].get(identity) or _alone(document, section, identity)
        if entry is not None:
            yield _Place(section, identity, entry, document)
    for document in own:
        for section in SECTIONS:
            entries = document.data.get(section) if isinstance(document.data, dict) else None
            for identity in entries if isinstance(entries, dict) else ():
                if collection.documents[section, identity][0] is not document:
                    entry = _alone(document, section, identity)
                    if entry is not None:
                        yield _Place(section, identity, entry, document)


def _alone(document: ParsedFile, section: str, identity: str) -> Any:
    """One entry of a document; None where it cannot be read, which loading has said."""
    single = replace(document, data={section: {identity: document.data[section][identity]}})
    model, _ = validate(Catalog, single)
    return None if model is None else getattr(model, section)[identity]


def _refused(flaw: Flaw) -> CatalogFlaw:
    code: Code = "duplicate" if flaw.message.startswith("this id is taken") else "format"
    parts = [f"expected {flaw.expected}" if flaw.expected else ""]
    parts += [f"found {flaw.found}" if flaw.found else "", flaw.hint]
    message = f"{flaw.path}: {flaw.message}" if flaw.path else flaw.message
    hint = "; ".join(part for part in parts if part)
    return CatalogFlaw(code, flaw.file, flaw.line, flaw.column, message, hint)


def _withdrawn(collection: Collection) -> Iterator[CatalogFlaw]:
    """Ids that a release had and the shipped catalogs have no more: specs out there name them."""
    for number, line in enumerate(published_ids().read_text("utf-8").splitlines(), 1):
        section, _, identity = line.partition(" ")
        if identity and (section, identity) not in collection.origins:
            message = f"{identity} of {section} was published and is gone"
            hint = "bring it back; what is no longer made is discontinued, not deleted"
            yield CatalogFlaw("published", "builtin:ids.txt", number, 1, message, hint)


def _ids(one: _Place) -> Iterator[CatalogFlaw]:
    """An id is for years: specs name it, so it holds no capitals, blanks or signs."""
    if not _ID.fullmatch(one.id):
        yield one.finding("id", "", "an id that will not last", "lower case: maker_model_variant")


def _sources(one: _Place) -> Iterator[CatalogFlaw]:
    """Figures that neither a source nor a basis accounts for."""
    entry: EntryKeys = one.entry
    if entry.source:
        return
    printed = {split_figure(key)[0] for key in entry.figures}
    for key, value in entry.told():
        if key in _PLAIN or value in (None, (), {}, "") or key in printed:
            continue
        if key == "primitives" and one.section == "timestamping":
            continue  # what a method serves is what it is
        if _is_nothing(value) or _has_basis(entry, key):
            continue
        hint = "add it to figures, name a source, or mark it in basis"
        yield one.finding("unsourced", key, f"no source for {key}", hint)


def _is_nothing(value: Any) -> bool:
    return isinstance(value, float) and value == 0.0


def _has_basis(entry: EntryKeys, key: str) -> bool:
    if entry.basis_of(key) is not None:
        return True
    return any(entry.basis_of(f"{key}.{part}") for part in PARTS.get(key, ()))


def _conversions(one: _Place) -> Iterator[CatalogFlaw]:
    """Sigmas that are not what the printed figure and its kind give."""
    for key, printed in one.entry.figures.items():
        name, part = split_figure(key)
        if name not in SIGMA_DIMENSIONS:
            continue
        try:
            converted = converted_sigma(name, printed)
        except UnitError as error:
            yield one.finding("conversion", name, f"the printed figure of {key}: {error}", "")
            continue
        if converted is None:
            wanted = "a kind that says how wide the error spreads: 1 sigma, cep50, 95 %, ..."
            message = f"the printed figure of {key} is of the kind {printed.kind}"
            yield one.finding("conversion", name, message, wanted)
            continue
        for written in _axis_figures(getattr(one.entry, name), name, part):
            if abs(float(written) - converted) > CLOSE * converted:
                says = format_like(getattr(written, "text", ""), converted)
                message = (
                    f"{getattr(written, 'text', written)} is written, "
                    f"{printed.figure} ({printed.kind}) gives {says}"
                )
                yield one.finding("conversion", name, message, "write what the conversion gives")
                break


def converted_sigma(name: str, printed: PrintedFigure) -> float | None:
    """One standard deviation per axis that a printed figure stands for, in SI; None: none."""
    conversion = conversion_of(printed.kind)
    if conversion is None:
        return None
    over = None if printed.over is None else float(printed.over)
    return conversion.factor * printed_value(printed.figure, SIGMA_DIMENSIONS[name], over)


def _axis_figures(value: Any, name: str, part: str) -> tuple[Any, ...]:
    axes = value if isinstance(value, tuple) else (value,)
    if not part or len(axes) == 1:
        return axes
    return tuple(axes[axis] for axis in AXES[name][part])


def _successor(one: _Place, known: Mapping[str, set[str]]) -> Iterator[CatalogFlaw]:
    """Who comes after a product that is no longer made, as far as that is known."""
    lifecycle: Lifecycle | None = getattr(one.entry, "lifecycle", None)
    if lifecycle is None:
        return
    follower = lifecycle.successor
    if follower is None and lifecycle.status == "discontinued" and not lifecycle.note:
        hint = "name the successor, or say in its note that none is known"
        yield one.finding("successor", "lifecycle", "discontinued without a successor", hint)
    if follower is not None and (follower not in known[one.section] or follower == one.id):
        hint = did_you_mean(follower, known[one.section] - {one.id}) or "an id of this section"
        yield one.finding("successor", "lifecycle", f"no such successor: {follower}", hint)


def _altered(one: _Place) -> Iterator[CatalogFlaw]:
    """Entries that say that they were measured, and whose figures are not what was."""
    for key in ("error", "offset"):
        error = getattr(one.entry, key, None)
        if isinstance(error, MeasuredKeys) and (why := error.why_not_measured):
            yield one.finding("measured", key, "not as it was measured", why)


def _sizes(every: Sequence[_Place]) -> Mapping[tuple[str, str, str], list[float]]:
    """What sensors of a modality and type say of a figure, by size."""
    found: dict[tuple[str, str, str], list[float]] = {}
    for one in every:
        if isinstance(one.entry, SensorEntry):
            for key in _COMPARED:
                if size := size_of(one.entry, key):
                    found.setdefault((one.entry.modality, one.entry.type, key), []).append(size)
    return {family: sorted(sizes) for family, sizes in found.items()}


def _siblings(
    one: _Place, sizes: Mapping[tuple[str, str, str], list[float]]
) -> Iterator[CatalogFlaw]:
    """Figures more than a factor of 5 off the median of the others of the same kind of sensor."""
    entry = one.entry
    if not isinstance(entry, SensorEntry) or not entry.type:
        return
    for key in _COMPARED:
        value = size_of(entry, key)
        if not value or key in entry.unusual:
            continue
        family = sizes[entry.modality, entry.type, key]
        mine = bisect_left(family, value)
        others = family[:mine] + family[mine + 1 :]
        if len(others) < FEWEST_SIBLINGS:
            continue
        middle = median(others)
        if not middle / FACTOR <= value <= middle * FACTOR:
            ratio = max(value / middle, middle / value)
            way = "more" if value > middle else "less"
            message = (
                f"{to_digits(ratio, 3)} times {way} than the median of {len(others)} others "
                f"of type {entry.type}"
            )
            hint = f"look at the unit; if it is right, say why: unusual: {{{key}: ...}}"
            yield one.finding("siblings", key, message, hint)


def size_of(entry: Product, key: str) -> float | None:
    """One number to compare by: a sigma over its axes, the far end of a reach."""
    value = getattr(entry, key)
    if isinstance(value, Reach):
        value = value.farthest()
    if isinstance(value, tuple):
        return math.sqrt(sum(float(axis) ** 2 for axis in value) / len(value))
    return None if value is None else float(value)


def _same_names(looked_at: Sequence[_Place], every: Sequence[_Place]) -> Iterator[CatalogFlaw]:
    """Two entries of a section by one name: a reader of a report cannot tell them apart."""
    first: dict[tuple[str, str], _Place] = {}
    asked = {(one.section, one.id) for one in looked_at}
    for one in every:
        name = " ".join(one.entry.name.casefold().split())
        other = first.setdefault((one.section, name), one) if name else one
        if other is not one and (one.section, one.id) in asked:
            message = f"the same name as {other.id}"
            yield one.finding("duplicate", "name", message, "say in which variant they differ")
