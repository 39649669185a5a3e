"""What the same length costs as a limit of each figure of the error.

python benchmarks/figure_cost.py SPEC LIMIT_M [LIMIT_M ...]
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from syncline_design.choice.decide import choose
from syncline_design.choice.evaluate import chosen_options, evaluate
from syncline_design.choice.outcome import Choice
from syncline_design.spec.case import Case
from syncline_design.spec.load import load
from syncline_design.spec.requirement import Requirement
from syncline_design.verdict.acceptance import Simulations

KINDS: dict[str, dict[str, Any]] = {
    "accuracy": {}, "worst_case": {}, "rmse": {"axis": "3d"}, "thu": {}, "tvu": {},
    "quantile": {"of": "3d", "p": 0.95},
}  # fmt: skip


def limited(case: Case, kind: str, limit_m: float) -> Case:
    """The spec with this one requirement alone; sync counts as ever."""
    keys = {"id": "ONE", "kind": kind, "limit": f"{limit_m} m", **KINDS[kind]}
    own = [one for one in case.spec.requirements if one.kind == "sync"]
    requirements = (*own, Requirement.model_validate(keys))
    return replace(case, spec=case.spec.model_copy(update={"requirements": requirements}))


def main(path: str, limits: list[float]) -> None:
    case = load(Path(path))
    for limit in limits:
        for kind in KINDS:
            start = time.process_time()
            asked = limited(case, kind, limit)
            problem = Simulations().problem_of(asked)
            found = choose(problem)
            spent = time.process_time() - start
            told = "no design"
            if isinstance(found, Choice):
                cost = evaluate(problem, found.design).cost
                sensors = ", ".join(one.sensor for one in chosen_options(problem, found.design))
                over = found.proof.passed_over
                told = (
                    f"{float(cost or 0):.2f} {case.spec.currency} ({sensors}), {over} passed over"
                )
            print(f"{limit:g} m {kind:10s} {told} [{spent:.1f} s]", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], [float(one) for one in sys.argv[2:]])
