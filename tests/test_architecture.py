"""The pages about the code are true of the code: rooms, stations of the walks, words."""

from __future__ import annotations

import ast
import importlib.util
import re
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import get_args

import pytest

from statements import statements
from syncline_design.choice.outcome import FixKind
from syncline_design.machine.sentences import or_rivals
from syncline_design.report.sarif import _RULES
from syncline_design.report.words import KINDS
from syncline_design.spec.requirement import (
    JUDGED_KINDS,
    LIMIT_DIMENSIONS,
    SUMMED_KINDS,
    Requirement,
)
from syncline_design.verdict.tree import UNITS

ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "syncline_design"
HOUSE = (ROOT / "docs" / "architecture.md").read_text("utf-8")
STATIONS = sorted(set(re.findall(r"`([\w/]+/\w+\.py): (\w+)`", HOUSE)))


def _drawer() -> ModuleType:
    found = importlib.util.spec_from_file_location("make_house", ROOT / "docs" / "make_house.py")
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


@dataclass(frozen=True, slots=True)
class _Read:
    """What the tests ask of a file: names at its top, types, and imports anywhere in it."""

    names: frozenset[str]
    types: dict[str, str]
    imports: tuple[ast.Import | ast.ImportFrom, ...]


@cache
def _read(path: Path) -> _Read:
    """Parsed once for all tests; the tree itself, of a thousand times the size, is not kept."""
    tree = ast.parse(path.read_text("utf-8"))
    found = (one for one in statements(tree) if isinstance(one, ast.Import | ast.ImportFrom))
    return _Read(_names(tree), _types(tree, path), tuple(found))


def _names(tree: ast.Module) -> frozenset[str]:
    """What a file defines at its top."""
    names = set()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign):
            names.update(target.id for target in node.targets if isinstance(target, ast.Name))
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
    return frozenset(names)


@pytest.mark.parametrize(("file", "name"), STATIONS, ids=lambda part: str(part))
def test_every_station_exists(file: str, name: str) -> None:
    assert name in _read(PACKAGE / file).names


def test_every_file_that_is_named_exists() -> None:
    files = set(re.findall(r"`([\w/]+/\w+\.py)`", HOUSE))
    assert len(STATIONS) > 30
    assert [file for file in files if not (PACKAGE / file).is_file()] == []


WALKS = HOUSE.partition("## Four walks")[2].split("\n**")[1:]


def _stations(walk: str) -> list[str]:
    """The files of a walk, in its order."""
    numbered = re.findall(r"^\d+\. (.*)$", walk, re.M)
    found = [file for line in numbered for file in re.findall(r"`([\w/]+/\w+\.py): \w+`", line)]
    assert len(found) >= len(numbered) >= 5, walk
    return found


def test_no_walk_climbs() -> None:
    drawer = _drawer()
    level = {room: number for number, floor in enumerate(drawer.floors()) for room in floor}
    assert len(WALKS) == 4
    for walk in WALKS:
        floors = [level[file.partition("/")[0]] for file in _stations(walk)]
        assert floors == sorted(floors, reverse=True), walk


def test_every_station_is_reached_from_one_before(arrows: dict[str, set[str]]) -> None:
    """Over imports; an effect is found by itself, so nothing names its file."""
    for walk in WALKS:
        stations = [f"{PACKAGE.name}.{file[:-3].replace('/', '.')}" for file in _stations(walk)]
        reached = _below(stations[0], arrows)
        for station in stations[1:]:
            is_effect = "EFFECT" in _read(ROOT / f"{station.replace('.', '/')}.py").names
            assert is_effect or station in reached, station
            reached |= _below(station, arrows)


def _below(module: str, arrows: dict[str, set[str]]) -> set[str]:
    """A module and what it imports, directly or through others."""
    found, ahead = {module}, [module]
    while ahead:
        new = arrows.get(ahead.pop(), set()) - found
        found |= new
        ahead += new
    return found


