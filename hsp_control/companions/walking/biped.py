"""Bipedal walking: its tasks and its two feet."""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import Literal

from hsp_control.common.errors import PlanError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.walking.legs import leg_freedoms, root_frame
from hsp_control.companions.walking.locomotion import MovingPlan
from hsp_control.companions.walking.plan_composition import composed
from hsp_control.constraints.contacts import Contact, SurfaceContact
from hsp_control.control.interface import PlanParts
from hsp_control.declaration import within
from hsp_control.declaration.quantities import (
    Flag,
    Fraction,
    Names,
    NonNegative,
    Points,
    Positive,
    PositiveCount,
)
from hsp_control.robot import Robot
from hsp_control.tasks import CenterOfMass, FrameOrientation, FramePose, Gains, Task
from hsp_control.tasks.frame_task import TrackingTask

BODY, TRUNK = "center_of_mass", "trunk"
"""Names of the tasks of every walk, besides one per foot."""
_SIX = 6
"""Degrees of freedom of a sole."""


class BipedPlan(MovingPlan):
    """A plan of two flat soles that step, one after the other."""

    _: KW_ONLY
    steps: PositiveCount | None = None
    """Number of steps before it slows down and stands [-]; by default it walks until
    the end of the run."""
    footsteps: Points | None = None
    """Instead of a velocity: the footsteps, one after the other; x, y and yaw relative
    to the middle between the feet at the start, x forward [m, m, rad]."""
    first: Literal["left", "right"] = "left"
    """The foot of the first footstep [-]."""
    feet: Names | None = None
    """Names of the two contacts that walk [-]; all of them by default."""
    trunk: str | None = None
    """Frame of the trunk that stays upright [-]; by default that of the root."""
    swing: Positive = 0.6
    """Duration of a swing, on one foot [s]."""
    double_support: Positive = 0.15
    """Duration of the time on both feet between two swings [s]."""
    lift: Positive = 0.05
    """Height to which a foot is lifted [m]."""
    crouch: NonNegative = 0.04
    """Distance by which the centre of mass is lowered, so that the knees stay flexed
    [m]."""
    acceleration: Positive = 0.4
    """Maximum rate of change of the velocity, from step to step [m/s²]."""
    feedback: Positive = 4.0
    """k, the rate at which an error of the divergent component decays [1/s]."""
    margin: Fraction = 0.9
    """Share of the sole that feedback uses [-]."""
    adjusts: Flag = True
    """Whether the next step is adjusted after a push [-]."""
    contact_force: Positive = 0.03
    """Normal force at which a swing foot has landed, in robot weights [-]."""

    def _complete(self) -> None:
        super()._complete()
        if self.footsteps is None:
            return
        for name in ("speed", "sideways", "turn", "velocity", "steps"):
            if getattr(self, name):
                raise PlanError(f"give either footsteps or {name}, not both")

    def parts(
        self, robot: Robot, tasks: Sequence[Task], contacts: Sequence[Contact]
    ) -> PlanParts:
        """Return the parts of a controller that walks; see `MotionPlan.parts`."""
        with within("plan"):
            if not robot.unactuated:
                raise PlanError(
                    f"{robot.name} cannot walk: it has no free-flyer root, it is fixed "
                    "to the world"
                )
            names = self._feet(contacts)
            frames = {each.name: each.frame for each in contacts}
            for name in names:
                joints = leg_freedoms(robot, frames[name])
                if joints < _SIX:
                    raise PlanError(
                        f"the leg of {name!r} has {joints} joints; a sole that is put "
                        f"down flat, anywhere, needs {_SIX}"
                    )
        trunk = root_frame(robot) if self.trunk is None else self.trunk
        with within("plan", "trunk"):
            robot.frame_id(trunk)
        own: list[TrackingTask] = [
            CenterOfMass(gains=Gains(natural_frequency=10.0), name=BODY, priority=1),
            FrameOrientation(
                trunk, gains=Gains(natural_frequency=10.0), name=TRUNK, priority=2
            ),
            *(
                FramePose(
                    frames[name],
                    gains=Gains(natural_frequency=20.0),
                    name=name,
                    priority=1,
                )
                for name in names
            ),
        ]
        return composed(own, tasks, contacts, names)

    def _feet(self, contacts: Sequence[Contact]) -> tuple[str, ...]:
        """Return the names of the two contacts that walk.

        Raises:
            PlanError: If they are not two flat soles.
        """
        there = {each.name: each for each in contacts}
        names = tuple(there) if self.feet is None else tuple(self.feet)
        for name in names:
            if name not in there:
                raise PlanError(
                    f"there is no contact {name!r}{did_you_mean(name, there)} to walk "
                    f"on (there are {listing(there) or 'none'})"
                )
            if not isinstance(there[name], SurfaceContact):
                raise PlanError(
                    f"contact {name!r} is a {there[name].yaml_type}; a biped walks on "
                    "flat soles: type surface"
                )
        if len(set(names)) != 2:
            raise PlanError(
                f"a biped walks on two feet; there are {len(set(names))} "
                f"({listing(names) or 'declare contacts'})"
                + ("; name two with feet" if len(names) > 2 else "")
            )
        return names
