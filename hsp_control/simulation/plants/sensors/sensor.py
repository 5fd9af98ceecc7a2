"""The base class of sensors."""

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

Sensing: TypeAlias = Callable[[float, Array, Array], tuple[Array, Array]]
"""(t, q, v) from the sensor before ↦ (q, v) as measured; called once per period."""


class Sensor(Part, ABC, family="sensors", error=SimulationError):
    """One imperfection of the measurements; several make a chain.

    A subclass declares its parameters as fields (see `Part`) and implements `begin`.
    A sensor knows no robot and has no memory: `begin` makes what runs.

    A plant applies its sensors in the order of their stages, whatever the order in
    which they are given: `SensorDelay` 10, `Imu` 15, `PositionNoise` 20, `Encoder` 30,
    `DifferencedVelocity` 40, `VelocityNoise` 50. A new sensor chooses a number between
    its neighbours; the default is behind all of these.

    Attributes:
        stage: The place in the chain.
    """

    stage: ClassVar[float] = 100.0

    @property
    def active(self) -> bool:
        """Whether it changes anything; a plant leaves out a sensor that does not."""
        return True

    @property
    def periods(self) -> int:
        """By how many control periods it delays the state, for the rate check."""
        return 0

    @abstractmethod
    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return what measures in one run: a function with a memory of its own.

        Args:
            robot: The simulated robot.
            q: True configuration at the start, shape (nq,).
            v: True velocity at the start, shape (nv,).
            random: The random numbers of this sensor in this run.

        Raises:
            SimulationError: If a field does not fit the robot.
        """


def _in_order(sensors: tuple[Sensor, ...]) -> tuple[Sensor, ...]:
    return tuple(sorted(sensors, key=lambda sensor: sensor.stage))


Sensors = Annotated[Sequence[Sensor], ByType(Sensor), AfterValidator(_in_order)]
"""A chain: a sequence in Python, a mapping by type in YAML; stored by stage."""
