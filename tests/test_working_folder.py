"""The working folder is data: nothing in it is run, imported or taken for a setting."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
COMMAND = Path(sys.executable).parent / "syncline-design"
STUDY = """\
study: 1
name: limits
base: position_track.yaml
grid: {"requirements[ACC-1].limit": {low: 1 cm, high: 10 cm, count: 10}}
"""

pytestmark = pytest.mark.skipif(not COMMAND.exists(), reason="the package is not installed here")


def run(folder: Path, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(COMMAND), *arguments], cwd=folder, env={**os.environ, **environment},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A repository under check with a module and a package by every name that could be imported.

    Each of them notes in `ran` that it was run.
    """
    folder = tmp_path_factory.mktemp("hostile")
    for name in ("position_track", "usv_mapping"):
        (folder / f"{name}.yaml").write_bytes((ROOT / "specs" / f"{name}.yaml").read_bytes())
    (folder / "study.yaml").write_text(STUDY)
    body = f"open({str(folder / 'ran')!r}, 'a').write(__name__ + chr(10))\nraise SystemExit(99)\n"
    names = {*sys.stdlib_module_names, *importlib.metadata.packages_distributions()}
    for name in {n for n in names if n.isidentifier()} | {"sitecustomize", "usercustomize"}:
        (folder / f"{name}.py").write_text(body)
        (folder / name).mkdir(exist_ok=True)
        (folder / name / "__init__.py").write_text(body)
    return folder


COMMANDS = [
    ("check", "position_track.yaml", "-o", "html:out/check.html", "-o", "json:out/check.json"),
    ("optimize", "position_track.yaml", "--pareto", "--write-design", "out/pinned.yaml"),
    # from three million samples on, and from nine cases on, other processes help
    ("simulate", "position_track.yaml", "--samples", "3000000", "--workers", "2"),
    ("study", "study.yaml", "--workers", "2", "--store", "out/store", "-o", "html:out/study.html"),
    ("diff", "position_track.yaml", "usv_mapping.yaml", "-o", "markdown:out/diff.md"),
    ("catalog", "list"),
    ("schema", "spec"),
    ("init", "out/new"),
]


@pytest.mark.parametrize("arguments", COMMANDS, ids=lambda a: a[0])
def test_no_command_runs_what_lies_in_the_working_folder(
    hostile: Path, arguments: tuple[str, ...]
) -> None:
    done = run(hostile, *arguments)
    assert done.returncode in (0, 1), done.stderr
    assert not (hostile / "ran").exists(), (hostile / "ran").read_text()


@pytest.mark.skipif(importlib.util.find_spec("distributed") is None, reason="Dask is not here")
def test_no_process_of_a_cluster_does_either(hostile: Path) -> None:
    done = run(hostile, "study", "study.yaml", "--dask", "--workers", "1", "--store", "out/dask")
    assert done.returncode in (0, 1), done.stderr
    assert not (hostile / "ran").exists(), (hostile / "ran").read_text()


def test_an_empty_entry_of_the_search_path_is_not_handed_on(hostile: Path) -> None:
    """`PYTHONPATH=$PYTHONPATH:/x` with nothing set before names the working folder."""
    code = (
        "import os, subprocess, sys\n"
        "from syncline_design.machine.processes import forget_working_folder, python_command\n"
        "sys.path.insert(0, '')\n"
        f"os.environ['PYTHONPATH'] = os.pathsep + {str(ROOT)!r} + os.pathsep + '.'\n"
        "forget_working_folder()\n"
        "for code in ('import numpy, json', 'import syncline_design'):\n"
        "    subprocess.run(python_command(code), check=True)\n"
        "    subprocess.run([sys.executable, '-c', code], check=True)\n"
        "print(os.environ['PYTHONPATH'])\n"
    )
    command = [sys.executable, "-P", "-c", code]
    done = subprocess.run(command, cwd=hostile, capture_output=True, text=True, check=False)
    assert done.stdout == f"{ROOT}\n", done.stderr
    assert not (hostile / "ran").exists(), (hostile / "ran").read_text()


SETTINGS = {
    "another style": b"font.size: 40\naxes.grid: True\nsvg.fonttype: path\ntext.usetex: True\n",
    "not text": b"\xff\xfe\x00\x01",
    "a pipe": None,
}


@pytest.fixture(scope="module")
def plain_page(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("plain")
    return page(folder)


def page(folder: Path, **environment: str) -> bytes:
    spec = folder / "position_track.yaml"
    spec.write_bytes((ROOT / "specs" / "position_track.yaml").read_bytes())
    done = run(folder, "check", "position_track.yaml", "--output", "html:page.html", **environment)
    assert done.returncode == 0, done.stderr
    return (folder / "page.html").read_bytes()


@pytest.mark.parametrize("content", SETTINGS.values(), ids=SETTINGS.keys())
def test_settings_of_matplotlib_in_the_working_folder_change_nothing(
    content: bytes | None, plain_page: bytes, tmp_path: Path
) -> None:
    if content is None:
        os.mkfifo(tmp_path / "matplotlibrc")
    else:
        (tmp_path / "matplotlibrc").write_bytes(content)
    assert page(tmp_path) == plain_page


def test_nor_do_those_of_its_folder_of_settings(plain_page: bytes, tmp_path: Path) -> None:
    folder = tmp_path / "settings"
    folder.mkdir()
    (folder / "matplotlibrc").write_bytes(SETTINGS["another style"] or b"")
    for version in range(300, 450):
        (folder / f"fontlist-v{version}.json").write_text('{"__class__": "FontManager"}')
    settings = {"MPLCONFIGDIR": str(folder), "MATPLOTLIBRC": str(folder / "matplotlibrc")}
    assert page(tmp_path, **settings) == plain_page
