"""How far a log goes beyond the speed and turn rate of its platform, for how long.

Means over some seconds count, so that the noise of one reading does not; what that noise can do to
the largest of so many means is known from the readings themselves.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from syncline_design.diagnosis.agreement import windows_of
from syncline_design.diagnosis.checks import MEAN_S
from syncline_design.diagnosis.scatter import scatter
from syncline_design.diagnosis.scene import Scene
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass
from syncline_design.model.distributions import normal_limit
from syncline_design.model.normal import NORMAL_95
from syncline_design.model.system import Stage

CHANCE: Final = 1e-3  # that noise alone reaches so far beyond a limit in one of the means


@dataclass(frozen=True, slots=True)
class Beyond:
    """The largest mean over `over_s`, its least and largest at 95 %, in SI.

    least: what it is beyond doubt, any of so many means counted.  share: of the means that lie
    beyond the limit by more than a reading's room beyond doubt.
    """

    most: float
    low: float
    high: float
    least: float
    limit: float
    over_s: float
    means: Array
    doubt: float

    def share(self, limit: float) -> float:
        """Share of the means beyond a limit beyond doubt."""
        return float(np.mean(self.means - self.doubt > limit))


def beyond_limits(view: Scene) -> Mapping[tuple[str, str], Beyond]:
    """Of every stage whose motion is logged, by (code, stage)."""
    found = {}
    for stage, logged in zip(view.system.stages, view.log.stages, strict=True):
        platform = stage.platform
        place_m, angle_rad = _sigmas(stage)
        for code, series, limit, pose in (
            ("speed", logged.velocity_mps, platform.v_max_mps, place_m),
            ("turn_rate", logged.rate_radps, platform.omega_max_radps, angle_rad),
        ):
            one = _beyond(view.log.time_s, series, limit, pose, MEAN_S[code])
            if one is not None:
                found[code, stage.name] = one
    return found


def _sigmas(stage: Stage) -> tuple[float, float]:
    place = 0.0 if stage.position is None else float(max(stage.position.sigma))
    angle = 0.0 if stage.attitude is None else float(max(stage.attitude.sigma))
    return place, angle


def _beyond(
    time_s: Array, series: Array, limit: float, pose: float, mean_s: float
) -> Beyond | None:
    """Of one column; pose: noise of the places or angles that the motion may be derived of.

    A mean over T is off by sqrt(2) pose / T then; of readings that scatter by s, by s over the
    root of their number.
    """
    spans = windows_of(time_s, mean_s, sliding=True)  # of those side by side, none may hold a peak
    if spans is None:
        return None
    length = float(np.median(spans.length_s))
    means = np.linalg.norm(spans.integral(series), axis=1) / spans.length_s
    usual = float(np.median(np.diff(np.unique(time_s))))
    noise = scatter(time_s, series)
    spread = np.hypot(noise * np.sqrt(usual / length), np.sqrt(2.0) * pose / length)
    reach = float(normal_limit(CHANCE / len(means)) * spread)
    most = float(np.max(means))
    near = NORMAL_95 * float(spread)
    return Beyond(most, most - near, most + near, most - reach, limit, length, means, reach)
