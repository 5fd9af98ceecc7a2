"""Which sensors a robot has besides those of its joints, and how packets hold them."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
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

        With too few or too many numbers the last parts have wrong shapes, for
        `valid_measurement` to refuse.
        """
        sizes = [robot.nq, robot.nv] + [_EACH] * len(self.wrenches)
        sizes += [3, 3] if self.inertial is not None else []
        q, v, *rest = np.split(numbers, np.cumsum(sizes))
        inertial = None
        if self.inertial is not None:
            inertial = Inertial(self.inertial, rest[-3], rest[-2])
        return Measurement(
            0,
            0.0,
            q,
            v,
            applied=rest[-1] if rest[-1].size else None,
            wrenches=dict(zip(self.wrenches, rest, strict=False)),
            inertial=inertial,
        )
