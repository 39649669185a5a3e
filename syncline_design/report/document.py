"""A subject's text as data, written once: four renderers walk it (console, Markdown, page, CSV).

An `on_*` file makes a Document of a result.  Nothing here is escaped: every renderer makes every
text harmless for its own output, so what a user named can stand in any node as it is.

Each node says how far it reaches: `everywhere`, only on the `page`, or only in the `text` outputs
(console and Markdown, where a line often says what a page draws).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, Literal, TypeAlias

from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.report.table import Table, Tone
from syncline_design.report.text import ticked, unticked

if TYPE_CHECKING:
    from syncline_design.report.svg import InlineChart

Audience = Literal["everywhere", "page", "text"]
Style = Literal["", "strong", "muted", "code", "given"]


@dataclass(frozen=True, slots=True)
class Span:
    """A stretch of text; `given` is a user's own, kept apart from the writing direction around."""

    text: str
    style: Style = ""


Inline: TypeAlias = "str | Span | tuple[str | Span, ...]"
Pairs: TypeAlias = "tuple[tuple[str, Inline], ...]"


@dataclass(frozen=True, slots=True)
class Outcome:
    """A result as colour, symbol and word together, so that none is needed alone."""

    tone: Tone
    mark: str
    word: str


@dataclass(frozen=True, slots=True)
class Heading:
    """A heading below a section's own; aside: quieter words behind it."""

    kind: ClassVar = "heading"
    words: Inline
    aside: Inline = ""
    reach: Audience = "everywhere"


@dataclass(frozen=True, slots=True)
class Text:
    """A paragraph; quiet for a note, mark and tone for what must be seen."""

    kind: ClassVar = "text"
    words: Inline
    quiet: bool = False
    mark: str = ""
    tone: Tone = ""
    reach: Audience = "everywhere"


@dataclass(frozen=True, slots=True)
class Facts:
    """Labels with their values: key `facts`, an aligned `record`, or `terms` with sentences."""

    kind: ClassVar = "facts"
    pairs: Pairs
    form: Literal["facts", "record", "terms"] = "facts"
    reach: Audience = "everywhere"


@dataclass(frozen=True, slots=True)
class Items:
    """A list; numbered where the order counts, marked where each entry warns."""

    kind: ClassVar = "items"
    entries: tuple[Inline, ...]
    mark: str = ""
    tone: Tone = ""
    reach: Audience = "everywhere"


@dataclass(frozen=True, slots=True)
class TableNode:
    """A table in its place; its caption is silent where a heading above says the same."""

    kind: ClassVar = "table"
    table: Table
    silent: bool = False
    reach: Audience = "everywhere"


@dataclass(frozen=True, slots=True)
class Chart:
    """A figure, drawn only when a page asks for it; name: unique in the document."""

    kind: ClassVar = "chart"
    name: str
    draw: Callable[[], InlineChart]
    caption: str
    reach: Audience = "page"


@dataclass(frozen=True, slots=True)
class ExploredLimit:
    """A limit to be moved: as it is shown at first, and the unit of it, one of which is size_m."""

    limit_m: float
    shown: str
    unit: str
    size_m: float


@dataclass(frozen=True, slots=True)
class Explorer:
    """Sliders that move tau and the limit of the chart so named; None where unknown.

    tau_crit_s: the system's tau at which the first sensor reaches its own tau_crit.
    """

    kind: ClassVar = "explorer"
    chart: str
    floor_m: float
    rate_mps: float
    tau_s: float
    tau_crit_s: float | None
    limit: ExploredLimit | None
    sync_limit: float
    others_pass: bool
    tau_span: tuple[float, float]
    limit_span: tuple[float, float]
    reach: Audience = "page"


@dataclass(frozen=True, slots=True)
class Group:
    """Nodes that belong together: an article, a column, side by side, folded.

    split: three parts to two; pair: two in a row; flow: two columns; trio: three in a row where
    there is room; alone: a figure with its words and values beside it.
    """

    kind: ClassVar = "group"
    nodes: tuple[Node, ...]
    form: Literal["article", "column", "split", "pair", "flow", "trio", "alone", "fold"] = "column"
    key: str = ""
    summary: str = ""  # of a fold
    reach: Audience = "everywhere"


Node: TypeAlias = "Heading | Text | Facts | Items | TableNode | Chart | Explorer | Group"


@dataclass(frozen=True, slots=True)
class Section:
    """A titled part; key: its anchor, label: its word in the contents list.

    folded: a page shows its title, and the rest when it is asked for.
    """

    key: str
    title: str
    label: str
    nodes: tuple[Node, ...]
    reach: Audience = "everywhere"
    folded: bool = False


