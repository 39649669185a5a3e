"""The pages of the documentation do what they say: commands, code and links."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from simulation_systems import fixed_wing
from study_specs import STUDY, write
from syncline_design.cli.app import app

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


def followed(body: str, folder: Path, first: bool) -> tuple[int, str, str]:
    """What a block of the shell ends with and prints: the first as a reader's own processes.

    Later ones are the same commands without a process each; nothing but `sed` is beside them.
    """
    code, out, err = 0, "", ""
    for line in [body] if first else body.splitlines():
        if first or not line.startswith("syncline-design "):
            done = run(["bash", "-ec", line], folder)
            ended = done.returncode, done.stdout, done.stderr
        else:
            one = CliRunner().invoke(app, shlex.split(line)[1:])
            ended = one.exit_code, one.stdout, one.stderr
        code, out, err = ended[0], out + ended[1], err + ended[2]
        if code:
            break
    return code, out, err


@needs_command
def test_the_tutorial_runs_from_top_to_bottom(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "120")  # as the page says
    page = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    printed: list[str] = []
    for block in BLOCK.finditer(page):
        note, language, body = block["note"] or "", block["language"], block["body"]
        if language == "yaml" and note.startswith("file: "):
            (tmp_path / note.removeprefix("file: ")).write_text(body, encoding="utf-8")
        elif language == "sh":
            code, out, err = followed(body, tmp_path, first=not printed)
            expected = int(note.removeprefix("exit code: ")) if note else 0
            assert code == expected, body + out + err
            printed.append(out.replace("\u00a0", " "))
        elif language == "text":
            for line in body.splitlines():
                assert line.rstrip() in printed[-1], line
    assert len(printed) >= 9
    for name in ("report.html", "verdict.json", "heights.html", "heights.csv"):
        assert (tmp_path / name).stat().st_size > 0
    assert "bench_ins" in (tmp_path / "mapping" / "my_sensors.yaml").read_text()


def test_the_python_of_the_guide_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Block after block; what worker processes import is a file of its own, run as one."""
    shutil.copytree(
        ROOT / "specs", tmp_path / "specs", ignore=shutil.ignore_patterns(".syncline-cases")
    )
    page = (DOCS / "api.md").read_text(encoding="utf-8")
    code = [block["body"] for block in BLOCK.finditer(page) if block["language"] == "python"]
    assert len(code) >= 6
    files = [body for body in code if "__main__" in body]
    assert len(files) == 1
    monkeypatch.chdir(tmp_path)
    shared: dict[str, object] = {"__name__": "guide"}
    for body in code:
        if body not in files:
            exec(compile(body, "guide.py", "exec"), shared)
    printed = capsys.readouterr().out
    assert printed.startswith("meets ")
    assert "Nothing in the files differs" in printed
    script = tmp_path / "guide.py"
    script.write_text(files[0], encoding="utf-8")
    done = run([sys.executable, str(script)], tmp_path)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) > 60


def python_of(page: str, part: int = 0) -> str:
    """A block of Python of a page."""
    blocks = BLOCK.finditer((DOCS / page).read_text("utf-8"))
    return [found["body"] for found in blocks if found["language"] == "python"][part]


def test_a_study_runs_from_python_as_its_page_says(tmp_path: Path) -> None:
    write(tmp_path, STUDY)
    (tmp_path / "read.py").write_text(python_of("trade-studies.md"), "utf-8")
    done = run([sys.executable, "read.py"], tmp_path)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 6
    assert re.search(r"meets \d+\.\d+$", done.stdout, re.M)


def test_a_simulation_runs_from_python_as_its_page_says() -> None:
    names: dict[str, Any] = {"system": fixed_wing()}
    shorter = python_of("simulation.md").replace("200_000", "2_000")
    exec(shorter, names)
    assert names["errors_m"].shape == (2_000, 3)
    assert [row.tau_s for row in names["rows"]] == [1e-4, 1e-3]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.name)
def test_links_inside_the_docs_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text):
        if "://" not in target:
            assert (page.parent / target).exists(), target
            assert (page.parent / target).resolve().parent.is_relative_to(ROOT / "docs"), (
                f"{target}: the site, which is built strictly, has pages of docs/ alone"
            )


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md"], ids=lambda path: path.name)
def test_links_to_a_heading_find_it(page: Path) -> None:
    """Slugs by the rule of Markdown's table of contents: small, without marks, `-` for spaces."""
    text = page.read_text(encoding="utf-8")
    for target, anchor in re.findall(r"\]\(([^)#\s:]*)#([^)]+)\)", text):
        other = (page.parent / target) if target else page
        heads = re.findall(r"^#+ (.+)$", other.read_text(encoding="utf-8"), re.M)
        slugs = [re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", head).strip().lower())
                 for head in heads]  # fmt: skip
        assert anchor in slugs, f"{target}#{anchor}"


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
    from syncline_design.studies import load_study

    loaded = load_study(study)
    assert 20 <= len(loaded) <= 200
    assert loaded.path == study


