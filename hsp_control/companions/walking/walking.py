"""The walk of a biped, and its run from phase to phase."""

from collections.abc import Mapping
from typing import Literal

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import PlanError
from hsp_control.companions.walking.biped import BODY, TRUNK, BipedPlan
from hsp_control.companions.walking.foot import Foot
from hsp_control.companions.walking.footsteps import Footstep, Velocity, between
from hsp_control.companions.walking.given_steps import GivenSteps
from hsp_control.companions.walking.leg_reaction import LegReaction
from hsp_control.companions.walking.pendulum import (
    GRAVITY,
    DcmPhase,
    dcm_of,
    in_step,
    plan_dcm,
)
from hsp_control.companions.walking.planned_references import Fed, FedOrientation
from hsp_control.companions.walking.polygon import (
    convex_hull,
    last_inside,
    nearest_inside,
)
from hsp_control.companions.walking.push_recovery import PlannedSwing, PushRecovery
from hsp_control.companions.walking.quintic import at_rest, to_rest
from hsp_control.companions.walking.step_planner import StepPlanner, stance_of
from hsp_control.companions.walking.swing import Swing, turned
from hsp_control.control.interface import (
    Controller,
    FallDetector,
    LogChannel,
    Measurement,
    RunningPlan,
)
from hsp_control.robot import RobotState

FIRST_SHIFT = (0.4, 0.6)
"""Time to get ready, and time to shift the weight for the first step [s]."""
LATE = 0.2
"""Maximum wait for a foot without ground under it [s]."""
EARLY = 0.6
"""Share of a swing before which no force is treated as touchdown."""
LANDING = 0.5
"""Time in which the force of a landed foot rises, in double supports [-]."""
_SHIFTS = 0.5, 2.0
"""The shortest and the longest shift of the weight after a step, in those planned."""
_HELD = 1.1
"""Share of the soles that an interrupted walk uses: for a while the law supplies the
rest by motion of the arms [-]."""
_CALM = 0.02
"""Error of the divergent component below which an interrupted walk continues [m]."""

_LEVEL = 0.01
"""Change of the ground's height that is ignored: a sole sinks in [m]."""

Mode = Literal["standing", "double", "single"]


class Walk(BipedPlan, type="walk"):
    """A walk of a biped on flat ground: a plan of the divergent component of motion.

    It stands, walks with the given velocity, and stands again when that is zero or the
    steps are done. The centre of mass follows the pendulum with feedback within the
    sole (`pendulum.py`); a push that the sole cannot withstand adjusts the next step,
    in place and in time (`step_adjustment.py`). A swing foot becomes a contact at
    touchdown, early or late.

    It has the tasks ``center_of_mass`` and ``trunk``, and one per foot with the
    name of its contact.
    """

    def begin(self, controller: Controller) -> "RunningWalk":
        """Return the walk of a run; see `MotionPlan.begin`."""
        names = self._feet(controller.contacts)
        return RunningWalk(self.begun(), controller, names, BODY, TRUNK)


