"""A document as one offline HTML page: one template with style and script; it loads nothing."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import replace
from functools import lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

from syncline_design.report import numbers
from syncline_design.report.columns import padded, worded
from syncline_design.report.document import Document, Inline, Span, charts, for_output, spans
from syncline_design.report.layout import laid_out
from syncline_design.report.table import Cell, Table, table
from syncline_design.report.text import dated, unbroken, unticked, visible

if TYPE_CHECKING:
    from jinja2 import Environment

    from syncline_design.report.svg import InlineChart

_TEMPLATES: Final = "syncline_design.templates"
MOST_VALUES: Final = 200  # rows of the table below a figure; of more both ends
_LINE: Final = 30  # characters of a column that holds sentences
_TABLET: Final = 100  # characters in a line of a table there
_PHONE: Final = 48
_SHORT_KEY: Final = 16  # letters: it stays in one line
_WORD: Final = 16  # letters of a word that a column of a printed table is as wide as
_FEW: Final = 16  # lines of a table that is shown whole below its figure
_BOX: Final = re.compile(r'viewBox="\S+ \S+ (\S+) (\S+)"')
_NAME: Final = re.compile(  # an id, a type, a power of ten, `u-blox`
    r"\b([\w.]{1,12}(?:-\d\w{0,8})+|[A-Za-z]-[a-z]{2,9})\b"
)
_MINUS: Final = re.compile(r"(?<![\w.,:/-])-(?=\d)|(?<=\de)-(?=\d)")
_BRANCH: Final = r"[A-Za-z_]\w*(?:\[[^\]\s]*\])?"
_PATH: Final = re.compile(  # a key of a spec or a file's name, with the marks that stand at it
    rf"((?<![\w./])\(?{_BRANCH}(?:\.{_BRANCH})+[).,;:]*)"
)
_STEP: Final = re.compile(r"(?<=[\w\]])(?=[.\[])")
_DOT: Final = re.compile(r"(?<=[\w\]])(?=\.\w)|(?<=_)(?=[a-z])")


def html(document: Document) -> str:
    """The page of a document; the same input gives the same bytes."""
    from markupsafe import Markup

    script = _asset("report.js")
    policy = content_security_policy(script)
    return _filled(document, "document", "style.css", script=Markup(script), policy=policy)


def fragment(document: Document) -> str:
    """The document as a part of somebody else's page, without a script: for notebooks."""
    return _filled(document, "fragment", "fragment.css", script="")


def _filled(document: Document, template: str, style: str, **more: str) -> str:
    """The document in a template, every figure drawn."""
    from markupsafe import Markup

    shown = for_output(document, "page")
    parts = tuple(replace(part, nodes=laid_out(part.nodes)) for part in shown.sections)
    shown = replace(shown, sections=parts)
    drawn = {c.name: c.draw() for part in shown.sections for c in charts(part.nodes)}
    page = _environment().get_template(f"{template}.html.j2")
    return page.render(d=shown, drawn=drawn, style=Markup(_asset(style)), **more).lstrip()


def _asset(name: str) -> str:
    """The text of a file in reports/templates."""
    return files(_TEMPLATES).joinpath(name).read_text(encoding="utf-8")


def content_security_policy(script: str) -> str:
    """A policy that allows inline styles, exactly this script, and no network at all.

    Pictures may come from the page itself: a figure becomes one on its way into a file.
    """
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    return (
        f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; "
        "img-src data:; connect-src 'none'; base-uri 'none'; form-action 'none'"
    )


