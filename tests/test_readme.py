"""What the README shows is what the commands print."""

from __future__ import annotations

import re
from pathlib import Path

from typer.testing import CliRunner

from syncline_design.cli.app import app

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text("utf-8")


def test_the_spec_shown_is_the_shipped_one() -> None:
    shown = re.search(r"```yaml\n(syncline: 1\n.*?)```", README, re.DOTALL)
    assert shown is not None
    assert (ROOT / "specs" / "uav_corridor.yaml").read_text("utf-8").endswith(shown.group(1))


def test_the_verdict_shown_is_what_check_prints(monkeypatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("COLUMNS", "100")
    shown = re.search(r"\$ syncline-design (check .*?)\n(.*?)```", README, re.DOTALL)
    assert shown is not None
    done = CliRunner().invoke(app, shown.group(1).split())
    assert done.exit_code == 0
    assert done.stdout == shown.group(2)


def test_every_file_the_readme_links_is_there() -> None:
    links = re.findall(r"\]\(((?!https?:)[^)#]+)", README)
    assert links
    assert [link for link in links if not (ROOT / link).exists()] == []
