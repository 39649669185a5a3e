"""Colours by meaning; each is a CSS variable with a light, a dark and a print value in style.css.

Figures are drawn with the light values below; `svg.inline` swaps each for its variable, so that
one drawing follows the reader's theme.
"""

from __future__ import annotations

from typing import Final

INK: Final = "#1f2328"
MUTED: Final = "#57606a"
GRID: Final = "#d8dee5"
SURFACE: Final = "#fefefe"
LINE: Final = "#0b57a3"
GOOD: Final = "#1a7f38"
BAD: Final = "#b42319"
WARN: Final = "#8a5a01"
SHADE: Final = "#eef3f9"
SERIES: Final = (
    "#0b58a4", "#b8500f", "#2a7f63", "#7a4fa3", "#8c6d1e", "#a23b73", "#3d6f8f", "#5b6771",
)  # fmt: skip

PALE: Final = 0.5  # opacity of what was before: told from what is after in grey print too

VARIABLES: Final[dict[str, str]] = {
    INK: "--ink", MUTED: "--muted", GRID: "--grid", SURFACE: "--surface", LINE: "--line",
    GOOD: "--good", BAD: "--bad", WARN: "--warn", SHADE: "--shade",
    **{colour: f"--series-{index}" for index, colour in enumerate(SERIES, start=1)},
}  # fmt: skip
