"""The box: an arm, its modes and its reflexes. It has no sockets and no clock."""

from collections.abc import Callable, Sequence

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import LiveError
from hsp_control.companions.franka.layouts import (
    JOINTS,
    PERIOD,
    ControllerMode,
    FrankaCommand,
    FrankaStatus,
    MotionGenerator,
    MoveStatus,
    RobotMode,
    message,
)
from hsp_control.companions.franka_box import impedance, reference, reflexes
from hsp_control.companions.franka_box.arm import Arm
from hsp_control.companions.franka_box.generators import generator
from hsp_control.companions.franka_box.model import Model
from hsp_control.companions.franka_box.motion import Motion, finished, is_finite
from hsp_control.companions.franka_box.readings import Readings
from hsp_control.companions.franka_box.reflexes import (
    LinkDistances,
    Reference,
    Violation,
)
from hsp_control.simulation.plants import SampledPlant

_REST_SPEED = 1e-3
"""Speed below which the arm is at rest [rad/s]."""
_LONGEST_BRAKING = 3.0
"""Time after which an arm is treated as at rest even if it still moves [s]."""
_CLEAR_ANGLE = 0.01
"""Margin to the limits of a posture to which recovery returns [rad]."""
_CLEAR_DISTANCE = 0.01
"""Distance of its links in that posture [m]."""

Say = Callable[[str], object]
"""A function called with a line for the user."""


