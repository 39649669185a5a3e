"""Stubs of catalog entries: every key of a type, to be filled in from a data sheet.

A figure still to be filled in is a bare `_`, which no reader takes for a number: a stub that was
forgotten is refused, with its line.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import chain, count
from typing import Final

from syncline_design.spec.catalog import SECTIONS

_SOURCES = """\
    figures:                             # what the source prints, figure by figure
      {first}: {{figure: _ {unit}, kind: 1 sigma, source: "_", address: "_", read: {day}}}
      # kinds: 1 sigma, rms, drms, 2drms, cep50, 95 %, median, max, typical, resolution, beam width
"""
_BOUGHT = """\
    cost: _ EUR                          # or price_class: 1000 EUR .. 3000 EUR
    mass: _ kg
    power: _ W
    lifecycle: {{status: active, read: {day}}}
    basis: {{cost: assumption, mass: assumption, power: assumption}}   # what no source gives
"""
_RANGING = """\
    modality: ranging
    type: {type}
    sigma_range: _ cm                    # one standard deviation
    sigma_bearing: [_ deg, _ deg]        # azimuth, elevation
    primitives: []                       # of pps, network, tov, trigger
    reach: {{min: _ m, max: _ m}}          # or max: {{10 %: _ m, 80 %: _ m}}
    medium: {medium}
    field_of_view: {{azimuth: _ deg .. _ deg, elevation: _ deg .. _ deg}}
    rate: _ Hz
"""
_POSITION = """\
    modality: position
    type: gnss
    sigma_position: [_ cm, _ cm, _ cm]   # north, east, down; one standard deviation each
    primitives: []                       # of pps, network, tov, trigger
    needs: [gnss]
    rate: _ Hz
"""
_ATTITUDE = """\
    modality: attitude
    type: {type}
    sigma_attitude: [_ deg, _ deg, _ deg]   # roll, pitch, yaw; one standard deviation each
    primitives: []                       # of pps, network, tov, trigger
    rate: _ Hz
"""
_METHOD = """\
    primitives: [pps]                    # of pps, network, tov, trigger, arrival
    timeline: host                       # or utc
    error: {{distribution: uniform, low: _ us, high: _ us}}
"""
_CLOCK = """\
    offset: {{distribution: uniform, low: _ us, high: _ us}}   # host against UTC
"""
_HARDWARE = """\
    channels: _
"""
_PLATFORM = """\
    v_max: _ m/s
    omega_max: _ deg/s
    distance: _ m
    baseline: _ m
    source: "_"
"""
_UNDER_WATER = "    depth_rating: _ m\n"

# type: section, keys of its own, which figure is sourced first, its unit, words put in
_TYPES: Final[dict[str, tuple[str, str, str, str, dict[str, str]]]] = {
    "gnss": ("sensors", _POSITION, "sigma_position.horizontal", "m", {}),
    "ins": ("sensors", _ATTITUDE, "sigma_attitude.roll_pitch", "deg", {"type": "ins"}),
    "ahrs": ("sensors", _ATTITUDE, "sigma_attitude.roll_pitch", "deg", {"type": "ahrs"}),
    "mru": ("sensors", _ATTITUDE, "sigma_attitude.roll_pitch", "deg", {"type": "mru"}),
    "gnss_compass": (
        "sensors", _ATTITUDE, "sigma_attitude.yaw", "deg", {"type": "gnss_compass"},
    ),
    **{
        name: ("sensors", _RANGING, "sigma_range", "cm", {"type": name, "medium": "air"})
        for name in ("lidar", "lidar_2d", "rangefinder", "stereo_camera", "tof_camera", "radar")
    },
    **{
        name: (
            "sensors", _RANGING + _UNDER_WATER, "sigma_range", "cm",
            {"type": name, "medium": "water"},
        )
        for name in ("usbl", "mbes", "single_beam", "imaging_sonar")
    },
    "timestamping": ("timestamping", _METHOD, "error", "us", {}),
    "clock": ("clocks", _CLOCK, "offset", "us", {}),
    "infrastructure": ("infrastructure", _HARDWARE, "cost", "EUR", {}),
    "platform": ("platforms", _PLATFORM, "", "", {}),
}  # fmt: skip
STUB_TYPES: Final = tuple(_TYPES)


def stub(kind: str, day: str, taken: Callable[[str, str], bool]) -> tuple[str, str]:
    """Section and text of an entry of a type, its figures still to be filled in.

    taken: whether a section has an id already; the stub's is numbered then.
    """
    section, own, first, unit, words = _TYPES[kind]
    names = (f"new_{kind}{end}" for end in chain([""], (f"_{n}" for n in count(2))))
    identity = next(name for name in names if not taken(section, name))
    text = f"  {identity}:                        # id: maker_model_variant, for years\n"
    text += '    name: "_"\n' + own.format(**words)
    if section != "platforms":
        text += _BOUGHT.format(day=day) + _SOURCES.format(first=first, unit=unit, day=day)
    return section, text


def put_in(catalog: str, section: str, entry: str) -> str:
    """A catalog's text with an entry at the end of its section, which is added if need be."""
    lines = catalog.splitlines(keepends=True)
    if lines and not lines[-1].endswith("\n"):
        lines[-1] += "\n"
    start = next((n for n, line in enumerate(lines) if line.startswith(f"{section}:")), None)
    if start is None:
        gap = "\n" if lines and lines[-1].strip() else ""
        return "".join(lines) + f"{gap}{section}:\n{entry}"
    end = next((n for n in range(start + 1, len(lines)) if _begins_a_section(lines[n])), len(lines))
    while end > start + 1 and not lines[end - 1].strip():
        end -= 1
    return "".join(lines[:end]) + "\n" + entry + "".join(lines[end:])


def _begins_a_section(line: str) -> bool:
    return line.partition(":")[0] in (*SECTIONS, "catalogs")