def _ratio_table(first: str) -> list[list[str]]:
    """The rows of the table in docs/simulation.md whose header starts like this."""
    text = (DOCS / "simulation.md").read_text(encoding="utf-8")
    body = text.partition(f"\n| {first} |")[2].partition("\n\n")[0]
    return [[c.strip() for c in line.strip("| ").split("|")] for line in body.splitlines()[2:]]


def _worst_ratios(platform: str) -> list[float]:
    from syncline_design.choice.chosen_system import system_of
    from syncline_design.simulation import comparison
    from syncline_design.spec.load import load_text
    from syncline_design.verdict.pinned import picked_design

    how = "primitive: pps, timestamping: hardware"
    text = (
        "syncline: 1\nname: x\nrequirements:\n  - {id: A, kind: accuracy, limit: 1 km}\n"
        "  - {id: S, kind: sync, limit: 1000000}\n"
        "horizon: {tilt: 0 deg}\n"
        f"stages:\n  - name: s\n    platform: {platform}\n"
        f"    position: {{sensor: ublox_f9p_rtk, {how}}}\n"
        f"    attitude: {{sensor: kongsberg_mru5, {how}}}\n"
        f"    ranging: {{sensor: riegl_vux1uav, {how}}}\n"
    )
    loaded = load_text(text, ROOT / "specs" / "x.yaml")
    system = system_of(loaded, *picked_design(loaded, seed=0))
    return [row.ratio for row in comparison(system, (1e-6, 1e-3, 1e-2, 1e-1), seed=0)]


def test_the_lever_arm_figures_are_what_the_simulator_gives() -> None:
    """Both tables of docs/simulation.md, anew; the search itself is good to a few thousandths."""
    platforms = _ratio_table("platform")
    assert len(platforms) == 7
    for name, _, *printed in platforms:
        assert _worst_ratios(name) == pytest.approx([float(p) for p in printed], abs=0.006), name
    lengths = _ratio_table("b / d")
    assert len(lengths) == 4
    for share, *printed in lengths:
        platform = f"{{use: uav_fixed_wing, distance: 100 m, baseline: {100 * float(share):g} m}}"
        assert _worst_ratios(platform) == pytest.approx([float(p) for p in printed], abs=0.006)


def test_how_often_errors_exceed_the_syncline_is_as_the_pages_say() -> None:
    """39 % from the chi-square distribution, 9 % from a simulation of the README's design."""
    import numpy as np
    from scipy.stats import chi2

    from syncline_design.choice.chosen_system import system_of
    from syncline_design.model.budget import budget
    from syncline_design.simulation import SimulationSettings, sample_errors
    from syncline_design.spec.load import load
    from syncline_design.verdict.pinned import picked_design

    assert f"{100 * chi2.sf(3.0, 3):.0f} %" == "39 %"
    loaded = load(ROOT / "specs" / "uav_corridor.yaml")
    system = system_of(loaded, *picked_design(loaded, seed=0))
    errors = np.linalg.norm(sample_errors(system, SimulationSettings(samples=100_000)), axis=1)
    share = float(np.mean(errors > budget(system).total_m))
    assert share == pytest.approx(0.09, abs=0.005)  # standard error 0.0009
    for page in ("simulation.md", "theory.md"):
        text = (DOCS / page).read_text(encoding="utf-8")
        assert "39 %" in text
        assert "9 %" in text
        assert "now and then" not in text


def test_the_drawing_of_signs_follows_the_simulator(tmp_path: Path) -> None:
    """The script's bearing is that of the chain, and the committed drawing is the script's."""
    import importlib.util

    import numpy as np

    from syncline_design.effects.kinematics import bearing

    source = importlib.util.spec_from_file_location("make_signs", DOCS / "make_signs.py")
    assert source is not None
    assert source.loader is not None
    drawing = importlib.util.module_from_spec(source)
    source.loader.exec_module(drawing)
    for azimuth, elevation in ((0.0, 0.0), (0.6, 0.5), (-2.0, -1.1), (np.pi / 2, 0.0)):
        ours = bearing(np.array([azimuth]), np.array([elevation]))[0]
        assert drawing.bearing(azimuth, elevation) == pytest.approx(tuple(ours), abs=1e-12)
    forward, right, down = drawing.bearing(0.3, 0.2)
    assert (forward > 0, right > 0, down < 0) == (True, True, True)
    drawing.IMAGE = tmp_path / "signs.svg"
    drawing.main()
    words = [
        re.findall(r">([^<]+)</text>", path.read_text("utf-8"))
        for path in (DOCS / "images" / "bearing_signs.svg", drawing.IMAGE)
    ]
    assert words[0] == words[1]
    assert {"azimuth &gt; 0:", "to the right", "elevation &gt; 0:", "above"} <= set(words[0])
