"""How a word goes on: what a shell offers at Tab besides commands and options.

A shell asks with a command half typed, so nothing here may refuse, and what is slow to load is
loaded when it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib.resources import files
from pathlib import Path

from syncline_design.model.roles import ROLES

Offer = Callable[[str], list[str]]

SOLVER_ROADS = ("auto", "front", "milp", "enumerate")
MEDIA = ("air", "water")
SENSORS = (*ROLES, "target")  # what an effect acts on


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
    """Every entry of the built-in catalogs, from the list of their names alone: no file is read."""
    return list(dict.fromkeys(name for _, name in _published()))


def catalog_sections() -> list[str]:
    """Kinds of entries that a catalog has."""
    return list(dict.fromkeys(section for section, _ in _published()))


def _published() -> list[tuple[str, str]]:
    """Section and id of all shipped entries."""
    lines = (files("syncline_design.catalogs") / "ids.txt").read_text("utf-8").split("\n")
    return [(section, name) for section, _, name in (line.partition(" ") for line in lines) if name]


def effect_terms(incomplete: str) -> list[str]:
    """`latency(` of a sum such as `latency(position)=1 ms, lev`, then `latency(position)=`.

    Names are those of the files in which effects are found; loading them takes a second.
    """
    head, comma, last = incomplete.rpartition(",")
    lead = head + comma + last[: len(last) - len(last.lstrip())]
    name, bracket, sensor = last.strip().partition("(")
    if not bracket:
        return [f"{lead}{one}(" for one in effect_names() if one.startswith(name)]
    return [f"{lead}{name}({one})=" for one in SENSORS if one.startswith(sensor)]


def effect_names() -> list[str]:
    """Every effect by its name, sorted."""
    folder = Path(__file__).parent.parent / "effects"
    modules = sorted(folder.glob("*.py"))
    return [one.stem for one in modules if "\nEFFECT" in one.read_text("utf-8")]


def stub_types() -> tuple[str, ...]:
    """Kinds of entries of which there is a stub."""
    from syncline_design.report.catalog_stub import STUB_TYPES

    return STUB_TYPES
