"""A walking quadruped: the common part of all gaits in one run."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import FallError, PlanError
from hsp_control.common.suggestions import listing
from hsp_control.companions.walking.contact_switch import Switch, Switched
from hsp_control.companions.walking.footsteps import Footstep, Velocity
from hsp_control.companions.walking.legs import hip_height, leg_length
from hsp_control.companions.walking.pendulum import GRAVITY
from hsp_control.companions.walking.planned_references import Fed, FedOrientation
from hsp_control.companions.walking.quadruped import QuadrupedPlan
from hsp_control.companions.walking.quintic import at_rest, to_rest
from hsp_control.companions.walking.swing import Swing, turned
from hsp_control.control.interface import (
    Controller,
    FallDetector,
    LogChannel,
    Measurement,
    RunningPlan,
)
from hsp_control.robot import RobotState

LATE = 0.12
"""Maximum wait for a foot without ground under it [s]."""
EARLY = 0.6
"""Share of a swing before which no force is treated as touchdown."""
RISE = 0.3
"""Time in which the trunk rises or sinks with the ground [s]."""
_PRESS = 0.002
"""Depth below the ground at which a swing foot aims, so that it touches it [m]."""
_SLOPE = 0.06
"""Slope below which the ground is level: a foot on a plate, or not yet down [-]."""
_UP = np.array([0.0, 0.0, 1.0])


class PointFoot(Switched):
    """A point foot.

    Attributes:
        name: The name of its contact and of its task.
        frame: Its frame.
        normal: The normal of the ground, shape (3,) [-].
        position: The reference of its frame's origin.
        swing: Its motion while it swings; None while it stands.
        followed: The motion of its reference until it rests; None: its present place.
        height: The height of its frame at its present or last stance [m].
        offset: Its position relative to the middle of the feet at the start, in axes of
        the trunk, shape (2,) [m].
        reach: Its maximum distance before and behind its hip [m].
    """

    def __init__(self, name: str, controller: Controller) -> None:
        """Find its parts in a controller."""
        self.name = name
        contact = {each.name: each for each in controller.contacts}[name]
        task = {each.name: each for each in controller.tasks}.get(name)
        if not (
            task is not None
            and isinstance(contact.schedule, Switch)
            and isinstance(task.schedule, Switch)
            and isinstance(task.followed, Fed)
        ):
            raise PlanError(
                f"the foot {name!r} does not follow the plan: build the controller "
                "from the plan's parts"
            )
        self.frame, self.normal = contact.frame, contact.axes[:, 2]
        self.reach = np.inf
        self.contact, self.task = contact.schedule, task.schedule
        self.position = task.followed
        self.swing: Swing | None = None
        self.followed: Swing | None = None

    def start(self, state: RobotState, middle: Footstep) -> None:
        """Stand at the robot's present pose; ``middle`` is below its centre of mass."""
        self.reset()
        self.swing = self.followed = None
        here = state.position(self.frame)
        self.height = float(here[2])
        self.offset: Array = middle.local(here)

    def follow(self, state: RobotState) -> None:
        """Write its reference: its swing, or its present place."""
        t, swing = state.t, self.followed
        if swing is None or self.rests(t):
            self.followed = None
            self.position.write(t, state.position(self.frame))
        else:
            self.position.write(t, *swing.position(t))

    def speed(self, velocity: Velocity) -> float:
        """Return the speed of the body above the foot at a velocity [m/s]."""
        x, y = self.offset
        forward, left, turn = velocity
        return float(np.hypot(forward - turn * y, left + turn * x))


