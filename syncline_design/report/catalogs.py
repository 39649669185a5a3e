"""The catalogs as text: what there is, and one entry with its sources."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from syncline_design.report.render_console import aligned
from syncline_design.report.text import visible
from syncline_design.spec.catalog import Catalog, Entry
from syncline_design.spec.fields import did_you_mean
from syncline_design.verdict.design_data import figure_text

SECTIONS = ("platforms", "sensors", "timestamping", "infrastructure", "clocks")
_TEXT_FIELDS = ("name", "source", "basis", "note")


def list_text(catalog: Catalog, section: str | None) -> str:
    """One line an entry: id, name, key figures."""
    blocks = []
    for name in SECTIONS if section is None else (section,):
        entries: Mapping[str, Entry] = getattr(catalog, name)
        rows = [[identity, visible(e.name), _digest(e)] for identity, e in entries.items()]
        if rows:
            blocks.append("\n".join([name, *aligned(rows)]))
    return "\n\n".join(blocks) + "\n"


def _digest(entry: Entry) -> str:
    figures = [
        f"{key} {shown(value)}" for key, value in _figures(entry) if key not in ("mass", "power")
    ]
    return ", ".join(figures)


def _figures(entry: Entry) -> list[tuple[str, Any]]:
    return [
        (key, value)
        for key, value in entry.told()
        if key not in _TEXT_FIELDS and value is not None and value != () and value != {}
    ]


def shown(value: Any) -> str:
    """A figure as the catalog writes it, harmless on a terminal."""
    return visible(figure_text(value))


def show_text(catalog: Catalog, identity: str) -> str | None:
    """Every figure of an entry, marked where it is an assumption; None: no such entry."""
    for section in SECTIONS:
        entry: Entry | None = getattr(catalog, section).get(identity)
        if entry is not None:
            return _entry_text(section, identity, entry)
    return None


def _entry_text(section: str, identity: str, entry: Entry) -> str:
    rows = [
        [key, shown(value), "assumption" if is_assumed(entry, key) else ""]
        for key, value in _figures(entry)
    ]
    lines = [f"{identity} ({section}): {visible(entry.name)}", *aligned(rows)]
    told = [(label, getattr(entry, label)) for label in ("source", "note")]
    lines += [f"  {label}: {visible(text)}" for label, text in told if text]
    return "\n".join(lines) + "\n"


def is_assumed(entry: Entry, figure: str) -> bool:
    """Whether the catalog has no public source for a figure."""
    return entry.basis_of(figure) == "assumption" and figure not in ("modality", "type")


def suggestion(catalog: Catalog, identity: str) -> str:
    """`; did you mean X?`, or where to look."""
    known = [name for section in SECTIONS for name in getattr(catalog, section)]
    return f"; {did_you_mean(identity, known) or 'see `syncline-design catalog list`'}"
