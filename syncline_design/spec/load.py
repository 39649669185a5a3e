"""A spec file with its catalogs, checked as a whole: everything wrong is named in one go."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

from syncline_design.machine.input_files import (
    FileContent,
    FileRead,
    FilesRead,
    UnsuitableError,
    noting,
    read_plain,
)
from syncline_design.spec.case import Case, Mission
from syncline_design.spec.catalog import Catalog
from syncline_design.spec.files import (
    BUILTIN_PACKAGE,
    Collection,
    add_builtin,
    add_own,
    fill_empirical,
    inside_folder,
    problem_at,
)
from syncline_design.spec.kinds import misplaced
from syncline_design.spec.known_effects import effect_problems
from syncline_design.spec.missions import disagreements, in_mission, mission_documents
from syncline_design.spec.references import (
    currency_problems,
    draw_in,
    misfits,
    missing_figures,
    unknown_ids,
)
from syncline_design.spec.spec import Spec
from syncline_design.spec.validation import validate
from syncline_design.spec.yaml_text import Flaw, KeyPath, ParsedFile, TextPosition, parse, read

MAX_SHOWN = 50
MOST_TRAJECTORY_BYTES = 2**28
BUILTIN_FOLDER = Path(str(files(BUILTIN_PACKAGE))).resolve()


class BadInput(Exception):  # noqa: N818  it is the input that is bad, not the program
    """What is wrong with a user's files; printing it gives one line per problem."""

    def __init__(self, problems: tuple[Flaw, ...]) -> None:
        # By place, then by text: the order of a set differs from run to run.
        self.problems = tuple(sorted(set(problems), key=_place_and_text))
        super().__init__(self._lines())

    def __reduce__(self) -> tuple[type[BadInput], tuple[tuple[Flaw, ...]]]:
        """So that it travels between processes: made again of its problems, not of their text."""
        return type(self), (self.problems,)

    def _lines(self) -> str:
        lines = [str(problem) for problem in self.problems[:MAX_SHOWN]]
        if len(self.problems) > MAX_SHOWN:
            lines.append(f"... and {len(self.problems) - MAX_SHOWN} more")
        return "\n".join(lines)


def _place_and_text(problem: Flaw) -> tuple[str, int, int, str]:
    return problem.file, problem.line, problem.column, str(problem)


def load(path: str | Path, builtin: bool = True) -> Case:
    """Read a spec and its catalogs; BadInput names everything that is wrong with them.

    builtin: whether the shipped catalogs are drawn in too.
    """
    with noting() as found:
        return _loaded(read(path), Path(path), builtin, found)


def load_text(text: str, path: str | Path, builtin: bool = True) -> Case:
    """The same for a text that is not on disk yet; `path` says where it would lie."""
    return _loaded(parse(text, str(path)), Path(path), builtin)


def catalogs_of(document: ParsedFile, path: Path, builtin: bool = True) -> Collection:
    """The catalogs that a spec draws in: the shipped ones and its own."""
    collection = Collection()
    if builtin:
        add_builtin(collection)
    add_own(collection, document, path.parent)
    draw_in(document, collection)
    return collection


def load_document(document: ParsedFile, path: Path, collection: Collection) -> Case:
    """A spec that was read already, with catalogs drawn together once for many specs."""
    return _complete(document, path, collection.copy())


def load_builtin(families: bool = True) -> Catalog:
    """The shipped catalogs alone; without families, those that hold the paper's entries."""
    collection = builtin_collection(families)
    _stop_at(collection.problems)
    return collection.catalog()


def load_siblings(types: Container[tuple[str, str]]) -> Catalog:
    """The shipped catalogs as far as they may hold sensors of these modalities and types."""
    collection = Collection()
    add_builtin(collection)
    collection.draw_types(types)
    _stop_at(collection.problems)
    return collection.catalog()


def builtin_collection(families: bool = True) -> Collection:
    """The shipped catalogs, and where each entry stands."""
    collection = Collection()
    add_builtin(collection)
    if families:
        collection.draw_all()
    return collection


def _stop_at(problems: list[Flaw]) -> None:
    if problems:
        raise BadInput(tuple(problems))


def _loaded(
    document: ParsedFile, path: Path, builtin: bool, found: FilesRead | None = None
) -> Case:
    if document.data is None:
        raise BadInput(document.problems)
    if (other := misplaced(document, "spec")) is not None:
        raise BadInput((other,))
    return _complete(document, path, catalogs_of(document, path, builtin), found)