class RunningQuadruped(RunningPlan):
    """A plan of four feet in one run."""

    _mode: str
    """The mode; "standing" in each gait."""

    def __init__(self, plan: QuadrupedPlan, controller: Controller) -> None:
        """Find the references and the switches."""
        super().__init__(plan)
        self.gait = plan
        self._controller = controller
        self._state = RobotState(controller.robot)
        tasks = {task.name: task for task in controller.tasks}
        fed = [
            task.followed if (task := tasks.get(name)) is not None else None
            for name in ("trunk", "height", "center_of_mass")
        ]
        trunk, height, body = fed
        if not (
            isinstance(trunk, FedOrientation)
            and isinstance(height, Fed)
            and isinstance(body, Fed)
        ):
            raise PlanError(
                "the tasks 'trunk', 'height' and 'center_of_mass' do not follow the "
                "plan: build the controller from the plan's parts"
            )
        self._trunk, self._height, self._body = trunk, height, body
        self._trunk_frame: str = tasks["trunk"].frame  # type: ignore[attr-defined]
        names = plan.feet_of(controller.contacts)
        self._feet = [PointFoot(name, controller) for name in names]
        mass = sum(inertia.mass for inertia in controller.robot.model.inertias)
        self._touch = plan.contact_force * mass * GRAVITY
        self._begun = False

    def start(self, state: RobotState) -> None:
        """Stand at the robot's present pose; see `RunningPlan.start`."""
        frame = state.frame(self._trunk_frame)
        mass = state.centroidal.position
        yaw = float(np.arctan2(frame.rotation[1, 0], frame.rotation[0, 0]))
        middle = Footstep(float(mass[0]), float(mass[1]), yaw)
        for foot in self._feet:
            foot.start(state, middle)
        # The offsets are relative to the middle of the feet, above which the mass is to
        # be.
        center = np.mean([foot.offset for foot in self._feet], axis=0)
        for foot in self._feet:
            foot.offset = foot.offset - center
        self._first_yaw = self._yaw = yaw
        self._rotation = frame.rotation.copy()
        self._above = float(mass[2]) - self._ground()
        self._rise = to_rest(at_rest(mass[2:]), mass[2:], state.t, RISE)
        frames = tuple(foot.frame for foot in self._feet)
        self._falling = FallDetector(self._trunk_frame, frames, state)
        self._velocity = Velocity(0.0, 0.0, 0.0)
        self._last = self._since = state.t
        self._mode = "standing"
        self._swings, self._idle = 0, 0
        self._sensed = {foot.name: False for foot in self._feet}
        self._controller.prepare(state, without=[foot.name for foot in self._feet])
        self._start_gait(state)
        for lifted in self._combinations():
            down = [foot.name for foot in self._feet if foot not in lifted]
            aloft = [foot.name for foot in lifted]
            self._controller.prepare(state, lifted=aloft, without=down)
        self._begun = True

    def _corners(self) -> tuple[PointFoot, PointFoot, PointFoot, PointFoot]:
        """Return the feet: front left and right, hind left and right."""
        corners: dict[tuple[bool, bool], PointFoot] = {}
        for foot in self._feet:
            corners[bool(foot.offset[0] > 0.0), bool(foot.offset[1] > 0.0)] = foot
        if len(corners) < 4:
            raise PlanError(
                "the feet do not stand at the four corners of the body, so that there "
                f"are no diagonals to {self.gait.gait} with"
            )
        return (
            corners[True, True],
            corners[True, False],
            corners[False, True],
            corners[False, False],
        )

    def _check_stride(self, state: RobotState, time: float) -> None:
        """Check that the legs are long enough for the speed and for the lift.

        A velocity that is a function of time is not checked: it is limited to the reach
        of the legs (`_wanted`).
        """
        self._stride_time = time
        for foot in self._feet:
            hip = hip_height(state, foot.frame)
            if self.gait.lift >= hip:
                raise PlanError(
                    f"lift is {self.gait.lift:.3g} m, but the hip of {foot.name!r} is "
                    f"only {hip:.3g} m above its foot"
                )
            square = leg_length(state.robot, foot.frame) ** 2 - hip**2
            foot.reach = 0.9 * float(np.sqrt(max(square, 1e-6)))
        if self.gait.velocity is not None:
            return
        velocity = Velocity(self.gait.speed, self.gait.sideways, self.gait.turn)
        for foot in self._feet:
            excursion = time * foot.speed(velocity)
            if excursion > foot.reach:
                speed = float(np.hypot(velocity.forward, velocity.left))
                turning = f" and {velocity.turn:.3g} rad/s" if velocity.turn else ""
                raise PlanError(
                    f"at {speed:.3g} m/s{turning} a foot is {excursion:.3g} m before "
                    f"and behind its hip; the leg of {foot.name!r} reaches "
                    f"{foot.reach:.3g} m. {self.gait.gait.capitalize()} slower, or "
                    "with a shorter swing"
                )

    @abstractmethod
    def _start_gait(self, state: RobotState) -> None:
        """Begin the gait, after everything else."""

    @abstractmethod
    def _combinations(self) -> Sequence[Sequence[PointFoot]]:
        """Return the sets of feet that may swing together."""

    @abstractmethod
    def _phase(self) -> tuple[float, str]:
        """Return the number of the phase, for the log, and the numbers' meanings."""

    @abstractmethod
    def _step(self, t: float, measured: Measurement) -> None:
        """Advance the gait, and write the reference of the centre of mass."""

    def log_channels(self) -> Mapping[str, LogChannel]:
        """Return the phase and the velocity."""
        phase, meaning = self._phase()
        return {
            "plan.phase": LogChannel(phase, "-", meaning),
            "plan.steps": LogChannel(float(self._swings), "-", "swings so far"),
            "plan.velocity": LogChannel(
                np.array(self._velocity), "m/s and rad/s", "forward, left, turning"
            ),
        }

    @property
    def rests(self) -> bool:
        """Whether the robot stands; see `RunningPlan.rests`."""
        return self._mode == "standing"

    def update(self, measured: Measurement) -> None:
        """Write references and switch contacts; see `RunningPlan.update`."""
        t, state = measured.t, self._state
        state.update(t, measured.q, measured.v)
        if not self._begun:
            self.start(state)
        self._feel(measured)
        try:
            self._falling.check(state)
        except FallError as error:
            raise FallError(f"{error}{self._groundless()}") from None
        self._step(t, measured)
        self._height.write(t, *self._rise.sample(t))
        rotation = turned(self._yaw - self._first_yaw, self._rotation)
        self._trunk.write(t, rotation, self._velocity.turn * _UP)
        for foot in self._feet:
            foot.follow(state)
        self._last = t

    def _feel(self, measured: Measurement) -> None:
        """Store which contacts have been sensed since the start."""
        for foot in self._feet:
            force = measured.normal_force(foot.frame, foot.normal)
            self._sensed[foot.name] |= force is not None and force > self._touch

    def _groundless(self) -> str:
        """Return the message on feet that never had contact."""
        never = [name for name, touched in self._sensed.items() if not touched]
        if not never:
            return ""
        return (
            f"; no ground was ever sensed at {listing(never)}: do they have shapes in "
            "plant.contacts, and is the ground at the height of start.ground?"
        )

    # -- the body ---------------------------------------------------------------------

    def _wanted(self, t: float) -> Velocity:
        """Return the desired velocity, limited to the reach of the legs."""
        if self.stopping:
            return Velocity(0.0, 0.0, 0.0)
        wanted = self.gait.velocity_at(t)
        speeds = [foot.speed(wanted) / foot.reach for foot in self._feet]
        excess = self._stride_time * max(speeds)
        return wanted if excess <= 1.0 else Velocity(*(v / excess for v in wanted))

    def _accelerate(self, t: float) -> None:
        """Bring the velocity nearer to the desired one, and integrate the heading."""
        h = t - self._last
        most = self.gait.acceleration * h
        # A metre per second and a radian per second change equally fast.
        self._velocity = self._velocity.towards(self._wanted(t), (most, most, most))
        self._yaw += h * self._velocity.turn

    def _world_velocity(self) -> Array:
        axes = Footstep(0.0, 0.0, self._yaw)
        return axes.world(np.array([self._velocity.forward, self._velocity.left]))

    def _ground(self) -> float:
        """Return the mean height of the feet at their present or last stance [m]."""
        return sum(foot.height for foot in self._feet) / len(self._feet)

    def _slope(self) -> Array:
        """Return the gradient of the plane through the feet, shape (2,) [-]."""
        places = np.array([self._state.position(foot.frame) for foot in self._feet])
        away = places - places.mean(axis=0)
        slope = np.linalg.lstsq(away[:, :2], away[:, 2], rcond=None)[0]
        return np.asarray(slope if np.hypot(*slope) > _SLOPE else 0.0 * slope)

    # -- a foot -----------------------------------------------------------------------

    def _lift_off(self, foot: PointFoot, t: float) -> None:
        """Begin the swing of a foot, at first upwards."""
        foot.lift(t)
        here = self._state.position(foot.frame)
        foot.swing = foot.followed = Swing(
            t,
            self.gait.swing,
            here,
            np.eye(3),
            Footstep(float(here[0]), float(here[1]), 0.0),
            np.eye(3),
            foot.height - _PRESS,
            self.gait.lift,
            self._slope(),
        )

    def _has_landed(self, foot: PointFoot, measured: Measurement) -> bool:
        """Return whether a foot has landed, also in this period."""
        t, swing = measured.t, foot.swing
        if swing is None:
            return True
        force = measured.normal_force(foot.frame, foot.normal)
        if force is None:
            lands = t >= swing.end
        else:
            touched = swing.share(t) > EARLY and force > self._touch
            lands = touched or t > swing.end + LATE
        if lands:
            foot.set_down(t, 0.5 * self.gait.stance)
            foot.swing = None
            foot.height = float(self._state.position(foot.frame)[2])
            # The trunk follows the ground.
            target = [self._ground() + self._above]
            self._rise = to_rest(self._rise.sample(t), target, t, RISE)
        return lands
