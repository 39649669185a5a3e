"""The statements of a piece of code, at any depth, without the expressions in them.

A walk over all nodes takes several times as long; no import, class or function is an expression.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")  # what holds statements, in ast


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """A node and the statements below it; clauses of `try` and `match` are passed too."""
    waiting = [node]
    while waiting:
        one = waiting.pop()
        yield one
        for block in BLOCKS:
            waiting += getattr(one, block, ())
