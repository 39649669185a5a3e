"""The simulator: the paper's nonlinear measurement chain, its worst case and its probabilities.

`cross_check` is what every verdict runs, `simulate` adds the worst case over a grid of tau against
the Syncline, `decide` settles a `monte_carlo` requirement, `sample_errors` hands out the errors as
an array.  Imports nothing but NumPy.
"""

from syncline_design.model.system import SimulationError
from syncline_design.simulation.comparison import comparison
from syncline_design.simulation.results import (
    ComparisonRow,
    MonteCarlo,
    ProportionEstimate,
    QuantileEstimate,
    Simulation,
    WorstCase,
)
from syncline_design.simulation.run import CrossCheck, Decision, cross_check, decide, simulate
from syncline_design.simulation.sampling import sample_errors
from syncline_design.simulation.settings import SimulationSettings
from syncline_design.simulation.worst_case import worst_cases

__all__ = [
    "ComparisonRow",
    "CrossCheck",
    "Decision",
    "MonteCarlo",
    "ProportionEstimate",
    "QuantileEstimate",
    "Simulation",
    "SimulationError",
    "SimulationSettings",
    "WorstCase",
    "comparison",
    "cross_check",
    "decide",
    "sample_errors",
    "simulate",
    "worst_cases",
]
