"""What is one of several effects that a log cannot tell apart is headed as that, everywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from diagnosis_samples import DESIGN, LATENCY, diagnosis
from syncline_design.campaign.adding import _named as named_alone
from syncline_design.comparison.meaning import with_design
from syncline_design.diagnosis.result import Estimate, Finding, Other, Rival, UnlikeOthers
from syncline_design.machine.sentences import any_of
from syncline_design.report.document import Document
from syncline_design.report.notebook import on_finding
from syncline_design.report.on_diagnosis import on_diagnosis
from syncline_design.report.on_findings import headline
from syncline_design.report.on_joint import unlike_words
from syncline_design.report.render_console import console
from syncline_design.report.render_html import html
from syncline_design.report.render_markdown import markdown
from syncline_design.spec.edit import with_effects_text
from syncline_design.spec.load import load, load_text
from watched_series import BOUND, car_spec, kept, run_of, statistics, watch

ARM = Rival("lever_arm", "position", "car", 0.999, 0.4, probability=0.3)
LAG = Rival("filter_lag", "position", "car", 0.999, 0.9, probability=0.2)
MORE = tuple(
    Rival(name, "ranging", "car", 0.999, 2.0, probability=0.05)
    for name in ("latency", "lever_arm", "range_bias")
)
BOTH = replace(LATENCY, aliases=(ARM,), probability=0.7)
FIVE = replace(LATENCY, aliases=(LAG, ARM, *MORE[:2]), probability=0.4)
TOLD = replace(LATENCY, aliases=(replace(ARM, probability=0.002),), probability=0.998)
RENDERED: dict[str, Callable[[Document], str]] = {
    "console": lambda said: console(said, colour=False),
    "markdown": markdown,
    "html": html,
}


def plain(text: str) -> str:
    return " ".join(text.replace("\\", "").replace("\u00a0", " ").split())


def said(name: str, *findings: Finding, **more: Any) -> str:
    """A diagnosis with these findings, up to its first section."""
    text = plain(RENDERED[name](on_diagnosis(diagnosis(findings=findings, **more))))
    begun = text.index("<body") if name == "html" else 0
    return text[begun : text.index("Gap closed on held-out data", begun)]


@pytest.mark.parametrize("name", list(RENDERED))
def test_the_headline_of_a_class_names_its_members_and_decides_nothing(name: str) -> None:
    text = said(name, BOTH)
    assert "Explained by one of several effects that this log cannot tell apart" in text
    assert "what is missing was found" not in text
    words = (
        "One of 2 effects that this log cannot tell apart: latency (position) or lever arm "
        "(position). If it is latency (position), probability 0.7: GNSS positions"
    )
    assert words in text


def test_three_members_are_named_and_the_others_counted() -> None:
    """By their probability, whatever their order in the finding."""
    words = headline(FIVE)
    assert words.startswith("One of 5 effects that this log cannot tell apart: ")
    first = "latency (position), lever arm (position), filter lag (position)"
    assert f": {first} or one of 2 others. If it is latency (position), " in words
    every = ["a", "b", "c", "d", "e"]
    told = [any_of(every[:n]) for n in range(6)]
    assert told == ["", "a", "a or b", "a, b or c", "a, b, c or another one",
                    "a, b, c or one of 2 others"]  # fmt: skip


def test_a_spec_that_lists_one_of_a_class_says_so(tmp_path: Path) -> None:
    """In the text of the spec, which reads back; what is told has no note."""
    case = load(car_spec(tmp_path / "car.yaml"))
    texts = [with_effects_text(case, one.as_entries()) for one in (BOTH, TOLD)]
    note = (
        "one of 2 effects that the data cannot tell apart: latency (position) or lever arm "
        "(position)"
    )
    assert [yaml.safe_load(text)["effects"][0].get("note", "") for text in texts] == [note, ""]
    assert load_text(texts[0], tmp_path / "found.yaml").spec.effects[0].note == note


@pytest.mark.parametrize("one", [TOLD, replace(LATENCY, aliases=())])
def test_a_cause_whose_rivals_are_ruled_out_stays_decided(one: Finding) -> None:
    text = said("console", one)
    assert "Explained: what is missing was found, and what remains is noise" in text
    assert "One of" not in text
    assert "GNSS positions are 87.1 ms older than their stamps." in text


def test_a_class_beside_a_cause_is_a_part() -> None:
    arm = replace(LATENCY, effect="range_bias", sensor="ranging", aliases=())
    text = said("console", BOTH, arm)
    assert "Explained, in part by one of several effects that this log cannot tell apart" in text


def test_noise_and_what_does_not_matter_decide_no_headline() -> None:
    noise = replace(BOTH, kind="noise")
    text = said("console", replace(LATENCY, aliases=()), noise, replace(BOTH, material=False))
    assert "Explained: what is missing was found, and what remains is noise" in text


def test_several_logs_are_said_to_be_several() -> None:
    words = headline(replace(BOTH, scope="build"))
    assert "One of 2 effects that these logs cannot tell apart" in words


def test_a_stand_in_is_no_cause_in_any_of_its_words() -> None:
    words = headline(replace(BOTH, kind="stand_in"))
    assert words.startswith("Not as a cause, as the nearest word for it: GNSS positions")
    assert words.endswith("; as well: lever arm (position).")


def test_members_of_a_chain_are_told_by_their_stages() -> None:
    other = replace(BOTH, aliases=(replace(ARM, effect="latency", stage="trailer"),))
    assert "latency (position, car) or latency (position, trailer)" in headline(other)


def test_the_design_says_as_which_member_it_is_charged() -> None:
    found = with_design(diagnosis(findings=(BOTH,)), DESIGN)
    assert found.design is not None
    assert found.design.text == (
        *DESIGN.text,
        "Charged is latency (position); with lever arm (position), which this log cannot tell from "
        "it, the figures may be others.",
    )
    assert with_design(diagnosis(findings=(TOLD,)), DESIGN).design == DESIGN


def test_a_finding_by_itself_is_headed_as_one_of_several() -> None:
    page = on_finding(BOTH)
    assert page.outcome.word == "latency (position) or lever arm (position)"
    assert page.sentences == (headline(BOTH),)
    assert on_finding(TOLD).outcome.word == "latency"
    assert on_finding(TOLD).sentences == (TOLD.sentence,)


def test_a_log_alone_is_kept_with_what_it_leaves() -> None:
    assert named_alone(BOTH).words.endswith(" (or lever arm (position): this log cannot tell)")
    assert named_alone(TOLD).words == TOLD.sentence


def test_a_log_unlike_the_others_is_so_in_one_of_several() -> None:
    by = {"latency_s": Estimate(0.02, 0.001, "s", True, "20 ms")}
    one = UnlikeOthers(4, ("d.csv",), "latency", "position", "car", by, -9.0,
                       aliases=(Other("lever_arm", "position", "car", 0.2),))  # fmt: skip
    words = unlike_words(one)
    names = "latency (position) or lever arm (position)"
    assert f": {names} differs there, as latency (position), latency by 20" in words
    alone = unlike_words(replace(one, aliases=None))
    assert "the others: latency (position) differs there, latency by 20" in alone


@pytest.mark.parametrize(
    ("last", "word", "first", "other"),
    [
        (6, "is unlike the others", "latency (position)", "datum offset (target)"),
        (9, "Changed", "datum offset (target)", "latency (position)"),
    ],
)
def test_a_watch_heads_its_alarm_as_one_of_several(
    tmp_path: Path, last: int, word: str, first: str, other: str
) -> None:
    """Latency and the datum's north of cosine 0.9999, off in one run or from one run on."""
    spec, rng = car_spec(tmp_path / "spec.yaml"), np.random.default_rng(24)
    moved = np.array([25.0, 0, 0, 0, 0]) * BOUND
    runs = [run_of(statistics(rng, moved * (5 <= k < last), 0.9999), k) for k in range(9)]
    text = plain(watch(kept(spec, tmp_path, runs), spec).output)
    assert f"{word}: {first} or {other}" in text
    name = f"{first[0].upper()}{first[1:]} or {other}"
    assert f"{name} (these runs cannot tell). As {first}: " in text
