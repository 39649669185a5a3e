"""The pages of the documentation do what they say: commands, code and links."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
SCRIPTS = Path(sys.executable).parent
PAGES = sorted(DOCS.glob("*.md"))
BLOCK = re.compile(r"(?:<!-- (?P<note>[^>]*) -->\n\n)?```(?P<language>\w+)\n(?P<body>.*?)```", re.S)

needs_command = pytest.mark.skipif(
    not (SCRIPTS / "syncline-design").exists(), reason="the package is not installed here"
)


def run(command: list[str], folder: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PATH": f"{SCRIPTS}:{os.environ['PATH']}", "PYTHONUTF8": "1"}
    return subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300,
        check=False,
    )  # fmt: skip


@needs_command
def test_the_tutorial_runs_from_top_to_bottom(tmp_path: Path) -> None:
    page = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    printed: list[str] = []
    for block in BLOCK.finditer(page):
        note, language, body = block["note"] or "", block["language"], block["body"]
        if language == "yaml" and note.startswith("file: "):
            (tmp_path / note.removeprefix("file: ")).write_text(body, encoding="utf-8")
        elif language == "sh":
            done = run(["bash", "-ec", body], tmp_path)
            expected = int(note.removeprefix("exit code: ")) if note else 0
            assert done.returncode == expected, body + done.stdout + done.stderr
            printed.append(done.stdout.replace("\u00a0", " "))
        elif language == "text":
            for line in body.splitlines():
                assert line.rstrip() in printed[-1], line
    assert len(printed) >= 9
    for name in ("report.html", "verdict.json", "heights.html", "heights.csv"):
        assert (tmp_path / name).stat().st_size > 0
    assert "bench_ins" in (tmp_path / "mapping" / "my_sensors.yaml").read_text()


def test_the_python_of_the_guide_runs(tmp_path: Path) -> None:
    shutil.copytree(
        ROOT / "specs", tmp_path / "specs", ignore=shutil.ignore_patterns(".syncline-cases")
    )
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    code = [block["body"] for block in BLOCK.finditer(page) if block["language"] == "python"]
    assert len(code) >= 6
    script = tmp_path / "guide.py"
    script.write_text("\n".join(code), encoding="utf-8")
    done = run([sys.executable, str(script)], tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("meets ")
    assert "Nothing in the files differs" in done.stdout


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_links_inside_the_docs_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text):
        if "://" not in target:
            assert (page.parent / target).exists(), target


def test_the_site_lists_every_page_and_no_other() -> None:
    site = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))

    def pages(entries: list[object]) -> list[str]:
        found: list[str] = []
        for entry in entries:
            for value in entry.values() if isinstance(entry, dict) else [entry]:
                found += pages(value) if isinstance(value, list) else [str(value)]
        return found

    assert sorted(pages(site["nav"])) == [page.name for page in PAGES]
    assert site["strict"] is True


@pytest.mark.parametrize("study", sorted((ROOT / "specs" / "studies").glob("*.yaml")))
def test_shipped_studies_can_be_read(study: Path) -> None:
    from syncline_design.study import load_study

    loaded = load_study(study)
    assert 20 <= len(loaded) <= 200
    assert loaded.path == study
