"""The base class of drives."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Annotated, ClassVar, TypeAlias

import numpy as np
from pydantic import AfterValidator

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.declaration import Part
from hsp_control.declaration.by_type import ByType
from hsp_control.robot import Robot

Driving: TypeAlias = Callable[[Array], tuple[Array, float]]
"""Effort from the drive before, shape (nv,) ↦ the effort that acts, and how long after
the start of the period it begins to [s]; called once per period."""


class Drive(Part, ABC, family="drives", error=SimulationError):
    """One imperfection of the actuation; several make a chain.

    A subclass declares its parameters as fields (see `Part`) and implements `begin`.
    A drive knows no robot and has no memory: `begin` makes what runs.

    A plant applies its drives in the order of their stages, whatever the order in which
    they are given: `DroppedPeriods` 10, `EffortDelay` 20, `Jitter` 30, `EffortNoise`
    40, `Saturation` 50. A new drive chooses a number between its neighbours; the
    default is behind all of these.

    Attributes:
        stage: The place in the chain.
    """

    stage: ClassVar[float] = 100.0

    @property
    def active(self) -> bool:
        """Whether it changes anything; a plant leaves out a drive that does not."""
        return True

    @property
    def periods(self) -> int:
        """By how many control periods it delays the effort, for the rate check."""
        return 0

    @abstractmethod
    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return what drives in one run: a function with a memory of its own.

        Args:
            robot: The simulated robot.
            random: The random numbers of this drive in this run.

        Raises:
            SimulationError: If a field does not fit the robot.
        """


def _in_order(drives: tuple[Drive, ...]) -> tuple[Drive, ...]:
    return tuple(sorted(drives, key=lambda drive: drive.stage))


Drives = Annotated[Sequence[Drive], ByType(Drive), AfterValidator(_in_order)]
"""A chain: a sequence in Python, a mapping by type in YAML; stored by stage."""
