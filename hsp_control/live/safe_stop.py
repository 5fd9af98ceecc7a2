"""The safe stop: first damping, then hold, on the feet that stand."""

from collections.abc import Sequence
from enum import IntEnum

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.constraints.contacts import Contact
from hsp_control.control.measurement import Measurement
from hsp_control.live.settings import StopSettings
from hsp_control.robot import Robot, RobotState


class Phase(IntEnum):
    """Phase of a robot under a loop, from its start to its stop."""

    WAITING = 0
    RUNNING = 1
    DAMPING = 2
    HOLDING = 3


_STEEPEST = 0.5
"""Smallest upward part of the normal of a plane that carries weight [-]: one of 60°.
Steeper ones, such as a wall, may only be pushed: the joints that are held do it."""
_SMALLEST = 1e-6
"""Singular values below this share of the largest are directions that feet cannot push
in, such as the turning about the line between two points."""


class StandingFeet:
    """The active contacts, and the efforts that they let the joints deliver.

    A generalized force x, shape (nv,), is the sum of the forces of joints and feet,
    x = Sᵀ tau + Jᵀ f. Its rows without motors determine the forces f at the feet's
    points, of minimum norm; then tau = S (x - Jᵀ f). While the feet stand still,
    J v = 0, these efforts do the work of x: vᵀ Sᵀ tau = vᵀ x.

    Without motors in six rows, and without a foot that stands, nothing holds the robot.
    """

    def __init__(self, robot: Robot, contacts: Sequence[Contact]) -> None:
        self._robot = robot
        self._all = tuple(c for c in contacts if c.axes[2, 2] >= _STEEPEST)
        self._base = list(robot.unactuated)
        self.contacts = self._all  # the contacts that are active now

    @property
    def hold(self) -> bool:
        """Whether the robot can be held: by its base, or by a foot that stands."""
        return not self._base or bool(self.contacts)

    def update(self, measured: Measurement) -> None:
        """Find which contacts are active: those that are pressed."""
        if self._base:
            self.contacts = tuple(c for c in self._all if _stands(c, measured))

    def lift(self) -> None:
        """Let no contact be active any more."""
        self.contacts = ()

    def joint_effort(self, state: RobotState, force: Array) -> Array:
        """Return the efforts (nv,) that exert x (nv,) with the feet's help."""
        if not self._base:
            return force
        effort = force.copy()
        if self.contacts:
            J = np.vstack([_points_jacobian(each, state) for each in self.contacts])
            inverse = np.linalg.pinv(J[:, self._base].T, rcond=_SMALLEST)
            effort -= J.T @ (inverse @ force[self._base])
        effort[self._base] = 0.0
        return effort


def _stands(contact: Contact, measured: Measurement) -> bool:
    force = measured.normal_force(contact.frame, contact.axes[:, 2])
    return contact.active(measured.t) if force is None else force > 0.0


def _points_jacobian(contact: Contact, state: RobotState) -> Array:
    """Return the Jacobian of a contact's points, shape (3 k, nv)."""
    frame = state.frame(contact.frame)
    linear, angular = frame.jacobian[:3], frame.jacobian[3:]
    rows = [linear - np.cross(arm, angular, axis=0) for arm in contact.arms(frame)]
    return np.vstack(rows)


