"""HiGHS through cvxpy, told what must hold of it and asked again where its answer cannot stand."""

from __future__ import annotations

from importlib import metadata
from typing import Any

from syncline_design.choice.outcome import Deadline, NoVerdict

LEAST_HIGHSPY = (1, 15)


OPTIONS: dict[str, Any] = {"mip_rel_gap": 0.0, "mip_abs_gap": 0.0, "threads": 1, "random_seed": 1}


TIGHT = {
    "mip_feasibility_tolerance": 1e-9,
    "primal_feasibility_tolerance": 1e-9,
    "dual_feasibility_tolerance": 1e-9,
}


_SUNG: list[bool] = []  # whether the canary has been solved rightly in this process


class Solver:
    """cvxpy with HiGHS: imported here only, checked for its version, one thread, both gaps 0."""

    def __init__(self, deadline: Deadline) -> None:
        try:
            import cvxpy
            import highspy  # noqa: F401 - whether it is there
        except ImportError as error:
            raise NoVerdict(f"the MILP needs cvxpy and highspy: {error}") from None
        version = metadata.version("highspy")
        if not is_recent(version):
            raise NoVerdict(
                f"highspy {version} is too old: 1.14 gives wrong optima on small problems; "
                "install highspy >= 1.15"
            )
        self.cp: Any = cvxpy
        self.deadline = deadline

    def run(self, problem: Any) -> str:
        """Solve; anything but a proven optimum or infeasibility is no verdict."""
        self.deadline.check()
        try:
            self._solve(problem, OPTIONS | TIGHT)
        except self.cp.error.SolverError:
            # Now and then the presolve of HiGHS 1.15.1 undoes itself wrongly: it notices, and ends
            # in an error ("untransformed violations").  Without presolve it finds the optimum.
            try:
                self._solve(problem, OPTIONS | TIGHT | {"presolve": "off"})
            except self.cp.error.SolverError as error:
                raise NoVerdict(f"the MILP solver stopped without an answer: {error}") from None
        status = str(problem.status)
        if status not in ("optimal", "infeasible"):
            self.deadline.check()
            raise NoVerdict(f"the MILP solver ended without a proof (status {status})")
        return status

    def _solve(self, problem: Any, options: dict[str, Any]) -> None:
        left = self.deadline.left_s()
        limit = {} if left is None else {"time_limit": left}
        problem.solve(solver=self.cp.HIGHS, **options, **limit)

    def demand_canary(self) -> None:
        """min 2 x + 3 z, x + z >= 4.5, z whole: 9; HiGHS 1.14 says 15 (highs-js issue 53).

        Once per process: the solver does not change under way.
        """
        if _SUNG:
            return
        x, z = self.cp.Variable(), self.cp.Variable(integer=True)
        rows = [x + z >= 4.5, x >= 0, x <= 10, z >= 0, z <= 10]
        canary = self.cp.Problem(self.cp.Minimize(2 * x + 3 * z), rows)
        if self.run(canary) != "optimal" or abs(float(canary.value) - 9.0) > 1e-6:
            raise NoVerdict(f"the MILP solver fails its canary: {canary.value} instead of 9")
        _SUNG.append(True)


def is_recent(version: str) -> bool:
    """Whether a highspy version is one that the product trusts."""
    numbers = tuple(int(part) for part in version.split(".")[:2] if part.isdigit())
    return numbers >= LEAST_HIGHSPY
