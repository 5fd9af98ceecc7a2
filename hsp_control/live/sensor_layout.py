"""Which sensors a robot has besides those of its joints, and how packets hold them."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HardwareError
from hsp_control.control.measurement import Inertial, Measurement
from hsp_control.robot import Robot

_EACH = 6
"""Numbers of a wrench, and of what an inertial measurement unit reports."""


class SensorLayout(NamedTuple):
    """The sensors that both ends of a connection know.

    The numbers of a state are q, v, then six of each wrench in this order, then those
    of the inertial measurement unit (angular velocity, specific force), and at the end
    the effort that the robot has, if it has one.

    Attributes:
        wrenches: The frames whose wrench is measured; see `Measurement.wrenches`.
        inertial: The frame of the inertial measurement unit; None: there is none.
    """

    wrenches: tuple[str, ...] = ()
    inertial: str | None = None

    @classmethod
    def of(cls, measured: Measurement) -> "SensorLayout":
        """Return the layout of what a robot measures."""
        unit = measured.inertial
        return cls(tuple(measured.wrenches), None if unit is None else unit.frame)

    def pack(self, measured: Measurement) -> Array:
        """Return the numbers of a measurement with these sensors, shape (n,)."""
        parts = [measured.q, measured.v]
        parts += [measured.wrenches[frame] for frame in self.wrenches]
        if measured.inertial is not None:
            parts += measured.inertial[1:]
        if measured.applied is not None:
            parts.append(measured.applied)
        return np.concatenate(parts)

    def unpack(self, numbers: Array, robot: Robot) -> Measurement:
        """Return a measurement from its numbers; number and time of it are 0.

        Raises:
            HardwareError: If there are too few or too many numbers.
        """
        nq, nv = robot.nq, robot.nv
        own = nq + nv + _EACH * (len(self.wrenches) + (self.inertial is not None))
        if len(numbers) not in {own, own + nv}:
            sensors = [*self.wrenches, *([self.inertial] if self.inertial else [])]
            raise HardwareError(
                f"a state of the robot has {len(numbers)} numbers; needs {own}, or "
                f"{own + nv} with its effort: {nq} of q, {nv} of v, {_EACH} of each "
                f"sensor ({', '.join(sensors) or 'none'})"
            )
        rest = numbers[nq + nv : own].reshape(-1, _EACH)
        inertial = None
        if self.inertial is not None:
            inertial = Inertial(self.inertial, rest[-1, :3], rest[-1, 3:])
        return Measurement(
            0,
            0.0,
            numbers[:nq],
            numbers[nq : nq + nv],
            applied=numbers[own:] if len(numbers) > own else None,
            wrenches=dict(zip(self.wrenches, rest, strict=False)),
            inertial=inertial,
        )
