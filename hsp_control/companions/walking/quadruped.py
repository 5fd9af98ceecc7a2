"""Quadrupedal walking: its tasks and its four feet."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from typing import ClassVar

from hsp_control.common.errors import PlanError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.walking.footsteps import Velocity
from hsp_control.companions.walking.legs import leg_freedoms, root_frame
from hsp_control.companions.walking.locomotion import MovingPlan
from hsp_control.companions.walking.plan_composition import composed
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits
from hsp_control.control.interface import PlanParts
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Names, Positive
from hsp_control.robot import Robot
from hsp_control.tasks import CenterOfMass, FrameOrientation, FramePosition, Gains, Task
from hsp_control.tasks.frame_task import TrackingTask

BANDWIDTH = 30.0
"""Default α of the limits' barriers [1/s]. A swinging knee accelerates
by some 100 rad/s² with 1 rad left to its limit: with α = 10 1/s this is forbidden, and
the robot falls."""
STEEPEST = 0.7
"""Smallest vertical part of the normal of the ground [-]."""


class QuadrupedPlan(MovingPlan):
    """A plan of four point feet.

    It has the tasks ``trunk``, ``height`` and ``center_of_mass``, and one per foot
    with the name of its contact.

    Attributes:
        gait: The gait as a verb, for messages, such as ``trot``.
        center_priority: The level of the centre of mass: on two feet it cannot be kept
        together with all other tasks.
        center_gains: The gains of the centre of mass.
    """

    gait: ClassVar[str]
    center_priority: ClassVar[int]
    center_gains: ClassVar[Gains]

    _: KW_ONLY
    until: Positive | None = None
    """Time at which it slows down and stands [s]; by default it walks until the end."""
    feet: Names | None = None
    """Names of the four contacts that walk [-]; all of them by default."""
    trunk: str | None = None
    """Frame of the trunk that stays upright [-]; by default that of the root."""
    swing: Positive = 0.25
    """Duration of a swing [s]."""
    stance: Positive = 0.05
    """Duration of the time on four feet between two swings [s]."""
    lift: Positive = 0.05
    """Height to which a foot is lifted [m]."""
    acceleration: Positive = 0.5
    """Maximum rate of change of the velocity [m/s²]."""
    contact_force: Positive = 0.01
    """Normal force at which a swing foot has landed, in robot weights [-]."""

    def _complete(self) -> None:
        super()._complete()
        if self.contact_force >= 0.25:
            raise PlanError(
                f"contact_force is {self.contact_force:g} robot weights; must be below "
                "0.25, which each of four feet carries"
            )

    def velocity_at(self, t: float) -> Velocity:
        """Return the desired velocity at time t [s]; zero at the end."""
        if self.until is not None and t >= self.until:
            return Velocity(0.0, 0.0, 0.0)
        return super().velocity_at(t)

    def parts(
        self, robot: Robot, tasks: Sequence[Task], contacts: Sequence[Contact]
    ) -> PlanParts:
        """Return the parts of a controller that follows it; see `MotionPlan.parts`."""
        with within("plan"):
            if not robot.unactuated:
                raise PlanError(
                    f"{robot.name} cannot {self.gait}: it has no free-flyer root, it "
                    "is fixed to the world"
                )
            names = self.feet_of(contacts)
            frames = {each.name: each.frame for each in contacts}
            for name in names:
                joints = leg_freedoms(robot, frames[name])
                if joints < 3:
                    raise PlanError(
                        f"the leg of {name!r} has {joints} joints between the root and "
                        f"{frames[name]!r}; a quadruped {self.gait}s on legs of at "
                        "least 3, which put a foot anywhere"
                    )
        trunk = root_frame(robot) if self.trunk is None else self.trunk
        with within("plan", "trunk"):
            robot.frame_id(trunk)
        own: list[TrackingTask] = [
            FrameOrientation(
                trunk, gains=Gains(natural_frequency=15.0), name="trunk", priority=1
            ),
            CenterOfMass(
                axes="z", gains=Gains(natural_frequency=15.0), name="height", priority=1
            ),
            CenterOfMass(
                axes="xy", gains=self.center_gains, priority=self.center_priority
            ),
        ]
        for name in names:
            gains = Gains(natural_frequency=40.0)
            own.append(FramePosition(frames[name], gains=gains, name=name, priority=1))
        return composed(own, tasks, contacts, names)

    def limits(self, limits: Limits | None) -> Limits | None:
        """Return limits whose barriers permit swings; see `MotionPlan.limits`."""
        if limits is None or limits.bandwidth is not None:
            return limits
        return replace(limits, bandwidth=BANDWIDTH)

    def feet_of(self, contacts: Sequence[Contact]) -> tuple[str, ...]:
        """Return the names of the four contacts that walk.

        Raises:
            PlanError: If they are not four points.
        """
        there = {each.name: each for each in contacts}
        names = tuple(there) if self.feet is None else tuple(self.feet)
        for name in names:
            if name not in there:
                raise PlanError(
                    f"there is no contact {name!r}{did_you_mean(name, there)} to "
                    f"{self.gait} on (there are {listing(there) or 'none'})"
                )
            normal = there[name].axes[:, 2]
            if normal[2] < STEEPEST:
                raise PlanError(
                    f"contact {name!r} has the normal {normal.tolist()}; a "
                    f"quadruped {self.gait}s on ground, whose normal points upwards "
                    f"(z at least {STEEPEST:g})"
                )
            if there[name].rows != 3:
                raise PlanError(
                    f"contact {name!r} is a {there[name].yaml_type}; a quadruped "
                    f"{self.gait}s on feet of type ball or point"
                )
        if len(set(names)) != 4:
            raise PlanError(
                f"a quadruped {self.gait}s on four feet; there are {len(set(names))} "
                f"({listing(names) or 'declare contacts'})"
                + ("; name four with feet" if len(names) > 4 else "")
            )
        return names
