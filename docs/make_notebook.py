"""Run the notebook of the docs anew: `python docs/make_notebook.py` from the repository's root.

Cells run one after the other in one namespace, as a kernel does; the last expression of a cell is
its result.  A test runs them too and holds what they say against what is stored.
"""

from __future__ import annotations

import ast
import contextlib
import io
import json
from pathlib import Path
from typing import Any

NOTEBOOK = Path(__file__).resolve().parent / "notebook.ipynb"


def main() -> None:
    """Write the notebook with the outputs of today."""
    book = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    codes = [cell for cell in book["cells"] if cell["cell_type"] == "code"]
    for count, (cell, outputs) in enumerate(zip(codes, ran(codes), strict=True), 1):
        cell["execution_count"], cell["outputs"] = count, outputs
    NOTEBOOK.write_text(json.dumps(book, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def ran(codes: list[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """The outputs of every cell, in the notebook's own form."""
    names: dict[str, Any] = {"__name__": "__main__"}
    return [_outputs("".join(cell["source"]), k, names) for k, cell in enumerate(codes, 1)]


def _outputs(source: str, count: int, names: dict[str, Any]) -> list[dict[str, Any]]:
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, f"cell {count}", "exec"), names)
        value = None
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), f"cell {count}", "eval"), names)
    outputs: list[dict[str, Any]] = []
    if printed.getvalue():
        outputs.append({"name": "stdout", "output_type": "stream",
                        "text": printed.getvalue().splitlines(keepends=True)})  # fmt: skip
    if value is not None:
        outputs.append(_result(value, count))
    return outputs


def _result(value: Any, count: int) -> dict[str, Any]:
    data = {"text/plain": [_plain(value)]}
    drawn = getattr(value, "_repr_html_", lambda: None)()
    if drawn is not None:
        data["text/html"] = drawn.splitlines(keepends=True)
    return {"output_type": "execute_result", "execution_count": count, "metadata": {}, "data": data}


def _plain(value: Any) -> str:
    """Results have a picture; their long `repr` would only hide it."""
    return repr(value) if isinstance(value, int | float | str) else f"<{type(value).__name__}>"


if __name__ == "__main__":
    main()
