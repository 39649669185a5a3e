"""Results of `check` in a requirements tool, as the docs say (in the docs' environment)."""

from __future__ import annotations

import html
import re
from pathlib import Path

import pytest

from syncline_design.report.checks import render_checks
from tests.checked import check_file

ROOT = Path(__file__).resolve().parent.parent
FILE = re.compile(r"<!-- file: (?P<name>[\w.]+) -->\n\n```\w+\n(?P<body>.*?)```", re.S)


def test_sphinx_needs_links_every_result_to_its_requirement(tmp_path: Path) -> None:
    pytest.importorskip("sphinx_test_reports", reason="of the docs' environment")
    from sphinx.cmd.build import build_main

    page = (ROOT / "docs" / "ci.md").read_text(encoding="utf-8")
    files = {found["name"]: found["body"] for found in FILE.finditer(page)}
    assert set(files) == {"conf.py", "index.rst"}
    for name, body in files.items():
        (tmp_path / name).write_text(body, encoding="utf-8")
    verdict = check_file(ROOT / "specs" / "usv_wire_missing.yaml")
    (tmp_path / "result.xml").write_text(render_checks("junit", [verdict]), encoding="utf-8")
    out = tmp_path / "out"
    assert build_main(["-q", "-W", "-b", "html", str(tmp_path), str(out)]) == 0
    shown = (out / "index.html").read_text(encoding="utf-8")
    table = shown[shown.rindex("<table") :]
    rows = [
        " ".join(html.unescape(re.sub(r"<[^>]+>", " ", row)).split())
        for row in re.findall(r"<tr.*?</tr>", table, re.S)
    ]
    for requirement in verdict.requirements:
        (row,) = [row for row in rows if row.startswith(f"{requirement.id} {requirement.kind}")]
        assert {"pass": "passed", "fail": "failed"}[requirement.status] in row
        assert repr(requirement.value) in row
        assert f'href="#{requirement.id}"' in table or f"#{requirement.id}" in table
