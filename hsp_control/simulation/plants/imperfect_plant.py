"""A plant with imperfect sensors and drives."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.log_channel import LogChannel
from hsp_control.simulation.plants.drives import Drive
from hsp_control.simulation.plants.json_data import to_json_data
from hsp_control.simulation.plants.plant import SampledPlant
from hsp_control.simulation.plants.sensors import Sensor


class ImperfectPlant(SampledPlant):
    """A plant whose measurements and efforts pass through imperfect sensors and drives.

    The measured state and the applied effort are logged beside the true state and the
    commanded effort.

    Attributes:
        plant: The plant that moves.
        sensors: The chain from the true state to the controller, in this order.
        drives: The chain from the controller to the joints, in this order.
    """

    def __init__(
        self,
        plant: SampledPlant,
        sensors: Sequence[Sensor] = (),
        drives: Sequence[Drive] = (),
    ) -> None:
        """Set the plant, and the sensors and drives between it and the controller.

        Args:
            plant: The plant that moves.
            sensors: The chain from the true state to the controller, in order.
            drives: The chain from the controller to the joints, in order.
        """
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
        """Return the output of the last sensor; see `SampledPlant.measure`."""
        q, v = self.plant.measure(t, q, v)
        for sensor in self.sensors:
            q, v = sensor.measure(t, q, v)
        self._measured = q, v
        return q, v

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Move on under the output of the drives; see `SampledPlant.advance`."""
        effort, delay = tau, 0.0
        for drive in self.drives:
            effort = drive.apply(effort)
            delay += drive.delay()
        arrival = min(t + delay, end)
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
        """Return measured state, applied effort, and the plant's own channels."""
        applied = tau if self._applied is None else self._applied
        q_measured, v_measured = self._measured
        return {
            "measured.q": LogChannel(
                q_measured, "rad or m", "configuration as measured"
            ),
            "measured.v": LogChannel(
                v_measured, "rad/s or m/s", "velocity as measured"
            ),
            "applied.tau": LogChannel(
                applied, "N·m or N", "effort that acted just before"
            ),
            **self.plant.log_channels(t, q, v, applied),
        }

    def describe(self) -> dict[str, Any]:
        """Return the plant's description, and its sensors and drives."""
        return {
            **self.plant.describe(),
            "sensors": to_json_data(self.sensors),
            "drives": to_json_data(self.drives),
        }
