"""The catalogs as text and as data: what there is, one entry whole, what a check found."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Annotated, Any, Final

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.machine.records import Record, SchemaName, optional
from syncline_design.model.conversion import conversion_of
from syncline_design.model.figure_text import format_like, format_quantity
from syncline_design.model.quantity import Dimension, Quantity, UnitError
from syncline_design.report.render_console import hanging, table_lines
from syncline_design.report.table import table
from syncline_design.report.text import visible
from syncline_design.spec.catalog import SECTIONS as SECTIONS
from syncline_design.spec.catalog import Catalog, EntryKeys, SensorEntry
from syncline_design.spec.catalog_check import CatalogCheck, converted_sigma
from syncline_design.spec.facts import (
    SIGMA_DIMENSIONS,
    Lifecycle,
    PrintedFigure,
    Reach,
    split_figure,
)
from syncline_design.spec.fields import did_you_mean
from syncline_design.verdict.design_data import figure_text

LIST_SCHEMA: Final = "syncline-design/catalog-list/v1"
ENTRY_SCHEMA: Final = "syncline-design/catalog-entry/v1"
_TEXT_FIELDS = ("name", "source", "basis", "note", "figures", "unusual")
_NOT_IN_A_LINE = frozenset(
    {"mass", "power", "lifecycle", "price_class", "temperature", "lead_time", "field_of_view"}
    | {"rate", "depth_rating", "corrects"}
)


@dataclass(frozen=True, slots=True)
class Narrowing:
    """What a list is narrowed to; reach in m, cost with its currency."""

    modality: str | None = None
    type: str | None = None
    reach: float | None = None
    medium: str | None = None
    max_cost: Quantity | None = None

    @property
    def narrows(self) -> bool:
        """Whether anything is asked for."""
        return any(value is not None for value in (self.modality, self.type, *self._facts()))

    def _facts(self) -> tuple[Any, ...]:
        return (self.reach, self.medium, self.max_cost)

    def answers(self, entry: EntryKeys) -> bool | str:
        """Whether an entry fits; the key of a fact that it does not give and that decides."""
        if not isinstance(entry, SensorEntry):
            return not self.narrows
        if self.modality not in (None, entry.modality) or self.type not in (None, entry.type):
            return False
        said = [self._reaches(entry), self._looks_through(entry), self._costs(entry)]
        if False in said:
            return False
        return next((one for one in said if isinstance(one, str)), True)

    def _reaches(self, entry: SensorEntry) -> bool | str:
        if self.reach is None:
            return True
        far = None if entry.reach is None else entry.reach.farthest()
        near = None if entry.reach is None else entry.reach.min
        if (far is not None and far < self.reach) or (near is not None and near > self.reach):
            return False
        return "reach" if far is None else True

    def _looks_through(self, entry: SensorEntry) -> bool | str:
        if self.medium is None:
            return True
        return "medium" if entry.medium is None else entry.medium in (self.medium, "both")

    def _costs(self, entry: SensorEntry) -> bool | str:
        if self.max_cost is None:
            return True
        if entry.cost is None or entry.cost.currency != self.max_cost.currency:
            return "cost"
        return bool(entry.cost <= self.max_cost)


@dataclass(frozen=True, slots=True)
class ListedEntry(Record):
    """One line of a list."""

    section: str
    id: str
    name: str
    origin: str
    modality: str | None = optional()
    type: str | None = optional()
    medium: str | None = optional()
    reach_m: float | None = optional()  # the far end; of a table its smallest row
    cost: str | None = optional()
    status: str | None = optional()


@dataclass(frozen=True, slots=True)
class Undecided(Record):
    """An entry that a filter cannot decide on, and the fact that it does not give."""

    id: str
    key: str


@dataclass(frozen=True, slots=True)
class CatalogList(Record):
    """Entries that fit, and those of which a fact that was asked for is not known."""

    schema: Annotated[str, SchemaName(LIST_SCHEMA)]
    entries: tuple[ListedEntry, ...]
    undecided: tuple[Undecided, ...]


@dataclass(frozen=True, slots=True)
class Printed(Record):
    """What a source prints of a figure, and how it becomes one sigma."""

    part: str
    figure: str
    kind: str
    source: str
    read: str
    factor: float | None = optional()
    conversion: str | None = optional()
    one_sigma: str | None = optional()
    over: str | None = optional()
    at: str | None = optional()
    address: str | None = optional()
    note: str | None = optional()


@dataclass(frozen=True, slots=True)
class ShownFigure(Record):
    """One figure of an entry: as the catalog has it, what it stands on, what its sources print."""

    key: str
    value: str
    printed: tuple[Printed, ...]
    basis: str | None = optional()
    unusual: str | None = optional()


@dataclass(frozen=True, slots=True)
class WholeEntry(Record):
    """One entry of a catalog, whole."""

    schema: Annotated[str, SchemaName(ENTRY_SCHEMA)]
    section: str
    id: str
    name: str
    origin: str
    figures: tuple[ShownFigure, ...]
    source: str
    note: str


Origins = Mapping[tuple[str, str], str]


def listed(
    catalog: Catalog, origins: Origins, section: str | None, wanted: Narrowing | None = None
) -> CatalogList:
    """The entries of a catalog, of one section or of all, that fit."""
    asked = wanted or Narrowing()
    entries: list[ListedEntry] = []
    undecided: list[Undecided] = []
    for name in SECTIONS if section is None else (section,):
        for identity, entry in getattr(catalog, name).items():
            said = asked.answers(entry)
            if said is True:
                entries.append(_listed(name, identity, entry, origins))
            elif isinstance(said, str):
                undecided.append(Undecided(identity, said))
    return CatalogList(LIST_SCHEMA, tuple(entries), tuple(undecided))


def _listed(section: str, identity: str, entry: EntryKeys, origins: Origins) -> ListedEntry:
    reach: Reach | None = getattr(entry, "reach", None)
    cost: Quantity | None = getattr(entry, "cost", None)
    lifecycle: Lifecycle | None = getattr(entry, "lifecycle", None)
    far = None if reach is None else reach.farthest()
    return ListedEntry(
        section, identity, entry.name, origins.get((section, identity), ""),
        getattr(entry, "modality", None), getattr(entry, "type", None) or None,
        getattr(entry, "medium", None), None if far is None else float(far),
        None if cost is None else cost.text, None if lifecycle is None else lifecycle.status,
    )  # fmt: skip


def list_text(catalog: Catalog, found: CatalogList) -> str:
    """Entry by entry: id and name in its first line, then key figures as far as the line goes."""
    blocks = []
    for name in SECTIONS:
        entries: Mapping[str, EntryKeys] = getattr(catalog, name)
        kept = [one.id for one in found.entries if one.section == name]
        rows = [(one, entries[one].name, _digest(entries[one])) for one in kept]
        if rows:
            blocks.append("\n".join([name, *_list_lines(rows)]))
    lacking: dict[str, list[str]] = {}
    for one in found.undecided:
        lacking.setdefault(one.key, []).append(one.id)
    blocks += [
        "\n".join(hanging(f"{len(ids)} more give no {key}, look it up: {', '.join(ids)}"))
        for key, ids in lacking.items()
    ]
    return "\n\n".join(blocks or ["no entry fits"]) + "\n"


def _list_lines(rows: Iterable[tuple[str, str, str]]) -> Iterator[str]:
    """An entry's id and name, so that a search for either shows both, and its figures below."""
    for identity, name, digest in rows:
        yield from hanging(f"{identity}  {name}", 2)
        if digest:
            yield from hanging(digest, 4, deeper=0)


