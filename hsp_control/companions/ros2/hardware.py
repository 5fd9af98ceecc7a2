"""A robot whose states and commands are topics of ROS 2."""

from itertools import pairwise
from statistics import median
from time import monotonic

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError
from hsp_control.common.warned import warn
from hsp_control.companions.ros2.address import checked_name, parse
from hsp_control.companions.ros2.joints import Joints
from hsp_control.companions.ros2.messages import (
    Float64MultiArray,
    JointState,
    MultiArrayLayout,
)
from hsp_control.companions.ros2.node import Node, ReceivedMessage
from hsp_control.companions.ros2.stamps import Stamps
from hsp_control.live.hardware import Measurement
from hsp_control.live.link import AgeEstimator
from hsp_control.robot import Robot

JOINT_STATES = "/joint_states"
"""The topic of a robot's states by default, as ros2_control's."""
_STATES = 10
"""Number of states from which the robot's period is measured."""
_TOLERANCE = 0.2
"""Tolerance of the robot's period, relative to the loop's."""
_POLL = 0.01
"""Time between two checks for a subscriber, before the run begins [s]."""


class Ros2Hardware:
    """`Hardware` that receives ``sensor_msgs/JointState`` and sends efforts.

    ros2_control's ``JointStateBroadcaster`` publishes these states, and its
    ``ForwardCommandController`` of efforts, once ``JointGroupEffortController``,
    receives these efforts as ``std_msgs/Float64MultiArray``. Joints are matched by
    name. The field ``effort`` is not read: whether it is commanded or measured, and
    with or without gravity, differs from robot to robot.

    A state has a stamp instead of a number: one that is not later than the last one is
    old, and a step of n periods means that n - 1 states were lost. The clock of the
    stamps is not compared with ours (`AgeEstimator`).

    Attributes:
        period: Time between two states [s].
        commands: The topic of the efforts.
        states: The topic of the states.
        q: Configuration of the robot when it was connected, shape (nq,).
        old: Number of states whose stamp was not later than the last one's.
    """

    real_time = True

    def __init__(
        self, address: str, robot: Robot, period: float, *, timeout: float = 10.0
    ) -> None:
        """Connect, and wait until the robot sends its states and receives commands.

        Args:
            address: ``CONTROLLER?states=TOPIC&joints=A,B&domain=N``. Efforts go to
                ``/CONTROLLER/commands``, in the order of ``joints`` (by default that
                of v); states come from ``/joint_states`` by default.
            robot: The controller's model.
            period: The control period [s].
            timeout: Maximum time to wait [s].

        Raises:
            HardwareError: If the address is invalid, Cyclone DDS cannot start, or the
                robot is not there; the message lists the topics that are.
        """
        name, domain, options = parse(address, ("states", "joints"))
        self.period, self._joints = period, Joints(robot)
        self._order = self._joints.command_order(options.get("joints"))
        self.commands = f"{name}/commands"
        self.states = checked_name(options.get("states", JOINT_STATES))
        node = Node(domain)
        self._subscription = node.subscription(self.states, JointState)
        self._publisher = node.publisher(self.commands, Float64MultiArray)
        self._stamps, self._ages = Stamps(period), AgeEstimator()
        self._sender: int | None = None
        self._last: Measurement | None = None
        self._reads = 0
        self._faulty = self._closed = False
        self.old = 0
        end = monotonic() + timeout
        self.q = self._check_period(end).q
        while self._publisher.matched == 0:
            if monotonic() > end:
                raise HardwareError(self._publisher.why_none())
            self._subscription.wait(_POLL)
            self._subscription.take()

    def read(self, timeout: float) -> Measurement | None:
        """Return the newest state; see `Hardware.read`.

        An invalid message, or a second publisher of states of these joints, is reported
        once as the `Measurement.fault` of the last good state.
        """
        end = monotonic() + timeout
        newest: Measurement | None = None
        while newest is None and not self._closed:
            for received in self._subscription.take():
                newest = self._measurement(received) or newest
                if newest is not None and newest.fault:
                    return newest
            left = end - monotonic()
            if newest is None and (left <= 0.0 or not self._subscription.wait(left)):
                return None
        if newest is None:
            return None
        # A robot's clock advances while the loop prepares after its first read.
        if self._reads < 2:
            self._stamps.begin(self._reads * self.period)
            newest = self._last = newest._replace(t=self._stamps.t)
            self._reads += 1
        return newest

    def write(self, effort: Array) -> None:
        """Send an effort; see `Hardware.write`.

        Raises:
            HardwareError: If the commands have no subscriber any more.
        """
        if self._publisher.matched == 0:
            raise HardwareError(f"no subscriber of {self.commands} is left")
        data = effort[self._order].tolist()
        self._publisher.send(Float64MultiArray(MultiArrayLayout(), data))

    def close(self) -> None:
        """Leave the domain; a second call does nothing.

        A ``ForwardCommandController`` then holds the last effort: its interface cannot
        end a run. A robot of `serve` stops.
        """
        if not self._closed:
            self._closed = True
            del self._subscription, self._publisher

    def _measurement(self, received: ReceivedMessage[JointState]) -> Measurement | None:
        """Return the state of a message; None if it is old, or about other joints."""
        try:
            state = self._joints.state(received.message, self.states)
        except HardwareError as error:
            return self._fault(str(error))
        if state is None:
            return None
        if self._sender is None:
            self._sender = received.publisher
        elif received.publisher != self._sender:
            return self._fault(f"{self.states}: two publishers send these joints")
        stamp = received.message.header.stamp.nanoseconds
        if not self._stamps.take(stamp):
            self.old += 1
            return None
        age = self._ages.age(monotonic(), 1e-9 * stamp)
        self._last = Measurement(self._stamps.sequence, self._stamps.t, *state, age)
        return self._last

    def _fault(self, fault: str) -> Measurement | None:
        """Return a fault the first time; the safe stop then needs the good states."""
        if self._last is None:
            raise HardwareError(fault)
        if self._faulty:
            return None
        self._faulty = True
        self._stamps.sequence += 1  # otherwise it would be an old state
        return self._last._replace(sequence=self._stamps.sequence, fault=fault)

    def _check_period(self, end: float) -> Measurement:
        """Receive some states, compare their period with the loop's, return one."""
        stamps: list[int] = []
        while self._last is None or len(stamps) < _STATES:
            left = end - monotonic()
            if left <= 0.0 or not self._subscription.wait(left):
                raise HardwareError(self._why_no_state())
            for received in self._subscription.take():
                found = self._measurement(received)
                if found is not None and found.fault:
                    raise HardwareError(found.fault)
                if found is not None:
                    stamps.append(received.message.header.stamp.nanoseconds)
        if self._joints.others:
            warn(
                f"{self.states}: joints that the robot does not have are ignored: "
                f"{', '.join(self._joints.others)}",
                RuntimeWarning,
            )
        there = 1e-9 * median(b - a for a, b in pairwise(stamps))
        if abs(there - self.period) > _TOLERANCE * self.period:
            raise HardwareError(
                f"{self.states}: a state every {there:.4g} s; the loop's period is "
                f"{self.period:g} s (set simulation.control_period)"
            )
        return self._last

    def _why_no_state(self) -> str:
        if self.old:
            return f"{self.states}: the stamps of the states do not increase"
        if self._last is not None:
            return f"{self.states}: fewer than {_STATES} states arrived"
        if self._subscription.matched == 0:
            return self._subscription.why_none()
        return f"{self.states}: no state of {', '.join(self._joints.names)} arrived"
