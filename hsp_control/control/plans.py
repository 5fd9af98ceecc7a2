"""The abstract plan: it writes references and switches contacts while a robot moves."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from hsp_control.common.entry_points import own_names
from hsp_control.common.errors import PlanError
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import LogChannel, Measurement
from hsp_control.declaration import Part
from hsp_control.declaration.nested import parts_within
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import Task
from hsp_control.trajectories.streams.followed import FollowedStream
from hsp_control.trajectories.streams.run import StreamRun


class PlanParts(NamedTuple):
    """The tasks and contacts of a controller that follows a plan.

    Attributes:
        tasks: The tasks that were given, and those that the plan adds.
        contacts: The contacts that were given; the plan switches some.
    """

    tasks: tuple[Task, ...]
    contacts: tuple[Contact, ...]


class MotionPlan(Part, ABC, family="plans", error=PlanError):
    """A motion of the robot, planned once a control period from the measurements.

    A plan writes references of tasks and switches contacts; it owns no part of the law.
    It adds the tasks that it needs. A task that already has the name of one of these
    is used instead, with its own gains and priority; only its reference and its
    schedule become the plan's.

    A subclass declares its parameters as fields (see `Part`) and implements `parts` and
    `begin`. The memory of a run belongs to the result of `begin`.
    """

    @abstractmethod
    def parts(
        self, robot: Robot, tasks: Sequence[Task], contacts: Sequence[Contact]
    ) -> PlanParts:
        """Return the parts of a controller that follows this plan.

        Args:
            robot: The robot.
            tasks: The tasks that are given.
            contacts: The contacts that are given.

        Raises:
            PlanError: If they do not fit the plan.
        """

    def limits(self, limits: Limits | None) -> Limits | None:
        """Return the limits of a controller that follows this plan.

        Given arguments stay; a plan may choose the others. By default it chooses
        nothing.

        Args:
            limits: The limits that are given; None: no limits.
        """
        return limits

    @abstractmethod
    def begin(self, controller: Controller) -> "RunningPlan":
        """Return the running plan of a controller that is made of `parts`.

        Raises:
            PlanError: If the controller has other parts, or the robot cannot follow.
        """


class RunningPlan(ABC):
    """A plan in one run of one controller.

    Attributes:
        plan: The plan, with the streams of this run.
        stopping: Whether it was commanded to come to rest.
    """

    def __init__(self, plan: MotionPlan) -> None:
        """Set the plan."""
        self.plan = plan
        self.stopping = False

    @property
    def streams(self) -> list[StreamRun]:
        """The plan's input streams in this run, such as its velocity."""
        return [each.run for each in parts_within(self.plan, FollowedStream)]

    def stop(self) -> None:
        """Come to rest as soon as the robot can stand, whatever else is planned."""
        self.stopping = True

    @property
    def rests(self) -> bool:
        """Whether the plan is at rest, so that the robot stands."""
        return True

    @abstractmethod
    def start(self, state: RobotState) -> None:
        """Begin at a state; the first `update` does it.

        Raises:
            PlanError: If the robot cannot follow the plan from there.
        """

    @abstractmethod
    def update(self, measured: Measurement) -> None:
        """Write references and switch contacts for the period that begins.

        It is called once a period, in order of time, before the effort is computed.

        Raises:
            FallError: If the robot falls.
        """

    @abstractmethod
    def log_channels(self) -> Mapping[str, LogChannel]:
        """Return the logged values of the last update, by name: ``plan.<...>``."""


__dir__ = own_names(__name__)
