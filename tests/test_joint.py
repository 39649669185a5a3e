"""Many logs of one system: their statistics, what they say together, and the store that keeps them.

Oracles: stacked least squares by numpy, dense covariances written out here, the hidden world.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

from syncline_design.campaign.joint import JointRequest, diagnose_joint
from syncline_design.campaign.kept import Run
from syncline_design.campaign.naming import Naming
from syncline_design.campaign.pool import Pool, Scoped, fitted, pool_of
from syncline_design.campaign.store import read_store
from syncline_design.campaign.telling import on_average
from syncline_design.campaign.twice import is_same
from syncline_design.cli.app import app
from syncline_design.diagnosis import DiagnosisSettings
from syncline_design.diagnosis.noise import row_covariance
from syncline_design.diagnosis.result import Estimate
from syncline_design.diagnosis.searched import examined
from syncline_design.diagnosis.sufficient import Less, Sufficient, shown_level, sufficient
from syncline_design.diagnosis.system import measured
from syncline_design.effects import registry
from syncline_design.machine.appended_files import append_line
from syncline_design.machine.linear_algebra import one_thread
from syncline_design.report.result_schemas import result_schema
from syncline_design.spec.load import load
from tests.world import Noise, hidden, make_log, scenario
from tests.world.bound import cramer_rao

LABELS = (
    ("latency", "position", 0, "latency_s"),
    ("lever_arm", "position", 0, "x_m"),
    ("lever_arm", "position", 0, "y_m"),
    ("lever_arm", "position", 0, "z_m"),
    ("range_bias", "ranging", 0, "bias_m"),
)
UNITS = np.array([1e-3, 1e-2, 1e-2, 1e-2, 1e-2])
BLOCKS = 8


def made(rng: np.random.Generator, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows of a linear log with unit noise: columns (64, 5) and errors."""
    columns = rng.standard_normal((64, 5)) / UNITS
    return columns, columns @ values + rng.standard_normal(64)


def statistics(columns: np.ndarray, error: np.ndarray) -> Sufficient:
    whole = np.concatenate([columns, error[:, None]], axis=1)
    total = whole.T @ whole
    parts = [total - p.T @ p for p in np.split(whole, BLOCKS)]
    less = np.array(parts)
    return Sufficient(
        LABELS, total[:-1, :-1], total[:-1, -1], float(total[-1, -1]),
        columns.T @ columns / len(columns),
        (Less(less[:, :-1, :-1], less[:, :-1, -1], less[:, -1, -1]),),
    )  # fmt: skip


