"""The command line as a user meets it: exit codes, streams, what is written and what is not."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import command as commands

ROOT = Path(__file__).parent.parent
SPECS = ROOT / "specs"
HEAVY = {"cvxpy", "highspy", "scipy", "matplotlib", "polars", "pymap3d", "jinja2", "rich"}


def run(*arguments: str, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    """A run of the command in a process of its own."""
    return commands.run(*arguments, cwd=cwd, environment={"NO_COLOR": "1"})


def really(*arguments: str) -> subprocess.CompletedProcess[str]:
    """An interpreter started from nothing."""
    return subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=False,
        env={**os.environ, "NO_COLOR": "1", "PYTHONPATH": str(ROOT)}, timeout=120,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("spec", "code", "words"),
    [
        ("uav_corridor.yaml", 0, "Meets every requirement"),
        ("subsea_survey_small_sv.yaml", 0, "Meets every requirement"),
        ("usv_wire_missing.yaml", 1, "Does not meet its requirements"),
        ("infeasible_example.yaml", 1, "Infeasible: no design meets"),
    ],
)
def test_check_ends_with_the_code_of_its_verdict(spec: str, code: int, words: str) -> None:
    done = run("check", str(SPECS / spec))
    assert done.returncode == code
    assert words in done.stdout
    assert done.stderr == ""


def test_a_typo_is_refused_at_its_place_and_nothing_is_written(tmp_path: Path) -> None:
    text = (SPECS / "uav_corridor.yaml").read_text("utf-8")
    spec = tmp_path / "typo.yaml"
    spec.write_text(text.replace("platform:", "platfrom:"), "utf-8")
    done = run("check", str(spec), "--output", f"json:{tmp_path / 'out.json'}")
    assert done.returncode == 2
    assert done.stdout == ""
    line = text.splitlines().index("    platform: uav_fixed_wing") + 1
    assert f"{spec}:{line}:5: stages[0].platfrom: unknown key" in done.stderr
    assert "did you mean platform?" in done.stderr
    assert "Traceback" not in done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["typo.yaml"]


def test_every_format_keeps_the_exit_code_and_only_one_thing_goes_to_stdout(tmp_path: Path) -> None:
    spec = str(SPECS / "usv_wire_missing.yaml")
    targets = [f"{name}:{tmp_path / name}" for name in ("junit", "sarif", "markdown", "csv")]
    options = [part for target in ("json:-", *targets) for part in ("--output", target)]
    done = run("check", spec, *options)
    assert done.returncode == 1
    assert json.loads(done.stdout)["verdict"] == "fails"
    assert {p.name for p in tmp_path.iterdir()} == {"junit", "sarif", "markdown", "csv"}


def test_several_specs_end_with_the_worst_of_their_codes(tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_text("syncline: 2\n", "utf-8")
    done = run("check", str(SPECS / "usv_mapping.yaml"), str(bad), "--output", "github:-")
    assert done.returncode == 2
    assert "::error file=" in done.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        ("check",),
        ("check", "missing.yaml"),
        ("check", "specs/usv_mapping.yaml", "--output", "pdf:x"),
        ("check", "specs/usv_mapping.yaml", "--output", "json:"),
        ("check", "specs/usv_mapping.yaml", "-o", "json:-", "-o", "csv:-"),
        ("check", "specs/usv_mapping.yaml", "--method", "guess"),
        ("check", "specs/usv_mapping.yaml", "--seed", "-1"),
        ("simulate", "specs/usv_mapping.yaml", "--samples", "0"),
        ("catalog", "show", "ublox_f9p_rtkk"),
        ("catalog", "list", "sensor"),
        ("schema", "specs"),
        ("chekc", "specs/usv_mapping.yaml"),
    ],
)
def test_wrong_usage_is_two_with_a_message_and_no_traceback(arguments: tuple[str, ...]) -> None:
    done = run(*arguments)
    assert done.returncode == 2
    assert done.stderr.strip()
    assert "Traceback" not in done.stderr


def test_init_writes_a_starter_that_check_accepts_and_never_overwrites(tmp_path: Path) -> None:
    assert run("init", str(tmp_path / "new")).returncode == 0
    (spec,) = (tmp_path / "new").glob("*.yaml")
    assert run("check", str(spec)).returncode == 0
    before = spec.read_bytes()
    again = run("init", str(tmp_path / "new"))
    assert again.returncode == 2
    assert spec.read_bytes() == before


def test_schema_and_catalogs_print_to_stdout() -> None:
    assert json.loads(run("schema", "spec").stdout)["$schema"]
    assert json.loads(run("schema", "catalog").stdout)["$schema"]
    assert "ublox_f9p_rtk" in run("catalog", "list", "sensors").stdout
    assert "assumption" in run("catalog", "show", "ublox_f9p_rtk").stdout


def test_reproduce_accounts_for_every_cell() -> None:
    done = run("reproduce", "--output", "json:-")
    assert done.returncode == 0
    cells = json.loads(done.stdout)["cells"]
    assert len([c for c in cells if c["table"].startswith("tau_crit")]) >= 46
    assert {c["status"] for c in cells} == {"agrees", "erratum"}
    assert all(c["note"] for c in cells if c["status"] == "erratum")


def test_version_and_quiet() -> None:
    """In processes started from nothing, as the shell starts them."""
    for module in ("syncline_design", "syncline_design.cli"):
        done = really("-m", module, "--version")
        assert (done.returncode, done.stdout.split()[0]) == (0, "syncline-design"), done.stderr
    quiet = really("-m", "syncline_design", "check", str(SPECS / "usv_mapping.yaml"), "--quiet")
    assert (quiet.returncode, quiet.stdout, quiet.stderr) == (0, "", "")
    missed = really("-m", "syncline_design", "check", str(SPECS / "usv_wire_missing.yaml"))
    assert (missed.returncode, missed.stderr) == (1, "")
    assert missed.stdout == run("check", str(SPECS / "usv_wire_missing.yaml")).stdout


def test_a_pinned_check_imports_nothing_heavy() -> None:
    code = (
        "import sys; from pathlib import Path; from syncline_design.spec.load import load; "
        "from syncline_design.verdict.verify import *; "
        "from syncline_design.report.on_verdict import on_verdict; "
        "from syncline_design.report.render_console import console; "
        "console(on_verdict(check_loaded(load(Path('specs/usv_mapping.yaml')), CheckSettings()))); "
        f"print(sorted({HEAVY} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "[]"


def test_a_check_of_an_open_spec_with_its_page_loads_no_solver(tmp_path: Path) -> None:
    """The proof by a second road is loaded by whom it concerns: `--method milp`."""
    code = (
        "import sys; from typer.testing import CliRunner; from syncline_design.cli.app import app; "
        "words = ['check', 'specs/uav_corridor.yaml', '-q', '-o', 'html:' + sys.argv[1]]; "
        "done = CliRunner().invoke(app, words); "
        "print(done.exit_code, sorted({'cvxpy', 'highspy', 'osqp', 'scs'} & set(sys.modules)))"
    )
    done = really("-c", code, str(tmp_path / "page.html"))
    assert done.stdout.strip() == "0 []", done.stderr
    assert (tmp_path / "page.html").stat().st_size > 10_000


def test_other_designs_are_looked_for_where_they_are_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The text is the same to the letter, with what comes next or without."""
    from typer.testing import CliRunner

    from syncline_design.cli.app import app
    from syncline_design.verdict import alternatives

    def checked(*outputs: str) -> str:
        words = ["check", str(SPECS / "uav_corridor.yaml"), *outputs]
        done = CliRunner().invoke(app, words, catch_exceptions=False)
        assert done.exit_code == 0
        return done.stdout

    data = tmp_path / "verdict.json"
    told = checked("-o", f"json:{data}")
    choice = json.loads(data.read_text(encoding="utf-8"))["choice"]
    assert choice["next_best_every"]
    assert choice["alternatives"]

    def looked(*_: object) -> None:
        raise AssertionError("looked for what nothing shows")

    monkeypatch.setattr(alternatives, "alternatives", looked)
    assert checked("-o", f"junit:{tmp_path / 'junit.xml'}") == told


