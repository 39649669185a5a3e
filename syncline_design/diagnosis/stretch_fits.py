"""One candidate in a window of a log, by re-simulation, and which of them are as good there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from syncline_design.diagnosis.candidates import Candidate, Signature, zero_values
from syncline_design.diagnosis.covariance import Precision
from syncline_design.diagnosis.fitting import Data, Model, adjusted
from syncline_design.diagnosis.noise import NoiseLevel, Structure, as_specified
from syncline_design.diagnosis.scene import Scene
from syncline_design.diagnosis.spans import StampSpan, cut_to
from syncline_design.effects.acting import Acting
from syncline_design.effects.record import Array
from syncline_design.machine.quick_dataclass import dataclass

AS_GOOD_NATS: Final = 4.5  # within which candidates of a window are not told apart
MISFIT: Final = 0.1  # of what is built in saves, that what comes and goes may leave within the log


@dataclass(frozen=True, slots=True)
class Hit:
    """A window in which something stands out, and the noise at its length."""

    from_s: float
    to_s: float
    log_p: float
    scale2: float
    signature: Signature
    margin_s: float = 0.0


@dataclass(frozen=True, slots=True)
class WindowFit:
    """A candidate fitted in a window: nat saved with its figures paid for, and without.

    data: the log as it was fitted, its motion as late as its poses or not.
    """

    signature: Signature
    nats: float
    saved: float
    values: tuple[float, ...]
    spreads: tuple[float, ...]
    data: Data


def as_good(fits: Sequence[WindowFit], *, inside: bool) -> list[WindowFit]:
    """Those within AS_GOOD_NATS of the best, each figure paid for by half of log N nat.

    What breaks another row needs not pay: that it has more figures is no proof against it (a turn
    of the attitude that looks like an azimuth).  Where it begins and ends within the log, nothing
    that is built in does, however little better its three figures follow what changed meanwhile:
    what comes and goes, and saves nearly as much, is then as good.
    """
    best = max(fits, key=lambda each: each.nats)
    good = _near(fits, best)
    passing = [each for each in fits if each.signature.candidate.effect.passing]
    if inside and passing:
        own = max(passing, key=lambda each: each.nats)
        if own.saved > (1.0 - MISFIT) * max(each.saved for each in fits):
            good += [each for each in _near(passing, own) if each not in good]
    return good


def _near(fits: Sequence[WindowFit], best: WindowFit) -> list[WindowFit]:
    row = _row(best.signature.candidate)
    return [
        each
        for each in fits
        if each.nats > best.nats - AS_GOOD_NATS
        or (_row(each.signature.candidate) != row and each.saved > best.saved - AS_GOOD_NATS)
    ]


def fitted(data: Data, model: Model, white: Precision, s: Signature, hit: Hit) -> WindowFit | None:
    """One candidate in a window, with motion that is as late as the poses there or is not.

    All of a log says whose stamps its columns of motion carry, and nothing of a while in which one
    of the devices was late.  Where both fit, the spread holds the other's value too.
    """
    found = _fitted_in(data, model, white, s, hit)
    if not _moves_motion(data, s.candidate):
        return found
    other = _fitted_in(_on_its_own(data, s.candidate), model, white, s, hit)
    both = sorted((each for each in (found, other) if each is not None), key=lambda f: -f.nats)
    if len(both) < 2 or both[1].nats < both[0].nats - AS_GOOD_NATS:
        return next(iter(both), None)
    off = np.subtract(both[0].values, both[1].values)
    return replace(both[0], spreads=tuple(map(float, np.hypot(both[0].spreads, off))))


def _moves_motion(data: Data, one: Candidate) -> bool:
    """Whether it delays poses whose slopes are taken to be as late as they are."""
    stage = data.view.log.stages[one.stage]
    late = {"position": stage.velocity_of_position, "attitude": stage.rate_of_attitude}
    return one.effect.comes_with == "stamps" and late.get(one.sensor, False)


def _on_its_own(data: Data, one: Candidate) -> Data:
    """The data with columns of motion that keep their time where a sensor's poses are late."""
    view = data.view
    motions = tuple(
        m.keeping_time(one.sensor) if k == one.stage else m for k, m in enumerate(view.motions)
    )
    own = Scene(view.system, view.log, motions, view.rows, view.known)
    return replace(data, view=own)


def _fitted_in(
    data: Data, model: Model, white: Precision, s: Signature, hit: Hit
) -> WindowFit | None:
    """One candidate in a window beside the model's effects, in the spec's white noise."""
    view = data.view
    own = in_stretch(data, s, (hit.from_s, hit.to_s))
    start = data.error(model.acting)
    acting, after, covariance = adjusted(data, (*model.acting, own), white, start, steps=6)
    slopes = s.candidate.effect.slopes()
    values = tuple(float(acting[-1].values[p.name]) for p in slopes)
    if any(abs(v) > p.high for v, p in zip(values, slopes, strict=True)):
        return None
    inside = (view.log.time_s >= hit.from_s) & (view.log.time_s <= hit.to_s)
    scale2 = max(hit.scale2, 1.0)
    rows = 3.0 * float(np.sum(inside))
    saved = white.negative_log_likelihood(model.error) - white.negative_log_likelihood(after)
    spreads = np.sqrt(scale2 * np.maximum(np.diag(covariance)[-len(slopes) :], 0.0))
    nats = saved / scale2 - 0.5 * len(slopes) * math.log(rows)
    return WindowFit(s, nats, saved / scale2, values, tuple(map(float, spreads)), data)


def in_stretch(data: Data, s: Signature, stretch: tuple[float, float]) -> Acting:
    """A candidate that acts from one stamp to another [s] alone, at zero."""
    one = s.candidate
    cut = cut_to(StampSpan(one.effect, *stretch), s, data.view.log.time_s)
    return Acting(cut.candidate.effect, one.sensor, one.stage, zero_values(one.effect))


def made(model: Model, fit: WindowFit) -> Array:
    """What a candidate would do to every row if it acted there (n, 3) [m]."""
    data = fit.data
    one = fit.signature.candidate
    values = {p.name: v for p, v in zip(one.effect.slopes(), fit.values, strict=True)}
    whole = Acting(one.effect, one.sensor, one.stage, {**zero_values(one.effect), **values})
    return data.error(model.acting) - data.error((*model.acting, whole))


def as_loud(structure: Structure, model: Model) -> NoiseLevel:
    """The spec's white noise, larger where the log has episodes of it, and along the motion."""
    return replace(as_specified(structure), episodes=True, size=model.level.size)


def _row(one: Candidate) -> tuple[str, str, int]:
    """What it breaks, of which sensor."""
    return one.effect.breaks, one.sensor, one.stage