class RunningWalk(RunningPlan):
    """A `Walk` in one run: phases, footsteps and feedback.

    On two feet the repellent point moves from sole to sole while the force of the next
    swing foot fades; on one foot it rests there. The references are those of the
    pendulum from the present centre of mass, so that an error of the divergent
    component decays as exp(-k t) while the repellent point stays within the soles.
    """

    def __init__(
        self,
        walk: Walk,
        controller: Controller,
        feet: tuple[str, ...],
        body: str,
        trunk: str,
    ) -> None:
        """Find the references and the switches.

        Args:
            walk: The plan.
            controller: A controller built from its parts.
            feet: The names of the contacts that walk.
            body: The name of the task of the centre of mass.
            trunk: The name of the task of the trunk.

        Raises:
            PlanError: If the controller is built from other parts.
        """
        super().__init__(walk)
        self.walk = walk
        self._controller = controller
        self._state = RobotState(controller.robot)
        tasks = {task.name: task for task in controller.tasks}
        missing = [name for name in (body, trunk, *feet) if name not in tasks]
        if missing:
            raise PlanError(
                f"the controller has no task {missing[0]!r}: build it from the plan's "
                "parts"
            )
        moved, turned_by = tasks[body].followed, tasks[trunk].followed
        if not (isinstance(moved, Fed) and isinstance(turned_by, FedOrientation)):
            raise PlanError(
                f"the tasks {body!r} and {trunk!r} do not follow the plan: build the "
                "controller from the plan's parts"
            )
        self._body, self._trunk = moved, turned_by
        self._trunk_frame: str = tasks[trunk].frame  # type: ignore[attr-defined]
        found = [Foot(name, controller) for name in feet]
        weight = sum(inertia.mass for inertia in controller.robot.model.inertias)
        self._touch = walk.contact_force * weight * GRAVITY
        self._feet: dict[float, Foot] = dict(zip((1.0, -1.0), found, strict=True))
        self._begun = False
        self._mode: Mode = "standing"

    def update(self, measured: Measurement) -> None:
        """Write references and switch contacts; see `RunningPlan.update`."""
        t, state = measured.t, self._state
        state.update(t, measured.q, measured.v)
        if not self._begun:
            self.start(state)
        self._falling.check(state)
        mass = state.centroidal
        self._dcm = dcm_of(mass.position, mass.velocity, self._frequency)
        self._go_on(measured)
        if self._mode == "single" and self.walk.adjusts:
            self._adjust(t)
        self._write(t, mass.position, mass.velocity)

    def log_channels(self) -> Mapping[str, LogChannel]:
        """Return the phase, the divergent component, and the next footstep."""
        phase = {"standing": 0.0, "double": 1.0, "single": 2.0}[self._mode]
        if self._mode == "single" and self._side < 0.0:
            phase = 3.0
        return {
            "plan.phase": LogChannel(
                phase, "-", "0 stands; 1 on two feet; 2 left, 3 right foot swings"
            ),
            "plan.steps": LogChannel(float(self._taken), "-", "steps completed"),
            "plan.dcm": LogChannel(self._dcm, "m", "divergent component of motion"),
            "plan.dcm_reference": LogChannel(self._dcm_wanted, "m", "desired"),
            "plan.repellent_point": LogChannel(
                self._point, "m", "desired centre of pressure, within the soles"
            ),
            "plan.footstep": LogChannel(
                np.array(self._target), "m and rad", "where the swing foot lands"
            ),
        }

    def stop(self) -> None:
        """Stand with the feet beside each other; see `RunningPlan.stop`."""
        super().stop()
        if self._begun:
            self._planner.stopping = True

    @property
    def rests(self) -> bool:
        """Whether the robot stands; see `RunningPlan.rests`."""
        return self._mode == "standing"

    # -- the start --------------------------------------------------------------------

    def start(self, state: RobotState) -> None:
        """Stand at the robot's present pose; see `RunningPlan.start`."""
        t, walk = state.t, self.walk
        trunk = state.frame(self._trunk_frame).rotation
        feet = list(self._feet.values())
        # It walks in the direction of its feet; the left one is on the left.
        ahead = state.frame(feet[0].frame).rotation[:, 0]
        away = state.position(feet[0].frame) - state.position(feet[1].frame)
        if ahead[0] * away[1] < ahead[1] * away[0]:
            feet.reverse()
        self._feet = dict(zip((1.0, -1.0), feet, strict=True))
        heading = float(np.arctan2(ahead[1], ahead[0]))
        for foot in feet:
            foot.begin(state, heading)
        mass = state.centroidal.position
        ground = max(foot.height for foot in feet)
        self._height = float(mass[2])
        pendulum = self._height - walk.crouch - ground
        if pendulum <= 0.0:
            raise PlanError(
                f"crouch is {walk.crouch} m; the centre of mass is only "
                f"{self._height - ground:.3g} m above the feet"
            )
        sides = {side: foot.frame for side, foot in self._feet.items()}
        self._legs = LegReaction(self._controller, self._trunk_frame, sides)
        pendulum += self._legs.pendulum(state)
        self._frequency = float(np.sqrt(GRAVITY / pendulum))
        self._stance = stance_of(self._feet, state, walk.crouch)
        self._recovery = PushRecovery(walk, self._stance, self._frequency)
        robot, places = state.robot.name, self._places
        if walk.footsteps is None:
            self._planner = StepPlanner(walk, self._stance, robot)
        else:
            self._planner = GivenSteps(walk, self._stance, robot, places)
        self._planner.stopping = self.stopping
        self._trunk_rotation = trunk.copy()
        self._first_yaw = between(feet[0].place, feet[1].place).yaw
        self._yaw = to_rest(at_rest([self._first_yaw]), [self._first_yaw], t, 1.0)
        self._sinking = to_rest(
            at_rest([self._height]), [self._height - walk.crouch], t, 1.0
        )
        frames = feet[0].frame, feet[1].frame
        self._falling = FallDetector(self._trunk_frame, frames, state)
        self._taken, self._side, self._held = 0, 1.0, False
        self._above, self._ground = self._height - walk.crouch - ground, ground
        self._now = Velocity(0.0, 0.0, 0.0)
        self._swing: Swing | None = None
        self._legs.begin(state, self._first_yaw, walk.swing, self._frequency)
        self._dcm = self._dcm_wanted = self._point = self._middle()
        self._target = self._feet[1.0].place
        self._stand(t)
        names = [foot.name for foot in feet]
        self._controller.prepare(state, without=names)
        for swinging, standing in (names, names[::-1]):
            self._controller.prepare(state, lifted=[swinging], without=[standing])
        self._begun = True

    # -- from phase to phase ----------------------------------------------------------

    def _go_on(self, measured: Measurement) -> None:
        """Begin the next phase when one ends."""
        t = measured.t
        while self._index + 1 < len(self._times) and t >= self._times[self._index + 1]:
            if self._swings[self._index]:
                break  # a swing ends when the foot has landed
            self._index += 1
            if self._mode == "double" and self._swings[self._index]:
                plan, soles = self._planned_swing(0.0), self._soles(1.0)
                if self.walk.adjusts and self._recovery.holds(plan, soles):
                    self._hold(t)
                else:
                    self._lift_off(t)
        if self._mode == "single":
            if self._has_landed(measured):
                self._land(t)
        elif self._mode == "standing":
            # An interrupted walk waits until its error is small.
            error = np.abs(self._dcm - self._dcm_wanted).max() if self._held else 0.0
            if error < _CALM and self._planner.sets_out(t, self._taken):
                self._set_out(t)
        elif self._index + 1 == len(self._phases):
            self._mode = "standing"

    def _stand(self, t: float) -> None:
        self._mode = "standing"
        middle = self._middle()
        self._follow(t, [DcmPhase(1.0, middle, middle)], [False])

    def _set_out(self, t: float) -> None:
        """Shift the weight for the first step."""
        if not self._held:  # otherwise it continues with the foot that was to swing
            self._side = self._planner.first_side(t, self._taken)
        self._held = False
        ready, shift = FIRST_SHIFT
        middle = self._middle()
        self._mode = "double"
        self._plan(t, [DcmPhase(ready, middle, middle)], shift, middle)
        self._feet[self._side].unload(t + ready, shift)

    def _hold(self, t: float) -> None:
        """Keep both feet on the ground, and move the mass back between them."""
        foot = self._feet[self._side]
        foot.set_down(t, LANDING * self.walk.double_support)
        self._now, self._held = Velocity(0.0, 0.0, 0.0), True
        self._stand(t)
        self._hull = self._soles(_HELD)

    def _put_down(self, t: float) -> None:
        """Stand on one foot, and put the other one down at its present place."""
        assert self._swing is not None
        foot, standing = self._feet[self._side], self._feet[-self._side]
        self._now, self._held = Velocity(0.0, 0.0, 0.0), True
        x, y = self._state.position(foot.frame)[:2].tolist()
        here = foot.place_of(Footstep(x, y, foot.place.yaw))
        place = self._stance.kept(standing.place, self._side, here)
        end = t + 0.5 * self.walk.swing
        self._swing.redirect(t, foot.origin_of(place), end, rises=False)
        self._react(t)
        rest = standing.place.point
        self._follow(t, [DcmPhase(1.0, rest, rest)], [True])
        self._hull = standing.corners(_HELD)

    def _lift_off(self, t: float) -> None:
        """Begin the swing of the unloaded foot."""
        foot, walk = self._feet[self._side], self.walk
        foot.lift(t)
        self._mode = "single"
        self._hull = self._feet[-self._side].corners(walk.margin)
        here, standing = self._state.frame(foot.frame), self._feet[-self._side]
        tilt, height, slope = standing.ground(self._state)
        rise = float(slope @ (self._target.point - standing.place.point))
        self._follow_ground(t, standing.sole_height(self._state) + 0.5 * rise)
        self._swing = foot.swing = Swing(
            t,
            walk.swing,
            here.position,
            here.rotation,
            foot.origin_of(self._target),
            tilt @ foot.flat(self._target.yaw),
            height + rise,
            walk.lift,
            slope,
        )
        self._react(t)
        yaw = between(self._feet[-self._side].place, self._target).yaw
        self._yaw = to_rest(self._yaw.sample(t), [yaw], t, walk.swing)
        # Plan again, because a phase ends at a control period.
        self._times[self._index :] += t - self._times[self._index]

    def _has_landed(self, measured: Measurement) -> bool:
        assert self._swing is not None
        t, foot = measured.t, self._feet[self._side]
        force = measured.normal_force(foot.frame, foot.normal)
        if force is None:
            return t >= self._swing.end
        if t > self._swing.end + LATE:
            return True
        return self._swing.share(t) > EARLY and force > self._touch

    def _land(self, t: float) -> None:
        """Set the foot down, and plan the rest from its actual place."""
        foot, walk = self._feet[self._side], self.walk
        foot.set_down(t, LANDING * walk.double_support)
        foot.stand(self._state)
        self._legs.lands(self._state, self._side, self._feet[-self._side].place.yaw)
        self._legs.lifts(self._state, -self._side, foot.place.yaw)
        self._swing, self._mode = None, "double"
        if self._held:  # it was put down; it swings again later
            self._stand(t)
            self._hull = self._soles(_HELD)
            return
        self._taken += 1
        self._side = -self._side
        # From the present centre of pressure, which a push has moved within the sole.
        self._plan(t, [], walk.double_support, self._point)
        if any(self._swings):
            self._feet[self._side].unload(t, self._phases[0].duration)

    def _follow_ground(self, t: float, ground: float) -> None:
        """Keep the height above the ground."""
        if abs(ground - self._ground) > _LEVEL:
            self._ground, height = ground, ground + self._above
            self._sinking = to_rest(
                self._sinking.sample(t), [height], t, self.walk.swing
            )

    def _plan(
        self, t: float, before: list[DcmPhase], shift: float, point: Array
    ) -> None:
        """Plan the next steps, from a phase on two feet on, until it stands.

        Args:
            t: The present time [s].
            before: Phases before that.
            shift: Time in which the weight shifts to the stance foot [s].
            point: The repellent point, shape (2,) [m].
        """
        preview = self._planner.look_ahead(
            t,
            self._taken,
            self._now,
            self._side,
            self._places,
            shift,
            point,
            self._lead,
        )
        self._now = preview.velocity
        if preview.target is not None:
            self._target = preview.target
        phases, none = preview.phases, [False] * len(before)
        if not before and self.walk.adjusts:
            starts, (least, most) = plan_dcm(phases, self._frequency), _SHIFTS
            bounds = least * phases[0].duration, most * phases[0].duration
            phases[0] = in_step(
                phases[0], starts[1], self._dcm, self._frequency, bounds
            )
        self._follow(t, [*before, *phases], [*none, *preview.swings])

    def _lead(
        self, side: float, places: Mapping[float, Footstep], target: Footstep
    ) -> Array:
        """Return the contribution of a step's swing to ξ at its start, (2,) [m]."""
        way = np.append(target.point - places[side].point, self.walk.lift)
        return self._legs.lead(side, places[-side], way)

    def _react(self, t: float) -> None:
        """Compensate the momentum of the swing leg."""
        assert self._swing is not None
        standing = self._feet[-self._side].place
        self._reaction = self._legs.of(self._swing, t, self._side, standing)

    def _follow(self, t: float, phases: list[DcmPhase], swings: list[bool]) -> None:
        """Follow phases from now on."""
        self._phases, self._swings = phases, swings
        self._dcm_starts = plan_dcm(phases, self._frequency)
        durations = [0.0, *(phase.duration for phase in phases[:-1])]
        # A control period that begins a rounding error early belongs to the next phase.
        self._times = t + np.cumsum(durations) - 1e-9
        self._index = 0
        self._hull = self._soles(self.walk.margin)

    # -- feedback ---------------------------------------------------------------------

    def _adjust(self, t: float) -> None:
        """Adjust the step, in place and time, if the sole cannot withstand a push."""
        assert self._swing is not None
        if self._held:
            return
        plan = self._planned_swing(t - self._times[self._index])
        step = self._recovery.step(plan, self._swing, t)
        if step is None:
            return
        if self._recovery.is_better_put_down(plan, step):
            self._put_down(t)
            return
        foot = self._feet[self._side]
        self._swing.redirect(t, foot.origin_of(step.target), t + step.remaining)
        self._react(t)

    def _planned_swing(self, since: float) -> PlannedSwing:
        """Return the swing of this phase, a time after its planned beginning [s]."""
        phase, first = self._phases[self._index], self._dcm_starts[self._index]
        return PlannedSwing(
            self._side,
            self._feet[-self._side],
            self._feet[self._side],
            self._target,
            phase,
            first,
            since,
            phase.dcm(first, since, self._frequency) + self._beside,
            self._dcm,
        )

    def _write(self, t: float, position: Array, velocity: Array) -> None:
        """Write the references of this period."""
        frequency, gain = self._frequency, self.walk.feedback
        phase, since = self._phases[self._index], t - self._times[self._index]
        since = max(since, 0.0)
        if self._index + 1 == len(self._phases):
            since = min(since, phase.duration)
        wanted = phase.dcm(self._dcm_starts[self._index], since, frequency)
        wanted, point = wanted + self._beside, phase.point(since)
        displaced = (1.0 + gain / frequency) * (self._dcm - wanted)
        self._dcm_wanted = wanted
        if self._mode == "single":  # along and across the sole separately
            self._point = nearest_inside(self._hull, point + displaced)
            repels = self._point + self._reaction.point(t)
        else:  # the error converges straight to zero, anywhere in the hull
            self._point = repels = last_inside(self._hull, point, point + displaced)
        height, yaw = self._sinking.sample(t), self._yaw.sample(t)
        acceleration = frequency**2 * (position[:2] - repels)
        self._body.write(
            t,
            np.append(position[:2], height.position),
            np.append(velocity[:2], height.velocity),
            np.append(acceleration, height.acceleration),
        )
        up = np.array([0.0, 0.0, 1.0])
        self._trunk.write(
            t,
            turned(float(yaw.position[0]) - self._first_yaw, self._trunk_rotation),
            yaw.velocity * up,
            yaw.acceleration * up,
        )
        for foot in self._feet.values():
            foot.follow(self._state)

    @property
    def _beside(self) -> Array:
        """Offset of ξ from that of its phase by a swinging leg, shape (2,) [m]."""
        if self._mode == "single":
            return self._reaction.shift(self._state.t)
        if self._swings[self._index]:  # it swings next
            return self._phases[self._index].lead
        return np.zeros(2)

    def _soles(self, share: float) -> Array:
        """Return the corners of a share of both soles, shape (m, 2) [m]."""
        corners = [each.corners(share) for each in self._feet.values()]
        return convex_hull(np.vstack(corners))

    @property
    def _places(self) -> dict[float, Footstep]:
        """The footsteps of both feet, by side."""
        return {side: foot.place for side, foot in self._feet.items()}

    def _middle(self) -> Array:
        return np.asarray(
            0.5 * (self._feet[1.0].place.point + self._feet[-1.0].place.point)
        )
