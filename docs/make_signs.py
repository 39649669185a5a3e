"""Draw the axes and signs of bearings anew: `python docs/make_signs.py` from the repository's root.

The arrows and arcs are computed from the measurement equation itself,
n = [cos(az) cos(el), sin(az) cos(el), -sin(el)] in the body (forward, right, down).
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

IMAGE = Path("docs/images/bearing_signs.svg")
AZIMUTH, ELEVATION = math.radians(35.0), math.radians(30.0)
INK, BODY, BEAM, ARC = "#1f2328", "#d8dee5", "#0b57a3", "#b8500f"
Point = tuple[float, float]


def bearing(azimuth: float, elevation: float) -> tuple[float, float, float]:
    """The unit vector to the object, in the body: forward, right, down."""
    level = math.cos(elevation)
    return math.cos(azimuth) * level, math.sin(azimuth) * level, -math.sin(elevation)


def main() -> None:
    """Write the drawing: from above (azimuth) and from the right side (elevation)."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    style: Any = {"svg.fonttype": "none", "svg.hashsalt": "syncline-design", "font.size": 11}
    with rc_context(style):
        figure = Figure(figsize=(8.2, 4.3), layout="constrained")
        figure.patch.set_facecolor("white")
        above, side = figure.subplots(1, 2)
        _from_above(above)
        _from_the_side(side)
        figure.savefig(IMAGE, format="svg", metadata={"Date": None, "Creator": None})
    # matplotlib ends some lines with a space
    lines = [line.rstrip() for line in IMAGE.read_text("utf-8").splitlines()]
    IMAGE.write_text("\n".join(lines) + "\n", "utf-8")


def _from_above(axes: Any) -> None:
    """Forward is up on the page, right is right: azimuth turns clockwise."""
    _frame(axes, "seen from above", [(-0.16, -0.3), (0.16, -0.3), (0.16, 0.18), (0, 0.36),
                                     (-0.16, 0.18)])  # fmt: skip
    _arrow(axes, (0.0, 1.0), INK, "x forward", (0.05, 1.05))
    _arrow(axes, (1.0, 0.0), INK, "y right", (0.86, 0.06))
    forward, right, _ = bearing(AZIMUTH, 0.0)
    _arrow(axes, (right, forward), BEAM, "object", (right + 0.02, forward + 0.03))
    turn = [AZIMUTH * step / 40 for step in range(41)]
    arc = [(0.55 * bearing(a, 0.0)[1], 0.55 * bearing(a, 0.0)[0]) for a in turn]
    _arc(axes, arc, "azimuth > 0:\nto the right", (0.42, 0.3))
    axes.text(0.24, -0.22, "z down: into the page", color=INK)
    axes.text(-0.98, 0.45, "azimuth < 0:\nto the left", color=ARC)


def _from_the_side(axes: Any) -> None:
    """Forward is right on the page, down is down: elevation turns towards the sky."""
    _frame(axes, "seen from the right side", [(-0.3, -0.1), (0.2, -0.1), (0.38, 0), (0.2, 0.1),
                                              (-0.3, 0.1)])  # fmt: skip
    _arrow(axes, (1.0, 0.0), INK, "x forward", (0.72, -0.14))
    _arrow(axes, (0.0, -1.0), INK, "z down", (0.06, -0.98))
    forward, _, down = bearing(0.0, ELEVATION)
    _arrow(axes, (forward, -down), BEAM, "object", (forward - 0.05, -down + 0.06))
    turn = [ELEVATION * step / 40 for step in range(41)]
    arc = [(0.6 * bearing(0.0, e)[0], -0.6 * bearing(0.0, e)[2]) for e in turn]
    _arc(axes, arc, "elevation > 0:\nabove", (0.64, 0.12))
    axes.text(0.5, -0.5, "elevation < 0:\nbelow", color=ARC)
    axes.text(-0.95, -0.45, "straight down:\nelevation \N{MINUS SIGN}90\N{DEGREE SIGN}", color=ARC)


def _frame(axes: Any, title: str, outline: list[Point]) -> None:
    from matplotlib.patches import Polygon

    axes.add_patch(Polygon(outline, closed=True, facecolor=BODY, edgecolor="none"))
    axes.text(-1.0, 1.3, title, fontsize=12, weight="bold", color=INK)
    axes.set_xlim(-1.05, 1.25)
    axes.set_ylim(-1.1, 1.45)
    axes.set_aspect("equal")
    axes.axis("off")


def _arrow(axes: Any, tip: Point, colour: str, word: str, at: Point) -> None:
    arrow = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.8, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=tip, xytext=(0.0, 0.0), arrowprops=arrow)
    axes.text(*at, word, color=colour)


def _arc(axes: Any, points: list[Point], words: str, at: Point) -> None:
    axes.plot([x for x, _ in points[:-2]], [y for _, y in points[:-2]], color=ARC, linewidth=1.6)
    arrow = {"arrowstyle": "-|>", "color": ARC, "linewidth": 1.6, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", xy=points[-1], xytext=points[-4], arrowprops=arrow)
    axes.text(*at, words, color=ARC)


if __name__ == "__main__":
    main()
