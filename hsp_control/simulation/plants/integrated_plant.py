"""A continuous plant with an integrator, as a sampled plant."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.log_channel import LogChannel
from hsp_control.robot.integrators import Advance, Integrator
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
        self._tau = np.zeros(plant.robot.nv)
        self._advance: Advance | None = None  # begun where it is needed

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy or a pickle needs: the integrator begins anew there."""
        return vars(self) | {"_advance": None}

    def reset(self, t: float, q: Array, v: Array) -> None:
        """Set the state; see `SampledPlant.reset`."""
        self._q, self._v = q.copy(), v.copy()

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Integrate from t to ``end``; see `SampledPlant.advance`."""
        if self._advance is None:
            self._advance = self.integrator.begin(
                self.robot, lambda q, v: self.plant.bind(q, v, self._tau)
            )
        self._tau[:] = tau
        self._q, self._v = self._advance(t, end, self._q, self._v)
        return self._q, self._v

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, LogChannel]:
        """Return the continuous plant's log channels."""
        return self.plant.log_channels(t, q, v, tau)

    def contact_wrenches(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, Array]:
        """Return the continuous plant's; see `Plant.contact_wrenches`."""
        return self.plant.contact_wrenches(t, q, v, tau)

    def describe(self) -> dict[str, Any]:
        """Return the continuous plant's description."""
        return self.plant.describe()
