"""An inertial measurement unit: gyroscope and accelerometer, with noise and biases."""

from dataclasses import KW_ONLY
from typing import ClassVar

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.rotations import log3
from hsp_control.control.measurement import Inertial
from hsp_control.declaration import within
from hsp_control.declaration.quantities import NonNegative
from hsp_control.robot import Robot
from hsp_control.simulation.plants.sensors.sensor import Sensing, Sensor


class Imu(Sensor, type="imu"):
    """A gyroscope and an accelerometer at a frame; q and v stay as they are.

    It reports means over a period: by how much the orientation R and the velocity v of
    the frame have changed from one measurement to the next, in the axes of the first,

        ω = log(R₀ᵀ R) / h + b_g + n_g,    f = R₀ᵀ ((v - v₀) / h - g) + b_a + n_a,

    as units do that sample fast and integrate. So it works with every engine, and no
    impact is lost. At the first measurement the frame counts as unaccelerated.

    The white noise n of density σ has the standard deviation σ / √h; the biases b are
    drawn at the start, and walk. The defaults are those of the ADIS16448, as in the
    EuRoC data set (Burri et al. 2016, Int. J. Robotics Research).
    """

    stage: ClassVar[float] = 15.0

    frame: str
    """Name of the frame that it is fixed to [-]."""
    _: KW_ONLY
    gyroscope_noise: NonNegative = 1.7e-4
    """Density of the gyroscope's white noise [rad/s/√Hz]."""
    accelerometer_noise: NonNegative = 2.0e-3
    """Density of the accelerometer's white noise [m/s²/√Hz]."""
    gyroscope_walk: NonNegative = 2.0e-5
    """Density of the rate of the gyroscope's bias [rad/s²/√Hz]."""
    accelerometer_walk: NonNegative = 3.0e-3
    """Density of the rate of the accelerometer's bias [m/s³/√Hz]."""
    gyroscope_bias: NonNegative = 2.0e-3
    """Standard deviation of the gyroscope's bias at the start [rad/s]."""
    accelerometer_bias: NonNegative = 0.03
    """Standard deviation of the accelerometer's bias at the start [m/s²]."""

    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return what measures; see `Sensor.begin`.

        Raises:
            FrameNotFoundError: If the frame does not exist.
        """
        with within("frame"):
            frame = robot.frame_id(self.frame)
        return RunningImu(self, robot, frame, random)


class RunningImu:
    """An `Imu` in one run."""

    def __init__(
        self, imu: Imu, robot: Robot, frame: int, random: np.random.Generator
    ) -> None:
        """Draw the biases."""
        self._imu, self._model, self._frame = imu, robot.model, frame
        self._data = robot.model.createData()
        self._random = random
        # b_g, shape (3,) [rad/s]
        self.gyroscope_bias: Array = imu.gyroscope_bias * random.standard_normal(3)
        # b_a, shape (3,) [m/s²]
        self.accelerometer_bias: Array = imu.accelerometer_bias * (
            random.standard_normal(3)
        )
        # what it reported last
        self.reading = Inertial(imu.frame, np.zeros(3), np.zeros(3))
        self._last: tuple[float, Array, Array] | None = None

    def __call__(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Measure, and return q and v as they are."""
        model, data = self._model, self._data
        pin.forwardKinematics(model, data, q, v)
        R = pin.updateFramePlacement(model, data, self._frame).rotation.copy()
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        motion = pin.getFrameVelocity(model, data, self._frame, axes)
        velocity, gravity = motion.linear.copy(), model.gravity.linear
        omega = R.T @ motion.angular
        force = -R.T @ gravity
        if self._last is not None and t > self._last[0]:
            before, R_before, v_before = self._last
            h = t - before
            log3(R_before.T @ R, omega)
            omega = omega / h
            force = R_before.T @ ((velocity - v_before) / h - gravity)
            omega = omega + self._noise(self._imu.gyroscope_noise, h)
            force = force + self._noise(self._imu.accelerometer_noise, h)
            self.gyroscope_bias = self.gyroscope_bias + h * self._noise(
                self._imu.gyroscope_walk, h
            )
            self.accelerometer_bias = self.accelerometer_bias + h * self._noise(
                self._imu.accelerometer_walk, h
            )
        self._last = t, R, velocity
        self.reading = Inertial(
            self._imu.frame,
            omega + self.gyroscope_bias,
            force + self.accelerometer_bias,
        )
        return q, v

    def _noise(self, density: float, h: float) -> Array:
        """Return white noise of a density, as its mean over h [s] has it."""
        return np.asarray(density / np.sqrt(h) * self._random.standard_normal(3))
