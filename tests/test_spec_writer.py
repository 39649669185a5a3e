"""Specs written back: what changes, what stays, and that nothing is half-written."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from syncline_design.machine.result_files import OutputError, write_file
from syncline_design.spec.case import Case, usable_primitives
from syncline_design.spec.edit import (
    PinnedRole,
    pinned,
    pinned_spec_text,
    with_effects,
    with_effects_text,
    write_spec,
)
from syncline_design.spec.load import BadInput, load, load_text
from syncline_design.spec.spec import EffectChoice
from syncline_design.spec.yaml_text import parse

SPECS = Path(__file__).parent.parent / "specs"
SHIPPED = sorted(SPECS.glob("*.yaml"))
EFFECT = EffectChoice(
    effect="latency",
    sensor="position",
    stage="uav",
    parameters={"latency_s": 0.087},
    standard_uncertainty={"latency_s": 2e-5},
    note='found: "on the north leg", 95 %',
)


def first_options(spec: Case) -> list[PinnedRole]:
    """The first usable option of every role."""
    pins = []
    for stage in spec.stages:
        for role in stage.roles:
            if role.inline is not None:
                pins.append(PinnedRole(stage.index, role.role, role.sensors[0].id))
                continue
            identity, primitive, method = next(
                (sensor.id, p, method.id)
                for sensor in role.sensors
                for method in role.methods
                for p in usable_primitives(sensor.entry, method.entry, role.choice.primitive)
            )
            pins.append(PinnedRole(stage.index, role.role, identity, primitive, method))
    return pins


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_a_pinned_spec_loads_keeps_its_comments_and_pins_every_role(path: Path) -> None:
    spec = load(path)
    pins = first_options(spec)
    clocks = {
        i: stage.clock.candidates[0] for i, stage in enumerate(spec.spec.stages) if stage.clock
    }
    text = pinned_spec_text(spec, pins, clocks)
    again = load_text(text, path)
    for pin in pins:
        role = again.spec.stages[pin.stage].role(pin.role)
        assert role is not None
        assert role.candidates is None
        if isinstance(role.sensor, str):
            assert role.sensor == pin.sensor
        if pin.timestamping is not None:
            assert (role.primitive, role.timestamping) == (pin.primitive, pin.timestamping)
        before = spec.spec.stages[pin.stage].role(pin.role)
        assert before is not None
        assert role.lever_arm == before.lever_arm
    assert again.spec.requirements == spec.spec.requirements
    assert pinned(spec, pins, clocks).spec == again.spec
    comments = [line for line in spec.text.split("\n") if line.startswith("#")]
    assert [line for line in text.split("\n") if line.startswith("#")] == comments
    assert (
        pinned_spec_text(again, pins, clocks) == text
        or parse(pinned_spec_text(again, pins, clocks)).data == parse(text).data
    )


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.stem)
def test_effects_are_added_and_nothing_else_changes(path: Path) -> None:
    spec = load(path)
    stage = spec.spec.stages[0].name
    entry = EFFECT.model_copy(update={"stage": stage})
    once = load_text(with_effects_text(spec, [entry]), path)
    assert once.spec.effects == (*spec.spec.effects, entry)
    added = with_effects(spec, [entry])
    assert (added.spec, added.effects) == (once.spec, once.effects)
    assert once.spec.model_copy(update={"effects": spec.spec.effects}) == spec.spec
    assert once.text.startswith(spec.text.rstrip("\n")) or spec.spec.effects
    twice = load_text(with_effects_text(once, [entry]), path)
    assert twice.spec.effects == (*once.spec.effects, entry)


FLOW = """# kept
{syncline: 1, name: Flow, requirements: [{id: A, kind: accuracy, limit: 1 m}], # also kept
 stages: [{name: uav, platform: uav_fixed_wing, clock: {candidates: [pps_gpio, ptp]},
   position: {candidates: [ublox_f9p_rtk], lever_arm: [1 m, 0 m, 0 m]}}],
 timestamping: {candidates: [gpio]}, effects: []}
"""


def test_flow_style_is_edited_in_place() -> None:
    spec = load_text(FLOW, SPECS / "flow.yaml")
    text = pinned_spec_text(
        spec, [PinnedRole(0, "position", "ublox_f9p_rtk", "pps", "gpio")], {0: "ptp"}
    )
    assert text.startswith("# kept\n")
    stage = load_text(text, SPECS / "flow.yaml").spec.stages[0]
    assert stage.clock is not None
    assert stage.clock.candidates == ("ptp",)
    assert stage.position is not None
    assert (stage.position.sensor, stage.position.lever_arm) == ("ublox_f9p_rtk", (1.0, 0.0, 0.0))


def test_comments_inside_an_edited_block_survive() -> None:
    text = (SPECS / "uav_corridor.yaml").read_text(encoding="utf-8")
    text = text.replace("    position:\n", "    position:  # the antenna\n      # on the tail\n")
    assert "# on the tail" in text
    spec = load_text(text, SPECS / "x.yaml")
    text = pinned_spec_text(spec, first_options(spec))
    assert "position:  # the antenna\n      # on the tail\n      sensor: ublox_f9p_pvt\n" in text


def test_what_cannot_be_edited_is_written_anew_with_a_remark() -> None:
    """A list of effects in block style with comments between is beyond the text edit."""
    base = FLOW.replace("{syncline", "{ ? syncline\n : 1, x_syncline")
    base = FLOW.replace("effects: []", "effects: [{effect: latency, # here\n   sensor: position,"
                        " parameters: {latency_s: 1 ms}}]")  # fmt: skip
    spec = load_text(base, SPECS / "flow.yaml")
    again = load_text(
        with_effects_text(spec, [EFFECT.model_copy(update={"stage": None})]), SPECS / "flow.yaml"
    )
    assert len(again.spec.effects) == 2
    assert again.spec.effects[0] == spec.spec.effects[0]


def test_text_with_every_kind_of_character_survives() -> None:
    name = "a\x01b \x85 \U0001f600 \\ \" ' : # - </script> \u2028 =HYPERLINK("
    escaped = name.replace("\\", "\\\\").replace('"', '\\"')
    escaped = escaped.replace("\x01", "\\x01").replace("\x85", "\\x85").replace("\u2028", "\\u2028")
    spec = load_text(FLOW.replace("name: Flow", f'name: "{escaped}"'), SPECS / "flow.yaml")
    assert spec.spec.name == name
    text = with_effects_text(spec, [EFFECT.model_copy(update={"note": name})])
    again = load_text(text, SPECS / "flow.yaml")
    assert again.spec.name == name
    assert again.spec.effects[0].note == name


def test_a_bad_text_is_never_written(tmp_path: Path) -> None:
    target = tmp_path / "out.yaml"
    with pytest.raises(BadInput):
        write_spec("syncline: 1\n", target)
    assert list(tmp_path.iterdir()) == []
    loaded = write_spec(FLOW, target)
    assert loaded.spec == load(target).spec
    with pytest.raises(BadInput):
        write_spec("syncline: 1\n", target)
    assert target.read_text(encoding="utf-8") == FLOW
    assert list(tmp_path.iterdir()) == [target]


def test_a_failed_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "out.yaml"
    target.write_text("old", encoding="utf-8")

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left"):
        write_file(target, b"new")
    assert target.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [target]
    monkeypatch.undo()
    target.chmod(0o640)
    write_file(target, b"new")
    assert target.read_text(encoding="utf-8") == "new"
    assert target.stat().st_mode & 0o777 == 0o640
    with pytest.raises(OutputError, match="cannot write"):
        write_file(target / "below" / "out.yaml", b"new")
