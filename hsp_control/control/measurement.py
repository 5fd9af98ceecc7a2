"""The measurement of a robot at one time, and the log channels of a run's parts."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from hsp_control.common.arrays import Array


class _NoWrenches(Mapping[str, Array]):
    """An empty, immutable mapping that can be pickled."""

    def __getitem__(self, key: str) -> Array:
        raise KeyError(key)

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0

    def __repr__(self) -> str:
        return "{}"


NO_WRENCHES: Mapping[str, Array] = _NoWrenches()
"""Wrenches of a robot without contact sensors."""


class Inertial(NamedTuple):
    """The reading of an inertial measurement unit: means over the period that ends.

    Both are in the axes that the frame had when the period began, so that an
    orientation R and a velocity v go on as R exp(ω h) and v + (R f + g) h, exactly.

    Attributes:
        frame: The frame that it is fixed to, and whose axes it has.
        angular_velocity: ω, of the gyroscope, shape (3,) [rad/s].
        specific_force: f, of the accelerometer: the acceleration of the frame's origin
            minus that of gravity, shape (3,) [m/s²].
    """

    frame: str
    angular_velocity: Array
    specific_force: Array


class Measurement(NamedTuple):
    """The measurement of a robot at one time, simulated or real.

    The pose and the twist of a floating base are the first entries of q and v: true
    ones in a simulation, or those of an estimator.

    Attributes:
        sequence: Number of the measurement; the robot increments it by one. A jump is
            the number of lost states; the same number again is an old state.
        t: Time of the measurement on the robot's own clock [s]; trajectories use it.
        q: Configuration, shape (nq,) [rad or m].
        v: Velocity, shape (nv,) [rad/s or m/s].
        age: State age, as far as the hardware knows it [s].
        halted: Whether the robot has stopped by itself and ignores efforts.
        applied: Effort the robot had when it measured, in the terms of
            `Hardware.write` (libfranka's ``tau_J_d``), shape (nv,), where the hardware
            knows it; None: the effort sent last is used.
        fault: Why the robot must be stopped safely, if hardware knows a reason.
        wrenches: The wrench of the world on the robot at every contact, by the name of
            its frame: force and moment about the frame's origin, world axes, shape (6,)
            [N, N·m]; of the period that ends now. Frames without one are missing.
        estimated: The frames whose wrench was not measured, but estimated.
        inertial: The reading of an inertial measurement unit; None: there is none.
    """

    sequence: int
    t: float
    q: Array
    v: Array
    age: float = 0.0
    halted: bool = False
    applied: Array | None = None
    fault: str = ""
    wrenches: Mapping[str, Array] = NO_WRENCHES
    estimated: frozenset[str] = frozenset()
    inertial: Inertial | None = None

    def normal_force(self, frame: str, normal: Array) -> float | None:
        """Return the normal force of the world on a frame [N].

        None if the frame has no sensor.
        """
        wrench = self.wrenches.get(frame)
        return None if wrench is None else float(normal @ wrench[:3])


class LogChannel(NamedTuple):
    """A value that a plant or a compensator reports; it becomes a column of the log.

    Attributes:
        value: A number, or an array of constant shape.
        unit: Its SI unit.
        meaning: A short description.
    """

    value: Array | float
    unit: str
    meaning: str
