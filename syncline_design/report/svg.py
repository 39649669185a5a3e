"""A matplotlib figure as inline SVG: themed, labelled for screen readers, the same every time."""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final
from xml.etree import ElementTree

from syncline_design.report.matplotlib_import import load_matplotlib
from syncline_design.report.palette import INK, MUTED, VARIABLES

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SVG: Final = "http://www.w3.org/2000/svg"
_XLINK: Final = "http://www.w3.org/1999/xlink"
_HREF: Final = f"{{{_XLINK}}}href"
_COLOUR: Final = re.compile(r"#[0-9a-f]{6}")
_REFERENCE: Final = re.compile(r"url\(#([^)]+)\)")
_DPI: Final = 72.0  # one figure pixel is one SVG unit
_STYLE: Final[dict[str, Any]] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "syncline-design",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 10,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.unicode_minus": False,
    "text.color": INK,
    "text.parse_math": False,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "legend.frameon": False,
}


@dataclass(frozen=True, slots=True)
class LogBox:
    """Where a log-log axes lies in its SVG: pixel edges and the decimal logarithms there."""

    left: float
    right: float
    top: float
    bottom: float
    log_left: float
    log_right: float
    log_bottom: float
    log_top: float


@dataclass(frozen=True, slots=True)
class InlineFigure:
    """An `<svg>` element as text, and the box of its main axes where that is log-log."""

    svg: str
    box: LogBox | None = None


def draw(
    name: str,
    title: str,
    description: str,
    size: tuple[float, float],
    build: Callable[[Figure], Axes | None],
) -> InlineFigure:
    """Draw one figure with the house style and return it as an `<svg>` element.

    name: prefix of every id, unique in the page.  title, description: what a screen reader says.
    size: width and height in SVG units.  build: draws into the figure; returns the axes whose
    box the page's script needs, or None.
    """
    load_matplotlib()
    from matplotlib import rc_context, rcdefaults, rcParams
    from matplotlib.figure import Figure

    stream = io.StringIO()
    style: Any = _STYLE
    with rc_context(), warnings.catch_warnings():
        rcdefaults()  # whatever the user's own settings are
        rcParams.update(style)
        # A name may hold characters the metrics font lacks; the browser's font draws them.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure = Figure(figsize=(size[0] / _DPI, size[1] / _DPI), dpi=_DPI, layout="constrained")
        axes = build(figure)
        figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None})
        box = None if axes is None else _log_box(figure, axes)
    return InlineFigure(_themed(stream.getvalue(), name, title, description), box)


def add_axes(figure: Figure, *position: int) -> Axes:
    """Axes without top and right spine, the grid behind the data."""
    axes: Axes = figure.add_subplot(*position)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_axisbelow(True)
    return axes


def _themed(drawn: str, name: str, title: str, description: str) -> str:
    root = ElementTree.fromstring(drawn)
    _strip(root)
    _prefix_ids(root, name)
    _theme(root)
    _label(root, name, title, description)
    ElementTree.register_namespace("", _SVG)
    ElementTree.register_namespace("xlink", _XLINK)
    return ElementTree.tostring(root, encoding="unicode")


def _log_box(figure: Figure, axes: Axes) -> LogBox:
    """The pixel box of a log-log axes after the figure was drawn."""
    extent = axes.get_window_extent()
    height = float(figure.get_figheight()) * _DPI
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    return LogBox(
        left=round(float(extent.x0), 3),
        right=round(float(extent.x1), 3),
        top=round(height - float(extent.y1), 3),
        bottom=round(height - float(extent.y0), 3),
        log_left=math.log10(x0),
        log_right=math.log10(x1),
        log_bottom=math.log10(y0),
        log_top=math.log10(y1),
    )


def _strip(root: ElementTree.Element) -> None:
    """Remove metadata, the page-wide style element and the fixed size."""
    for parent in list(root.iter()):
        for child in list(parent):
            if child.tag in {f"{{{_SVG}}}metadata", f"{{{_SVG}}}style"}:
                parent.remove(child)
    for attribute in ("width", "height", "version"):
        root.attrib.pop(attribute, None)


def _prefix_ids(root: ElementTree.Element, name: str) -> None:
    """Make ids unique in the page, and references follow them."""
    for element in root.iter():
        if "id" in element.attrib:
            element.set("id", f"{name}-{element.attrib['id']}")
        reference = element.attrib.get(_HREF, "")
        if reference.startswith("#"):
            element.set(_HREF, f"#{name}-{reference[1:]}")
        for attribute in ("clip-path", "style"):
            value = element.attrib.get(attribute, "")
            if "url(#" in value:
                element.set(attribute, _REFERENCE.sub(rf"url(#{name}-\1)", value))


def _theme(root: ElementTree.Element) -> None:
    """Swap each palette colour for its CSS variable; text takes the page's font."""
    for element in root.iter():
        style = element.attrib.get("style")
        if style is None:
            continue
        themed = _COLOUR.sub(lambda found: _variable(found.group()), style)
        element.set("style", themed)


def _variable(colour: str) -> str:
    name = VARIABLES.get(colour)
    return colour if name is None else f"var({name})"


def _label(root: ElementTree.Element, name: str, title: str, description: str) -> None:
    root.set("role", "img")
    root.set("aria-labelledby", f"{name}-title {name}-desc")
    for position, (tag, text) in enumerate((("title", title), ("desc", description))):
        element = ElementTree.Element(f"{{{_SVG}}}{tag}", {"id": f"{name}-{tag}"})
        element.text = text
        root.insert(position, element)
