"""A study file with its base specs, checked before anything is computed."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

from syncline_design.machine.input_files import note_read
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.spec.case import Case
from syncline_design.spec.catalog import Catalog
from syncline_design.spec.fields import did_you_mean
from syncline_design.spec.files import MOST_PATH, Collection, fill_empirical, problem_at
from syncline_design.spec.keys import CATALOG, KeyPathError, label, plain, put, resolve, value_at
from syncline_design.spec.kinds import misplaced
from syncline_design.spec.load import BadInput, catalogs_of, load_document
from syncline_design.spec.references import unknown_ids
from syncline_design.spec.spec import Spec
from syncline_design.spec.validation import validate
from syncline_design.spec.yaml_text import Flaw, KeyPath, ParsedFile, read
from syncline_design.studies.definition import (
    MAX_CASES,
    CheckChoice,
    Factor,
    FactorError,
    HeatMapChoice,
    MeetsWhen,
    StudyFile,
    grid_values,
    sample_values,
    scale_of,
)


@dataclass(frozen=True, slots=True)
class Base:
    """One base spec: its data, its catalogs drawn together once, where each key path leads."""

    path: Path
    document: ParsedFile = field(repr=False)
    catalogs: Collection = field(repr=False)
    paths: dict[str, KeyPath]
    simulated: tuple[str, ...]  # ids of its monte_carlo requirements
    has_waivers: bool
    name: str
    currency: str

    def load(self, settings: Sequence[tuple[str, Any]]) -> Case:
        """The spec with these key paths set; BadInput when the combination cannot be."""
        data, catalogs = self.document.data, self.catalogs
        # A whole mapping before its keys: a platform's id must not undo its distance.
        placed = sorted(((self.paths[key], value) for key, value in settings), key=_depth)
        for path, value in placed:
            if path[0] == CATALOG:
                catalogs = override_entry(catalogs, path, value, self.document)
            else:
                data = put(data, path, value)
        return load_document(_with_data(self.document, data), self.path, catalogs)


@dataclass(frozen=True, slots=True)
class Study:
    """A study ready to run: every case is a base with one value per factor."""

    name: str
    note: str
    path: Path
    sha256: str
    bases: tuple[Base, ...]
    grid: tuple[Factor, ...]
    sample: tuple[Factor, ...]
    samples: int
    check: CheckChoice
    heat_map: HeatMapChoice | None
    meets_when: MeetsWhen

    @property
    def factors(self) -> tuple[Factor, ...]:
        """What varies, grid first."""
        return self.grid + self.sample

    def __len__(self) -> int:
        combinations = math.prod(len(factor.values) for factor in self.grid)
        return len(self.bases) * combinations * self.samples

    def case(self, index: int) -> tuple[int, tuple[tuple[str, Any], ...]]:
        """Base and settings of a case; the base turns slowest, the sample fastest."""
        rest, row = divmod(index, self.samples)
        drawn = [(factor.key, factor.values[row]) for factor in self.sample]
        chosen: list[tuple[str, Any]] = []
        for factor in reversed(self.grid):
            rest, place = divmod(rest, len(factor.values))
            chosen.append((factor.key, factor.values[place]))
        return rest, (*reversed(chosen), *drawn)


def _depth(setting: tuple[KeyPath, Any]) -> int:
    return len(setting[0])


def load_study(path: str | Path) -> Study:
    """Read a study with its base specs; BadInput names everything wrong with them in one go."""
    document = read(path)
    if (other := misplaced(document, "study")) is not None:
        raise BadInput((other,))
    study_file, problems = validate(StudyFile, document)
    problems = [*document.problems, *problems]
    if study_file is None:
        raise BadInput(tuple(problems))
    grid = list(_grid(study_file, document, problems))
    sample = list(_sample(study_file, document, problems))
    _check_keys(study_file, document, grid, sample, problems)
    bases = list(_bases(study_file, document, Path(path), [*grid, *sample], problems))
    if problems:
        raise BadInput(tuple(problems))
    count = study_file.sample.count if study_file.sample is not None else 1
    study = Study(
        study_file.name, study_file.note, Path(path), document.sha256, tuple(bases), tuple(grid),
        tuple(sample), count, study_file.check, study_file.heat_map, study_file.meets_when,
    )  # fmt: skip
    for base in bases:
        _note_files(base, grid)
        _check_values(base, study, document, problems)
    if problems:
        raise BadInput(tuple(problems))
    return study


def _note_files(base: Base, grid: Sequence[Factor]) -> None:
    """Note the files that values of the grid may name: each case reads its own later."""
    for factor in grid:
        for value in factor.values if factor.listed else ():
            for text in _texts(value):
                if len(text) <= MOST_PATH:
                    note_read(base.path.parent / text)


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        yield from (text for item in value.values() for text in _texts(item))
    elif isinstance(value, tuple | list):
        yield from (text for item in value for text in _texts(item))


def _grid(chosen: StudyFile, document: ParsedFile, problems: list[Flaw]) -> Iterator[Factor]:
    combinations = len(chosen.base) * (chosen.sample.count if chosen.sample is not None else 1)
    for key, value in (chosen.grid or {}).items():
        place: KeyPath = ("grid", key)
        try:
            values, listed = grid_values(value)
        except FactorError as error:
            problems.append(_factor_problem(document, place, error))
            continue
        combinations *= len(values)
        yield Factor(key, values, "grid", place, listed, scale_of(value))
    if combinations > MAX_CASES:
        found = f"{combinations} cases"
        problems.append(problem_at(document, (), "too many cases", f"at most {MAX_CASES}", found))


def _sample(chosen: StudyFile, document: ParsedFile, problems: list[Flaw]) -> Iterator[Factor]:
    if chosen.sample is None:
        return
    for key, value in chosen.sample.over.items():
        place: KeyPath = ("sample", "over", key)
        try:
            [values] = sample_values({key: value}, chosen.sample.count, chosen.sample.seed)
        except FactorError as error:
            problems.append(_factor_problem(document, place, error))
            continue
        yield Factor(key, values, "sample", place, listed=False, scale=scale_of(value))


def _factor_problem(document: ParsedFile, place: KeyPath, error: FactorError) -> Flaw:
    where = (*place, *error.where)
    return problem_at(document, where, error.message, error.expected, error.found)


def _check_keys(
    chosen: StudyFile, document: ParsedFile, grid: list[Factor], sample: list[Factor],
    problems: list[Flaw],
) -> None:  # fmt: skip
    both = {factor.key for factor in grid} & {factor.key for factor in sample}
    for factor in sample:
        if factor.key in both:
            message = "varied by grid and sample"
            problems.append(problem_at(document, factor.place, message, hint="keep one of them"))
    varied = [factor.key for factor in (*grid, *sample)]
    if chosen.heat_map is None:
        return
    for axis in ("x", "y"):
        key = getattr(chosen.heat_map, axis)
        if key not in varied:
            message, hint = "not a key path of this study", did_you_mean(key, varied)
            wanted = " or ".join(varied) or "a key path of grid or sample"
            problems.append(problem_at(document, ("heat_map", axis), message, wanted, key, hint))


def _bases(
    chosen: StudyFile, document: ParsedFile, path: Path, factors: list[Factor],
    problems: list[Flaw],
) -> Iterator[Base]:  # fmt: skip
    seen: dict[Path, int] = {}
    for index, name in enumerate(chosen.base):
        place: KeyPath = ("base", index)
        if Path(name).is_absolute():
            message, hint = "an absolute path", "write it relative to the study file"
            problems.append(problem_at(document, place, message, "a relative path", name, hint))
            continue
        target = _plain_path(path.parent / name)
        if seen.setdefault(target.resolve(), index) < index:
            problems.append(problem_at(document, place, "listed twice", "each base once", name))
            continue
        base = _base(target, document, place, factors, problems)
        if base is not None:
            yield base


def _plain_path(path: Path) -> Path:
    """`specs/studies/../uav.yaml` as `specs/uav.yaml`, unless a symlink makes that another file."""
    short = Path(os.path.normpath(path))
    return short if short.resolve() == path.resolve() else path


def _base(
    target: Path, study: ParsedFile, place: KeyPath, factors: list[Factor], problems: list[Flaw]
) -> Base | None:
    """One base spec; its own errors stand beside the study's, each in its own file."""
    document = read(target)
    if document.data is None and not document.sha256:
        message = f"{target}: {document.problems[0].message}"
        problems.append(problem_at(study, place, message, "a spec file"))
        return None
    if document.data is None:
        problems.extend(document.problems)
        return None
    try:
        catalogs = catalogs_of(document, target)
        case = load_document(document, target, catalogs)
    except BadInput as bad:
        problems.extend(bad.problems)
        return None
    paths = _paths(document, study, factors, problems, str(target))
    simulated = tuple(r.id for r in case.spec.requirements if r.kind == "monte_carlo")
    return Base(
        target, document, catalogs, paths, simulated, case.has_waivers, case.spec.name,
        case.spec.currency,
    )  # fmt: skip


