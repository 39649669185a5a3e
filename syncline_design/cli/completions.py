"""How a word goes on: what a shell offers at Tab besides commands and options.

A shell asks with a command half typed, so nothing here may refuse, and what is slow to load is
loaded when it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

Offer = Callable[[str], list[str]]

SOLVER_ROADS = ("auto", "front", "milp", "enumerate")
MEDIA = ("air", "water")


def among(words: Callable[[], Iterable[str]]) -> Offer:
    """Those of the words that begin as what is typed."""

    def offered(incomplete: str) -> list[str]:
        return [word for word in words() if word.startswith(incomplete)]

    return offered


def one_of(*words: str) -> Offer:
    """The same for words that are known beforehand."""
    return among(lambda: words)


def format_words(formats: tuple[str, ...]) -> Offer:
    """Formats of `--output`, each with the colon that its path follows."""
    return one_of(*(f"{name}:" for name in formats))


def catalog_ids() -> list[str]:
    """Every entry of the built-in catalogs."""
    from syncline_design.report.catalogs import SECTIONS
    from syncline_design.spec.load import builtin_collection

    catalog = builtin_collection().catalog()
    return [name for section in SECTIONS for name in getattr(catalog, section)]


def catalog_sections() -> tuple[str, ...]:
    """Kinds of entries that a catalog has."""
    from syncline_design.report.catalogs import SECTIONS

    return tuple(SECTIONS)


def stub_types() -> tuple[str, ...]:
    """Kinds of entries of which there is a stub."""
    from syncline_design.report.catalog_stub import STUB_TYPES

    return STUB_TYPES