def test_table_and_drawing_show_every_room_on_its_floor() -> None:
    floors = _drawer().floors()
    rooms = {path.name for path in PACKAGE.iterdir() if (path / "__init__.py").is_file()}
    assert {room for floor in floors for room in floor} == rooms
    table = re.findall(r"^\| (\d) \| (.*?) \|", HOUSE, re.M)
    assert [int(level) for level, _ in table] == list(range(1, len(floors) + 1))
    for floor, (_, cell) in zip(floors, table, strict=True):
        assert set(re.findall(r"`(\w+)`", cell)) - {"api"} == set(floor)
    picture = (ROOT / "docs" / "images" / "house.svg").read_text("utf-8")
    assert set(re.findall(r'font-weight="bold">(\w+)<', picture)) == rooms


def test_no_import_climbs() -> None:
    """Those inside functions and for type checkers too, which a contract might be told to skip."""
    drawer = _drawer()
    level = {room: number for number, floor in enumerate(drawer.floors()) for room in floor}
    arrows = {(a, b) for a, b in drawer.arrows() if b in level}
    assert arrows
    assert [(a, b) for a, b in arrows if level[a] < level[b]] == []


def test_every_folder_with_modules_is_in_the_wheel() -> None:
    packages = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["setuptools"]
    mapped = set(packages["package-dir"])
    folders = {".".join(path.parent.relative_to(ROOT).parts) for path in PACKAGE.rglob("*.py")}
    assert set(packages["packages"]) == folders | mapped


def test_the_words_of_the_glossary_are_names_in_the_code() -> None:
    page = (ROOT / "docs" / "glossary.md").read_text("utf-8")
    defined = frozenset().union(*(_read(path).names for path in PACKAGE.rglob("*.py")))
    named = set(re.findall(r"`([A-Z][a-z]\w+)`", page))
    assert len(named) > 25
    assert named - defined == set()


def test_a_kind_of_requirement_is_known_wherever_the_page_sends_one() -> None:
    """Every kind has its dimension, unit, words, rule and fix; which are sums is listed once."""
    kinds = set(get_args(Requirement.model_fields["kind"].annotation))
    assert set(LIMIT_DIMENSIONS) == kinds == set(SUMMED_KINDS) | set(JUDGED_KINDS)
    for known in (KINDS, _RULES, get_args(FixKind), (*UNITS, "cost")):
        assert kinds <= set(known)
    assert {kind: UNITS[kind] for kind in sorted(kinds - {"cost"})} == {
        "accuracy": "m", "mass": "kg", "monte_carlo": "m", "power": "W", "quantile": "m",
        "rmse": "m", "sample_spacing": "m", "sync": "1", "thu": "m", "tvu": "m", "worst_case": "m",
    }  # fmt: skip
    listed = re.compile(r'"mass",\s*"power",\s*"sample_spacing",?\s*\)')
    assert [p.name for p in PACKAGE.rglob("*.py") if listed.search(p.read_text("utf-8"))] == []


@pytest.mark.parametrize(
    "words", ["this log cannot tell)", "two outputs go to", "is a folder; give the name"]
)
def test_a_sentence_is_composed_in_one_place(words: str) -> None:
    count = sum(path.read_text("utf-8").count(words) for path in PACKAGE.rglob("*.py"))
    assert count == 1
    assert or_rivals(["a", "b"]) == " (or a or b: this log cannot tell)"
    assert or_rivals(()) == ""


SAME_MEANING = {"Index"}  # places in an array, of either width


def _types(tree: ast.Module, path: Path) -> dict[str, str]:
    """The classes and named types of a file, with what tells one from another of its name."""
    found = {}
    for node in tree.body:
        if isinstance(node, ast.ClassDef):
            found[node.name] = f"class of {path}"
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            found[node.targets[0].id] = ast.unparse(node.value)
    return {name: what for name, what in found.items() if re.fullmatch(r"[A-Z]\w*[a-z]\w*", name)}