def _digest(entry: EntryKeys) -> str:
    figures = [
        f"{key}\N{NO-BREAK SPACE}{shown(value)}"
        for key, value in _figures(entry)
        if key not in _NOT_IN_A_LINE
    ]
    return ", ".join(figures)


def _figures(entry: EntryKeys) -> list[tuple[str, Any]]:
    return [
        (key, value)
        for key, value in entry.told()
        if key not in _TEXT_FIELDS and value is not None and value != () and value != {}
    ]


def shown(value: Any) -> str:
    """A figure as the catalog writes it, harmless on a terminal."""
    return visible(figure_text(value))


def entry_data(catalog: Catalog, origins: Origins, identity: str) -> WholeEntry | None:
    """Every figure of an entry with what its sources print; None: no such entry."""
    for section in SECTIONS:
        entry: EntryKeys | None = getattr(catalog, section).get(identity)
        if entry is not None:
            origin = origins.get((section, identity), "")
            figures = tuple(_shown_figure(entry, key, value) for key, value in _figures(entry))
            return WholeEntry(
                ENTRY_SCHEMA, section, identity, entry.name, origin, figures, entry.source,
                entry.note,
            )  # fmt: skip
    return None


def _shown_figure(entry: EntryKeys, key: str, value: Any) -> ShownFigure:
    parts = {name: one for name, one in entry.figures.items() if name.partition(".")[0] == key}
    bases = dict.fromkeys(
        basis for name in parts or (key,) if (basis := _basis(entry, name)) is not None
    )
    printed = tuple(_printed(name, one) for name, one in parts.items())
    return ShownFigure(
        key, figure_text(value), printed, ", ".join(bases) or None, entry.unusual.get(key)
    )


