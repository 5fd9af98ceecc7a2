"""A motion under way: who computes it, and how well its commands arrive."""

from collections import deque
from collections.abc import Iterator

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.franka_box import reference
from hsp_control.franka_box.arm import ArmLimits
from hsp_control.franka_box.reflexes import (
    Reference,
    Violation,
    commanded_motion,
    effort_rate,
)
from hsp_control.franka_box.wire import JOINTS, Controller, MotionGenerator

_WINDOW = 100
"""Commands over which the success rate is taken (libfranka, ``RobotState``)."""

SERVED = {
    (Controller.EXTERNAL, MotionGenerator.NONE),
    (Controller.EXTERNAL, MotionGenerator.JOINT_POSITION),
    (Controller.EXTERNAL, MotionGenerator.JOINT_VELOCITY),
    (Controller.JOINT_IMPEDANCE, MotionGenerator.JOINT_POSITION),
    (Controller.JOINT_IMPEDANCE, MotionGenerator.JOINT_VELOCITY),
    (Controller.CARTESIAN_IMPEDANCE, MotionGenerator.JOINT_POSITION),
    (Controller.CARTESIAN_IMPEDANCE, MotionGenerator.JOINT_VELOCITY),
}
"""What a motion can be made of."""


class Motion:
    """What a client commands, from the start of a motion to its end.

    Until the first command nothing counts as lost: a client needs a while from the
    answer that its motion has started to its first state.

    Attributes:
        number: Number of the request that has started it.
        controller: Who computes efforts.
        generator: Who computes the desired motion.
        reference: The desired motion; None without a motion generator.
        effort: The effort commanded last, shape (7,) [N·m]; zero at first.
        commands: Number of commands.
        lost: Number of commands that were lost in a row.
        lost_in_all: Number of commands that were lost.
    """

    def __init__(
        self,
        number: int,
        controller: Controller,
        generator: MotionGenerator,
        start: Reference,
    ) -> None:
        """Begin at a desired motion."""
        self.number, self.controller, self.generator = number, controller, generator
        generated = generator is not MotionGenerator.NONE
        self.reference = reference.as_told(start) if generated else None
        self.effort: Array = np.zeros(JOINTS)
        self.commands = self.lost = self.lost_in_all = 0
        self._window: deque[bool] = deque(maxlen=_WINDOW)

    def __str__(self) -> str:
        by = self.controller.name.lower().replace("_", " ") + " controller"
        if self.reference is None:
            return by
        return f"{self.generator.name.lower().replace('_', ' ')}, {by}"

    @property
    def external(self) -> bool:
        """Whether the client computes the efforts."""
        return self.controller is Controller.EXTERNAL

    @property
    def success_rate(self) -> float:
        """Share of the last 100 commands that arrived."""
        return sum(self._window) / len(self._window) if self._window else 1.0

    def lose(self) -> None:
        """Go on without a command: the effort is held, the acceleration too."""
        if not self.commands:
            return
        self.lost += 1
        self.lost_in_all += 1
        self._window.append(False)
        if self.reference is not None:
            self.reference = reference.extrapolated(self.reference)

    def obey(self, command: np.void, limits: ArmLimits) -> Iterator[Violation]:
        """Follow a command, and yield what it violates."""
        self._window.append(True)
        self.lost = 0
        first, self.commands = not self.commands, self.commands + 1
        if self.external:
            effort = np.array(command["tau_J_d"])
            before = self.effort.astype(np.float32).astype(float)
            self.effort = effort
            yield from effort_rate(effort, before)
        if self.reference is None:
            return
        kind = self.generator
        name, advance = {
            MotionGenerator.JOINT_POSITION: ("q_c", reference.to_position),
            MotionGenerator.JOINT_VELOCITY: ("dq_c", reference.to_velocity),
        }[kind]
        values = np.array(command[name])
        told = reference.as_told(self.reference)
        self.reference = advance(values, self.reference)
        yield from commanded_motion(advance(values, told), told, limits, first=first)


def finished(command: np.void) -> bool:
    """Return whether a command ends its motion."""
    return bool(
        command["motion_generation_finished"] or command["torque_command_finished"]
    )


def is_finite(command: np.void) -> bool:
    """Return whether all joint values of a command are finite."""
    return all(bool(np.isfinite(command[n]).all()) for n in ("q_c", "dq_c", "tau_J_d"))
