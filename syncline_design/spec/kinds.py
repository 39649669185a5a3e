"""Whether a file is of another kind than the one that is wanted, by the keys at its top."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal

from syncline_design.spec.catalog import SECTIONS
from syncline_design.spec.yaml_text import Flaw, ParsedFile

Wanted = Literal["spec", "study"]
_MARKERS: Final = {"study": "study", "spec": "syncline"}
_OF_SPECS: Final = {"syncline", "stages", "requirements"}
_USES: Final = {
    "study": "`syncline-design study` takes it",
    "spec": "`syncline-design check` takes it, and a study as one of its `base`",
    "catalog": "`syncline-design catalog check` takes it, and a spec among its `catalogs`",
}


def misplaced(document: ParsedFile, wanted: Wanted) -> Flaw | None:
    """The file is plainly of another kind: it has what only that kind has at its top.

    Else its keys are told one by one: a first line that is misspelt makes no other kind of it.
    """
    keys = document.data if isinstance(document.data, Mapping) else {}
    found = None if _MARKERS[wanted] in keys else _other(keys)
    if found is None:
        return None
    kind, key = found
    place = document.key_positions.get((key,), (1, 1))
    expected = f"a {wanted} (`{_MARKERS[wanted]}: 1` at its top)"
    return Flaw(document.file, *place, "", "another kind of file", expected,
                f"a {kind} (`{key}`)", _USES[kind])  # fmt: skip


def _other(keys: Mapping[str, object]) -> tuple[str, str] | None:
    """The kind that keys tell, and by which of them."""
    for kind, marker in _MARKERS.items():
        if marker in keys:
            return kind, marker
    sections = [key for key in keys if key in SECTIONS]
    return ("catalog", sections[0]) if sections and not _OF_SPECS & set(keys) else None
