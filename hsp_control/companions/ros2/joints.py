"""A robot's joints in messages that name them in any order."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError
from hsp_control.common.suggestions import did_you_mean
from hsp_control.companions.ros2.messages import Header, JointState, Time
from hsp_control.robot import Robot


class Joints:
    """Reads and writes the joints of a robot, whose order is that of v.

    Attributes:
        names: The joints, shape (nv,).
        others: Joints of the last message that the robot does not have.
    """

    def __init__(self, robot: Robot) -> None:
        """Read the joints of the robot."""
        if not robot.flat:
            many = next(j for j, model in robot.joints.items() if model.nv > 1)
            raise HardwareError(
                f"ros2:// carries one number for a joint; {many!r} has "
                f"{robot.joints[many].nv} degrees of freedom"
            )
        self._robot = robot
        self.names = robot.dof_names
        self.others: tuple[str, ...] = ()
        self._known: list[str] = []
        self._order: list[int] = []

    def state(self, message: JointState, topic: str) -> tuple[Array, Array] | None:
        """Return q, shape (nq,), and v, shape (nv,); None if it has no joint of ours.

        Numbers may be NaN: the loop checks them.
        """
        if message.name != self._known:
            order = self._found(message.name, topic)
            if not order:
                return None
            self._known, self._order = list(message.name), order
        for what in ("position", "velocity"):
            count = len(getattr(message, what))
            if count != len(message.name):
                raise HardwareError(
                    f"{topic}: a message has {len(message.name)} names, and "
                    f"{what} has {count} numbers"
                )
        position, v = np.array([message.position, message.velocity])[:, self._order]
        robot = self._robot
        if not robot.linear and np.isfinite(position).all():
            position = robot.integrate(robot.neutral(), position)
        return position, v

    def message(self, stamp: int, q: Array, v: Array, tau: Array) -> JointState:
        """Return a state as a message."""
        return JointState(
            Header(Time.of(stamp), ""),
            list(self.names),
            self._robot.joint_positions(q).tolist(),
            v.tolist(),
            tau.tolist(),
        )

    def command_order(self, joints: str | None) -> list[int]:
        """Return the indices in v of a command's numbers, shape (nv,)."""
        if joints is None:
            return list(range(len(self.names)))
        given = joints.split(",")
        for name in given:
            if name not in self.names:
                raise HardwareError(
                    f"joints={joints}: the robot has no joint {name!r}"
                    f"{did_you_mean(name, self.names)}"
                )
        if sorted(given) != sorted(self.names):
            missing = [name for name in self.names if name not in given]
            wrong = (
                f"{missing[0]!r} is missing" if missing else "a joint is there twice"
            )
            raise HardwareError(f"joints={joints}: {wrong}")
        return [self.names.index(name) for name in given]

    def _found(self, names: Sequence[str], topic: str) -> list[int]:
        """Return the indices of our joints in a message; empty if it has none."""
        ours = [name for name in names if name in self.names]
        if not ours:
            return []
        if missing := [name for name in self.names if name not in names]:
            raise HardwareError(
                f"{topic}: a message lacks {', '.join(missing)}; it has "
                f"{', '.join(names)}"
            )
        if len(ours) > len(self.names):
            twice = next(name for name in ours if names.count(name) > 1)
            raise HardwareError(f"{topic}: a message names {twice} twice")
        self.others = tuple(name for name in names if name not in self.names)
        return [names.index(name) for name in self.names]
