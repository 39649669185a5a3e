"""GitHub workflow commands: annotations at the spec's line in a pull request.

Source: GitHub Docs, "Workflow commands for GitHub Actions" (error, warning, notice; escaping of
%, CR, LF, and in properties of : and ,).
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePath

from syncline_design.report.ci import SILENT, Notice, all_notices, closing_words
from syncline_design.report.text import unticked, visible
from syncline_design.report.verdict_words import design_sentence
from syncline_design.verdict.tree import Checked

_COMMANDS = {
    "fail": "error",
    "undecided": "error",
    **dict.fromkeys(("waived", "known", "warning"), "warning"),
}


def render_github(verdicts: Sequence[Checked]) -> str:
    """One command per notice that is no pass, then a notice with each spec's outcome."""
    lines = [github_command(f) for f in all_notices(verdicts) if f.level not in SILENT]
    for verdict in verdicts:
        text = f"{closing_words(verdict).removesuffix('.')}. {design_sentence(verdict)}"
        lines.append(github_notice(verdict.name, verdict.file, text))
    return "\n".join(lines) + "\n"


def github_command(notice: Notice) -> str:
    """One annotation."""
    title = f"{notice.label} {notice.rule}".strip()
    if notice.level in ("waived", "known"):
        title += f" ({notice.level})"
    message = notice.message + (f"; {notice.justification}" if notice.justification else "")
    file = PurePath(notice.file).as_posix()
    return (
        f"::{_COMMANDS[notice.level]} file={_property(file)},line={notice.line},"
        f"col={notice.column},title={_property(title)}::{_data(unticked(message))}"
    )


def github_notice(name: str, file: str, text: str) -> str:
    """The outcome, at the top of the spec."""
    place = f"file={_property(PurePath(file).as_posix())},line=1"
    return f"::notice {place},title={_property(name)}::{_data(unticked(text))}"


def _data(text: str) -> str:
    return visible(text).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def _property(text: str) -> str:
    return _data(text).replace(":", "%3A").replace(",", "%2C")
