"""A simulated robot on topics of ROS 2, for any controller."""

from collections import deque
from collections.abc import Callable
from time import monotonic, sleep, time_ns

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError
from hsp_control.companions.ros2.address import checked_name, parse
from hsp_control.companions.ros2.hardware import JOINT_STATES
from hsp_control.companions.ros2.joints import Joints
from hsp_control.companions.ros2.messages import Float64MultiArray, JointState
from hsp_control.companions.ros2.node import Node
from hsp_control.live.hardware import described
from hsp_control.live.operator_requests import OPERATOR
from hsp_control.live.real_time import no_garbage_collection
from hsp_control.live.safe_stop import Phase
from hsp_control.live.simulated_robot import SimulatedRobot
from hsp_control.live.udp import CLOSED_BY_LOOP
from hsp_control.robot import Robot

_CATCH_UP = 10
"""Maximum number of periods that are made up for after the process was not
scheduled."""
_WAITING = 0.1
"""Time between two states of a robot in lockstep that waits for an effort [s]."""
_POLL = 0.1
"""Time between two checks for a reason to stop, while waiting for an effort [s]."""


class RobotTopics:
    """The topics of a robot with ros2_control.

    Attributes:
        commands: The topic of the efforts.
        states: The topic of the states.
    """

    def __init__(self, address: str, robot: Robot) -> None:
        """Open the topics.

        Args:
            address: As that of `Ros2Hardware`.
            robot: The robot.

        Raises:
            HardwareError: If the address is invalid, or Cyclone DDS cannot start.
        """
        name, domain, options = parse(address, ("states", "joints"))
        self._joints = Joints(robot)
        self._order = self._joints.command_order(options.get("joints"))
        self.commands = f"{name}/commands"
        self.states = checked_name(options.get("states", JOINT_STATES))
        node = Node(domain)
        self._publisher = node.publisher(self.states, JointState)
        self._subscription = node.subscription(self.commands, Float64MultiArray)
        self._sender: int | None = None
        self._efforts: deque[Array] = deque()

    @property
    def left(self) -> bool:
        """Whether the publisher of efforts has gone."""
        return self._sender is not None and self._subscription.matched == 0

    def send(self, stamp: int, q: Array, v: Array, tau: Array) -> None:
        """Publish a state; see `Joints.message`."""
        self._publisher.send(self._joints.message(stamp, q, v, tau))

    def wait(self, timeout: float) -> bool:
        """Wait for an effort, at most a time [s]; return whether one arrived."""
        return bool(self._efforts) or self._subscription.wait(timeout)

    def efforts(self, most: int) -> list[Array]:
        """Return the oldest queued efforts, shapes (nv,).

        Args:
            most: Their maximum number.

        Raises:
            HardwareError: If one has another size, or a second publisher sends some.
        """
        for message, publisher in self._subscription.take():
            if self._sender not in {None, publisher}:
                raise HardwareError(f"{self.commands}: two publishers send efforts")
            self._sender = publisher
            if len(message.data) != len(self._order):
                raise HardwareError(
                    f"{self.commands}: an effort has {len(message.data)} numbers; the "
                    f"robot has {len(self._order)} joints"
                )
            effort = np.empty(len(self._order))
            effort[self._order] = message.data
            self._efforts.append(effort)
        return [self._efforts.popleft() for _ in range(min(most, len(self._efforts)))]


def serve(
    robot: SimulatedRobot,
    topics: RobotTopics,
    *,
    stop_reason: Callable[[], str | None],
    lockstep: bool = False,
) -> None:
    """Run a robot until it has stopped and was held.

    In a period: receive efforts, advance the plant, publish the state. Stamps begin at
    the time of day, and grow by one period. If the process overruns by some periods,
    it makes up for them, since a robot would have moved; if by more, the plant stands
    still, but the stamps advance.

    The robot stops as a `SimulatedRobot` does, and where a ``ForwardCommandController``
    would not: if the publisher of efforts has gone, if there is a second one, and at an
    effort of the wrong size.

    Args:
        robot: The robot, waiting for its first effort.
        topics: Its topics.
        stop_reason: Called every period; returns a reason to stop, or None.
        lockstep: Whether a period passes with every effort, instead of in real time.
    """
    step, stamp, due = round(1e9 * robot.period), time_ns(), monotonic()
    with no_garbage_collection():
        while not robot.done:
            efforts = []
            reason = stop_reason()
            if reason is not None and robot.phase == Phase.WAITING:
                return
            if reason is None and topics.left:
                reason = CLOSED_BY_LOOP
            try:
                efforts = topics.efforts(1 if lockstep else 1000)
            except OPERATOR:
                raise
            except BaseException as error:  # Cyclone DDS may raise anything
                reason = described(error)
            if reason is not None:
                robot.halt(reason)
            robot.advance(efforts)
            stamp += step
            try:
                topics.send(stamp, *robot.measure(), robot.tau)
            except OPERATOR:
                raise
            except BaseException as error:
                robot.halt(described(error))
            if lockstep and robot.phase == Phase.RUNNING:
                while not (topics.wait(_POLL) or topics.left or stop_reason()):
                    pass
                due = monotonic()
                continue
            if lockstep and robot.phase == Phase.WAITING:
                # Few states, since each answered one delays all efforts by a period.
                topics.wait(_WAITING)
                due = monotonic()
                continue
            due += robot.period
            behind = int((monotonic() - due) / robot.period)
            if behind > _CATCH_UP:
                due, stamp = due + behind * robot.period, stamp + behind * step
            sleep(max(due - monotonic(), 0.0))
