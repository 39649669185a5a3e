"""What a time limit leaves unsaid is said to be unsaid, in every command and format."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from syncline_design.choice import explain as explaining
from syncline_design.cli.app import app
from syncline_design.machine.deadline import in_force

SPECS = Path(__file__).parent.parent / "specs"
OPEN = str(SPECS / "uav_corridor.yaml")


def run(*words: str) -> tuple[int, str]:
    done = CliRunner().invoke(app, list(words))
    return done.exit_code, done.output


@pytest.mark.parametrize("extra", [[], ["--pareto", "--best", "3"], ["--method", "milp"]])
def test_optimize_without_a_design_in_time_still_answers(extra: list[str], tmp_path: Path) -> None:
    out = {name: tmp_path / f"out.{name}" for name in ("json", "html", "csv")}
    targets = [word for name, path in out.items() for word in ("-o", f"{name}:{path}")]
    code, text = run("optimize", OPEN, "--time-limit", "0", *extra, *targets)
    assert code == 3
    assert "time limit" in text
    data = json.loads(out["json"].read_text("utf-8"))
    assert (data["verdict"], data["designs"]) == ("indeterminate", [])
    assert (data["proof"]["optimal"], data["proof"]["rechecked"]) == (False, False)
    assert "time limit" in data["message"]
    assert "time limit" in out["html"].read_text("utf-8")
    assert len(out["csv"].read_text("utf-8").splitlines()) == 1


def test_check_without_a_design_in_time_has_no_proof(tmp_path: Path) -> None:
    out = tmp_path / "out.json"
    code, _ = run("check", OPEN, "--time-limit", "0", "-o", f"json:{out}")
    data = json.loads(out.read_text("utf-8"))
    assert (code, data["verdict"]) == (3, "indeterminate")
    assert data["choice"]["proof"]["optimal"] is False


@pytest.mark.parametrize("spec", ["infeasible_example", "infeasible_no_option"])
@pytest.mark.parametrize("command", ["check", "optimize"])
def test_remedies_cut_short_are_not_called_none(
    command: str, spec: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Both specs have fixes; a search that ended before them must not deny them."""
    path, out = str(SPECS / f"{spec}.yaml"), tmp_path / "out.json"
    code, whole = run(command, path, "-o", f"json:{out}")
    told = json.loads(out.read_text("utf-8"))["infeasibility"]
    assert code == 1
    assert told["fixes"]
    assert told["cut_short"] is False
    assert "time limit" not in whole
    real = explaining.parts_of

    def at_the_end(problem: Any) -> Any:
        in_force()._end = 0.0  # the time is over just when the reasons are looked for
        return real(problem)

    monkeypatch.setattr(explaining, "parts_of", at_the_end)
    code, text = run(command, path, "--time-limit", "60", "-o", f"json:{out}")
    data = json.loads(out.read_text("utf-8"))
    assert (code, data["verdict"]) == (1, "infeasible")
    assert data["infeasibility"]["cut_short"] is True
    assert "No single change" not in text
    assert "was not worked out" in text
    if command == "check":
        assert [w["code"] for w in data["warnings"]] == ["time-limit"]
        assert not any(r["note"].startswith("part of") for r in data["requirements"])
    else:
        assert data["cut_short"] == ["reasons and remedies"]


def large_spec(folder: Path, sensors: int = 150) -> Path:
    """One stage; per role many sensors, each with four primitives under six methods of all."""
    kinds = {
        "position": "sigma_position: 1 cm",
        "attitude": "sigma_attitude: 0.1 deg",
        "ranging": "sigma_range: 1 cm, sigma_bearing: 0.1 deg",
    }
    signals = "primitives: [pps, tov, trigger, network]"
    own = ["sensors:"]
    for role, sigma in kinds.items():
        own += [
            f"  {role}{i}: {{modality: {role}, {sigma}, {signals}, cost: {i} EUR, source: own}}"
            for i in range(sensors)
        ]
    own.append("timestamping:")
    own += [
        f"  m{i}: {{{signals}, timeline: host, error: {{distribution: constant, value: 1 us}}, "
        "cost: 1 EUR, source: own}"
        for i in range(6)
    ]
    spec = [
        "syncline: 1", "name: large", "catalogs: [own.yaml]", "requirements:",
        "  - {id: A, kind: accuracy, limit: 9 m}", "stages:", "  - name: v",
        "    platform: usv",
        *(
            f"    {role}: {{candidates: [{', '.join(f'{role}{i}' for i in range(sensors))}]}}"
            for role in kinds
        ),
        f"timestamping: {{candidates: [{', '.join(f'm{i}' for i in range(6))}]}}",
    ]  # fmt: skip
    (folder / "own.yaml").write_text("\n".join(own) + "\n", "utf-8")
    path = folder / "large.yaml"
    path.write_text("\n".join(spec) + "\n", "utf-8")
    return path


@pytest.mark.parametrize("command", ["check", "optimize"])
def test_making_the_tables_ends_with_the_time(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """3 x 150 sensors x 24 ways of stamping: only some sensors are looked at.

    Without the grace that small tables have: these take a thirtieth of a second.
    """
    from syncline_design.choice import candidates
    from syncline_design.machine import deadline

    made = 0
    real = candidates._error_terms

    def counted(*given: Any) -> Any:
        nonlocal made
        made += 1
        return real(*given)

    monkeypatch.setattr(candidates, "_error_terms", counted)
    monkeypatch.setattr(deadline, "GRACE_S", 0.0)
    path, out, page = large_spec(tmp_path), tmp_path / "out.json", tmp_path / "out.html"
    targets = ("-o", f"json:{out}", "-o", f"html:{page}")
    code, _ = run(command, str(path), "--time-limit", "0", *targets)
    data = json.loads(out.read_text("utf-8"))
    assert (code, data["verdict"]) == (3, "indeterminate")
    assert 0 < made < 450
    told = data if command == "optimize" else data["spec"]
    assert told["combinations"] is None
    assert "time limit" in page.read_text("utf-8")


def test_pinned_spec_is_judged_however_little_time(tmp_path: Path) -> None:
    """Its sums need no search; what is not a matter of simulation passes or fails."""
    out = tmp_path / "out.json"
    run("check", str(SPECS / "usv_wire_missing.yaml"), "--time-limit", "0", "-o", f"json:{out}")
    data = json.loads(out.read_text("utf-8"))
    kinds = {r["kind"]: r["status"] for r in data["requirements"]}
    assert kinds["accuracy"] in ("pass", "fail")


def test_the_implied_sync_limit_has_a_name_in_every_format(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A conflict with the sync limit that the spec does not write has no id to print."""
    real = explaining.parts_of

    def at_the_end(problem: Any) -> Any:
        in_force()._end = 0.0
        return real(problem)

    text = (SPECS / "infeasible_example.yaml").read_text("utf-8")
    lines = [line for line in text.splitlines() if "kind: sync" not in line]
    path = tmp_path / "implied.yaml"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    monkeypatch.setattr(explaining, "parts_of", at_the_end)
    names = ("github", "sarif", "junit", "markdown", "html")
    targets = [word for name in names for word in ("-o", f"{name}:{tmp_path / name}")]
    code, _ = run("check", str(path), "--time-limit", "60", *targets)
    assert code == 1
    for name in names:
        told = (tmp_path / name).read_text("utf-8")
        assert ("<bdi>None" if name == "html" else "None") not in told, name
    assert "the implied sync requirement" in (tmp_path / "github").read_text("utf-8")