def _complete(
    document: ParsedFile, path: Path, collection: Collection, found: FilesRead | None = None
) -> Case:
    """The case, or every problem of the file; found: what was read since the spec was asked for."""
    documents, overrides = mission_documents(document)
    for one in (document, *(own for _, own in documents)):
        draw_in(one, collection)  # a study's case may name what its base does not
    try:
        case = _alone(document, path, collection, found)
    except BadInput as error:
        raise BadInput((*error.problems, *overrides)) from None
    _stop_at(overrides)
    missions = tuple(_mission(name, own, path, collection, case.files) for name, own in documents)
    if missions:
        _stop_at(list(disagreements(document, missions)))
    return replace(case, missions=missions) if missions else case


def _mission(
    name: str, document: ParsedFile, path: Path, collection: Collection,
    files: tuple[FileRead, ...],
) -> Mission:  # fmt: skip
    """One mission as a case, with what is wrong in it alone."""
    try:
        case = _alone(document, path, collection.copy())
    except BadInput as error:
        raise BadInput(in_mission(name, error.problems)) from None
    return Mission(name, replace(case, files=files))


def _alone(
    document: ParsedFile, path: Path, collection: Collection, found: FilesRead | None = None
) -> Case:
    """The case of one document."""
    filled = fill_empirical(document, path.parent, path.parent, collection)
    spec, problems = validate(Spec, document, filled)
    problems = [*document.problems, *problems, *collection.problems]
    problems += unknown_ids(document, collection)
    if spec is None:
        raise BadInput(tuple(problems))
    named, trajectory = _named_files(document, spec, path.parent)
    _stop_at(problems + named)
    case = Case(
        spec, collection.catalog(), path, document.positions, document.sha256,
        collection.sha256(), document.text, collection.origins,
        () if found is None else _beside(path, found), trajectory,
    )  # fmt: skip
    _stop_at(misfits(document, case) + currency_problems(document, case))
    _stop_at(missing_figures(document, case))
    _stop_at(list(effect_problems(document, spec)))
    return case


def _named_files(
    document: ParsedFile, spec: Spec, folder: Path
) -> tuple[list[Flaw], FileContent | None]:
    """Files that the spec names for later: they have to be there, inside its folder.

    The trajectory is read at once, so that a verdict rests on one content of it.
    """
    named = enumerate(spec.log.files if spec.log is not None else ())
    found = [
        inside_folder(document, ("log", "files", i), name, folder, folder.resolve())
        for i, name in named
    ]
    problems = [item for item in found if isinstance(item, Flaw)]
    recorded = _recorded_trajectory(document, spec, folder)
    if isinstance(recorded, Flaw):
        return [*problems, recorded], None
    return problems, recorded


def _recorded_trajectory(
    document: ParsedFile, spec: Spec, folder: Path
) -> FileContent | Flaw | None:
    choice = spec.monte_carlo.trajectory
    if choice is None or choice.file is None:
        return None
    at: KeyPath = ("monte_carlo", "trajectory", "file")
    inside = inside_folder(document, at, choice.file, folder, folder.resolve())
    if isinstance(inside, Flaw):
        return inside
    try:
        return FileContent(folder / choice.file, read_plain(inside, MOST_TRAJECTORY_BYTES))
    except (OSError, UnsuitableError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        return problem_at(document, at, f"cannot read the file: {reason.lower()}")


def _beside(spec: Path, found: FilesRead) -> tuple[FileRead, ...]:
    """What a spec was read with: its own catalogs, files of delays, trajectory."""
    folder = spec.parent.resolve()
    own = {Path(path).resolve(): digest for path, digest in found.contents.items()}
    own.pop(spec.resolve(), None)
    return tuple(
        FileRead(path.relative_to(folder).as_posix(), digest)
        for path, digest in sorted(own.items())
        if path.is_relative_to(folder) and not path.is_relative_to(BUILTIN_FOLDER)
    )


__all__ = [
    "BadInput",
    "Case",
    "Flaw",
    "catalogs_of",
    "load",
    "load_builtin",
    "load_document",
    "load_text",
    "problem_at",
]


def without_simulated(case: Case) -> Case:
    """The spec without its monte_carlo requirements, every other one still at its own line."""
    kept = [i for i, r in enumerate(case.spec.requirements) if r.kind != "monte_carlo"]
    requirements = tuple(case.spec.requirements[i] for i in kept)
    renumbered = {old: new for new, old in enumerate(kept)}
    positions: dict[KeyPath, TextPosition] = {}
    for path, position in case.positions.items():
        if path[:1] == ("requirements",) and len(path) > 1:
            if path[1] not in renumbered:
                continue
            path = ("requirements", renumbered[int(path[1])], *path[2:])
        positions[path] = position
    spec = case.spec.model_copy(update={"requirements": requirements})
    missions = tuple(replace(one, case=without_simulated(one.case)) for one in case.missions)
    return replace(case, spec=spec, positions=positions, missions=missions)