def _paths(
    spec: ParsedFile, study: ParsedFile, factors: list[Factor], problems: list[Flaw], name: str
) -> dict[str, KeyPath]:
    paths: dict[str, KeyPath] = {}
    for factor in factors:
        try:
            path = resolve(factor.key, spec.data)
        except KeyPathError as error:
            line, column = study.key_positions.get(factor.place, study.position(factor.place))
            message = f"{error.message} in {name}"
            shown = factor.place[0]
            problems.append(
                Flaw(
                    study.file, line, column, f"{shown}: {factor.key}", message, error.expected,
                    hint=error.hint,
                )
            )  # fmt: skip
            continue
        twin = next((key for key, other in paths.items() if other == path), None)
        if twin is not None:
            message = f"the same place as {twin}"
            problems.append(problem_at(study, factor.place, message, hint="keep one of them"))
        paths[factor.key] = path
    return paths


def _with_data(document: ParsedFile, data: Any) -> ParsedFile:
    """The document with other data; positions still point at the base spec's lines."""
    return ParsedFile(
        document.file, data, document.positions, document.key_positions, document.sha256,
        document.text,
    )  # fmt: skip


def _check_values(base: Base, study: Study, document: ParsedFile, problems: list[Flaw]) -> None:
    """Every value by itself in its base: what is wrong with it is said at its place."""
    for factor in study.factors:
        if factor.key not in base.paths:
            continue
        for index, value in enumerate(_distinct_ends(factor)):
            place = (*factor.place, index) if factor.listed else factor.place
            for problem in _value_problems(base, factor.key, value):
                where = f"{factor.place[0]}: {factor.key}"
                shown = label(value)
                restated = problem_at(
                    document, place, f"{problem.message} ({shown})", problem.expected,
                    problem.found, problem.hint,
                )  # fmt: skip
                key = restated.line, restated.column, restated.message
                known = {(p.line, p.column, p.message) for p in problems}
                if key not in known:
                    problems.append(_at_path(restated, where))