@lru_cache(maxsize=1)
def _environment() -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined
    from markupsafe import Markup

    def harmless(value: Any) -> Any:
        """Every expression of the template passes here before it is escaped."""
        return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value

    environment = Environment(
        loader=FunctionLoader(_asset),
        autoescape=True,  # select_autoescape() would miss .html.j2
        undefined=StrictUndefined,
        finalize=harmless,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["spans"] = _spans
    environment.filters["bare"] = unticked
    environment.tests["wide"] = lambda shown: _needed(shown) > _TABLET
    environment.tests["narrow"] = lambda shown: _needed(shown) <= _PHONE
    environment.tests["wordy"] = _is_wordy
    environment.tests["lengthy"] = _is_lengthy
    environment.tests["few"] = lambda shown: _lines(shown) <= _FEW
    environment.filters["dated"] = dated
    environment.filters["whole"] = _whole
    environment.filters["printed"] = _printed
    environment.filters["soft"] = _soft
    environment.filters["points"] = _points
    environment.filters["values"] = _values
    environment.filters["shape"] = _shape
    environment.filters["drawing"] = Markup  # matplotlib has escaped the texts in it
    return environment


def _spans(words: Inline) -> tuple[Span, ...]:
    """Inline text in which, outside of code, figures are typeset."""
    return tuple(
        one if one.style == "code" else replace(one, text=_printed(one.text))
        for one in spans(words)
    )


def _printed(text: str) -> str:
    """A text whose figures stay with their units, moments as people write them, minus signs."""
    return unbroken(_MINUS.sub("\N{MINUS SIGN}", dated(text)))


def _whole(text: str) -> Any:
    """A text in which no line ends at the hyphen of `ACC-1` or `1e-3`, long keys end at dots."""
    from markupsafe import Markup

    parts = _PATH.split(visible(text))
    parts[::2] = [_named(part) for part in parts[::2]]
    parts[1::2] = [_breakable(part) for part in parts[1::2]]
    return Markup("").join(parts)


def _named(text: str) -> Any:
    from markupsafe import Markup, escape

    parts = [escape(part) for part in _NAME.split(text)]
    parts[1::2] = [Markup('<span class="whole">{}</span>').format(part) for part in parts[1::2]]
    return Markup("").join(parts)


def _breakable(key: str) -> Any:
    """A long key path or file's name: where no line holds it, it goes on at a dot or low line."""
    from markupsafe import Markup

    if len(key) <= _SHORT_KEY:
        return _named(key)
    steps = Markup("<wbr>").join(_named(part) for part in _DOT.split(key))
    return Markup('<span class="key">{}</span>').format(steps)


def _points(figure: InlineChart) -> str:
    """What the places of a figure say, for the page's script.

    Labels; every word once; a row a place: left, top, width, height, the places of its words.
    """
    labels, words = _labels(figure), {"": 0}
    rows = []
    for t in figure.told:
        said = (t.says.get(label, "") for label in labels)
        found = [words.setdefault(_printed(word), len(words)) for word in said]
        rows.append([t.left, t.top, t.wide, t.high, *found])
    data = {"labels": labels, "words": list(words), "rows": rows}
    return json.dumps(data, ensure_ascii=False, separators=(",", ":"))


def _values(figure: InlineChart, caption: str) -> Table | None:
    """The same as a table, as far as anyone reads; None of a figure that says nothing."""
    if not figure.told:
        return None
    once = list({tuple(one.says.items()): one for one in figure.told}.values())  # of two panels
    end, every = MOST_VALUES // 2, numbers.count(len(once))
    whole = len(once) <= MOST_VALUES
    told = once if whole else [*once[:end], *once[-end:]]
    labels = sorted(_labels(figure), key=lambda one: any(one not in t.says for t in figure.told))
    columns = [worded(padded([t.says.get(label, "") for t in told])) for label in labels]
    note = f"The first and the last {end} of {every}; the figure tells them all, one by one."
    note = "" if whole else note
    return table(caption, labels, zip(*columns, strict=True), note)


def _shape(figure: InlineChart) -> str:
    """A figure's height over its width, for the style sheet to work out."""
    box = _BOX.search(figure.svg)
    return "1" if box is None else f"{box[2]} / {box[1]}"


def _labels(figure: InlineChart) -> list[str]:
    return list(dict.fromkeys(label for t in figure.told for label in t.says))


def _needed(shown: Table) -> int:
    """Characters in a line of a table: words may break into lines, figures may not."""
    needed = 0
    for column, head in enumerate(shown.heads):
        longest = max((len(row[column].text) for row in shown.rows), default=0)
        words = [head.text] if head.numeric else head.text.split()  # heads of figures stay whole
        longest = longest if head.numeric else min(longest, _LINE)
        needed += 2 + max(longest, *(2 + len(word) for word in words or [""]))  # with its arrow
    return needed


def _lines(shown: Table) -> int:
    """Lines of a table beside its figure, where a cell of many words has several."""
    return sum(max(1, *(-(-len(cell.text) // _LINE) for cell in row)) for row in shown.rows)


def _is_wordy(shown: Table) -> bool:
    """Whether the last column holds sentences, which take the width that figures leave."""
    return any(len(row[-1].text) > _LINE for row in shown.rows)


def _is_lengthy(cell: Cell) -> bool:
    """Whether a cell holds a word too long for a column of a printed table to be as wide as it."""
    return any(len(word) > _WORD for word in _printed(cell.text).split(" "))


def _soft(text: str) -> str:
    """The same for an attribute that a style sheet shows."""
    whole = _NAME.sub(lambda found: found[0].replace("-", "\N{NON-BREAKING HYPHEN}"), text)
    return "\N{ZERO WIDTH SPACE}".join(_STEP.split(whole))
