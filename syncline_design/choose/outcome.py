"""What a choice comes to, as values."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from syncline_design.design_space import Design

Method = Literal["auto", "front", "milp", "enumerate"]
METHODS: tuple[Method, ...] = ("auto", "front", "milp", "enumerate")


class NoVerdict(Exception):  # noqa: N818 - an outcome with its own exit code, not a failure
    """No proven answer: a time limit, a missing solver, or roads that disagree."""


class TooLarge(NoVerdict):
    """One road gives up; another may still do it."""


@dataclass(frozen=True, slots=True)
class FrontPoint:
    """One point of the exact front: the least of a resource for this error, and the design."""

    amount: Fraction
    error_m: float
    design: Design


@dataclass(frozen=True, slots=True)
class Proof:
    """How a choice was proven: the road, and that every constraint was recomputed exactly."""

    method: str
    optimal: bool
    rechecked: bool
    agrees_with: tuple[str, ...] = ()  # further roads that gave the same answer


@dataclass(frozen=True, slots=True)
class Choice:
    """The best design."""

    design: Design
    proof: Proof


@dataclass(frozen=True, slots=True)
class Infeasible:
    """No design meets every requirement; proven by `proof.method`."""

    proof: Proof
    empty_roles: tuple[int, ...] = ()
