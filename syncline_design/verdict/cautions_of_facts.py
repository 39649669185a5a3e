"""What a verdict stands on that an entry does not tell, or tells of a better case than is asked."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from itertools import islice

from syncline_design.model.figure_text import format_quantity
from syncline_design.model.quantity import Dimension
from syncline_design.model.system import System
from syncline_design.spec.barred import path_medium, surroundings
from syncline_design.spec.case import Case, StageCase
from syncline_design.spec.catalog import Product, SensorEntry
from syncline_design.spec.existence import is_acoustic, not_told
from syncline_design.spec.noise_table import angles_of
from syncline_design.spec.plausibility import implausible
from syncline_design.verdict.design_data import UsedEntry
from syncline_design.verdict.tree import Caution
from syncline_design.verdict.verified import Verified

# The order in which a wrong guess costs: first what nothing works without.
FIRST = (
    "reach", "medium", "field_of_view", "rate", "sigma_range", "sigma_bearing", "depth_rating",
    "temperature",
)  # fmt: skip
Chosen = tuple[StageCase, str, SensorEntry]
MOST_LOOKED_AT = 100  # candidates of a spec without a design


def fact_cautions(case: Case, verified: Verified) -> tuple[Caution, ...]:
    """Facts that a rule of this spec needs of the chosen payload and nobody gives, the weightiest
    first; then what holds for bright objects alone."""
    chosen = list(_chosen(case, verified.system))
    silent = [caution for one in chosen for caution in _silent(case, one)]
    silent += [caution for one in chosen for caution in _pathless(one)]
    silent += [caution for one in chosen for caution in _untold_noise(one)]
    silent.sort(key=lambda one: FIRST.index((one.key or "").partition(".")[0]))
    names = {name for _, name, _ in chosen}
    doubtful = implausible_cautions(case, names)
    return (*doubtful, *silent, *_favoured(chosen), *_travelling(case, verified, chosen))


def implausible_cautions(case: Case, names: Container[str] | None = None) -> list[Caution]:
    """Figures of a spec that are hardly meant; names: of the sensors to look at (None: of all)."""
    every = (one for stage in case.stages for role in stage.roles for one in role.sensors)
    sensors = islice((one for one in every if names is None or one.id in names), MOST_LOOKED_AT)
    return [
        Caution("implausible", one.reason, entry=one.entry, key=one.key)
        for one in implausible(case, sensors)
    ]


def _chosen(case: Case, system: System) -> Iterator[Chosen]:
    for stage, found in zip(system.stages, case.stages, strict=True):
        for one in stage.sensors():
            role = found.role(one.role)
            entry = None if role is None else role.sensor(one.id)
            if entry is not None:
                yield found, one.id, entry


def _silent(case: Case, one: Chosen) -> Iterator[Caution]:
    stage, name, entry = one
    for fact in not_told(name, entry, surroundings(case, stage)):
        yield Caution("unknown-fact", fact.reason, entry=fact.entry, key=fact.key)


def _untold_noise(one: Chosen) -> Iterator[Caution]:
    """Noise that is told by range or angle, and used beyond its rows."""
    stage, name, entry = one
    for figure, table in entry.tables.items():
        told = float(table.is_told_to)
        if table.of == "range":
            asked, size = stage.platform.entry.distance, Dimension.LENGTH
            beyond = "its last line goes on"
        elif stage.choice.look is None or stage.choice.look.elevation is None:
            continue
        else:
            asked, size = float(angles_of(stage.choice.look)[1]), Dimension.ANGLE
            beyond = "its last row holds"
        if asked > told * (1.0 + 1e-12):
            ends = [format_quantity(value, size) for value in (told, asked)]
            message = f"{name} tells {figure} up to {ends[0]}, asked are {ends[1]}: {beyond}"
            yield Caution("unknown-fact", message, entry=name, key=figure)


def _pathless(one: Chosen) -> Iterator[Caution]:
    """A ranging sensor of one medium where nobody says what its path goes through."""
    stage, name, entry = one
    if entry.modality != "ranging" or entry.medium in (None, "both"):
        return
    if path_medium(stage) is None:
        yield Caution(
            "unknown-fact",
            f"{stage.choice.name} gives no medium, {name} measures through {entry.medium}: "
            "say in the stage what its path goes through",
            entry=stage.platform.id,
            key="medium",
        )


def _favoured(chosen: list[Chosen]) -> Iterator[Caution]:
    """A distance that is within reach only because the object is said to be bright."""
    for stage, name, entry in chosen:
        distance, share = stage.platform.entry.distance, stage.choice.reflectivity
        if entry.reach is not None and entry.reach.is_favourable(distance, share):
            shown = getattr(distance, "text", format_quantity(distance, Dimension.LENGTH))
            yield Caution(
                "favourable-reach",
                f"{name} reaches {shown} only with the reflectivity that {stage.choice.name} "
                "says its object has: darker ones are out of reach",
                entry=name,
                key="reach",
            )


def _travelling(case: Case, verified: Verified, chosen: list[Chosen]) -> Iterator[Caution]:
    """What vehicle and object move while sound is on its way: (v + d omega) 2 d / c [m], v
    with that of the vehicle that it locates, if it does.

    The maker takes it out (then no figure has it), or says that he does not (then the ledger has
    it), or nobody says: then no figure has it, and somebody has to look.
    """
    for stage, name, entry in chosen:
        if entry.modality != "ranging" or not is_acoustic(entry.type):
            continue
        platform, sound = stage.platform.entry, surroundings(case, stage).sound_speed
        echo = 2.0 * platform.distance / sound
        moved = (platform.v_max + platform.distance * platform.omega_max) * echo
        moved += sum(one.platform.entry.v_max * echo for one in case.stages[stage.index + 1 :][:1])
        where = (
            f"{name}: {stage.choice.name} and its object move up to "
            f"{format_quantity(moved, Dimension.LENGTH)} while sound is on its way "
            f"({format_quantity(echo, Dimension.TIME)})"
        )
        said = "; the entry says that the maker corrects for it, and no figure here has it"
        if entry.corrects == ():
            said = "; the entry says that the maker does not correct for it, and the ledger has it"
        elif entry.corrects is None and case.spec.strict_facts:
            said = "; nobody says whether the maker corrects for it, so the ledger has it"
        elif entry.corrects is None:
            turned = ", ".join(_turned(case, verified, moved))
            said = "; no figure here has it: look up whether the maker corrects for it"
            said += f", without that {turned} would fail" if turned else ""
        yield Caution("travel-time", where + said, entry=name, key="corrects")


def _turned(case: Case, verified: Verified, more_m: float) -> Iterator[str]:
    """Accuracy requirements that are kept, and would not be with so much more error."""
    total = verified.figures.total(case.spec.sync_model)
    for row in verified.requirements:
        if row.kind == "accuracy" and row.status == "pass" and total + more_m > row.limit:
            yield row.id


def lifecycle_cautions(entries: Iterable[UsedEntry]) -> Iterator[Caution]:
    """What is chosen though it is no longer sold, or not yet."""
    for one in entries:
        sold = one.entry.lifecycle if isinstance(one.entry, Product) else None
        if sold is not None and sold.status != "active":
            after = f"; {sold.successor} follows it" if sold.successor else ""
            message = f"{one.id} is {sold.status}, read {sold.read}{after}"
            yield Caution("discontinued", message, entry=one.id, key="lifecycle")
