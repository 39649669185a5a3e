"""A world of its own for tests of the diagnosis: no code and no formula of the package in it.

A vehicle truly moves along smooth splines; its sensors read that truth at the moments at which
they really measure, from where they really sit, turned as they really are.  A system that believes
its spec writes a log of the readings.  See `hidden` for what the parameters mean.
"""

from tests.world.hidden import CONSTRUCTIONS, DISCRETE, STOCHASTIC, Hidden, hidden
from tests.world.motions import MOTIONS
from tests.world.noise import SILENT, Noise
from tests.world.scenarios import CHAIN, Scenario, scenario
from tests.world.worldlog import WorldLog, make_log

__all__ = [
    "CHAIN",
    "CONSTRUCTIONS",
    "DISCRETE",
    "MOTIONS",
    "SILENT",
    "STOCHASTIC",
    "Hidden",
    "Noise",
    "Scenario",
    "WorldLog",
    "hidden",
    "make_log",
    "scenario",
]
