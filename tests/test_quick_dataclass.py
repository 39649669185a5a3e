"""The dataclasses of the package behave as those of the standard library, which stand beside."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from syncline_design.machine import quick_dataclass

DECORATORS = (dataclasses.dataclass, quick_dataclass.dataclass)
FORMS = [
    {"frozen": frozen, "slots": slots, "kw_only": kw_only, "eq": eq}
    for frozen in (False, True)
    for slots in (False, True)
    for kw_only in (False, True)
    for eq in (False, True)
]


def _made(decorator: Any, **form: bool) -> tuple[type, type]:
    @decorator(**form)
    class Base:
        """A class with every kind of field."""

        first: int
        second: float = 2.0
        third: list[int] = dataclasses.field(default_factory=list)
        unseen: str = dataclasses.field(default="u", repr=False, compare=False)
        later: int = dataclasses.field(init=False, default=7)

    @decorator(**form)
    class Child(Base):
        """One that adds a field and looks at what it was given."""

        fourth: tuple[int, ...] = ()

        def __post_init__(self) -> None:
            if self.first < 0:
                raise ValueError("negative")

    for kind in (Base, Child):
        kind.__qualname__ = kind.__name__
    return Base, Child


def _outcome(act: Callable[[], Any]) -> tuple[str, object]:
    try:
        return "value", act()
    except (TypeError, ValueError, AttributeError) as error:
        return type(error).__name__, str(error).replace("_made.<locals>.", "")


def _set(one: Any, name: str, value: object) -> object:
    setattr(one, name, value)
    return getattr(one, name)


def _behaviour(kinds: tuple[type, type]) -> list[tuple[str, object]]:
    """What classes do, in words that do not name them."""
    _, child = kinds
    calls: list[tuple[tuple[Any, ...], dict[str, Any]]] = [
        ((1,), {}), ((1, 3.0, [4]), {}), ((), {"first": 1}), ((), {}), ((-1,), {}),
        ((), {"first": -1}), ((1,), {"no": 2}), ((1, 2, 3, 4, 5, 6), {}), ((1,), {"later": 8}),
        ((), {"first": 1, "fourth": (2,), "third": [1], "unseen": "v"}),
    ]  # fmt: skip
    seen = []
    for kind in kinds:
        for args, kwargs in calls:
            seen.append(_outcome(lambda k=kind, a=args, w=kwargs: repr(k(*a, **w))))
        one, same, other = (kind(first=n) for n in (1, 1, 2))  # type: ignore[call-arg]
        seen += [
            ("equal", one == same), ("other", one == other), ("no kin", one == 1),
            ("unseen", one == kind(first=1, unseen="w")),  # type: ignore[call-arg]
            ("kin", one == kinds[0](first=1)),  # type: ignore[call-arg]
            _outcome(lambda o=one: (hash(o), "same")[1]),
            _outcome(lambda o=one: repr(dataclasses.replace(o, first=5, second=1.0))),
            _outcome(lambda o=one: repr(dataclasses.asdict(o))),
            _outcome(lambda o=one: repr(copy.deepcopy(o))),
            ("lists", one.third is same.third),
            ("slots", hasattr(one, "__dict__")), ("match", str(kind.__match_args__)),  # type: ignore[attr-defined]
            _outcome(lambda o=one: _set(o, "first", 9)),
            _outcome(lambda o=one: delattr(o, "second")),
        ]  # fmt: skip
    seen.append(("of the child", [one.name for one in dataclasses.fields(child)]))  # type: ignore[arg-type]
    return seen


@pytest.mark.parametrize("form", FORMS, ids=str)
def test_it_does_what_the_standard_one_does(form: dict[str, bool]) -> None:
    standard, quick = (_behaviour(_made(one, **form)) for one in DECORATORS)
    assert quick == standard


@quick_dataclass.dataclass(frozen=True, slots=True)
class Point:
    """One that can be pickled: it stands in a module."""

    x: float
    y: float = 0.0


def test_hash_follows_the_fields() -> None:
    assert hash(Point(1.0)) == hash(Point(1.0, 0.0)) == hash((1.0, 0.0))
    assert len({Point(1.0), Point(1.0), Point(2.0)}) == 2


def test_it_survives_pickle_and_copy() -> None:
    point = Point(1.0, 2.0)
    assert pickle.loads(pickle.dumps(point)) == copy.copy(point) == point


def test_a_plain_subclass_may_hold_more_but_keeps_the_fields() -> None:
    class More(Point):
        """Not a dataclass itself."""

    more = More(1.0)
    more.z = 3.0  # type: ignore[attr-defined]
    with pytest.raises(dataclasses.FrozenInstanceError):
        more.x = 2.0  # type: ignore[misc]


def test_only_what_is_made_is_compiled() -> None:
    code = (
        "import builtins\n"
        "from syncline_design.machine import quick_dataclass as q\n"
        "compiled = []\n"
        "q.exec = lambda text, names: (compiled.append(text), builtins.exec(text, names))\n"
        "@q.dataclass(frozen=True, slots=True)\n"
        "class A:\n    x: int\n"
        "assert not compiled\n"
        "A(1), A(2)\n"
        "assert len(compiled) == 1, compiled\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_package_takes_its_dataclasses_from_here() -> None:
    """But for the model, which needs no machine: its few classes cost a start 10 ms."""
    package = Path(quick_dataclass.__file__).parent.parent
    others = [
        str(path.relative_to(package))
        for path in sorted(package.rglob("*.py"))
        if path.parts[len(package.parts)] != "model" and path.name != "quick_dataclass.py"
        if re.search(r"from dataclasses import .*\bdataclass\b|@dataclasses\.", path.read_text())
    ]
    assert others == []