@dataclass(frozen=True, slots=True)
class Document:
    """The answer first (outcome, name, sentences, key facts), then what it rests on.

    family: what kind of report it is; source: the file it is about, for the console's first line.
    """

    family: str
    outcome: Outcome
    name: str
    sentences: tuple[Inline, ...]
    facts: Pairs
    sections: tuple[Section, ...]
    source: str = ""
    title: str = ""  # of the browser's window; by default name and outcome


def code(text: object) -> Span:
    """A name that a file or a program knows."""
    return Span(str(text), "code")


def strong(text: object) -> Span:
    """What the eye should find."""
    return Span(str(text), "strong")


def muted(text: object) -> Span:
    """What may be passed over."""
    return Span(str(text), "muted")


def given(text: object) -> Span:
    """A user's own words among ours."""
    return Span(str(text), "given")


def spans(words: Inline) -> tuple[Span, ...]:
    """Inline text as spans, empty ones left out; what stands in backticks as code."""
    parts = words if isinstance(words, tuple) else (words,)
    found = (part if isinstance(part, Span) else Span(part) for part in parts)
    return tuple(one for span in found for one in _coded(span) if one.text)


def _coded(span: Span) -> Iterator[Span]:
    """Code as it is; in what is told, names and commands apart from the words around them.

    What stands out or back as a whole does so with them.
    """
    if span.style == "code":
        yield span
    elif span.style in ("strong", "muted"):
        yield Span(unticked(span.text), span.style)
    else:
        for k, part in enumerate(ticked(span.text)):
            yield Span(part, "code" if k % 2 else span.style)


def plain(words: Inline) -> str:
    """Inline text without its styles."""
    return "".join(span.text for span in spans(words))


def show(
    table: Table | None, *, silent: bool = False, reach: Audience = "everywhere"
) -> list[Node]:
    """A table as a node; none, or one without rows, as nothing.

    A column in which no row says anything is left out, unless it is the first.
    """
    if table is None or not table.rows:
        return []
    kept = [i for i in range(len(table.heads)) if not i or any(row[i].text for row in table.rows)]
    heads = tuple(table.heads[i] for i in kept)
    rows = tuple(tuple(row[i] for i in kept) for row in table.rows)
    named_by = kept.index(table.named_by) if table.named_by in kept else 0
    shown = replace(table, heads=heads, rows=rows, named_by=named_by)
    return [TableNode(shown, silent, reach)]


def section(key: str, title: str, nodes: Iterable[Node], label: str = "",
            reach: Audience = "everywhere") -> list[Section]:  # fmt: skip
    """A section, or nothing where nothing stands in it; its label is its title unless given."""
    found = tuple(nodes)
    return [Section(key, title, label or title, found, reach)] if found else []


def folded(document: Document, left_open: Collection[str]) -> Document:
    """What answers stays open on a page, by key; what it rests on opens when it is asked for."""
    parts = (replace(part, folded=part.key not in left_open) for part in document.sections)
    return replace(document, sections=tuple(parts))


def provenance(pairs: Sequence[tuple[str, str]], reach: Audience = "page") -> list[Section]:
    """The last section: what made the result."""
    record = Facts(tuple((label, code(value)) for label, value in pairs), "record")
    return section("provenance", "Provenance", [record] if pairs else [], reach=reach)


def pins(
    version: str, spec_sha256: str, catalogs_sha256: str, seed: int | None
) -> list[tuple[str, str]]:
    """What a result of a spec is pinned by, for `provenance`; no seed where nothing is drawn."""
    return [
        ("syncline-design", version),
        ("Spec, SHA-256", spec_sha256),
        ("Catalogs, SHA-256", catalogs_sha256),
        *([("Seed", str(seed))] if seed is not None else []),
    ]


def for_output(document: Document, output: Literal["page", "text"]) -> Document:
    """The document as far as it reaches into one kind of output; empty sections are left out."""
    kept = []
    for part in document.sections:
        nodes = tuple(_reaching(part.nodes, output))
        if nodes and part.reach in ("everywhere", output):
            kept.append(replace(part, nodes=nodes))
    return replace(document, sections=tuple(kept))


def _reaching(nodes: Iterable[Node], output: Audience) -> Iterator[Node]:
    for node in nodes:
        if node.reach not in ("everywhere", output):
            continue
        if isinstance(node, Group):
            inner = tuple(_reaching(node.nodes, output))
            if inner:
                yield replace(node, nodes=inner)
        else:
            yield node


def charts(nodes: Iterable[Node]) -> Iterator[Chart]:
    """Every chart below these nodes."""
    for node in nodes:
        if isinstance(node, Group):
            yield from charts(node.nodes)
        elif isinstance(node, Chart):
            yield node