def test_a_type_has_one_home() -> None:
    """Two types of one name, each known outside its file, are two meanings of one word."""
    homes: dict[str, dict[str, str]] = {}
    known: set[tuple[str, str]] = set()
    for path in sorted(PACKAGE.rglob("*.py")):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for name, what in _read(path).types.items():
            homes.setdefault(name, {})[module] = what
        for node in _read(path).imports:
            if isinstance(node, ast.ImportFrom):
                known |= {(node.module or "", one.name) for one in node.names}
    twice = {
        name: sorted(found)
        for name, modules in homes.items()
        if len(found := {m: w for m, w in modules.items() if (m, name) in known}) > 1
        and len(set(found.values())) > 1
    }
    assert {name: found for name, found in twice.items() if name not in SAME_MEANING} == {}
    assert set(twice) == SAME_MEANING  # an exception that is none any more goes


def _imported(path: Path, modules: frozenset[str]) -> set[str]:
    """The package's own modules that a file imports anywhere: late and for type checkers too."""
    found = set()
    for node in _read(path).imports:
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif node.module is not None:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= inner & modules or {node.module}
    return found & modules


def _cycle(arrows: dict[str, set[str]]) -> list[str]:
    """One way back to where it begins, empty where there is none."""
    done: set[str] = set()
    for start in arrows:
        path, ahead = [start], [iter(sorted(arrows[start]))]
        while path:
            following = next((one for one in ahead[-1] if one not in done), None)
            if following is None:
                done.add(path.pop())
                ahead.pop()
            elif following in path:
                return [*path[path.index(following) :], following]
            else:
                path.append(following)
                ahead.append(iter(sorted(arrows[following])))
    return []


def test_imports_are_found_wherever_they_stand() -> None:
    """As a walk over every node finds them, in each kind of block that holds statements."""
    text = """
import a
def f():
    import b
    class C:
        async def g(self):
            async with x:
                from c import d
for _ in x:
    import e
else:
    import f
while x:
    import g
else:
    import h
try:
    import i
except E:
    import j
else:
    import k
finally:
    import l
try:
    pass
except* E:
    import m
if x:
    import n
elif y:
    import o
else:
    import p
match x:
    case 1:
        with y:
            import q
    case _:
        import r
"""
    for code in (text, *(path.read_text("utf-8") for path in PACKAGE.glob("cli/*.py"))):
        tree = ast.parse(code)
        found, wanted = (
            {
                (one.lineno, ast.unparse(one))
                for one in walk
                if isinstance(one, ast.Import | ast.ImportFrom)
            }
            for walk in (statements(tree), ast.walk(tree))
        )
        assert found == wanted
    assert len(set(re.findall(r"(?:import|from) (\w)", text))) == 18


def test_a_way_back_is_found() -> None:
    assert _cycle({"a": {"b"}, "b": {"c"}, "c": {"d", "b"}, "d": set()}) == ["b", "c", "b"]
    assert _cycle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []


@pytest.fixture(scope="module")
def arrows() -> dict[str, set[str]]:
    """Which module imports which, over all imports of the package."""
    paths = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in sorted(PACKAGE.rglob("*.py"))
    }
    modules = frozenset(paths)
    root = {PACKAGE.name}  # names the functions of api for type checkers, and holds the version
    return {
        name: _imported(path, modules) - root for name, path in paths.items() if name not in root
    }


def test_no_module_imports_one_that_imports_it(arrows: dict[str, set[str]]) -> None:
    """A late import hides a cycle from the contract, which looks at rooms only."""
    assert sum(map(len, arrows.values())) > 2000
    assert _cycle(arrows) == []


def test_no_function_below_the_commands_has_a_seed_of_its_own() -> None:
    """A default would hide that one was forgotten; settings hold theirs, made by a command."""
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        file = path.relative_to(PACKAGE).as_posix()
        text = path.read_text("utf-8")
        if file.startswith("cli/") or file == "api.py" or "seed" not in text:
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef):
                plain = [*node.args.posonlyargs, *node.args.args]
                own = plain[len(plain) - len(node.args.defaults) :]
                kept = zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
                own += [one for one, default in kept if default is not None]
                found += [(file, node.name) for one in own if one.arg == "seed"]
    assert found == []