def test_an_interval_without_an_end_is_written_out(tmp_path: Path) -> None:
    """Few samples leave the upper end of a high quantile open: null in JSON, a word in text."""
    text = (ROOT / "specs" / "position_track.yaml").read_text(encoding="utf-8")
    head = text.split("\nmonte_carlo:")[0]
    spec = tmp_path / "few.yaml"
    spec.write_text(head + "\nmonte_carlo: {samples: 40}\n", encoding="utf-8")
    result = run("check", str(spec), "--output", f"json:{tmp_path / 'few.json'}")
    assert result.returncode in (0, 1), result.stderr
    data = json.loads((tmp_path / "few.json").read_text(encoding="utf-8"))
    assert data["monte_carlo"]["quantiles"]["0.997"]["high_m"] is None
    assert " or more" in result.stdout


def test_no_output_takes_the_place_of_a_file_that_is_read(tmp_path: Path) -> None:
    spec, other = tmp_path / "mine.yaml", tmp_path / "catalog.yaml"
    text = (SPECS / "position_track.yaml").read_text("utf-8")
    spec.write_text(text, "utf-8")
    other.write_text("sensors: {}\n", "utf-8")
    (tmp_path / "link.json").symlink_to(spec)
    for arguments, words in (
        (("check", str(spec), "--output", f"json:{spec}"), "is read by this command"),
        (("check", str(spec), "--output", f"json:{tmp_path / 'link.json'}"), "is read by"),
        (("simulate", str(spec), "--output", f"json:{other}"), "a YAML file is there"),
        (("optimize", str(spec), "--write-design", str(spec)), "is read by this command"),
    ):
        done = run(*arguments)
        assert done.returncode == 2, arguments
        assert words in done.stderr
        assert done.stdout == ""
    assert spec.read_text("utf-8") == text
    assert other.read_text("utf-8") == "sensors: {}\n"