class ControlBox:
    """A simulated arm, moved period by period as by a Franka's control box.

    The box adds gravity compensation, by its own model, to a client's effort. Whenever
    no client moves the arm, an impedance controller brakes and holds it.

    Attributes:
        arm: The arm.
        model: The box's own model of it, with the load that a client has set.
        plant: The simulated arm, which may differ.
        readings: The state that a client receives.
        motion: The motion under way, or None.
        mode: The robot's mode.
        thresholds: Of contacts and collisions; none until a client sets them.
        joint_stiffness: Of the joints' impedance controller, shape (7,) [N·m/rad].
        cartesian_stiffness: Of the hand's, shape (6,) [N/m, N·m/rad].
        outbox: Responses to be sent.
        q: True positions, shape (7,) [rad].
        v: True velocities, shape (7,) [rad/s].
        tau: Effort of the motors in the last period, shape (7,) [N·m].
        periods: Number of periods that were simulated.
        at_rest: Whether the arm is at rest, held by the box.
        on_period: Called at the end of each period, for logs.
    """

    def __init__(self, arm: Arm, plant: SampledPlant, q: Array, say: Say) -> None:
        """Hold the arm at its start.

        Args:
            arm: The arm.
            plant: The simulated arm.
            q: Start, shape (7,) [rad].
            say: Called with a line per reflex, and for each end of a motion.

        Raises:
            LiveError: If the start is beyond a limit.
        """
        self.arm, self.plant, self._say = arm, plant, say
        self.model, self.readings = Model(arm), Readings()
        self.motion: Motion | None = None
        self.mode = RobotMode.IDLE
        self.thresholds = reflexes.ReflexThresholds.none()
        self.joint_stiffness: Array = impedance.JOINT_STIFFNESS
        self.cartesian_stiffness: Array = impedance.CARTESIAN_STIFFNESS
        self.outbox: list[bytes] = []
        self.periods, self.at_rest = 0, True
        self.on_period: Callable[[], object] = lambda: None
        self._id, self._braked_for, self._recovery = 0, 0, -1
        self.q, self.v = q.copy(), np.zeros(JOINTS)
        plant.reset(0.0, self.q, self.v)
        self.model.state.update(0.0, self.q, self.v)
        self._self_distance = LinkDistances(self.model.state)
        for line in self._self_distance.unwatched:
            say(line)
        self.tau: Array = self.model.gravity
        self._reference = reference.at_rest(self.q)
        self._goal: Array | None = None
        self._clear: Array = self.q
        self._measure(_ZERO)
        for violation in self._violations():
            raise LiveError(f"the start is not allowed: {violation}")
        self.readings.set_end_effector(self.model)

    @property
    def t(self) -> float:
        """Simulated time [s]."""
        return self.periods * PERIOD

    def state(self) -> tuple[int, bytes]:
        """Return the number of the next state, and the state as it is sent."""
        self._id += 1
        fields, motion = self.readings.fields, self.motion
        wanted, measured = self._reference, self.model.state
        if motion is not None:
            wanted = motion.reference or Reference(measured.q, measured.v, _ZERO)
        hand = motion.generator.hand if motion and motion.generator else None
        self.readings.set_desired(self.model, wanted, hand)
        if motion is not None and motion.external:
            fields["tau_J_d"][:] = motion.effort  # from which its rate is computed
        fields["message_id"][0] = self._id
        fields["robot_mode"][0] = self.mode
        idle = MotionGenerator.IDLE, ControllerMode.OTHER
        modes = (motion.kind, motion.controller) if motion else idle
        fields["motion_generator_mode"][0], fields["controller_mode"][0] = modes
        rate = motion.success_rate if motion else 0.0
        fields["control_command_success_rate"][0] = rate
        return self._id, self.readings.datagram()

    def begin(self, number: int, by: ControllerMode, kind: MotionGenerator) -> None:
        """Start the motion of a request.

        Args:
            number: Number of the request.
            by: The source of the efforts.
            kind: The motion generator.
        """
        start = reference.at_rest(self._reference.q)
        made = generator(kind, start, self.arm.limits, self.model)
        self.motion = Motion(number, by, kind, made)
        self.mode, self.at_rest = RobotMode.MOVE, False
        self._respond(FrankaCommand.MOVE, number, MoveStatus.MOTION_STARTED)
        self._say(f"motion: {self.motion}")

    def end(self, status: MoveStatus, why: str) -> None:
        """End the motion under way, if there is one, and brake the arm.

        Args:
            status: The second answer to its request.
            why: The reason, for the user.
        """
        motion, self.motion = self.motion, None
        if motion is None:
            return
        self.mode = RobotMode.IDLE
        self._respond(FrankaCommand.MOVE, motion.number, status)
        self._say(
            f"motion ended: {why} ({motion.commands} commands, "
            f"{motion.lost_in_all} lost)"
        )
        state = self.model.state
        if motion.reference is None or status is not MoveStatus.SUCCESS:
            self._reference = Reference(state.q.copy(), state.v.copy(), _ZERO)
        else:
            self._reference = motion.reference
        self._brake()

    def recover(self, number: int) -> None:
        """Answer a request for automatic error recovery, later if the arm moves.

        An arm beyond a limit first returns to where it was last clear of all limits.
        """
        if self.mode is not RobotMode.REFLEX:
            recovers = self.mode is RobotMode.AUTOMATIC_ERROR_RECOVERY
            status = (
                FrankaStatus.COMMAND_NOT_POSSIBLE_REJECTED
                if recovers
                else FrankaStatus.SUCCESS
            )
            self._respond(FrankaCommand.AUTOMATIC_ERROR_RECOVERY, number, status)
            return
        self.mode, self._recovery = RobotMode.AUTOMATIC_ERROR_RECOVERY, number
        if not self._is_allowed():
            self._goal = self._clear
            self._say("recovery: the arm returns to where it was clear of its limits")
        self._brake()

    def step(self, command: np.void | None) -> None:
        """Simulate a period of a millisecond.

        Args:
            command: The command received for the last state (`wire.COMMAND`), or None.
        """
        if self.motion is not None:
            self._receive(self.motion, command)
        motion = self.motion
        gravity = self.model.gravity
        if motion is None:
            effort = self._own_effort(gravity)
        elif motion.external:
            effort = motion.effort
        else:
            assert motion.reference is not None
            of_hand = motion.controller is ControllerMode.CARTESIAN_IMPEDANCE
            effort = self._tracking_effort(motion.reference, gravity, of_hand=of_hand)
        self.tau = effort + gravity
        end = (self.periods + 1) * PERIOD
        self.q, self.v = self.plant.advance(self.t, end, self.tau)
        self.periods += 1
        self._measure(effort)
        if motion is not None:
            violations = list(self._violations())
            if violations:
                self._reflex(violations)
        else:
            self._come_to_rest()
        self.on_period()

    def settle(self) -> None:
        """Simulate until the arm is at rest, and a recovery has ended."""
        while not self.at_rest:
            self.step(None)
            self._id += 1  # shows a client that time has passed

    def carry(self, load: pin.Inertia) -> None:
        """Set the load that the box compensates, in the flange's frame."""
        self.model.carry(load)
        self.model.state.update(self.t, *self._measured)

    def gravity_with(self, load: pin.Inertia) -> Array:
        """Return the joints' efforts against gravity with a load, shape (7,) [N·m]."""
        robot, rest = self.arm.carrying(load), np.zeros(JOINTS)
        return robot.inverse_dynamics(self.model.state.q, rest, rest)

    def _receive(self, motion: Motion, command: np.void | None) -> None:
        """Follow a client's command, or continue without one."""
        if command is None:
            motion.miss()
            lost = list(reflexes.communication(motion.lost))
            if lost:
                self._reflex(lost)
            return
        if not is_finite(command):
            self.end(MoveStatus.INPUT_ERROR_ABORTED, "a command is not finite")
            return
        if finished(command):
            self.end(MoveStatus.SUCCESS, "the client has finished it")
            return
        violations = list(motion.execute(command))
        if violations:
            self._reflex(violations)

    def _reflex(self, violations: Sequence[Violation]) -> None:
        fields = self.readings.fields
        fields["reflex_reason"][:] = 0
        for violation in violations:
            fields["errors"][violation.error] = 1
            fields["reflex_reason"][violation.error] = 1
        self.end(
            MoveStatus.REFLEX_ABORTED, f"reflex, {'; '.join(map(str, violations))}"
        )
        self.mode = RobotMode.REFLEX

    def _violations(self) -> list[Violation]:
        """Return the violations of the measured state; store clear postures."""
        state, limits = self.model.state, self.arm.limits
        found = [*reflexes.measured(state.q, state.v, self.tau, limits)]
        distance, links = self._self_distance.nearest(state)
        found += reflexes.self_collision(distance, links)
        effort = self.model.external_effort
        found += reflexes.collisions(effort, self._wrench, self.thresholds)
        room = np.minimum(limits.upper - state.q, state.q - limits.lower).min()
        if room > _CLEAR_ANGLE and distance > _CLEAR_DISTANCE:
            self._clear = state.q.copy()
        return found

    def _is_allowed(self) -> bool:
        """Return whether the arm is within its limits, and not in self-collision."""
        state, limits = self.model.state, self.arm.limits
        inside = (limits.lower <= state.q) & (state.q <= limits.upper)
        return bool(inside.all()) and self._self_distance.nearest(state)[0] >= 0.0

    def _brake(self) -> None:
        self.at_rest, self._braked_for = False, 0

    def _come_to_rest(self) -> None:
        """Detect that the arm is at rest, which completes a recovery."""
        self._braked_for += 1
        wanted, goal = self._reference, self._goal
        on_its_way = goal is not None and not np.allclose(wanted.q, goal, 0.0, 1e-9)
        still = not wanted.dq.any() and float(np.abs(self.v).max()) < _REST_SPEED
        given_up = self._braked_for * PERIOD > _LONGEST_BRAKING
        if on_its_way or not (still or given_up):
            return
        self.at_rest, self._goal = True, None
        if self.mode is RobotMode.AUTOMATIC_ERROR_RECOVERY:
            self._end_recovery()

    def _end_recovery(self) -> None:
        request = FrankaCommand.AUTOMATIC_ERROR_RECOVERY, self._recovery
        if not self._is_allowed():
            self.mode = RobotMode.REFLEX
            self._say("recovery failed: the arm is still beyond a limit")
            self._respond(
                *request, FrankaStatus.MANUAL_ERROR_RECOVERY_REQUIRED_REJECTED
            )
            return
        self.mode = RobotMode.IDLE
        for name in ("errors", "joint_collision", "cartesian_collision"):
            self.readings.fields[name][:] = 0
        self._say("recovered from the reflex")
        self._respond(*request, FrankaStatus.SUCCESS)

    def _own_effort(self, gravity: Array) -> Array:
        """Return the effort that brakes, holds or retreats, without gravity."""
        before = self._reference
        if before.dq.any():
            self._reference = reference.braking(before)
        elif self._goal is not None:
            self._reference = reference.retreating(self._goal, before)
        return self._tracking_effort(self._reference, gravity)

    def _tracking_effort(
        self, wanted: Reference, gravity: Array, *, of_hand: bool = False
    ) -> Array:
        model, limit = self.model, self.arm.limits.effort
        kind = (
            impedance.of_hand(model, self.cartesian_stiffness)
            if of_hand
            else impedance.of_joints(model, self.joint_stiffness)
        )
        effort = impedance.tracking_effort(model, wanted, kind)
        return np.clip(effort, -limit - gravity, limit - gravity)

    def _measure(self, effort: Array) -> None:
        """Measure the arm after an effort, without gravity's, and send it."""
        self._measured = self.plant.measure(self.t, self.q, self.v)
        self.model.measure(self.t, *self._measured, self.tau)
        self._wrench = self.readings.set_measured(
            self.model, self.tau, effort, self.thresholds
        )

    def _respond(self, command: FrankaCommand, number: int, status: int) -> None:
        self.outbox.append(message(command, number, bytes([status])))


_ZERO = np.zeros(JOINTS)
