"""Sensors: they turn the true state into the measured one."""

from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY
from typing import Annotated, ClassVar, TypeAlias

import numpy as np
import pinocchio as pin
from pydantic import AfterValidator

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.control.measurement import Inertial
from hsp_control.declaration import within
from hsp_control.declaration.by_type import ByType
from hsp_control.declaration.quantities import NonNegative, Periods, Weights
from hsp_control.engine.rotations import log3
from hsp_control.robot import Robot
from hsp_control.simulation.plants.plant import Imperfection, in_order

Sensing: TypeAlias = Callable[[float, Array, Array], tuple[Array, Array]]
"""(t, q, v) from the sensor before ↦ (q, v) as measured; called once per period."""


class Sensor(Imperfection, family="sensors", error=SimulationError):
    """One imperfection of the measurements; several make a chain.

    A subclass declares its parameters as fields (see `Part`) and implements `begin`.
    Stages: `SensorDelay` 10, `Imu` 15, `PositionNoise` 20, `Encoder` 30,
    `DifferencedVelocity` 40, `VelocityNoise` 50; see `Imperfection`.
    """

    @abstractmethod
    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return the sensor in one run: a function with its own memory.

        Args:
            robot: The simulated robot.
            q: True configuration at the start, shape (nq,).
            v: True velocity at the start, shape (nv,).
            random: The random numbers of this sensor in this run.

        Raises:
            SimulationError: If a field does not fit the robot.
        """


Sensors = Annotated[Sequence[Sensor], ByType(Sensor), AfterValidator(in_order)]
"""A chain: a sequence in Python, a mapping by type in YAML; stored by stage."""


class DifferencedVelocity(Sensor, type="differenced_velocity"):
    """The difference of the last two measured positions, over the time between them.

    Its delay is half a period, and its resolution is one encoder count per period. At
    the first measurement, and for a root, the velocity is passed on unchanged.
    """

    stage: ClassVar[float] = 40.0

    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return a function that replaces joint velocities; see `Sensor.begin`."""
        joints = robot.is_single_dof()
        last: tuple[float, Array] | None = None

        def sense(t: float, q: Array, v: Array) -> tuple[Array, Array]:
            nonlocal last
            if last is not None and t > last[0]:
                rate = robot.difference(last[1], q) / (t - last[0])
                v = np.where(joints, rate, v)
            last = (t, q.copy())
            return q, v

        return sense


class Encoder(Sensor, type="encoder_resolution"):
    """Joint positions rounded to the encoder's resolution; a root is exact."""

    stage: ClassVar[float] = 30.0
    strength: ClassVar[str] = "resolution"

    resolution: Weights
    """Resolution of the encoders [rad or m], one number or nv: 2π/2¹⁹ for 19 bits per
    revolution; 0 is exact."""

    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return a function that rounds to the nearest count; see `Sensor.begin`."""
        with within("resolution"):
            given = robot.per_dof(self.resolution)
        rounded = given > 0.0
        count = np.where(rounded, given, 1.0)

        def sense(t: float, q: Array, v: Array) -> tuple[Array, Array]:
            position = robot.joint_positions(q)
            change = np.round(position / count) * count - position
            return robot.integrate(q, np.where(rounded, change, 0.0)), v

        return sense


class PositionNoise(Sensor, type="position_noise"):
    """Gaussian white noise on the configuration, in its tangent space."""

    stage: ClassVar[float] = 20.0
    strength: ClassVar[str] = "std"

    std: Weights
    """Standard deviation of position noise [rad or m], one number or nv."""

    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return a function that adds a random tangent vector to q; `Sensor.begin`."""
        with within("std"):
            std = robot.per_dof(self.std)
        return lambda t, q, v: (
            robot.integrate(q, std * random.standard_normal(robot.nv)),
            v,
        )


class VelocityNoise(Sensor, type="velocity_noise"):
    """Gaussian white noise on the velocity."""

    stage: ClassVar[float] = 50.0
    strength: ClassVar[str] = "std"

    std: Weights
    """Standard deviation of velocity noise [rad/s or m/s], one number or nv."""

    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return a function that adds noise to the velocity; see `Sensor.begin`."""
        with within("std"):
            std = robot.per_dof(self.std)
        return lambda t, q, v: (q, v + std * random.standard_normal(std.shape))


class SensorDelay(Sensor, type="delay"):
    """The state of some periods ago; at first the start state."""

    stage: ClassVar[float] = 10.0
    strength: ClassVar[str] = "periods"

    periods: Periods
    """Delay of the measurements [control periods]."""

    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return a queue that is full of the start state; see `Sensor.begin`."""
        queue = deque([(q.copy(), v.copy())] * self.periods)

        def sense(t: float, q: Array, v: Array) -> tuple[Array, Array]:
            queue.append((q.copy(), v.copy()))
            return queue.popleft()

        return sense


class Imu(Sensor, type="imu"):
    """A gyroscope and an accelerometer at a frame; q and v are not changed.

    It reports means over a period: by how much the orientation R and the velocity v of
    the frame have changed from one measurement to the next, in the axes of the first,

        ω = log(R₀ᵀ R) / h + b_g + n_g,    f = R₀ᵀ ((v - v₀) / h - g) + b_a + n_a,

    as units do that sample fast and integrate. So it works with every engine, and no
    impact is lost. At the first measurement the frame is taken as unaccelerated.

    The white noise n of density σ has the standard deviation σ / √h; the biases b are
    drawn at the start, and walk. The defaults are those of the ADIS16448, as in the
    EuRoC data set (Burri et al. 2016, Int. J. Robotics Research).
    """

    stage: ClassVar[float] = 15.0

    frame: str
    """Name of the frame to which it is fixed [-]."""
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
        """Return the running sensor; see `Sensor.begin`."""
        with within("frame"):
            frame = robot.frame_id(self.frame)
        return RunningImu(self, robot, frame, random)


class RunningImu:
    """An `Imu` in one run."""

    def __init__(
        self, imu: Imu, robot: Robot, frame: int, random: np.random.Generator
    ) -> None:
        self._imu, self._model, self._frame = imu, robot.model, frame
        self._data = robot.model.createData()
        self._random = random
        # b_g, shape (3,) [rad/s]
        self.gyroscope_bias: Array = imu.gyroscope_bias * random.standard_normal(3)
        # b_a, shape (3,) [m/s²]
        self.accelerometer_bias: Array = imu.accelerometer_bias * (
            random.standard_normal(3)
        )
        # its last reading
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
            omega = log3(R_before.T @ R) / h
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
