"""What simulation says of a design, beside the sums that the tables decide."""

from __future__ import annotations

from syncline_design.choice.table import Design, Problem, SimulatedJudgement

NOTHING_SIMULATED = SimulatedJudgement()


def judgement(problem: Problem, design: Design) -> SimulatedJudgement:
    """What simulation says of a design."""
    return NOTHING_SIMULATED if problem.judge is None else problem.judge.judge(problem, design)


def refusals(problem: Problem) -> int:
    """How often simulation was refused because too many designs had been simulated."""
    return 0 if problem.judge is None else problem.judge.refusals
