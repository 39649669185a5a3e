"""Several logs of which one is beyond the limits of the spec's platform: that is what is said."""

from __future__ import annotations

from pathlib import Path

from syncline_design.campaign.joint import JointRequest, diagnose_joint
from syncline_design.spec.load import load_text

ROOT = Path(__file__).parent.parent / "examples"


def test_a_log_beyond_the_limits_of_the_platform_is_named_with_its_file(tmp_path: Path) -> None:
    text = (ROOT / "hidden_latency.yaml").read_text("utf-8")
    assert "distance: 40 m" in text
    case = load_text(text.replace("distance: 40 m", "distance: 10 m"), tmp_path / "spec.yaml")
    head, *rows = (ROOT / "hidden_latency.csv").read_text("utf-8").splitlines()
    for name, part in (("one.csv", rows[:400]), ("two.csv", rows[400:800])):
        (tmp_path / name).write_text("\n".join([head, *part]) + "\n", "utf-8")
    logs = (tmp_path / "one.csv", tmp_path / "two.csv")
    found = diagnose_joint(case, JointRequest(logs))
    assert (found.verdict, found.sound) == ("unexplained", False)
    assert [check.code for check in found.checks] == ["range", "range"]
    assert [check.message.split(":")[0] for check in found.checks] == ["in one.csv", "in two.csv"]
    assert not found.remaining.material
    assert all("the spec's distance is 10 m" in check.message for check in found.checks)
