"""One offline HTML page: templates, style and script put together; nothing is ever fetched."""

from __future__ import annotations

import base64
import hashlib
import re
from functools import lru_cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any, Final

from syncline_design.report.text import visible

if TYPE_CHECKING:
    from jinja2 import Environment

_TEMPLATES: Final = "syncline_design.templates"
_STEP: Final = re.compile(r"(?<=[\w\]])(?=[.\[])")


def asset(name: str) -> str:
    """The text of a file in reports/templates."""
    return files(_TEMPLATES).joinpath(name).read_text(encoding="utf-8")


def content_security_policy(script: str) -> str:
    """A policy that allows inline styles, exactly this script, and no network at all."""
    digest = base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
    return (
        f"default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; "
        "img-src 'none'; connect-src 'none'; base-uri 'none'; form-action 'none'"
    )


@lru_cache(maxsize=1)
def _environment() -> Environment:
    from jinja2 import Environment, FunctionLoader, StrictUndefined
    from markupsafe import Markup

    def harmless(value: Any) -> Any:
        """Every expression of every template passes here before it is escaped."""
        return visible(value) if isinstance(value, str) and not isinstance(value, Markup) else value

    environment = Environment(
        loader=FunctionLoader(asset),
        autoescape=True,  # select_autoescape() would miss .html.j2
        undefined=StrictUndefined,
        finalize=harmless,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["breakable"] = breakable
    return environment


def breakable(text: str) -> Any:
    """A key path that may go on in the next line before each of its dots and brackets."""
    from markupsafe import Markup, escape

    return Markup("<wbr>").join(escape(part) for part in _STEP.split(visible(text)))


def render_page(template: str, **content: Any) -> str:
    """One page from a template that extends base.html.j2; the result is complete HTML."""
    from markupsafe import Markup

    script = asset("report.js")
    return (
        _environment()
        .get_template(template)
        .render(
            style=Markup(asset("style.css")),
            script=Markup(script),
            policy=content_security_policy(script),
            **content,
        )
    )


def trusted_svg(svg: str) -> Any:
    """Marks a figure of this package, whose texts matplotlib has escaped, as ready HTML."""
    from markupsafe import Markup

    return Markup(svg)
