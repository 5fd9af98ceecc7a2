"""A continuous plant with an integrator, as a sampled plant."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.log_channel import LogChannel
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants.plant import ContinuousPlant, SampledPlant


class IntegratedPlant(SampledPlant):
    """A continuous plant and its integrator, under efforts that are held.

    Attributes:
        plant: The continuous plant.
        integrator: The integrator.
    """

    def __init__(self, plant: ContinuousPlant, integrator: Integrator) -> None:
        """Set the plant and the integrator."""
        super().__init__(plant.robot)
        self.plant = plant
        self.integrator = integrator
        self._q, self._v = plant.robot.neutral(), np.zeros(plant.robot.nv)

    def reset(self, t: float, q: Array, v: Array) -> None:
        """Set the state; see `SampledPlant.reset`."""
        self._q, self._v = q.copy(), v.copy()

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Integrate from t to ``end``; see `SampledPlant.advance`."""
        dynamics = partial(_acceleration, self.plant, tau)
        self._q, self._v = self.integrator.advance(
            self.robot, dynamics, t, end, self._q, self._v
        )
        return self._q, self._v

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, LogChannel]:
        """Return the continuous plant's log channels."""
        return self.plant.log_channels(t, q, v, tau)

    def describe(self) -> dict[str, Any]:
        """Return the continuous plant's description."""
        return self.plant.describe()


def _acceleration(
    plant: ContinuousPlant, tau: Array, t: float, q: Array, v: Array
) -> Array:
    """Return v' under a held effort; a function, because pickle takes no lambda."""
    return plant.acceleration(t, q, v, tau)
