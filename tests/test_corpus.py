"""Bad input, each file with the outcome it has to have: refused with its place, or accepted.

The files lie in `corpus/`, their outcomes in `corpus/expected.yaml`; what is too large or no plain
file is made here.
"""

from __future__ import annotations

import os
import random
import re
import shutil
import signal
import string
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from syncline_design.spec.case import Case
from syncline_design.spec.edit import yaml_text
from syncline_design.spec.load import BadInput, load, load_text
from syncline_design.spec.yaml_text import Flaw, read

CORPUS = Path(__file__).parent / "corpus"
SPECS = Path(__file__).parent.parent / "specs"
EXPECTED: dict[str, dict[str, Any]] = read(CORPUS / "expected.yaml").data
BASE = (CORPUS / "yaml" / "base.yaml").read_text(encoding="utf-8")
MESSAGE = re.compile(r"^[^:]+(:[^:]+\.ya?ml)?:\d+:\d+: \S")


STARTED = """
import os, resource, subprocess, sys
code = subprocess.call(sys.argv[2:])
peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
open(sys.argv[1], "w").write(str(peak))
sys.exit(code)
"""


@pytest.fixture(scope="module")
def copied(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the corpus to work in, so that anything written would be seen."""
    return Path(shutil.copytree(CORPUS, tmp_path_factory.mktemp("bad") / "corpus"))


@pytest.fixture
def corpus(copied: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(copied)
    return copied


def refused(path: str | Path) -> tuple[str, tuple[Flaw, ...]]:
    """The message of a file that has to be refused, within a second."""
    start = time.perf_counter()
    with pytest.raises(BadInput) as caught:
        load(path)
    assert time.perf_counter() - start < 1.0
    text = str(caught.value)
    for line in text.split("\n"):
        assert MESSAGE.match(line) or re.fullmatch(r"\.\.\. and [0-9]+ more", line), line
        assert line.isprintable(), line
    return text, caught.value.problems


def files_under(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*")}


def value_at(loaded: Case, path: str) -> Any:
    value: Any = loaded.spec
    for part in path.split("."):
        value = value[int(part)] if part.isdigit() else getattr(value, part)
    return value


@pytest.mark.parametrize("name", EXPECTED)
def test_file_ends_as_said(name: str, corpus: Path) -> None:
    case, before = EXPECTED[name], files_under(corpus)
    file = f"{name}.yaml"
    if case["outcome"] == "accepted":
        loaded = load(file)
        if "same_hash" in case:
            assert loaded.spec_sha256 == load(f"{case['same_hash']}.yaml").spec_sha256
        if "value" in case:
            path, expected = case["value"]
            assert value_at(loaded, path) == expected
    else:
        text, problems = refused(file)
        for words in case.get("says", ()):
            assert words in text
        if "at" in case:
            place = case["at"] if "/" in case["at"] else f"{file}:{case['at']}"
            assert place in {f"{p.file}:{p.line}:{p.column}" for p in problems}
    assert files_under(corpus) == before


def test_every_corpus_file_has_an_expected_outcome() -> None:
    names = {str(p.relative_to(CORPUS).with_suffix("")) for p in CORPUS.rglob("*/*.yaml")}
    assert names == set(EXPECTED)


def spec_with_catalog(folder: Path, catalog: str) -> Path:
    (folder / "own.yaml").write_text(catalog, encoding="utf-8")
    spec = folder / "spec.yaml"
    spec.write_text("catalogs: [own.yaml]\n" + BASE, encoding="utf-8")
    return spec


def test_two_mebibytes_are_refused_before_reading(tmp_path: Path) -> None:
    spec = tmp_path / "spec.yaml"
    spec.write_text(BASE + "#" * 2 * 2**20, encoding="utf-8")
    assert "bytes; expected at most" in refused(spec)[0]
    spec = spec_with_catalog(tmp_path, "#" * 2 * 2**20)
    text, problems = refused(spec)
    assert "own.yaml" in text
    assert (problems[0].line, problems[0].column) == (1, 12)


def test_one_honest_mebibyte_is_accepted(tmp_path: Path) -> None:
    entry = (
        "  s{:05}: {{modality: attitude, sigma_attitude: 0.1 deg, primitives: [pps], note: {}}}\n"
    )
    line = entry.format(0, "x" * 160)
    catalog = "sensors:\n" + "".join(
        entry.format(index, "x" * 160) for index in range(2**20 // len(line) + 1)
    )
    assert len(catalog) >= 2**20
    loaded = load(spec_with_catalog(tmp_path, catalog))
    assert len(loaded.catalog.sensors) > 4000


def test_spec_of_one_mebibyte_is_accepted(tmp_path: Path) -> None:
    spec = tmp_path / "spec.yaml"
    spec.write_text(BASE + "# honest remark\n" * (2**16), encoding="utf-8")
    assert spec.stat().st_size >= 2**20
    assert load(spec).spec.name == "Corpus base"


@pytest.mark.parametrize("opening", ["[", "{", "[{", "- ", "? "])
def test_deep_nesting_is_refused_at_once(opening: str, tmp_path: Path) -> None:
    spec = tmp_path / "spec.yaml"
    spec.write_text(opening * (100_000 // len(opening)), encoding="utf-8")
    refused(spec)


def test_depth_64_reads_and_65_does_not(tmp_path: Path) -> None:
    for depth, wanted in ((64, True), (65, False)):
        file = tmp_path / f"{depth}.yaml"
        file.write_text("a: " + "[" * (depth - 1) + "]" * (depth - 1), encoding="utf-8")
        problems = read(file).problems
        assert (not problems) is wanted
        assert wanted or "deeper than 64" in problems[0].message


def test_special_files_are_refused_at_once(tmp_path: Path) -> None:
    fifo = tmp_path / "fifo.yaml"
    os.mkfifo(fifo)
    assert "not a regular file" in refused(fifo)[0]
    assert "not a regular file" in refused("/dev/zero")[0]
    assert "a folder" in refused(tmp_path)[0]
    assert "no such file" in refused(tmp_path / "absent.yaml")[0]


@pytest.mark.parametrize("target", ["fifo", "/dev/zero"])
def test_special_catalogs_are_refused_at_once(target: str, tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    if target == "fifo":
        os.mkfifo(home / "own.yaml")
    else:
        (home / "own.yaml").symlink_to(target)
    spec = home / "spec.yaml"
    spec.write_text("catalogs: [own.yaml]\n" + BASE, encoding="utf-8")
    _, problems = refused(spec)
    assert (problems[0].line, problems[0].column, problems[0].path) == (1, 12, "catalogs[0]")


def test_symlinks_may_stay_inside_the_folder_but_not_leave_it(tmp_path: Path) -> None:
    home = tmp_path / "home"
    (home / "sub").mkdir(parents=True)
    catalog = "sensors:\n  own: {modality: attitude, sigma_attitude: 1 deg, primitives: []}\n"
    (home / "sub" / "inner.yaml").write_text(catalog, encoding="utf-8")
    (tmp_path / "outer.yaml").write_text(catalog, encoding="utf-8")
    (home / "good.yaml").symlink_to("sub/inner.yaml")
    (home / "bad.yaml").symlink_to("../outer.yaml")
    (home / "loop.yaml").symlink_to("loop.yaml")
    spec = home / "spec.yaml"
    spec.write_text("catalogs: [good.yaml]\n" + BASE, encoding="utf-8")
    assert "own" in load(spec).catalog.sensors
    spec.write_text("catalogs: [bad.yaml]\n" + BASE, encoding="utf-8")
    assert "leaves the spec's folder" in refused(spec)[0]
    spec.write_text("catalogs: [loop.yaml]\n" + BASE, encoding="utf-8")
    refused(spec)


def test_unreadable_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = tmp_path / "spec.yaml"
    spec.write_text(BASE, encoding="utf-8")

    def denied(*_: object, **__: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("syncline_design.machine.input_files.os.open", denied)
    assert "permission denied" in refused(spec)[0]


COMMAND = (sys.executable, "-m", "syncline_design.cli", "check")
THROUGH_THE_COMMAND = (
    "yaml/billion_laughs.yaml", "yaml/nul.yaml", "yaml/latin1.yaml", "units/power_tower.yaml",
    "numbers/digits_5000.yaml", "model/typo_key.yaml", "paths/cycle.yaml", "deep", "fifo",
    "/dev/zero", "absent.yaml",
)  # fmt: skip


@pytest.mark.parametrize("name", THROUGH_THE_COMMAND)
def test_the_command_refuses_with_exit_2_and_writes_nothing(
    name: str, corpus: Path, tmp_path: Path
) -> None:
    """Exit 2, a place, no traceback, under 300 MB, even where reports were asked for.

    The second that a refusal may take is held in-process above; here a slow start is allowed for.
    """
    if name == "deep":
        (tmp_path / name).write_text("[" * 100_000, encoding="utf-8")
        name = str(tmp_path / name)
    elif name == "fifo":
        os.mkfifo(tmp_path / name)
        name = str(tmp_path / name)
    before = files_under(corpus)
    usage = tmp_path / "peak"
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        wanted = ("--output", "html:report.html", "--output", "json:report.json")
        # a process of its own in between: what starts it counts into the peak of what is started
        started = [sys.executable, "-I", "-S", "-c", STARTED, str(usage), *COMMAND, name, *wanted]
        process = subprocess.Popen(
            started, stdout=out, stderr=err, cwd=corpus, start_new_session=True
        )
        timer = threading.Timer(120.0, os.killpg, (process.pid, signal.SIGKILL))
        timer.start()
        process.wait()
        timer.cancel()
        out.seek(0)
        err.seek(0)
        stdout, stderr = out.read().decode(), err.read().decode()
    assert process.returncode == 2, stderr
    assert stdout.strip() == ""
    assert "Traceback" not in stderr
    assert re.search(r":\d+:\d+: ", stderr), stderr
    assert int(usage.read_text()) < 300_000  # kB
    assert files_under(corpus) == before


WEIRD = (
    "", "~", "NO", "0x1F", "1:20", "-", "[", "]", "{", "}", "&a", "*a", "!!str x", "<<", "|", ">",
    "9" * 400, "1e999", ".nan", "'", '"', "\t", "\u202e", "\x00", "\ud7ff", "%", "@", "`", "# x",
    "1,5 mm", "5 MM", "-1 m", "0 deg", "a: b: c", "{a: 1, a: 2}", "[[[[1]]]]", "true", "\u2028",
)  # fmt: skip


def mutated(text: str, rng: random.Random) -> str:
    """The text with one to three slips in it."""
    for _ in range(rng.randint(1, 3)):
        lines = text.split("\n")
        at = rng.randrange(len(lines))
        word = rng.choice(WEIRD)
        kind = rng.randrange(7)
        if kind == 0:
            del lines[at]
        elif kind == 1:
            lines.insert(at, lines[rng.randrange(len(lines))])
        elif kind == 2:
            cut = rng.randint(0, len(lines[at]))
            lines[at] = lines[at][:cut] + word + lines[at][cut:]
        elif kind == 3:
            lines[at] = re.sub(r":.*", lambda _, w=word: f": {w}", lines[at], count=1)
        elif kind == 4:
            lines[at] = " " * rng.randint(0, 6) + lines[at].strip()
        elif kind == 5:
            cut = rng.randint(0, len(lines[at]))
            lines[at] = lines[at][:cut] + rng.choice(string.printable) + lines[at][cut + 1 :]
        else:
            lines = lines[: at + 1]
        text = "\n".join(lines) or "x"
    return text


@pytest.mark.parametrize("seed", range(4))
def test_fuzzed_specs_load_or_are_refused(seed: int) -> None:
    """800 mutations of shipped specs end as success or BadInput, never otherwise."""
    rng = random.Random(f"fuzz-{seed}")
    sources = [p.read_text(encoding="utf-8") for p in sorted(SPECS.glob("*.yaml"))]
    sources = [re.sub(r"(?m)^#.*\n", "", source) for source in sources]
    outcomes = {"loaded": 0, "refused": 0}
    problems: list[Flaw] = []
    for _ in range(200):
        text = mutated(rng.choice(sources), rng)
        try:
            load_text(text, SPECS / "fuzzed.yaml")
            outcomes["loaded"] += 1
        except BadInput as error:
            outcomes["refused"] += 1
            problems += error.problems
    assert all(p.line >= 1 and p.column >= 1 and p.message for p in problems)
    assert min(outcomes.values()) > 0


VALUES: tuple[Any, ...] = (
    None, True, 0, -1, 3, 1e-3, 10**17, "", "x", "uav", "gpio", "sbg_ellipse", "ublox_f9p_rtk",
    "uav_fixed_wing", "5 m", "-5 m", "0 m", "5 s", "2 deg", "7 kg", "9 W", "20 USD", "30 NOK",
    "40 EUR", "1 deg +/- 5 %", "a\x01b", "x" * 5000, "../x.yaml", (), ((),), ("x",), ("5 m",) * 3,
    ("gpio", "gpio"), {}, {"use": "x"}, {"candidates": ()}, {"candidates": ("gpio", "arrival")},
    {"candidates": {"max_cost": "20 USD"}}, {"candidates": {"max_cost": "20 EUR"}},
    {"candidates": {"type": "lidar"}}, {"sensor": {"modality": "ranging", "primitives": ()}},
    {"error": {"distribution": "constant", "value": "1 ms"}},
    {"error": {"distribution": "empirical", "file": "x"}}, {"distribution": "empirical"},
    {"modality": "attitude", "sigma_attitude": "1 deg", "primitives": (), "cost": "3 NOK"},
    {"lever_arm": ("1 m", "0 m", "0 m")}, {"manoeuvre": "x"}, {"file": "x"}, {"USD": "0.9 EUR"},
)  # fmt: skip
KEYS = (
    "catalogs", "exchange_rates", "currency", "clock", "vehicle", "timestamping", "candidates",
    "sensor", "quantile", "waiver", "effects", "log", "monte_carlo", "objective", "lever_arm",
    "primitive", "trajectory", "ranging", "position", "attitude", "unheard_of",
)  # fmt: skip


def changed(data: Any, rng: random.Random) -> Any:
    """Plain data with one node, somewhere, put in place of another."""
    if isinstance(data, dict) and data and rng.random() < 0.85:
        key = rng.choice(KEYS) if rng.random() < 0.2 else rng.choice(list(data))
        if rng.random() < 0.05:
            return {k: v for k, v in data.items() if k != key}
        return {**data, key: changed(data.get(key, rng.choice(VALUES)), rng)}
    if isinstance(data, tuple) and data and rng.random() < 0.85:
        at = rng.randrange(len(data))
        return (*data[:at], changed(data[at], rng), *data[at + rng.choice((0, 1, 1)) :])
    return rng.choice(VALUES)


@pytest.mark.parametrize("seed", range(4))
def test_specs_with_nodes_changed_load_or_are_refused(seed: int) -> None:
    """1200 changes of the tree itself: valid YAML throughout, so that they reach every check."""
    rng = random.Random(f"nodes-{seed}")
    sources = [read(p).data for p in sorted(SPECS.glob("*.yaml"))]
    outcomes = {"loaded": 0, "refused": 0}
    for _ in range(300):
        data = rng.choice(sources)
        for _ in range(rng.randint(1, 3)):
            data = changed(data, rng)
        try:
            load_text(yaml_text(data if isinstance(data, dict) else {"x": data}), SPECS / "f.yaml")
            outcomes["loaded"] += 1
        except BadInput:
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 0
