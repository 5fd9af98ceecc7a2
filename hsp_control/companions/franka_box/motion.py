"""A motion under way: its controller, and the statistics of its commands."""

from collections import deque
from collections.abc import Iterator

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.franka.layouts import (
    JOINTS,
    ControllerMode,
    MotionGenerator,
)
from hsp_control.companions.franka_box.generators import Generator
from hsp_control.companions.franka_box.reflexes import Reference, Violation, effort_rate

_WINDOW = 100
"""Commands over which the success rate is computed (libfranka, ``RobotState``)."""

OF_THE_HAND = {MotionGenerator.CARTESIAN_POSITION, MotionGenerator.CARTESIAN_VELOCITY}
"""Motion generators that command the hand."""
_OF_THE_JOINTS = {MotionGenerator.JOINT_POSITION, MotionGenerator.JOINT_VELOCITY}
SERVED = {(ControllerMode.EXTERNAL, MotionGenerator.NONE)} | {
    (controller, generator)
    for controller in (
        ControllerMode.EXTERNAL,
        ControllerMode.JOINT_IMPEDANCE,
        ControllerMode.CARTESIAN_IMPEDANCE,
    )
    for generator in _OF_THE_JOINTS | OF_THE_HAND
}
"""The supported combinations of controller and motion generator."""


class Motion:
    """The commands of a client, from the start of a motion to its end.

    Until the first command none is lost: a client needs some time between the answer
    that its motion has started and its first state.

    Attributes:
        number: Number of the request that has started it.
        controller: The source of the efforts.
        kind: The motion generator.
        generator: The source of the desired motion; None without a motion generator.
        effort: The effort commanded last, shape (7,) [N·m]; zero at first.
        commands: Number of commands.
        lost: Number of commands that were lost in a row.
        lost_in_all: Number of commands that were lost.
    """

    def __init__(
        self,
        number: int,
        controller: ControllerMode,
        kind: MotionGenerator,
        generator: Generator | None = None,
    ) -> None:
        """Begin."""
        self.number, self.controller, self.kind = number, controller, kind
        self.generator = generator
        self.effort: Array = np.zeros(JOINTS)
        self.commands = self.lost = self.lost_in_all = 0
        self._window: deque[bool] = deque(maxlen=_WINDOW)

    def __str__(self) -> str:
        by = self.controller.name.lower().replace("_", " ") + " controller"
        if self.generator is None:
            return by
        return f"{self.kind.name.lower().replace('_', ' ')}, {by}"

    @property
    def reference(self) -> Reference | None:
        """The desired motion; None without a motion generator."""
        return self.generator.reference if self.generator else None

    @property
    def external(self) -> bool:
        """Whether the client computes the efforts."""
        return self.controller is ControllerMode.EXTERNAL

    @property
    def success_rate(self) -> float:
        """Share of the last 100 commands that arrived."""
        return sum(self._window) / len(self._window) if self._window else 1.0

    def miss(self) -> None:
        """Continue without a command: effort and acceleration are held."""
        if not self.commands:
            return
        self.lost += 1
        self.lost_in_all += 1
        self._window.append(False)
        if self.generator is not None:
            self.generator.extrapolate()

    def execute(self, command: np.void) -> Iterator[Violation]:
        """Follow a command, and yield the violated limits."""
        self._window.append(True)
        self.lost = 0
        first, self.commands = not self.commands, self.commands + 1
        if self.external:
            effort = np.array(command["tau_J_d"])
            before = self.effort.astype(np.float32).astype(float)
            self.effort = effort
            yield from effort_rate(effort, before)
        if self.generator is not None:
            yield from self.generator.follow(command, first=first)


def finished(command: np.void) -> bool:
    """Return whether a command ends its motion."""
    return bool(
        command["motion_generation_finished"] or command["torque_command_finished"]
    )


def is_finite(command: np.void) -> bool:
    """Return whether all numbers of a command are finite."""
    names = ("q_c", "dq_c", "O_T_EE_c", "O_dP_EE_c", "elbow_c", "tau_J_d")
    return all(bool(np.isfinite(command[name]).all()) for name in names)
