"""Figures that are allowed and hardly meant are asked about, and nothing that is usual is."""

from __future__ import annotations

import json
from pathlib import Path
from statistics import median
from typing import Any

import pytest
import yaml

from syncline_design.spec import files
from syncline_design.spec.load import load, load_builtin, load_siblings, load_text
from syncline_design.verdict.cautions_of_facts import implausible_cautions
from syncline_design.verdict.verify import CheckSettings, check_loaded

Raw = dict[str, Any]
SPECS = sorted(Path("specs").glob("*.yaml"))


def spec_of(platform: Any, lever_arm: Any = None, sensor: Any = "sbg_ellipse") -> str:
    position: Raw = {"sensor": "ublox_f9p_rtk"}
    if lever_arm:
        position["lever_arm"] = lever_arm
    stage = {
        "name": "uav", "platform": platform, "timestamping": {"candidates": ["hardware"]},
        "position": position, "attitude": {"sensor": sensor},
        "ranging": {"candidates": ["riegl_vux1uav"]},
    }  # fmt: skip
    limit = {"id": "ACC-1", "kind": "accuracy", "limit": "90 m"}
    spec = {"syncline": 1, "name": "slips", "requirements": [limit], "stages": [stage]}
    return json.dumps(spec, indent=1)


def asked(text: str, folder: Path) -> list[tuple[str | None, str | None, str]]:
    found = implausible_cautions(load_text(text, folder / "spec.yaml"))
    assert {one.code for one in found} <= {"implausible"}
    return [(one.entry, one.key, one.message) for one in found]


WING: Raw = {"use": "uav_fixed_wing"}
OWN: Raw = {"v_max": "21 m/s", "omega_max": "78 deg/s", "distance": "60 m", "baseline": "1 m"}


@pytest.mark.parametrize(
    ("platform", "key", "words"),
    [
        (WING | {"omega_max": "77.9 rad/s"}, "omega_max", "did you mean 77.9 deg/s?"),
        (WING | {"v_max": "210 m/s"}, "v_max", "10 times the 21 m/s"),
        (WING | {"v_max": "4 m/s"}, "v_max", "5.25 times less than the 21 m/s"),
        (WING | {"baseline": "20 m"}, "baseline", "20 times the 1 m"),
        (OWN | {"omega_max": "77.9 rad/s"}, "omega_max", "did you mean 77.9 deg/s?"),
        (OWN | {"omega_max": "9 rad/s"}, "omega_max", "did you mean 9 deg/s?"),
        (OWN | {"omega_max": "2000 deg/s"}, "omega_max", "6.41 times the most"),
        (OWN | {"v_max": "340 m/s"}, "v_max", "11.3 times the most"),
    ],
)
def test_a_platform_that_moves_as_none_does(
    platform: Raw, key: str, words: str, tmp_path: Path
) -> None:
    ((entry, told, message),) = asked(spec_of(platform), tmp_path)
    assert (entry, told) == ("uav_fixed_wing" if "use" in platform else "uav", key)
    assert words in message
    assert platform[key] in message


@pytest.mark.parametrize(
    "platform",
    [
        WING, "car", OWN, WING | {"v_max": "4.2 m/s"}, WING | {"v_max": "105 m/s"},
        WING | {"distance": "3 km"}, WING | {"omega_max": "1.4 rad/s"}, OWN | {"v_max": "140 m/s"},
        OWN | {"v_max": "0 m/s"}, OWN | {"v_max": "1 mm/s"}, OWN | {"omega_max": "5.4 rad/s"},
    ],
)  # fmt: skip
def test_what_may_be_is_not_asked_about(platform: Any, tmp_path: Path) -> None:
    assert asked(spec_of(platform), tmp_path) == []


@pytest.mark.parametrize(
    ("arm", "long"),
    [
        (["3 m", "0 m", "0 m"], False),
        (["3.001 m", "0 m", "0 m"], True),
        (["2 m", "-2 m", "1 m"], False),  # 3 m in all
        (["2 m", "-2 m", "-1.1 m"], True),
        (["300 mm", "0 mm", "-200 mm"], False),
    ],
)
def test_a_lever_arm_beyond_three_baselines(arm: list[str], long: bool, tmp_path: Path) -> None:
    found = asked(spec_of(WING, arm), tmp_path)
    assert [key for _, key, _ in found] == (["stages[0].position.lever_arm"] if long else [])
    assert all("baseline (its largest) is 1 m" in message for *_, message in found)


