"""The three roles of a stage; what a sensor can do (its modality) is the role that it fills."""

from typing import Final, Literal

RoleName = Literal["position", "attitude", "ranging"]
ROLES: Final[tuple[RoleName, ...]] = ("position", "attitude", "ranging")