def _basis(entry: EntryKeys, figure: str) -> str | None:
    return None if figure in ("modality", "type") else entry.basis_of(figure)


def _printed(name: str, one: PrintedFigure) -> Printed:
    key = split_figure(name)[0]
    conversion = conversion_of(one.kind) if key in SIGMA_DIMENSIONS else None
    sigma = None
    if conversion is not None:
        with suppress(UnitError):
            sigma = converted_sigma(key, one)
    return Printed(
        name,
        one.figure,
        one.kind,
        one.source,
        one.read,
        None if conversion is None else conversion.factor,
        None if conversion is None else conversion.formula,
        None if sigma is None else _one_sigma(sigma, SIGMA_DIMENSIONS[key]),
        None if one.over is None else str(getattr(one.over, "text", one.over)),
        one.at or None,
        one.address or None,
        one.note or None,
    )


def _one_sigma(value: float, dimension: Dimension) -> str:
    """In the unit that catalogs use: degrees for angles, however small."""
    if dimension is Dimension.ANGLE:
        return format_like("deg", value)
    return format_quantity(value, dimension)


def entry_text(entry: WholeEntry) -> str:
    """An entry for people: its figures, marked where they are assumed, then what was read."""
    rows = [(one.key, visible(one.value), one.basis or "") for one in entry.figures]
    head = f"{entry.id} ({entry.section}): {entry.name}"
    shown = table("Figures", ("Figure", "Value", "Basis"), rows)
    lines = [*hanging(head), *table_lines(shown, "  ", silent=True)]
    printed = [part for one in entry.figures for part in one.printed]
    if printed:
        lines += hanging("read in the sources, and how it becomes one sigma per axis:", 2)
        lines += [line for one in printed for line in _printed_lines(one)]
    told = [(f"unusual: {one.key}", one.unusual) for one in entry.figures]
    told += [(label, getattr(entry, label)) for label in ("source", "note")]
    lines += [line for label, text in told if text for line in hanging(f"{label}: {text}", 2)]
    return "\n".join(lines) + "\n"


def _printed_lines(one: Printed) -> Iterator[str]:
    over = f" of {one.over}" if one.over else ""
    at = f", {one.at}" if one.at else ""
    conversion = f": {one.conversion}" if one.conversion else ""
    conversion += f"; one sigma {one.one_sigma}" if one.one_sigma else ""
    yield from hanging(f"{one.part}: {one.figure}{over} ({one.kind}{at}){conversion}", 4)
    address = f", {one.address}" if one.address else ""
    yield from hanging(f"{one.source}{address}, read {one.read}", 6)
    if one.note:
        yield from hanging(one.note, 6)


def suggestion(catalog: Catalog, identity: str) -> str:
    """`; did you mean X?`, or where to look."""
    known = [name for section in SECTIONS for name in getattr(catalog, section)]
    return f"; {did_you_mean(identity, known) or 'see `syncline-design catalog list`'}"


def check_text(found: CatalogCheck) -> str:
    """The findings, one a line, and how much was looked at."""
    files = f"{len(found.files)} file{'' if len(found.files) == 1 else 's'}"
    count = len(found.findings)
    said = f"{count} finding{'' if count == 1 else 's'}" if count else "no findings"
    lines = [visible(str(one)) for one in found.findings]
    return "\n".join([*lines, f"{found.entries} entries in {files}: {said}"]) + "\n"
