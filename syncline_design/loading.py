"""A spec file with its catalogs, checked as a whole: everything wrong is named in one go."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from syncline_design.catalog import Catalog
from syncline_design.catalog_files import (
    Collection,
    add_builtin,
    add_own,
    fill_empirical,
    inside_folder,
    problem_at,
)
from syncline_design.references import currency_problems, misfits, missing_figures, unknown_ids
from syncline_design.spec import Spec
from syncline_design.validation import validate
from syncline_design.yaml_reader import Document, KeyPath, Position, Problem, parse, read

MAX_SHOWN = 50


class BadInput(Exception):  # noqa: N818  it is the input that is bad, not the program
    """What is wrong with a user's files; printing it gives one line per problem."""

    def __init__(self, problems: tuple[Problem, ...]) -> None:
        self.problems = tuple(sorted(set(problems), key=lambda p: (p.file, p.line, p.column)))
        super().__init__(self._lines())

    def _lines(self) -> str:
        lines = [str(problem) for problem in self.problems[:MAX_SHOWN]]
        if len(self.problems) > MAX_SHOWN:
            lines.append(f"... and {len(self.problems) - MAX_SHOWN} more")
        return "\n".join(lines)


@dataclass(frozen=True)
class LoadedSpec:
    """A spec that can be worked with: its catalogs merged, every reference found.

    positions: key path, as in ("requirements", 0, "limit"), to (line, column).
    origins: (section, id) of a catalog entry to the file:line:column that defines it.
    """

    spec: Spec
    catalog: Catalog
    path: Path
    positions: dict[KeyPath, Position] = field(repr=False)
    spec_sha256: str
    catalogs_sha256: str
    text: str = field(repr=False)
    origins: dict[tuple[str, str], str] = field(repr=False)
    builtin: bool = True

    def place(self, path: KeyPath) -> str:
        """`file:line:column` of a key path, or of the nearest thing around it."""
        for length in range(len(path), -1, -1):
            if path[:length] in self.positions:
                line, column = self.positions[path[:length]]
                return f"{self.path}:{line}:{column}"
        return str(self.path)


def load(path: str | Path, builtin: bool = True) -> LoadedSpec:
    """Read a spec and its catalogs; BadInput names everything that is wrong with them.

    builtin: whether the shipped catalogs are drawn in too.
    """
    return _loaded(read(path), Path(path), builtin)


def load_text(text: str, path: str | Path, builtin: bool = True) -> LoadedSpec:
    """The same for a text that is not on disk yet; `path` says where it would lie."""
    return _loaded(parse(text, str(path)), Path(path), builtin)


def catalogs_of(document: Document, path: Path, builtin: bool = True) -> Collection:
    """The catalogs that a spec draws in: the shipped ones and its own."""
    collection = Collection()
    if builtin:
        add_builtin(collection)
    add_own(collection, document, path.parent)
    return collection


def load_document(
    document: Document, path: Path, collection: Collection, builtin: bool = True
) -> LoadedSpec:
    """A spec that was read already, with catalogs drawn together once for many specs."""
    return _complete(document, path, collection.copy(), builtin)


def load_builtin() -> Catalog:
    """The shipped catalogs alone."""
    collection = Collection()
    add_builtin(collection)
    _stop_at(collection.problems)
    return collection.catalog()


def load_catalogs(builtin: bool = True) -> Collection:
    """The shipped catalogs with the place and digest of every entry."""
    collection = Collection()
    if builtin:
        add_builtin(collection)
    _stop_at(collection.problems)
    return collection


def _stop_at(problems: list[Problem]) -> None:
    if problems:
        raise BadInput(tuple(problems))


def _loaded(document: Document, path: Path, builtin: bool) -> LoadedSpec:
    if document.data is None:
        raise BadInput(document.problems)
    return _complete(document, path, catalogs_of(document, path, builtin), builtin)


def _complete(document: Document, path: Path, collection: Collection, builtin: bool) -> LoadedSpec:
    filled = fill_empirical(document, path.parent, path.parent, collection)
    spec, problems = validate(Spec, document, filled)
    problems = [*document.problems, *problems, *collection.problems]
    problems += unknown_ids(document, collection)
    if spec is None:
        raise BadInput(tuple(problems))
    problems += _missing_files(document, spec, path.parent)
    _stop_at(problems)
    catalog = collection.catalog()
    _stop_at(misfits(document, spec, catalog) + currency_problems(document, spec, catalog))
    _stop_at(missing_figures(document, spec, catalog))
    return LoadedSpec(
        spec, catalog, path, document.positions, document.sha256, collection.sha256(),
        document.text, collection.origins, builtin,
    )  # fmt: skip


def _missing_files(document: Document, spec: Spec, folder: Path) -> list[Problem]:
    """Files that the spec names for later: they have to be there, inside its folder."""
    named: list[tuple[KeyPath, str]] = []
    trajectory = spec.monte_carlo.trajectory
    if trajectory is not None and trajectory.file is not None:
        named.append((("monte_carlo", "trajectory", "file"), trajectory.file))
    if spec.log is not None:
        named += [(("log", "files", i), name) for i, name in enumerate(spec.log.files)]
    found = [inside_folder(document, at, name, folder, folder.resolve()) for at, name in named]
    return [item for item in found if isinstance(item, Problem)]


__all__ = [
    "BadInput",
    "LoadedSpec",
    "Problem",
    "catalogs_of",
    "load",
    "load_builtin",
    "load_document",
    "load_text",
    "problem_at",
]
