"""Every function, class and constant of the package is reached from a command or the Python API.

By name, from what runs: a name is alive where something alive says it.  Tests do not count.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from statements import statements

ROOT = Path(__file__).resolve().parent.parent / "syncline_design"
# What is called by name from outside: the ways in, and what every file of a folder provides.
WAYS_IN = ("api.py", "__init__.py", "__main__.py", "cli/__init__.py")
FOUND_IN_FILES = {"EFFECT", "READER"}
HOOKS = {"__getattr__", "__dir__"}


def named(node: ast.AST) -> set[str]:
    """All names that a piece of code says, in types that are written as text as well."""
    found: set[str] = set()
    for each in ast.walk(node):
        if isinstance(each, ast.Name):
            found.add(each.id)
        elif isinstance(each, ast.Attribute):
            found.add(each.attr)
        elif isinstance(each, ast.Constant) and isinstance(each.value, str):
            found.update(re.findall(r"[A-Za-z_]\w*", each.value))
        elif isinstance(each, ast.keyword) and each.arg:
            found.add(each.arg)
    return found


def defined(statement: ast.stmt) -> list[str]:
    if isinstance(statement, ast.FunctionDef | ast.ClassDef):
        return [statement.name]
    if isinstance(statement, ast.Assign | ast.AnnAssign):
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        return [target.id for target in targets if isinstance(target, ast.Name)]
    return []


def without_docs(statement: ast.stmt) -> ast.stmt:
    """Words of a docstring keep nothing alive."""
    for each in statements(statement):
        if isinstance(each, ast.FunctionDef | ast.ClassDef) and ast.get_docstring(each):
            each.body = each.body[1:] or [ast.Pass()]
    return statement


def unreachable(files: dict[str, str]) -> Iterator[str]:
    """`file: name` of every definition that nothing alive names."""
    alive = FOUND_IN_FILES | HOOKS
    waiting: list[tuple[str, str, set[str]]] = []
    for file, text in files.items():
        for statement in map(without_docs, ast.parse(text).body):
            says = named(statement)
            if file in WAYS_IN:
                alive |= says | set(defined(statement))
            elif names := defined(statement):
                waiting += [(file, name, says - {name}) for name in names]
            elif not isinstance(statement, ast.Import | ast.ImportFrom):
                alive |= says
    more = True
    while more:
        woken = [one for one in waiting if one[1] in alive]
        waiting = [one for one in waiting if one[1] not in alive]
        alive |= set().union(*(says for *_, says in woken))
        more = bool(woken)
    yield from (f"{file}: {name}" for file, name, _ in waiting)


def test_what_nothing_reaches_is_found() -> None:
    files = {
        "api.py": "from a import used\nused()\n",
        "a.py": (
            "def used():\n    return kept\n"
            "kept = 1\n"
            'def first():\n    """used"""\n    return second()\n'
            "def second():\n    return first()\n"
        ),
    }
    assert list(unreachable(files)) == ["a.py: first", "a.py: second"]


def test_everything_is_reached() -> None:
    files = {
        str(path.relative_to(ROOT)): path.read_text("utf-8") for path in sorted(ROOT.rglob("*.py"))
    }
    assert list(unreachable(files)) == []
