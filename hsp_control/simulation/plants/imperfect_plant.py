"""A plant with imperfect sensors and drives.

Parts have independent random numbers: adding one does not change those of the others.
"""

from collections.abc import Mapping, Sequence
from typing import Any
from zlib import crc32

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.measurement import Inertial, LogChannel
from hsp_control.declaration import within
from hsp_control.engine import Dynamics
from hsp_control.simulation.plants.drives import Drive, Driving, RunningLag
from hsp_control.simulation.plants.plant import SampledPlant, to_json_data
from hsp_control.simulation.plants.sensors import RunningImu, Sensing, Sensor


def seeded_generator(seed: int, name: str) -> np.random.Generator:
    """Return a new generator for a plant's seed and the name of the part's class."""
    return np.random.default_rng([seed, crc32(name.encode())])


class ImperfectPlant(SampledPlant):
    """A plant whose measurements and efforts pass through imperfect sensors and drives.

    The measured state and the applied effort are logged beside the true state and the
    commanded effort. A copy, or a pickle, begins its sensors and drives anew.
    """

    def __init__(
        self,
        plant: SampledPlant,
        sensors: Sequence[Sensor] = (),
        drives: Sequence[Drive] = (),
        seed: int = 0,
    ) -> None:
        """Set the plant, and the sensors and drives between it and the controller."""
        super().__init__(plant.robot)
        self.plant = plant
        self.sensors, self.drives = tuple(sensors), tuple(drives)
        self.seed = seed
        self.sensor_delay = sum(sensor.periods for sensor in sensors)
        self.effort_delay = sum(drive.periods for drive in drives)
        self.effort_lag = sum(drive.lag for drive in drives)
        self._measured = plant.robot.neutral(), np.zeros(plant.robot.nv)
        self._applied: Array | None = None
        self._begin(*self._measured)

    @property
    def dynamics(self) -> Dynamics | None:
        """Those of the plant; see `Plant.dynamics`."""
        return self.plant.dynamics

    def reset(self, t: float, q: Array, v: Array) -> None:
        """Reset the plant, the sensors and the drives; see `SampledPlant.reset`."""
        self.plant.reset(t, q, v)
        self._begin(q, v)
        self._applied = None

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the output of the last sensor; see `SampledPlant.measure`."""
        q, v = self.plant.measure(t, q, v)
        if not self._begun:
            self._begin(q, v)
        for sense in self._sensing:
            q, v = sense(t, q, v)
        self._measured = q, v
        return q, v

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Advance under the output of the drives; see `SampledPlant.advance`."""
        effort, delay = tau, 0.0
        if not self._begun:
            self._begin(*self._measured)
        for drive in self._driving:
            if isinstance(drive, RunningLag):
                drive.period = end - t
            effort, later = drive(effort)
            delay += later
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

    def contact_wrenches(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, Array]:
        """Return the plant's, under the effort that acted; these are exact."""
        applied = tau if self._applied is None else self._applied
        return self.plant.contact_wrenches(t, q, v, applied)

    def inertial(self) -> Inertial | None:
        """Return the reading of its IMU, or of the plant's."""
        for sense in self._sensing:
            if isinstance(sense, RunningImu):
                return sense.reading
        return self.plant.inertial()

    def describe(self) -> dict[str, Any]:
        """Return the plant's description, and its sensors and drives."""
        return {
            **self.plant.describe(),
            "sensors": to_json_data(self.sensors),
            "drives": to_json_data(self.drives),
            "seed": self.seed,
        }

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "_sensing": [], "_driving": [], "_begun": False}

    def _begin(self, q: Array, v: Array) -> None:
        """Begin all sensors and drives, for a start at (q, v)."""
        self._sensing: list[Sensing] = []
        self._driving: list[Driving] = []
        self._begun = True  # not in a copy
        for sensor in self.sensors:
            with within("sensors", sensor.yaml_type or type(sensor).__name__):
                random = seeded_generator(self.seed, type(sensor).__name__)
                self._sensing.append(sensor.begin(self.robot, q, v, random))
        for drive in self.drives:
            with within("drives", drive.yaml_type or type(drive).__name__):
                random = seeded_generator(self.seed, type(drive).__name__)
                self._driving.append(drive.begin(self.robot, random))