def _at_path(problem: Flaw, path: str) -> Flaw:
    return Flaw(
        problem.file, problem.line, problem.column, path, problem.message, problem.expected,
        problem.found, problem.hint,
    )  # fmt: skip


def _distinct_ends(factor: Factor) -> Sequence[Any]:
    """The values to look at: all that are listed, a few of a range (its ends among them)."""
    if factor.listed or len(factor.values) <= 200:
        return factor.values
    step = len(factor.values) // 100
    return (*factor.values[::step], factor.values[-1])


def _value_problems(base: Base, key: str, value: Any) -> list[Flaw]:
    """What is wrong with one value, whatever the other factors are."""
    path = base.paths[key]
    if path[0] == CATALOG:
        try:
            override_entry(base.catalogs, path, value, base.document)
        except BadInput as bad:
            return list(bad.problems)
        return []
    try:
        data = put(base.document.data, path, value)
    except KeyPathError as error:
        return [problem_at(base.document, (), error.message, error.expected, hint=error.hint)]
    document = _with_data(base.document, data)
    _, found = validate(Spec, document)
    return found + unknown_ids(document, base.catalogs)


def override_entry(catalogs: Collection, path: KeyPath, value: Any, spec: ParsedFile) -> Collection:
    """The catalogs with `catalog.SECTION[ID].KEY...` set; BadInput says why that cannot be."""
    section, identity = str(path[1]), str(path[2])
    catalogs.draw([(section, identity)])
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
    document: ParsedFile, place: tuple[str, str], entry: Any, spec: Path, read: Collection
) -> tuple[Catalog | None, list[Flaw]]:
    """The entry through the catalog's own model, its errors placed in its own file.

    Files are named from the catalog's folder; a shipped catalog has none, the spec's counts.
    """
    section, identity = place
    single = ParsedFile(
        document.file, {section: {identity: entry}}, document.positions, document.key_positions,
        document.sha256, document.text,
    )  # fmt: skip
    shipped = document.file.startswith("builtin:")
    folder = (spec if shipped else Path(document.file)).parent
    filled = fill_empirical(single, folder, spec.parent, read)
    model, problems = validate(Catalog, single, filled)
    return model, [*problems, *read.problems]


def _entry_document(document: ParsedFile, at: KeyPath, entry: Any) -> ParsedFile:
    """The document with one entry changed, so that a further override starts from it."""
    return ParsedFile(
        document.file, put(document.data, at, entry), document.positions, document.key_positions,
        document.sha256, document.text,
    )  # fmt: skip
