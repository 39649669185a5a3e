"""syncline-design: choose, verify and diagnose sensor payloads and their time synchronisation.

Conventions, said once for the whole package
--------------------------------------------
- Plain floats are SI: metre, second, radian, kilogram, watt; suffixes say so where a value
  travels (`_m`, `_s`, `_rad`, `_mps`, `_radps`).
- Frames: n is north-east-down (NED), b is body forward-right-down (FRD).  `R_nb` takes body
  vectors to NED and is built from yaw-pitch-roll (ZYX) Euler angles.
- Bearing: `n = [cos(az) cos(el), sin(az) cos(el), -sin(el)]`.
- Timestamp error: a measurement stamped t was valid at t + mu.  `latency = -mu`, positive when
  the data are older than their stamp.
- Arrays: rows first; vectors are (n, 3), rotations (n, 3, 3).
"""

from importlib import import_module

TYPE_CHECKING = False  # of `typing`, which would double the time of this import
if TYPE_CHECKING:
    from syncline_design.api import (
        BadInput,
        Case,
        NoVerdict,
        OutOfTime,
        accept,
        audit,
        check,
        diagnose,
        diff,
        load,
        optimize,
        plan,
        reproduce,
        simulate,
        study,
        timing,
        watch,
    )

__version__ = "0.1.0"

__all__ = [
    "BadInput",
    "Case",
    "NoVerdict",
    "OutOfTime",
    "__version__",
    "accept",
    "audit",
    "check",
    "diagnose",
    "diff",
    "load",
    "optimize",
    "plan",
    "reproduce",
    "simulate",
    "study",
    "timing",
    "watch",
]


def __getattr__(name: str) -> object:
    """The functions of `api`, loaded when one of them is first used."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    found = globals()[name] = getattr(import_module(f"{__name__}.api"), name)
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__} - {"TYPE_CHECKING", "import_module"})
