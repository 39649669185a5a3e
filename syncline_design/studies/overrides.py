"""One figure of a catalog entry set to another value for one case."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from syncline_design.spec.catalog import Catalog
from syncline_design.spec.factors import plain
from syncline_design.spec.fields import did_you_mean
from syncline_design.spec.files import Collection, fill_empirical, problem_at
from syncline_design.spec.keys import KeyPathError, put, value_at
from syncline_design.spec.load import BadInput
from syncline_design.spec.validation import validate
from syncline_design.spec.yaml_text import Document, KeyPath, Problem


def override_entry(catalogs: Collection, path: KeyPath, value: Any, spec: Document) -> Collection:
    """The catalogs with `catalog.SECTION[ID].KEY...` set; BadInput says why that cannot be."""
    section, identity = str(path[1]), str(path[2])
    origin = catalogs.documents.get((section, identity))
    if origin is None:
        known = [name for part, name in catalogs.origins if part == section]
        hint = did_you_mean(identity, known)
        raise BadInput((problem_at(spec, (), f"no entry {identity} in {section}", hint=hint),))
    document, at = origin
    try:
        changed = put(value_at(document.data, at), path[3:], value)
    except KeyPathError as error:
        raise BadInput((problem_at(spec, (), error.message, error.expected),)) from None
    read = Collection()  # files of delays that the new value names
    model, problems = _validated(document, (section, identity), changed, Path(spec.file), read)
    if model is None or problems:
        raise BadInput(tuple(problems))
    result = catalogs.copy()
    result.entries[section][identity] = getattr(model, section)[identity]
    result.documents[section, identity] = (_entry_document(document, at, changed), at)
    shown = json.dumps([list(path), plain(value)], ensure_ascii=True)
    result.digests += [f"override {shown}", *read.digests]
    return result


def _validated(
    document: Document, place: tuple[str, str], entry: Any, spec: Path, read: Collection
) -> tuple[Catalog | None, list[Problem]]:
    """The entry through the catalog's own model, its errors placed in its own file.

    Files are named from the catalog's folder; a shipped catalog has none, the spec's counts.
    """
    section, identity = place
    single = Document(
        document.file, {section: {identity: entry}}, document.positions, document.key_positions,
        document.sha256, document.text,
    )  # fmt: skip
    shipped = document.file.startswith("builtin:")
    folder = (spec if shipped else Path(document.file)).parent
    filled = fill_empirical(single, folder, spec.parent, read)
    model, problems = validate(Catalog, single, filled)
    return model, [*problems, *read.problems]


def _entry_document(document: Document, at: KeyPath, entry: Any) -> Document:
    """The document with one entry changed, so that a further override starts from it."""
    return Document(
        document.file, put(document.data, at, entry), document.positions, document.key_positions,
        document.sha256, document.text,
    )  # fmt: skip
