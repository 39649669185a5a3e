"""A matplotlib figure as inline SVG: themed, labelled for screen readers, the same every time.

What a point or a bar is can be told with it (`tell`): pages show it under the pointer, by arrow
keys and as a table below the figure.
"""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, Final, Literal
from xml.etree import ElementTree

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.figure_text import to_places
from syncline_design.report.matplotlib_import import load_matplotlib
from syncline_design.report.palette import INK, MUTED, SURFACE, VARIABLES
from syncline_design.report.text import visible

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SVG: Final = "http://www.w3.org/2000/svg"
_XLINK: Final = "http://www.w3.org/1999/xlink"
_TEXT: Final = f"{{{_SVG}}}text"
_HREF: Final = f"{{{_XLINK}}}href"
_COLOUR: Final = re.compile(r"#[0-9a-f]{6}")
_REFERENCE: Final = re.compile(r"url\(#([^)]+)\)")
_PLACES: Final = frozenset({"d", "x", "y"})  # attributes
_LONG: Final = re.compile(r"-?\d+\.\d{3,}")
_SIZE: Final = re.compile(r"(\d+(?:\.\d+)?)px")
_DPI: Final = 72.0  # one figure pixel is one SVG unit
_SHARP: Final = 216.0  # dots per inch of a picture in pixels: three a unit
_STYLE: Final[dict[str, Any]] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "syncline-design",
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 10,
    "axes.titlesize": "medium",
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.8,
    "axes.unicode_minus": True,
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


Pairs = Mapping[str, str]  # what a place in a figure says: label, value
Ends = tuple[float, float]
Build = Callable[["Figure"], "Axes | None"]


@dataclass(frozen=True, slots=True)
class Tip:
    """A place in a figure, in SVG units from its left upper corner, and what it says.

    wide, high: of a bar, whose corner the place then is.
    """

    left: float
    top: float
    wide: float
    high: float
    says: Pairs


@dataclass(frozen=True, slots=True)
class InlineChart:
    """An `<svg>` element as text, and the box of its main axes where that is log-log.

    exported: the figure as a file of its own, on a ground and in colours of its own.
    """

    svg: str
    box: LogBox | None = None
    told: tuple[Tip, ...] = ()
    exported: Callable[[Literal["svg", "png"]], bytes] | None = None


_Note = tuple["Axes", Ends, Ends, Pairs]
_NOTES: ContextVar[list[_Note]] = ContextVar("notes")


def tell(
    axes: Axes, x: float | Ends, y: float | Ends, says: Sequence[tuple[str, str]]
) -> None:  # fmt: skip
    """Say what stands at a point of the axes, or over a span of them where x, y have two ends."""
    ends_x = x if isinstance(x, tuple) else (x, x)
    ends_y = y if isinstance(y, tuple) else (y, y)
    _NOTES.get().append((axes, ends_x, ends_y, dict(says)))


def draw(
    name: str, title: str, description: str, size: tuple[float, float], build: Build
) -> InlineChart:
    """Draw one figure with the house style and return it as an `<svg>` element.

    name: prefix of every id, unique in the page.  title, description: what a screen reader says.
    size: width and height in SVG units.  build: draws into the figure; returns the axes whose
    box the page's script needs, or None.
    """

    def exported(kind: Literal["svg", "png"]) -> bytes:
        with _drawn(size, build) as (figure, _):
            return _saved(figure, kind, _DPI if kind == "svg" else _SHARP, SURFACE)

    with _drawn(size, build) as (figure, axes):
        text = _saved(figure, "svg", _DPI, "none").decode("utf-8")
        box = None if axes is None else _log_box(figure, axes)
        told = tuple(_places(size[1], _NOTES.get()))
    return InlineChart(_themed(text, name, title, description), box, told, exported)


@contextmanager
def _drawn(size: tuple[float, float], build: Build) -> Iterator[tuple[Figure, Axes | None]]:
    """A figure in the house style, and the axes that its maker returned."""
    load_matplotlib()
    from matplotlib import rc_context, rcdefaults, rcParams
    from matplotlib.figure import Figure

    style: Any = _STYLE
    with rc_context(), warnings.catch_warnings():
        rcdefaults()  # whatever the user's own settings are
        rcParams.update(style)
        # A name may hold characters the metrics font lacks; the browser's font draws them.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure = Figure(figsize=(size[0] / _DPI, size[1] / _DPI), dpi=_DPI, layout="constrained")
        kept = _NOTES.set([])
        try:
            yield figure, build(figure)
        finally:
            _NOTES.reset(kept)


def _saved(figure: Figure, kind: Literal["svg", "png"], dpi: float, ground: str) -> bytes:
    """The figure as a file, without its date and maker: the same every time."""
    if kind == "svg":
        _lay_out(figure)
    stream = io.BytesIO()
    unsaid = {"Date": None, "Creator": None} if kind == "svg" else {"Software": None}
    figure.savefig(stream, format=kind, metadata=unsaid, dpi=dpi, facecolor=ground)
    return stream.getvalue()


def _lay_out(figure: Figure) -> None:
    """Give the axes their places for SVG, once: saving would draw all of it once more for them."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    FigureCanvasSVG(figure)  # whose widths of words count
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        maps = [axes for axes in figure.axes if axes.get_aspect() != "auto"]
        for axes in maps:  # their limits, and so their labels, follow the box they are given
            axes.apply_aspect()
        if maps:
            engine.execute(figure)
        figure.set_layout_engine(None)


def _places(height: float, notes: Sequence[_Note]) -> Iterator[Tip]:
    """Where in the drawn figure the noted places lie."""
    for axes, (x0, x1), (y0, y1), says in notes:
        a, b = axes.transData.transform([(x0, y0), (x1, y1)])
        left, right = sorted((float(a[0]), float(b[0])))
        low, top = sorted((float(a[1]), float(b[1])))
        shown = {label: visible(value) for label, value in says.items()}
        yield Tip(round(left, 1), round(height - top, 1), round(right - left, 1),
                   round(top - low, 1), shown)  # fmt: skip


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
    _shorten(root)
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
        if element.tag == _TEXT:  # smaller where the page draws the figure larger
            themed = _SIZE.sub(r"calc(\1px * var(--fig-text, 1))", themed)
        element.set("style", themed)


def _shorten(root: ElementTree.Element) -> None:
    """The same picture in half the letters: places to a hundredth, one style for marks alike."""
    for element in root.iter():
        if element.tag != _TEXT:
            element.text = (element.text or "").strip()
        element.tail = (element.tail or "").strip()
        for attribute in _PLACES & element.attrib.keys():
            element.set(attribute, _LONG.sub(_hundredth, element.attrib[attribute]))
        marks = [child.attrib.get("style") for child in element]
        alike = len(set(marks)) == 1 and {child.tag for child in element} == {f"{{{_SVG}}}use"}
        if alike and marks[0] and "style" not in element.attrib:
            element.set("style", marks[0])
            for child in element:
                del child.attrib["style"]


def _hundredth(found: re.Match[str]) -> str:
    return to_places(float(found[0]), 2).rstrip("0").rstrip(".")


def _variable(colour: str) -> str:
    name = VARIABLES.get(colour)
    return colour if name is None else f"var({name})"


def _label(root: ElementTree.Element, name: str, title: str, description: str) -> None:
    root.set("role", "img")
    root.set("aria-labelledby", f"{name}-title {name}-desc")
    for position, (tag, text) in enumerate((("title", title), ("desc", description))):
        element = ElementTree.Element(f"{{{_SVG}}}{tag}", {"id": f"{name}-{tag}"})
        element.text = visible(text)
        root.insert(position, element)
