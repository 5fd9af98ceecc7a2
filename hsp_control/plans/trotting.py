"""A quadruped that trots: one run, from swing to swing."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import PlanError
from hsp_control.control.controller import Controller
from hsp_control.control.log_channel import LogChannel
from hsp_control.control.measurement import Measurement
from hsp_control.plans.falling import FallDetector
from hsp_control.plans.footsteps import Footstep, Velocity
from hsp_control.plans.legs import hip_height, leg_length
from hsp_control.plans.pendulum import GRAVITY
from hsp_control.plans.plan import RunningPlan
from hsp_control.plans.swing import Swing, turned
from hsp_control.robot import RobotState
from hsp_control.trajectories.fed import Fed, FedOrientation
from hsp_control.trajectories.switch import Switch

if TYPE_CHECKING:
    from hsp_control.plans.trot import Trot

READY = 0.2
"""Time on four feet before the first swing; the body waits for it [s]."""
LATE = 0.1
"""How long a foot without ground under it is waited for [s]."""
EARLY = 0.6
"""Share of a swing before which no force counts as touchdown."""
LEASH = 0.1
"""How far the reference may be from the centre of mass [m]."""
CLOSING = 2
"""Swings without velocity before it stands, which bring the feet below the hips."""
_PRESS = 0.002
"""How far below the ground a swing foot aims, so that it does not miss it [m]."""
_COMMITTED = 0.05
"""A step is not moved so shortly before it lands [s]."""
_UP = np.array([0.0, 0.0, 1.0])

Mode = Literal["standing", "ready", "four", "two"]


class PointFoot:
    """A foot that touches the ground in a point.

    Attributes:
        name: The name of its contact and of its task.
        frame: Its frame.
        normal: The normal of the ground, shape (3,) [-].
        contact: Switches the contact.
        task: Switches the task that moves it.
        position: The reference of its frame's origin.
        swing: Its motion while it swings; None while it bears.
    """

    def __init__(self, name: str, controller: Controller) -> None:
        """Find its parts in a controller.

        Raises:
            PlanError: If the controller is not made of the plan's parts.
        """
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
                f"the foot {name!r} does not follow the plan: make the controller of "
                "the plan's parts"
            )
        self.frame, self.normal = contact.frame, contact.axes[:, 2]
        self.contact, self.task = contact.schedule, task.schedule
        self.position = task.followed
        self.swing: Swing | None = None

    def start(self, state: RobotState, middle: Footstep) -> None:
        """Stand where the robot is; ``middle`` is below its centre of mass."""
        self.contact.reset()
        self.task.reset()
        self.swing = None
        here = state.position(self.frame)
        self.height = float(here[2])
        self.offset: Array = middle.local(here)


class RunningTrot(RunningPlan):
    """What a `Trot` became for one run."""

    def __init__(
        self, trot: "Trot", controller: Controller, feet: tuple[str, ...]
    ) -> None:
        """Find the references and the switches.

        Args:
            trot: The plan.
            controller: A controller that is made of its parts.
            feet: The names of the contacts that trot.

        Raises:
            PlanError: If the controller is made of other parts.
        """
        super().__init__(trot)
        self.trot = trot
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
                "plan: make the controller of the plan's parts"
            )
        self._trunk, self._height, self._body = trunk, height, body
        self._trunk_frame: str = tasks["trunk"].frame  # type: ignore[attr-defined]
        self._feet = [PointFoot(name, controller) for name in feet]
        mass = sum(inertia.mass for inertia in controller.robot.model.inertias)
        self._touch = trot.contact_force * mass * GRAVITY
        self._mode: Mode = "standing"
        self._begun = False

    def start(self, state: RobotState) -> None:
        """Stand where the robot is; see `RunningPlan.start`."""
        frame = state.frame(self._trunk_frame)
        mass = state.centroidal.position
        yaw = float(np.arctan2(frame.rotation[1, 0], frame.rotation[0, 0]))
        middle = Footstep(float(mass[0]), float(mass[1]), yaw)
        for foot in self._feet:
            foot.start(state, middle)
        # The offsets are from the middle of the feet, below which the mass is to be.
        center = np.mean([foot.offset for foot in self._feet], axis=0)
        for foot in self._feet:
            foot.offset = foot.offset - center
        self._pairs = self._diagonals()
        self._first_yaw = self._yaw = yaw
        self._rotation, self._first_height = frame.rotation.copy(), float(mass[2])
        lowest = min(foot.height for foot in self._feet)
        self._time_constant = float(np.sqrt((mass[2] - lowest) / GRAVITY))
        self._check_stride(state)
        frames = tuple(foot.frame for foot in self._feet)
        self._falling = FallDetector(self._trunk_frame, frames, state)
        self._reference: Array = mass[:2].copy()
        self._velocity = Velocity(0.0, 0.0, 0.0)
        self._last, self._since = state.t, state.t
        self._mode, self._swings, self._idle = "standing", 0, 0
        names = [foot.name for foot in self._feet]
        self._controller.prepare(state, without=names)
        for pair in self._pairs:
            for aloft in (pair, pair[:1], pair[1:]):  # one may land before the other
                lifted = [foot.name for foot in aloft]
                down = [name for name in names if name not in lifted]
                self._controller.prepare(state, lifted=lifted, without=down)
        self._begun = True

    def _diagonals(self) -> tuple[list[PointFoot], list[PointFoot]]:
        """Return the two pairs of diagonal feet.

        Raises:
            PlanError: If the feet do not stand at the corners of a body.
        """
        corners: dict[tuple[bool, bool], PointFoot] = {}
        for foot in self._feet:
            corners[bool(foot.offset[0] > 0.0), bool(foot.offset[1] > 0.0)] = foot
        if len(corners) < 4:
            raise PlanError(
                "the feet do not stand at the four corners of the body, so that there "
                "are no diagonals to trot with"
            )
        front_left, front_right = corners[True, True], corners[True, False]
        hind_left, hind_right = corners[False, True], corners[False, False]
        return [front_left, hind_right], [front_right, hind_left]

    def _check_stride(self, state: RobotState) -> None:
        trot = self.trot
        speed = float(np.hypot(trot.speed, trot.sideways))
        excursion = 0.5 * speed * (trot.swing + 2.0 * trot.stance)
        for foot in self._feet:
            square = (
                leg_length(state.robot, foot.frame) ** 2
                - hip_height(state, foot.frame) ** 2
            )
            reach = 0.9 * float(np.sqrt(max(square, 0.0)))
            if excursion > reach:
                raise PlanError(
                    f"at {speed:.3g} m/s a foot is {excursion:.3g} m before and behind "
                    f"its hip; the leg of {foot.name!r} reaches {reach:.3g} m. Trot "
                    "slower, or with a shorter swing"
                )

    def update(self, measured: Measurement) -> None:
        """Write references and switch contacts; see `RunningPlan.update`."""
        t, state = measured.t, self._state
        state.update(t, measured.q, measured.v)
        if not self._begun:
            self.start(state)
        self._falling.check(state)
        acceleration = self._drive(t)
        self._go_on(measured)
        self._place(t)
        self._write(t, acceleration)

    def log_channels(self) -> Mapping[str, LogChannel]:
        """Return the phase and the velocity."""
        phase = {"standing": 0.0, "ready": 1.0, "four": 1.0, "two": 2.0}[self._mode]
        if self._mode == "two" and self._swings % 2:
            phase = 3.0
        return {
            "plan.phase": LogChannel(
                phase, "-", "0 stands; 1 on four feet; 2, 3 a diagonal pair swings"
            ),
            "plan.steps": LogChannel(float(self._swings), "-", "swings so far"),
            "plan.velocity": LogChannel(
                np.array(self._velocity), "m/s and rad/s", "forward, left, turning"
            ),
        }

    # -- from swing to swing ----------------------------------------------------------

    def _drive(self, t: float) -> Array:
        """Advance velocity and reference; return the acceleration [m/s²]."""
        h, self._last = t - self._last, t
        if h <= 0.0 or self._mode in {"standing", "ready"}:
            return np.zeros(2)
        before, most = self._world_velocity(), self.trot.acceleration * h
        wanted = self.trot.velocity_at(t)
        # A metre per second and a radian per second change equally fast.
        self._velocity = Velocity(
            *(
                a + min(max(b - a, -most), most)
                for a, b in zip(self._velocity, wanted, strict=True)
            )
        )
        self._yaw += h * self._velocity.turn
        now = self._world_velocity()
        self._reference = self._reference + 0.5 * h * (before + now)
        away = self._state.centroidal.position[:2] - self._reference
        far = float(np.hypot(*away))
        if far > LEASH:  # somebody pushes it: the reference comes along
            self._reference = self._reference + away * (1.0 - LEASH / far)
        return (now - before) / h

    def _world_velocity(self) -> Array:
        axes = Footstep(0.0, 0.0, self._yaw)
        return axes.world(np.array([self._velocity.forward, self._velocity.left]))

    def _go_on(self, measured: Measurement) -> None:
        t, trot = measured.t, self.trot
        wanted = trot.velocity_at(t)
        if self._mode == "standing":
            if not wanted.is_zero:
                self._mode, self._idle = "ready", 0
                self._since = t + READY - trot.stance
                self._unload(self._since)
        elif self._mode in {"ready", "four"}:
            if t >= self._since + trot.stance - 1e-9:
                self._lift_off(t)
        elif all(self._has_landed(foot, measured) for foot in self._pair):
            self._swings += 1
            self._idle = self._idle + 1 if self._velocity.is_zero else 0
            if wanted.is_zero and self._idle >= CLOSING:
                self._mode = "standing"
                return
            self._mode, self._since = "four", t
            self._unload(t)

    @property
    def _pair(self) -> list[PointFoot]:
        """The feet that swing, or swing next."""
        return self._pairs[self._swings % 2]

    def _unload(self, t: float) -> None:
        """Let the force of the next pair fade while all feet bear."""
        for foot in self._pair:
            foot.contact.throw(False, t, self.trot.stance)

    def _lift_off(self, t: float) -> None:
        self._mode = "two"
        for foot in self._pair:
            foot.contact.throw(False, t)
            foot.task.throw(True, t)
            here = self._state.frame(foot.frame)
            target = Footstep(float(here.position[0]), float(here.position[1]), 0.0)
            foot.swing = Swing(
                t,
                self.trot.swing,
                here.position,
                np.eye(3),
                target,
                np.eye(3),
                foot.height - _PRESS,
                self.trot.lift,
            )

    def _has_landed(self, foot: PointFoot, measured: Measurement) -> bool:
        """Return whether a foot bears, perhaps since now."""
        t, swing = measured.t, foot.swing
        if swing is None:
            return True
        force = measured.normal_force(foot.frame, foot.normal)
        if force is None:
            lands = t >= swing.end
        else:
            felt = swing.share(t) > EARLY and force > self._touch
            lands = felt or t > swing.end + LATE
        if lands:
            foot.contact.throw(True, t, 0.5 * self.trot.stance)
            foot.task.throw(False, t)
            foot.swing = None
        return lands

    # -- references -------------------------------------------------------------------

    def _place(self, t: float) -> None:
        """Let the feet that swing go to where the body will be."""
        mass, trot = self._state.centroidal, self.trot
        velocity, wanted = mass.velocity[:2], self._world_velocity()
        axes = Footstep(0.0, 0.0, self._yaw)
        for foot in self._pair:
            swing = foot.swing
            if swing is None or swing.end - t <= _COMMITTED:
                continue
            target = (
                mass.position[:2]
                + velocity * (swing.end - t)
                + axes.world(foot.offset)
                + 0.5 * (trot.swing + trot.stance) * wanted
                + self._time_constant * (velocity - wanted)
            )
            place = Footstep(float(target[0]), float(target[1]), 0.0)
            swing.redirect(t, place, swing.end)

    def _write(self, t: float, acceleration: Array) -> None:
        self._body.write(t, self._reference, self._world_velocity(), acceleration)
        self._height.write(t, [self._first_height])
        rotation = turned(self._yaw - self._first_yaw, self._rotation)
        self._trunk.write(t, rotation, self._velocity.turn * _UP)
        for foot in self._feet:
            if foot.swing is not None:
                foot.position.write(t, *foot.swing.position(t))