class SafeStop:
    """Brakes a robot until it is at rest, then holds its position.

    Damping: tau = g(q) - s k M(q) v. The kinetic energy obeys T' = -s k vᵀM v. This is
    negative for any true inertia of the robot, because the model's M is positive
    definite. (Coriolis terms do no work; compensating them with a wrong model would.)
    With an exact model T falls like exp(-2 k t) for heavy and light joints alike, so
    that one gain k is enough. s, in [0, 1], scales the whole vector into the effort
    limits: damping that is clipped joint by joint can accelerate the robot.

    With other masses or an unknown load g(q) is wrong by d, and a joint that is only
    damped sinks at d/(k M); so an estimate of d is subtracted where there is one.

    Hold: tau = g(q) - ω² M₀ (q ⊖ q₀) - 2 ω M₀ v with M₀ at the configuration q₀ where
    the robot came to rest: the PD control with gravity compensation of Takegaki and
    Arimoto (1981), stable for any inertia.

    A robot with a floating base stands on its feet meanwhile: the share of damping and
    hold on its base is exerted through the feet that stand (`StandingFeet`). If none
    stands, or after a fall, nothing can hold it. Then its joints are damped only, tau_j
    = -k M_jj v_j: the robot sinks, and does not thrash.

    Attributes:
        feet: What the robot stands on.
        phase: `Phase.DAMPING` or `Phase.HOLDING`.
        damped_for: Time spent damping [s].
        held_for: Time spent holding [s].
    """

    def __init__(
        self,
        robot: Robot,
        settings: StopSettings,
        effort_limits: Array,
        period: float,
        feet: StandingFeet | None = None,
    ) -> None:
        """Check the gains for this period.

        Args:
            robot: The model.
            settings: Gains and durations.
            effort_limits: Upper limits of the efforts, shape (nv,); they may change.
            period: Time between two calls of `effort` [s].
            feet: What a robot with a floating base stands on; None: nothing.

        Raises:
            LiveError: If the period is too long for the settings.
        """
        settings.check_period(period)
        self._robot, self._settings, self._period = robot, settings, period
        self._effort_limits = effort_limits
        self.feet = StandingFeet(robot, ()) if feet is None else feet
        self._base = list(robot.unactuated)
        self._rest = np.zeros(robot.nv)
        self.begin()

    def begin(self) -> None:
        """Start a safe stop, with damping."""
        self.phase = Phase.DAMPING
        self.damped_for = self.held_for = 0.0
        self._held_q: Array = self._robot.neutral()
        self._held_mass = np.zeros((self._robot.nv, self._robot.nv))

    @property
    def done(self) -> bool:
        """Whether the robot has been held for `StopSettings.hold`."""
        held = self.held_for >= self._settings.hold - 0.5 * self._period
        return self.phase == Phase.HOLDING and held

    def effort(self, state: RobotState, disturbance: Array | None = None) -> Array:
        """Return the effort of this period at the state, shape (nv,); once a period.

        Args:
            state: The state, measured or predicted.
            disturbance: What acts besides the model's gravity and is compensated, shape
                (nv,) [N·m or N]; None: nothing.
        """
        settings, v = self._settings, state.v
        if self.phase == Phase.DAMPING and (
            float(np.abs(v).max()) <= settings.rest_speed
            or self.damped_for >= settings.longest_damping
        ):
            self.phase = Phase.HOLDING
            self._held_q, self._held_mass = state.q.copy(), state.mass_matrix.copy()
        if self.phase == Phase.DAMPING:
            self.damped_for += self._period
        else:
            self.held_for += self._period
        if not self.feet.hold:
            return self._sinking(state)
        if self.phase == Phase.DAMPING:
            braking = -settings.damping * (state.mass_matrix @ v)
        else:
            w = settings.natural_frequency
            displacement = self._robot.difference(self._held_q, state.q)
            braking = -(self._held_mass @ (w * w * displacement + 2.0 * w * v))
        rest = self._rest  # with what the state's robot carries
        gravity = self._robot.inverse_dynamics(state.q, rest, rest, state.dynamics)
        if disturbance is not None:
            gravity = gravity - disturbance
        gravity, braking = (
            self.feet.joint_effort(state, force) for force in (gravity, braking)
        )
        return gravity + largest_scale(gravity, braking, self._effort_limits) * braking

    def _sinking(self, state: RobotState) -> Array:
        """Return the effort that only damps the joints, shape (nv,)."""
        v = state.v.copy()
        v[self._base] = 0.0
        braking = -self._settings.damping * (state.mass_matrix @ v)
        braking[self._base] = 0.0
        return largest_scale(self._rest, braking, self._effort_limits) * braking


def largest_scale(base: Array, direction: Array, limits: Array) -> float:
    """Return the largest s in [0, 1] with |base + s direction| ≤ limits; 0 if none."""
    room = np.maximum(limits - np.sign(direction) * base, 0.0)
    size = np.abs(direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        scales = np.where(size > room, room / size, 1.0)
    return float(scales.min(initial=1.0))
