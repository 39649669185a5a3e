"""Draw the rooms of the package anew: `python docs/make_house.py` from the repository's root.

Boxes are the packages, on the floors that the import contract in pyproject.toml names; lines are
the imports that the code really has (those inside functions included), darker where there are more.
"""

from __future__ import annotations

import ast
import tomllib
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "syncline_design"
IMAGE = ROOT / "docs" / "images" / "house.svg"
WIDTH, FLOOR, BOX_W, BOX_H, LEFT = 860, 86, 150, 40, 40
INK, BODY, LINE = "#1f2328", "#e7edf3", "#0b57a3"


def floors() -> list[list[str]]:
    """The rooms of every floor, the lowest first."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    layers = next(one["layers"] for one in contracts if one["type"] == "layers")
    names = [layer.replace("|", " ").replace(":", " ").split() for layer in layers]
    return [[n for n in floor if (PACKAGE / n).is_dir()] for floor in reversed(names)]


def arrows() -> Counter[tuple[str, str]]:
    """(from room, to room) with the number of import statements."""
    found: Counter[tuple[str, str]] = Counter()
    for path in sorted(PACKAGE.rglob("*/*.py")):
        room = path.relative_to(PACKAGE).parts[0]
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.module is not None:
                parts = node.module.split(".")
                if parts[0] == PACKAGE.name and len(parts) > 1 and parts[1] != room:
                    found[room, parts[1]] += 1
    return found


def _places() -> dict[str, tuple[float, float]]:
    """The middle of every room's box."""
    rows = floors()
    places = {}
    for level, row in enumerate(rows):
        for index, room in enumerate(row):
            shift = (level % 2) * 0.12  # or lines from floor to floor would hide boxes
            x = LEFT + (WIDTH - LEFT) * (index + 0.5 + shift * (len(row) > 1)) / len(row)
            places[room] = (min(x, WIDTH - BOX_W / 2 - 4), FLOOR * (len(rows) - level) - FLOOR / 2)
    return places


def drawing() -> str:
    """The whole picture as SVG."""
    places, height = _places(), FLOOR * len(floors())
    lines = []
    for (start, end), count in sorted(arrows().items()):
        (x1, y1), (x2, y2) = places[start], places[end]
        strength = min(0.12 + 0.04 * count, 0.8)
        bend = 0 if y1 != y2 else 40  # between rooms of one floor
        lines.append(
            f'<path d="M{x1:.0f} {y1 + BOX_H / 2:.0f} C{x1:.0f} {y1 + 45 + bend:.0f} '
            f'{x2:.0f} {y2 - 45 + bend:.0f} {x2:.0f} {y2 - BOX_H / 2:.0f}" '
            f'fill="none" stroke="{LINE}" stroke-opacity="{strength:.2f}" stroke-width="1.4"/>'
        )
    for level in range(len(floors())):
        y = height - FLOOR * level - FLOOR / 2
        lines.append(f'<text x="10" y="{y + 5:.0f}" fill="{INK}" opacity="0.6">{level + 1}</text>')
    for room, (x, y) in places.items():
        files = list((PACKAGE / room).glob("*.py"))
        lines.append(
            f'<rect x="{x - BOX_W / 2:.0f}" y="{y - BOX_H / 2:.0f}" width="{BOX_W}" '
            f'height="{BOX_H}" rx="6" fill="{BODY}" stroke="{INK}"/>'
            f'<text x="{x:.0f}" y="{y - 2:.0f}" text-anchor="middle" fill="{INK}" '
            f'font-weight="bold">{room}</text>'
            f'<text x="{x:.0f}" y="{y + 13:.0f}" text-anchor="middle" fill="{INK}" '
            f'font-size="11">{len(files)} files</text>'
        )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" '
        f'font-family="sans-serif" font-size="14" role="img">\n'
        f"<title>Rooms of the package by floor; lines are imports, all of them downwards</title>\n"
        f'<rect width="{WIDTH}" height="{height}" fill="white"/>\n'
        + "\n".join(lines)
        + "\n</svg>\n"
    )


if __name__ == "__main__":
    IMAGE.write_text(drawing(), "utf-8")
