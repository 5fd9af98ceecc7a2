"""A plant behind sensors and drives that are not perfect."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.log_channel import LogChannel
from hsp_control.simulation.plants.describing import described
from hsp_control.simulation.plants.drives import Drive
from hsp_control.simulation.plants.plant import SampledPlant
from hsp_control.simulation.plants.sensors import Sensor


class ImperfectPlant(SampledPlant):
    """A plant whose state is measured, and whose effort arrives, imperfectly.

    The log has what was measured beside the truth, and the effort that acted beside the
    commanded one.

    Attributes:
        plant: What moves.
        sensors: From the true state to the controller, in this order.
        drives: From the controller to the joints, in this order.
    """

    def __init__(
        self,
        plant: SampledPlant,
        sensors: Sequence[Sensor] = (),
        drives: Sequence[Drive] = (),
    ) -> None:
        """Set the plant and what is between it and the controller."""
        super().__init__(plant.robot)
        self.plant = plant
        self.sensors, self.drives = tuple(sensors), tuple(drives)
        self._measured = plant.robot.neutral(), np.zeros(plant.robot.nv)
        self._applied: Array | None = None

    def reset(self, t: float, q: Array, v: Array) -> None:
        """Reset the plant, the sensors and the drives; see `SampledPlant.reset`."""
        self.plant.reset(t, q, v)
        for sensor in self.sensors:
            sensor.reset(self.robot, t, q, v)
        for drive in self.drives:
            drive.reset(self.robot)
        self._applied = None

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return what the last sensor passes on; see `SampledPlant.measure`."""
        q, v = self.plant.measure(t, q, v)
        for sensor in self.sensors:
            q, v = sensor.measure(t, q, v)
        self._measured = q, v
        return q, v

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Move on under what the drives make of it; see `SampledPlant.advance`."""
        effort, lateness = tau, 0.0
        for drive in self.drives:
            effort = drive.apply(effort)
            lateness += drive.lateness()
        arrival = min(t + lateness, end)
        if self._applied is not None and arrival > t:
            state = self.plant.advance(t, arrival, self._applied)
            if arrival == end:
                self._applied = effort
                return state
            t = arrival
        self._applied = effort
        return self.plant.advance(t, end, effort)

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, LogChannel]:
        """Return what was measured, what acted, and the plant's own readings."""
        acted = tau if self._applied is None else self._applied
        q_measured, v_measured = self._measured
        return {
            "measured.q": LogChannel(
                q_measured, "rad or m", "configuration as measured"
            ),
            "measured.v": LogChannel(
                v_measured, "rad/s or m/s", "velocity as measured"
            ),
            "applied.tau": LogChannel(
                acted, "N·m or N", "effort that acted just before"
            ),
            **self.plant.log_channels(t, q, v, acted),
        }

    def describe(self) -> dict[str, Any]:
        """Return the plant's description, and its imperfections."""
        return {
            **self.plant.describe(),
            "sensors": described(self.sensors),
            "drives": described(self.drives),
        }
