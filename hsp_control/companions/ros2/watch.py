"""A live loop on topics of ROS 2, for observers: RViz, PlotJuggler, bags."""

from time import time_ns

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError
from hsp_control.companions.ros2.address import checked_name, parse
from hsp_control.companions.ros2.joints import Joints
from hsp_control.companions.ros2.messages import (
    Header,
    JointState,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Time,
)
from hsp_control.companions.ros2.node import Node, TopicPublisher
from hsp_control.companions.shared import Rate, rate_of
from hsp_control.simulation.control_chain import EffortSource
from hsp_control.tasks import Task

_POSITION, _POSE = ("position",), ("position", "orientation")


class Watched:
    """Publishes a controller's states and poses; `run_loop` calls it as ``on_period``.

    `/NAME/joint_states` has the state that the controller received, and its effort.
    For each task with a position in space, `/NAME/TASK/reference` and
    `/NAME/TASK/actual` are poses in the frame of the robot's root; a task without an
    orientation has that of the root. Stamps are the time of day.
    """

    def __init__(self, address: str, effort_source: EffortSource) -> None:
        """Open the topics.

        Args:
            address: ``NAME?rate=HZ&domain=N``.
            effort_source: The source of the efforts.

        Raises:
            HardwareError: If the address is invalid, or Cyclone DDS cannot start.
        """
        self._prefix, domain, options = parse(address, ("rate",))
        try:
            self._rate = Rate(rate_of(options))
        except ValueError as error:
            raise HardwareError(f"{address}: {error}") from None
        self._source = effort_source
        robot = effort_source.controller.robot
        self._joints = Joints(robot)
        self._frame = robot.model.frames[1].name  # 0 is Pinocchio's universe
        self._node = Node(domain)
        self._states = self._node.publisher(f"{self._prefix}/joint_states", JointState)
        self._poses: dict[str, TopicPublisher[PoseStamped]] = {}
        for task in effort_source.controller.tasks:
            if task.drawn in {_POSITION, _POSE}:
                for what in ("reference", "actual"):
                    self._pose(task, what)

    def __call__(self, t: float) -> None:
        """Publish, if it is due.

        Args:
            t: The controller's time [s].
        """
        if not self._rate.due(t):
            return
        stamp, state = time_ns(), self._source.state
        tau = self._source.output.tau
        self._states.send(self._joints.message(stamp, state.q, state.v, tau))
        header = Header(Time.of(stamp), self._frame)
        for task in self._source.controller.tasks:
            if task.drawn not in {_POSITION, _POSE}:
                continue
            values = zip(("reference", "actual"), task.measure(state), strict=True)
            for what, value in values:
                if len(value) >= 3:  # fewer: a point along some axes only
                    self._pose(task, what).send(PoseStamped(header, _pose_of(value)))

    def ended(self, ended: str, reason: str) -> None:
        """Do nothing: the topics have no message for the end."""

    def _pose(self, task: Task, what: str) -> TopicPublisher[PoseStamped]:
        """Return a publisher; a task may be added while the loop runs."""
        name = task.name.replace("-", "_")  # which ROS 2 does not allow
        topic = checked_name(f"{self._prefix}/{name}/{what}")
        if topic not in self._poses:
            self._poses[topic] = self._node.publisher(topic, PoseStamped)
        return self._poses[topic]


def _pose_of(value: Array) -> Pose:
    x, y, z, *rest = value.tolist()
    return Pose(Point(x, y, z), Quaternion(*(rest or (0.0, 0.0, 0.0, 1.0))))
