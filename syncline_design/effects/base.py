"""What an effect is: one record that simulator, budget, diagnosis and report all read.

An effect looks at the rows of one stage (`StageRows`, the true state at every stamp) and says how
the world departs from the spec (`Departures`).  The chain (`simulate.chain`) turns departures into
errors; the linear sensitivity beside it is what the diagnosis screens with.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from syncline_design.model.system import RoleName, Stage

Array = NDArray[np.float64]
Target = RoleName | Literal["target"]
Values = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class StageRows:
    """True state of one stage at n stamps of its ranging sensor.

    time_s (n,); position_m (n, 3) reference point in NED; rotation (n, 3, 3) R_nb;
    euler_rad (n, 3) roll, pitch, yaw; velocity_mps and acceleration_mps2 (n, 3) of the reference
    point, body axes; rate_radps (n, 3) body; range_m, azimuth_rad, elevation_rad (n,) true
    bearing in the ranging sensor's believed axes; target_m (n, 3) true object in NED.
    antenna_m, ranging_m: lever arms l_G, l_L the spec believes [m], body, (3,) or (n, 3).
    """

    time_s: Array
    position_m: Array
    rotation: Array
    euler_rad: Array
    velocity_mps: Array
    acceleration_mps2: Array
    rate_radps: Array
    range_m: Array
    azimuth_rad: Array
    elevation_rad: Array
    antenna_m: Array
    ranging_m: Array
    target_m: Array

    def __len__(self) -> int:
        return int(self.time_s.shape[0])


_ZERO = np.zeros(1)
_ZERO3 = np.zeros((1, 3))


@dataclass(frozen=True, slots=True)
class Departures:
    """How the world departs from the spec, row by row; every field adds, zero means as specified.

    position_shift_s, attitude_shift_s, ranging_shift_s (n,): extra mu of that sensor.
    antenna_m, ranging_m (n, 3): true lever arm minus the spec's, body.
    attitude_rotation_rad (n, 3): alpha, measured R = R exp(S(alpha)).
    attitude_euler_rad (n, 3): added to measured roll, pitch, yaw.
    bearing_rotation_rad (n, 3): beta, true mounting of the ranging sensor exp(S(beta)).
    position_m (n, 3): added to the antenna reading, NED.
    range_m (n,), range_scale (n,): measured r = r (1 + range_scale) + range_m.
    azimuth_rad, elevation_rad (n,): added to the measured bearing.
    target_m (n, 3): surveyed object minus true object, NED.
    """

    position_shift_s: Array = field(default_factory=lambda: _ZERO)
    attitude_shift_s: Array = field(default_factory=lambda: _ZERO)
    ranging_shift_s: Array = field(default_factory=lambda: _ZERO)
    antenna_m: Array = field(default_factory=lambda: _ZERO3)
    ranging_m: Array = field(default_factory=lambda: _ZERO3)
    attitude_rotation_rad: Array = field(default_factory=lambda: _ZERO3)
    attitude_euler_rad: Array = field(default_factory=lambda: _ZERO3)
    bearing_rotation_rad: Array = field(default_factory=lambda: _ZERO3)
    position_m: Array = field(default_factory=lambda: _ZERO3)
    range_m: Array = field(default_factory=lambda: _ZERO)
    range_scale: Array = field(default_factory=lambda: _ZERO)
    azimuth_rad: Array = field(default_factory=lambda: _ZERO)
    elevation_rad: Array = field(default_factory=lambda: _ZERO)
    target_m: Array = field(default_factory=lambda: _ZERO3)

    def __add__(self, other: Departures) -> Departures:
        """Both departures at once; rotation vectors add, which is exact to second order."""
        return Departures(
            **{f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(self)}
        )


NOTHING = Departures()


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter: its name carries the unit; [low, high] is its plausible magnitude."""

    name: str
    low: float
    high: float
    unit: str = ""
    signed: bool = True


@dataclass(frozen=True, slots=True)
class Contribution:
    """What a fitted effect adds to the Syncline: tau of its sensor [s], a systematic term [m]."""

    tau_s: float = 0.0
    systematic_m: float = 0.0


Depart = Callable[[StageRows, Values, Target, "np.random.Generator | None"], Departures]
Sensitivity = Callable[[StageRows, Target], Array]
Contribute = Callable[[Stage, Values, Target], Contribution]


@dataclass(frozen=True, slots=True)
class Effect:
    """One physical effect.

    kind: deterministic (a departure given the rows), stochastic (a departure drawn anew, seen as
    covariance) or discrete (a convention; re-simulated, never linearised).
    depart: exact departures; stochastic effects draw from the generator they are given.
    sensitivity: (n, 3, p) derivative of the error [m] by each parameter at zero, NED, to first
    order; None where an effect has none (discrete), the standard deviation per unit parameter
    along its axis for stochastic ones.
    contribute: what it adds to the Syncline of a stage.
    """

    name: str
    sensors: tuple[Target, ...]
    kind: Literal["deterministic", "stochastic", "discrete"]
    parameters: tuple[Parameter, ...]
    sentence: str  # for people, a format string over the parameters
    confused_with: str
    separated_by: str
    source: str
    depart: Depart
    sensitivity: Sensitivity | None
    contribute: Contribute
