"""A continuous plant with an integrator, as a sampled plant."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.measurement import LogChannel
from hsp_control.robot.integrators import Advance, Integrator, Steps
from hsp_control.simulation.plants.plant import ContinuousPlant, SampledPlant


class IntegratedPlant(SampledPlant):
    """A continuous plant and its integrator, under efforts that are held.

    Attributes:
        plant: The continuous plant.
        integrator: The integrator.
        effort: The effort that is held, shape (nv,).
    """

    def __init__(self, plant: ContinuousPlant, integrator: Integrator) -> None:
        super().__init__(plant.robot)
        self.plant = plant
        self.integrator = integrator
        self._q, self._v = plant.robot.neutral(), np.zeros(plant.robot.nv)
        self.effort = np.zeros(plant.robot.nv)
        self._advance: Advance | None = None  # begun where it is needed

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_advance": None}

    def reset(self, t: float, q: Array, v: Array) -> None:
        """Set the state; see `SampledPlant.reset`."""
        self._q, self._v = q.copy(), v.copy()

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Integrate from t to ``end``; see `SampledPlant.advance`."""
        advance = self._advance or self._begin()
        self.effort[:] = tau
        self._q, self._v = advance(t, end, self._q, self._v)
        return self._q, self._v

    def _begin(self) -> Advance:
        """Begin the integrator."""
        self._advance = self.integrator.begin(
            self.robot, lambda q, v: self.plant.bind(q, v, self.effort)
        )
        return self._advance

    def native_steps(self) -> Steps | None:
        """Return the steps that `advance` takes, if they are native.

        Whoever calls them begins with `hold`, and ends with `moved`.
        """
        steps = self._advance or self._begin()
        return steps if isinstance(steps, Steps) and steps.native is not None else None

    def hold(self, steps: Steps, tau: Array) -> None:
        """Write the present state and an effort, (nv,), where native steps read it."""
        steps.q[:], steps.v[:], self.effort[:] = self._q, self._v, tau

    def moved(self, steps: Steps) -> tuple[Array, Array]:
        """Go on where native steps have ended; return (q, v) there, as `advance`."""
        self._q, self._v = steps.q.copy(), steps.v.copy()
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