@pytest.mark.parametrize("command", ["check", "optimize", "simulate"])
def test_names_cannot_start_a_line_nor_colour_it(command: str, tmp_path: Path) -> None:
    evil = '"a\\n::error::pwn \\e[31m"'
    text = (SPECS / "position_track.yaml").read_text("utf-8")
    text = text.replace("name: USV track against a total station", f"name: {evil}")
    text = text.replace("- name: usv", f"- name: {evil}").replace("ACC-1,", f"{evil},")
    assert text.count(evil) == 3
    spec = tmp_path / "evil.yaml"
    spec.write_text(text + "monte_carlo: {samples: 200}\n", "utf-8")
    done = run(command, str(spec))
    assert done.returncode == 0, done.stderr
    assert "pwn" in done.stdout
    assert "\x1b" not in done.stdout
    assert not any(line.lstrip().startswith("::") for line in done.stdout.splitlines())


def test_a_design_is_not_written_where_its_catalogs_are_missing(tmp_path: Path) -> None:
    text = (SPECS / "position_track.yaml").read_text("utf-8")
    (tmp_path / "own.yaml").write_text("sensors: {}\n", "utf-8")
    (tmp_path / "elsewhere").mkdir()
    spec = tmp_path / "spec.yaml"
    spec.write_text(text + "catalogs: [own.yaml]\n", "utf-8")
    done = run("optimize", str(spec), "--write-design", str(tmp_path / "elsewhere" / "p.yaml"))
    assert done.returncode == 2
    assert "write the design beside the spec" in done.stderr
    assert list((tmp_path / "elsewhere").iterdir()) == []
    assert run("optimize", str(spec), "--write-design", str(tmp_path / "p.yaml")).returncode == 0
    assert run("check", str(tmp_path / "p.yaml")).returncode == 0