def linear_logs(
    count: int, seed: int, build: np.ndarray, own: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray], Pool]:
    rng = np.random.default_rng(seed)
    logs = [made(rng, build + own * rng.standard_normal()) for _ in range(count)]
    starts = [k // 2 for k in range(count)]
    pool = pool_of([statistics(*log) for log in logs], starts)
    return [x for x, _ in logs], [e for _, e in logs], pool


@pytest.mark.parametrize("scope", ["build", "start", "log"])
def test_values_of_every_scope_are_those_of_stacked_least_squares(scope: str) -> None:
    columns, errors, pool = linear_logs(6, 1, 0.2 * UNITS, 0.0 * UNITS)
    arm = next(t for t in pool.terms if t.label[0] == "lever_arm")
    latency = next(t for t in pool.terms if t.label[0] == "latency")
    fit = fitted(pool, (Scoped(latency, "build"), Scoped(arm, scope)))  # type: ignore[arg-type]
    group = {"build": [0] * 6, "start": [0, 0, 1, 1, 2, 2], "log": list(range(6))}[scope]
    width = max(group) + 1
    design = []
    for x, g in zip(columns, group, strict=True):
        block = np.zeros((64, 1 + 3 * width))
        block[:, 0] = x[:, 0]
        block[:, 1 + 3 * g : 4 + 3 * g] = x[:, 1:4]
        design.append(block)
    stacked, error = np.concatenate(design), np.concatenate(errors)
    expected, left, *_ = np.linalg.lstsq(stacked / stacked.std(), error, rcond=None)
    values = np.concatenate([fit.of(0).ravel(), fit.of(1).ravel()])
    np.testing.assert_allclose(values, expected / stacked.std(), rtol=1e-8)
    assert fit.gain == pytest.approx(0.5 * (float(error @ error) - float(left[0])), rel=1e-9)
    # the jackknife: every part of every log left out, solved anew
    row, parts = np.arange(384), []
    for log in range(6):
        own = []
        for part in range(BLOCKS):
            keep = row // 8 != log * BLOCKS + part
            own.append(np.linalg.lstsq(stacked[keep], error[keep], rcond=None)[0])
        parts.append((np.array(own) - np.mean(own, axis=0)) * np.sqrt((BLOCKS - 1) / BLOCKS))
    spread = np.concatenate(parts).T @ np.concatenate(parts)
    judged = fit.judged(np.arange(len(values)))
    (found, count), *_ = judged.jackknives
    free = 6 * (BLOCKS - 1)  # moderated by the fitted covariance, which counts for 30
    moderated = (free * spread + 30 * np.linalg.inv(stacked.T @ stacked)) / (free + 30)
    np.testing.assert_allclose(np.diag(found), np.diag(moderated), rtol=1e-6)
    assert count == free + 30 + 1
    np.testing.assert_allclose(judged.model, np.linalg.inv(stacked.T @ stacked), rtol=1e-6)


def test_parameters_are_called_by_their_own_names() -> None:
    """Whatever the order of their names: north, east and down of the datum are not sorted."""
    every = [
        (e.name, e.sensors[0], 0, p.name) for e in registry().values() for p in e.slopes()
    ]  # fmt: skip
    size = len(every)
    one = Sufficient(tuple(every), np.eye(size), np.zeros(size), 0.0, np.eye(size), ())
    pool = pool_of([one], [1])
    assert len(pool.terms) > 30
    for term in pool.terms:
        names = [pool.labels[k][3] for k in term.index]
        assert names == [p.name for p in term.effect.slopes()]


def test_what_differs_is_told_by_its_mean_as_uncertain_as_it_scatters() -> None:
    """87 and 0.12 ms: 43.56, s / sqrt(2) = 43.44, Student's 12.706 of that at one degree."""
    one = Sufficient((("latency", "position", 0, "latency_s"),), np.eye(1), np.zeros(1), 0.0,
                     np.eye(1), ())  # fmt: skip
    (latency,) = pool_of([one], [1]).terms
    once = {"latency_s": Estimate(0.0547, 0.0027, "s", True, "")}
    found = on_average(latency, np.array([[0.087], [0.00012]]), once)["latency_s"]
    assert float(found.value) == pytest.approx(0.04356)
    assert found.standard_uncertainty == pytest.approx(0.04344)
    assert found.interval95 == pytest.approx((0.04356 - 0.55195, 0.04356 + 0.55195), abs=1e-5)
    assert on_average(latency, np.array([[0.087]]), once) == once


def test_the_order_of_logs_changes_nothing() -> None:
    _, _, pool = linear_logs(5, 2, 0.3 * UNITS, 0.0 * UNITS)
    turned = pool.part(np.array([3, 1, 4, 0, 2]))
    for term in pool.terms:
        one, other = (fitted(p, (Scoped(term, "build"),)) for p in (pool, turned))
        np.testing.assert_allclose(one.values, other.values, rtol=1e-9)
        assert one.gain == pytest.approx(other.gain, rel=1e-9)


def test_one_value_is_told_from_a_value_in_every_log() -> None:
    """Bias common to eight logs: of the build.  The same size, another in each: of the log."""
    common = np.array([0, 0, 0, 0, 1.0]) * UNITS
    scopes = []
    for build, own in ((common, 0 * common), (0 * common, 3 * common)):
        _, _, pool = linear_logs(8, 5, build, own)
        found = Naming(pool, 0.05, 4).named()
        scopes.append([(t.scoped.term.label[0], t.scoped.scope) for t in found.terms])
    assert scopes == [[("range_bias", "build")], [("range_bias", "log")]]


def test_a_value_of_every_start_is_told_from_one_in_every_log() -> None:
    """Two logs a start share the start's value."""
    rng, bias, logs = np.random.default_rng(8), np.array([0, 0, 0, 0, 1.0]) * UNITS, []
    for start in range(6):
        size = (-1) ** start * 2.0
        logs += [made(rng, size * bias) for _ in range(2)]
    pool = pool_of([statistics(*log) for log in logs], [k // 2 for k in range(12)])
    (found,) = Naming(pool, 0.05, 4).named().terms
    assert (found.scoped.term.label[0], found.scoped.scope) == ("range_bias", "start")
    assert found.tested.starts is not None
    assert found.tested.starts < 1e-6
    assert found.tested.logs is not None
    assert found.tested.logs > 0.01


def test_noise_names_nothing_more_often_than_stated() -> None:
    """200 sets of three clean logs at 5 %: more than 20 come in 0.3 % of choices of seeds."""
    named = 0
    for seed in range(200):
        _, _, pool = linear_logs(3, 1000 + seed, 0 * UNITS, 0 * UNITS)
        named += bool(Naming(pool, 0.05, 2).named().terms)
    assert named <= 20


@pytest.fixture(scope="module")
def weak(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A spec, and three logs of a system whose latency is too small for any of them."""
    folder = tmp_path_factory.mktemp("weak")
    zero = hidden("latency", "position", latency_s=0.0)
    size = 0.0
    for k in range(3):
        run = scenario("multirotor_lines", 70 + k, 60.0, 5.0)
        size = size or 2.6 * next(iter(cramer_rao(run, (zero,), Noise()).values()))
        log = make_log(run, (zero.with_values({"latency_s": size}),))
        log.to_csv(folder / f"log{k}.csv")
        (folder / "spec.yaml").write_text(log.spec_yaml(), encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps(size))
    return folder


@pytest.fixture(scope="module")
def stored(weak: Path) -> Path:
    """The same, two logs in a store; the third is added by whom it concerns."""
    paths = tuple(Path(log) for log in logs(weak)[:2])
    diagnose_joint(load(weak / "spec.yaml"), JointRequest(paths, store=weak / "store.jsonl"))
    return weak / "store.jsonl"


def logs(folder: Path) -> list[str]:
    return [str(folder / f"log{k}.csv") for k in range(3)]


def together(folder: Path, order: tuple[int, ...], *more: str) -> dict:
    out = folder / "out.json"
    chosen = [logs(folder)[k] for k in order]
    run = CliRunner().invoke(app, ["diagnose", str(folder / "spec.yaml"), *chosen, "--joint",
                                   "--output", f"json:{out}", *more])  # fmt: skip
    assert run.exit_code in (0, 1), run.output
    return dict(json.loads(out.read_text("utf-8")))


def _each_log_agrees(found: dict) -> None:
    """What each log tells alone, weighted by its variance, is what all of them tell together."""
    own = [one["parameters"]["latency_s"] for one in found["each_log"]]
    assert sorted(one["log"] for one in found["each_log"]) == [1, 2, 3]
    weights = np.array([one["standard_uncertainty"] ** -2 for one in own])
    mean = float(weights @ [one["value"] for one in own] / weights.sum())
    common = found["parameters"]["latency_s"]
    assert abs(mean - common["value"]) < 0.3 * common["standard_uncertainty"]
    assert min(one["standard_uncertainty"] for one in own) > common["standard_uncertainty"]


def test_weak_logs_name_together_what_none_names_alone(weak: Path, stored: Path) -> None:
    """And adding the third later is the same as all at once, in any order."""
    once = together(weak, (2, 0, 1))
    request = JointRequest((Path(logs(weak)[2]),), store=stored)
    later = diagnose_joint(load(weak / "spec.yaml"), request).to_json()
    truth = json.loads((weak / "truth.json").read_text())
    Draft202012Validator(result_schema("diagnosis")).validate(once)
    assert [one["verdict"] for one in once["joint"]["logs"]] == ["agrees"] * 3
    assert once["verdict"] == "explained"
    for document in (once, later):
        (found,) = document["findings"]
        assert (found["effect"], found["sensor"], found["scope"]) == (
            "latency",
            "position",
            "build",
        )
        assert "per_log" not in found
        _each_log_agrees(found)
        low, high = found["parameters"]["latency_s"]["interval95"]
        assert low < truth < high
    one, other = (d["findings"][0] for d in (once, later))
    for key in ("value", "standard_uncertainty"):
        assert one["parameters"]["latency_s"][key] == pytest.approx(
            other["parameters"]["latency_s"][key], rel=1e-9
        )
    assert one["gain_nat"] == pytest.approx(other["gain_nat"], rel=1e-9)
    assert [run["new"] for run in later["joint"]["logs"]] == [False, False, True]


def refused(stored: Path, *arguments: str) -> str:
    run = CliRunner().invoke(app, ["diagnose", *arguments, "--joint", "--store", str(stored)])
    assert run.exit_code == 2, run.output
    return run.output + run.stderr


def test_a_store_refuses_what_it_must(weak: Path, stored: Path, tmp_path: Path) -> None:
    spec, third = str(weak / "spec.yaml"), logs(weak)[2]
    assert "this run is in the store already, as number 1" in refused(stored, spec, logs(weak)[0])
    other = tmp_path / "other.yaml"
    text = (weak / "spec.yaml").read_text("utf-8")
    other.write_text(text.replace("v_max: ", "v_max: 1"), encoding="utf-8")
    said = refused(stored, str(other), third)
    assert f"{stored}:1:1: a store of another system" in said
    assert "v_max" in said
    renamed = tmp_path / "renamed.yaml"
    renamed.write_text(text.replace("name: multirotor lines", "name: another")
                       .replace("limit: 1 m", "limit: 2 m"), encoding="utf-8")  # fmt: skip
    assert renamed.read_text("utf-8") != text
    again = diagnose_joint(load(renamed), JointRequest((), store=stored))  # is not refused
    assert not any(run["new"] for run in again.to_json()["joint"]["logs"])


@pytest.mark.parametrize("copy", ["rounded", "a row less"])
def test_a_run_that_was_written_otherwise_is_the_same_run(
    copy: str, weak: Path, stored: Path, tmp_path: Path
) -> None:
    """The same rows with fewer digits, or less one of them, would count twice."""
    head, *rows = Path(logs(weak)[0]).read_text("utf-8").splitlines()
    if copy == "rounded":
        rows = [",".join(f"{float(cell):.5f}" for cell in row.split(",")) for row in rows]
    else:
        rows = rows[1:]
    log = tmp_path / "copy.csv"
    log.write_text("\n".join([head, *rows, ""]), encoding="utf-8")
    before = stored.read_bytes()
    said = refused(stored, str(weak / "spec.yaml"), str(log))
    assert "holds the same rows as run 1" in " ".join(said.split())
    assert stored.read_bytes() == before


def test_two_runs_are_the_same_as_often_as_their_noise_is() -> None:
    """Scores s = N theta + N^(1/2) z: of one path with other noise never, with the same always."""
    rng = np.random.default_rng(4)
    root = rng.standard_normal((40, 12))
    labels = tuple(("latency", "position", 0, f"p{k}_s") for k in range(12))

    def run(noise: np.ndarray, weight: float = 1.0) -> Sufficient:
        normal = weight * root.T @ root
        score = normal @ np.arange(12.0) + weight * root.T @ noise
        return Sufficient(labels, normal, score, 0.0, normal, ())

    first = rng.standard_normal(40)
    assert is_same(run(first), run(first, 0.998))  # two of a thousand rows are missing
    assert not any(is_same(run(first), run(rng.standard_normal(40))) for _ in range(500))


@pytest.mark.parametrize("change", ["edit", "drop", "swap", "forge", "garbage"])
def test_a_store_that_was_tampered_with_is_damaged(
    change: str, weak: Path, stored: Path, tmp_path: Path
) -> None:
    lines = stored.read_bytes().splitlines(keepends=True)
    where = 2
    if change == "edit":
        lines[1] = lines[1].replace(b'"used":300', b'"used":301')
    elif change == "drop":
        del lines[1]
    elif change == "swap":
        lines[1], lines[2] = lines[2], lines[1]
    elif change == "forge":  # a line with a right hash of its own that follows from nothing
        lines.insert(1, lines[2])
    else:
        lines[1] = b"{}\n"
    forged = tmp_path / "forged.jsonl"
    forged.write_bytes(b"".join(lines))
    assert f"{forged}:{where}:1: damaged" in refused(forged, str(weak / "spec.yaml"))
    assert forged.read_bytes() == b"".join(lines)


def test_a_torn_last_line_is_dropped_and_said(weak: Path, stored: Path, tmp_path: Path) -> None:
    lines = stored.read_bytes().splitlines(keepends=True)
    torn = tmp_path / "torn.jsonl"
    torn.write_bytes(b"".join(lines[:2]) + lines[2][:1000])
    arguments = [
        "diagnose",
        str(weak / "spec.yaml"),
        logs(weak)[1],
        "--joint",
        "--store",
        str(torn),
    ]
    run = CliRunner().invoke(app, arguments)
    assert "1000 bytes" in " ".join(run.output.split())
    again = read_store(torn)
    assert again is not None
    assert (len(again.entries), again.torn) == (2, 0)
    assert again.runs[1].score == read_store(stored).runs[1].score  # type: ignore[union-attr]


def test_options_that_ask_for_nothing_are_refused(weak: Path) -> None:
    spec = str(weak / "spec.yaml")
    for arguments, words in (
        ([spec, logs(weak)[0], "--starts", "1"], "goes with --joint"),
        ([spec, *logs(weak), "--joint", "--starts", "1,2"], "expected 3 names"),
        ([spec, *logs(weak), "--joint", "--starts", "1,,2"], "found an empty one"),
        ([spec, logs(weak)[0], logs(weak)[0], "--joint"], "the same log as"),
        ([spec, "--joint"], "no log"),
        ([spec, "--joint", "--store", spec], "spec.yaml:1:1"),
    ):
        run = CliRunner().invoke(app, ["diagnose", *arguments])
        assert run.exit_code == 2, run.output
        assert words in run.output + run.stderr


def test_the_statistics_are_those_of_dense_least_squares(tmp_path: Path) -> None:
    """Normal matrix and score of a log, with its covariance written out in full (200 rows)."""
    effect = hidden("latency", "position", latency_s=0.02)
    log = make_log(scenario("car_stops", 4, 40.0, 5.0), (effect,), Noise(wander_share=0.5))
    spec = tmp_path / "spec.yaml"
    spec.write_text(log.spec_yaml(), encoding="utf-8")
    inputs = measured(load(spec), [log.to_csv(tmp_path / "log.csv")])
    with one_thread():
        one = examined(inputs, DiagnosisSettings(max_effects=1))
        data, model, states = one.data, one.result.model, one.search.states
        found = sufficient(data, model, states)
    level, time_s = shown_level(data, model, model.error), data.view.log.time_s
    n = len(time_s)
    dense = np.zeros((n, 3, n, 3))
    dense[np.arange(n), :, np.arange(n), :] = row_covariance(data.structure, level)
    common = [w.loading * f for w, f in zip(data.structure.white, level.factor, strict=True)
              if w.loading is not None]  # fmt: skip
    for loading in common:  # one row a stamp here: common to it alone
        dense[np.arange(n), :, np.arange(n), :] += loading @ np.swapaxes(loading, 1, 2)
    apart = np.abs(time_s[:, None] - time_s)
    for part, sizes, times in zip(data.structure.slow, level.slow, level.time_constant_s,
                                  strict=True):  # fmt: skip
        index = [w.sensor for w in data.structure.white].index(part.sensor)
        for k in range(part.columns):
            own = part.loading[:, :, k] * np.sqrt(sizes[k]) * max(1.0, level.factor[index])
            dense += np.einsum("ia,ij,jb->iajb", own, np.exp(-apart / times[k]), own)
    with one_thread():
        inverse = np.linalg.inv(dense.reshape(3 * n, 3 * n))
    k = found.labels.index(("latency", "position", 0, "latency_s"))
    (acting,) = model.acting
    step = 1e-5
    moved = [
        data.error((type(acting)(acting.effect, acting.sensor, acting.stage,
                                 {"latency_s": acting.values["latency_s"] + s}),))
        for s in (-step, step)
    ]  # fmt: skip
    slope = ((moved[0] - moved[1]) / (2.0 * step)).ravel()
    weight = slope @ inverse
    # far rows count less, and what is left sets the size of the noise: both by a few percent
    assert found.normal[k, k] == pytest.approx(float(weight @ slope), rel=0.35)
    value = float(weight @ model.error.ravel()) / float(weight @ slope)
    expected = acting.values["latency_s"] + value
    assert found.score[k] / found.normal[k, k] == pytest.approx(
        expected, abs=1.5 / np.sqrt(found.normal[k, k])
    )
    assert abs(expected - 0.02) < 5.0 / np.sqrt(found.normal[k, k])


def test_a_run_is_read_back_bit_by_bit(stored: Path) -> None:
    read = read_store(stored)
    assert read is not None
    for run in read.runs:
        found = run.statistics()
        assert isinstance(run, Run)
        assert np.array_equal(found.normal, found.normal.T)
        assert len(found.labels) == found.score.size
        for part in found.less:  # leaving parts out takes information away
            assert np.all(np.einsum("gpp->gp", part.normal) <= 1.05 * np.diag(found.normal) + 1e-12)


def test_from_python(weak: Path) -> None:
    found = diagnose_joint(load(weak / "spec.yaml"), JointRequest((Path(logs(weak)[0]),)))
    assert found.joint is not None
    assert found.joint.starts == 1


def test_appending_survives_kills(tmp_path: Path) -> None:
    """A writer that is killed while it writes leaves whole lines, and at most one torn end."""
    path, code = (
        tmp_path / "lines",
        "import sys; from pathlib import Path\n"
        "from syncline_design.machine.appended_files import append_line\n"
        "for k in range(10**6):\n"
        "    append_line(Path(sys.argv[1]), lambda kept: b'%06d' % kept.count(b'\\n')"
        " + b'x' * 5000 + b'\\n')\n"
        "    print(k, flush=True)\n",
    )
    for _ in range(2):
        writer = subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE)
        assert writer.stdout is not None
        told = [writer.stdout.readline() for _ in range(5)]
        writer.kill()
        writer.wait()
        assert all(told)
    append_line(path, lambda kept: b"%06d" % kept.count(b"\n") + b"x" * 5000 + b"\n")
    lines = path.read_bytes().split(b"\n")
    assert lines.pop() == b""
    assert len(lines) >= 11
    assert [int(line[:6]) for line in lines] == list(range(len(lines)))
    assert {len(line) for line in lines} == {5006}