def medians_of_ins() -> float:
    """Of the shipped attitude sensors of type ins, from the files."""
    every: Raw = {}
    for path in (Path("catalogs/sensors.yaml"), *Path("catalogs/sensors").glob("*.yaml")):
        every |= yaml.safe_load(path.read_text("utf-8")).get("sensors") or {}
    kin = [e for e in every.values() if (e["modality"], e.get("type")) == ("attitude", "gnss/ins")]
    assert len(kin) >= 4
    sizes = []
    for one in kin:
        sigma = one["sigma_attitude"]
        axes = [float(x.split()[0]) for x in (sigma if isinstance(sigma, list) else [sigma] * 3)]
        assert all(x.endswith(" deg") for x in (sigma if isinstance(sigma, list) else [sigma]))
        sizes.append((sum(a * a for a in axes) / 3) ** 0.5)
    return median(sizes)


@pytest.mark.parametrize(("factor", "odd"), [(4.9, False), (5.1, True), (0.19, True)])
def test_noise_five_times_off_that_of_its_kind(factor: float, odd: bool, tmp_path: Path) -> None:
    sigma = f"{medians_of_ins() * factor:.6f} deg"
    own = {
        "modality": "attitude", "type": "gnss/ins", "sigma_attitude": sigma,
        "primitives": ["pps"], "cost": "1 EUR",
    }  # fmt: skip
    found = asked(spec_of(WING, sensor=own), tmp_path)
    assert [(entry, key) for entry, key, _ in found] == (
        [("uav.attitude", "sigma_attitude")] if odd else []
    )
    own["unusual"] = {"sigma_attitude": "measured"}
    assert asked(spec_of(WING, sensor=own), tmp_path) == []


def test_verdicts_say_it_with_a_design_and_without(tmp_path: Path) -> None:
    slipped = spec_of(WING | {"omega_max": "77.9 rad/s"})
    quick = CheckSettings(monte_carlo=False)
    for limit, word in (("900 m", "meets"), ("1 mm", "infeasible")):
        text = slipped.replace("90 m", limit)
        verdict = check_loaded(load_text(text, tmp_path / "spec.yaml"), quick).to_json()
        assert verdict["verdict"] == word
        told = [one for one in verdict["warnings"] if one["code"] == "implausible"]
        assert [(one["entry"], one["key"]) for one in told] == [("uav_fixed_wing", "omega_max")]


def test_shipped_specs_are_as_they_are_meant() -> None:
    assert {
        path.name: [str(one) for one in implausible_cautions(load(path))] for path in SPECS
    } == {path.name: [] for path in SPECS}


@pytest.mark.parametrize(
    ("given", "keys"),
    [
        ({"depth": "300 m", "medium": "air"}, ["medium"]),
        ({"depth": "300 m", "gnss": True}, ["gnss"]),
        ({"depth": "300 m", "medium": "water", "gnss": False}, []),
        ({"depth": "2 m", "medium": "air", "gnss": True}, []),  # a mast stands out of the water
        ({"medium": "air", "gnss": True}, []),
    ],
)
def test_what_is_deep_under_water_has_no_air_and_no_satellites(
    given: Raw, keys: list[str], tmp_path: Path
) -> None:
    spec = json.loads(spec_of(WING))
    spec["stages"][0] |= given
    found = asked(json.dumps(spec, indent=1), tmp_path)
    assert [key for _, key, _ in found] == [f"stages[0].{key}" for key in keys]
    assert all("at a depth of 300 m" in reason for _, _, reason in found)


def test_siblings_are_those_of_the_whole_catalog() -> None:
    """Of every type there is, from the families that hold one and no others."""
    whole = load_builtin().sensors
    types = {(one.modality, one.type) for one in whole.values()}
    assert len(types) > 15
    for kind in types:
        siblings = {k for k, one in whole.items() if (one.modality, one.type) == kind}
        found = load_siblings({kind}).sensors
        assert {k for k, one in found.items() if (one.modality, one.type) == kind} == siblings
        assert all(found[k] == whole[k] for k in siblings)


def test_a_sensor_is_held_against_its_type_without_reading_all_families(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of them took a fifth of a second of every command on a system of one's own."""
    text = Path("examples/hidden_latency.yaml").read_text("utf-8")
    case = load_text(text, tmp_path / "spec.yaml")
    read: list[str] = []
    drawn = files._family

    def noted(shown: str) -> files.Collection:
        read.append(shown)
        return drawn(shown)

    monkeypatch.setattr(files, "_family", noted)
    list(implausible_cautions(case))
    assert 0 < len(read) < 10
    assert all(name.startswith("builtin:sensors/") for name in read)
