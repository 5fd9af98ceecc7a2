"""The chain from a measurement to an effort: the law and its compensators.

    measurement → velocity filter → predictor → law → start-up ramp
                → friction and disturbance offset → limits → effort

The friction feed-forward and the observer's estimate r are an offset of the effort of
the model, M a + N + friction - r; the controller's limits hold for the sum. The two do
not cancel each other: the observer gets the effort sent minus the feed-forward, because
friction consumes that part. For the same reason it gets the contact forces that the
controller expects, so that r is what else acts.
"""

from collections import deque
from collections.abc import Mapping
from itertools import islice

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.linalg import cholesky
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation import Status
from hsp_control.control.compensation.compensation import Compensation
from hsp_control.control.compensation.force_feedback import RunningForceFeedback
from hsp_control.control.compensation.friction_feed_forward import FrictionFeedForward
from hsp_control.control.compensation.integral_action import RunningIntegral
from hsp_control.control.compensation.momentum_observer import RunningObserver
from hsp_control.control.compensation.predictor import Predictor, RunningPredictor
from hsp_control.control.compensation.start_up_ramp import RunningRamp
from hsp_control.control.compensation.velocity_filter import RunningFilter
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import NO_WRENCHES, LogChannel
from hsp_control.control.output import ControlOutput
from hsp_control.law import VARYING
from hsp_control.law.pseudo_inverse import (
    apply_pseudo_inverse_transpose,
    weighted_pseudo_inverse,
)
from hsp_control.robot import RobotState
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import CompliantTask


class Command:
    """A controller with its compensators: computes one effort per period.

    Without compensators it returns the controller's effort, bit for bit. A run is one
    `restart`, then one `effort` per period, in order of time. What the compensators
    remember during a run is the command's own.

    Attributes:
        controller: The controller.
        compensation: The compensators.
        state: The last state at which the law was evaluated.
        output: The controller's output there.
        feels_contacts: Whether `effort` needs the wrenches that sensors in contacts
            measure.
    """

    state: RobotState
    output: ControlOutput

    def __init__(
        self, controller: Controller, compensation: Compensation | None = None
    ) -> None:
        """Set the controller and its compensation, if any.

        Raises:
            CompensationError: If a compensator does not fit the robot, tasks, contacts.
            GainError: If errors would not decay with the integral action.
        """
        self.controller = controller
        self.compensation = Compensation() if compensation is None else compensation
        own, robot = self.compensation, controller.robot
        own.check(robot, controller.tasks, controller.contacts)
        self.state = controller.state
        self._measured = self.state if own.predictor is None else RobotState(robot)
        self._tau, self._zero = np.zeros(robot.nv), np.zeros(robot.nv)
        feedback = own.force_feedback
        self.feels_contacts = feedback is not None and feedback.force == "measured"
        self._changes_state = (own.velocity_filter or own.predictor) is not None
        self._changes_effort = any(
            part is not None
            for part in (
                own.momentum_observer,
                own.friction_feed_forward,
                own.start_up_ramp,
            )
        )
        self.restart()

    def restart(self) -> None:
        """Reset all memory, for a new run."""
        own, robot = self.compensation, self.controller.robot
        self.controller.restart()
        self._filter: RunningFilter | None = None
        if own.velocity_filter is not None:
            self._filter = RunningFilter(own.velocity_filter)
        self._observer: RunningObserver | None = None
        if own.momentum_observer is not None:
            self._observer = own.momentum_observer.begin(robot)
        self._feed_forward: FrictionFeedForward | None = own.friction(robot)
        self._integral: RunningIntegral | None = None
        if own.integral_action is not None:
            self._integral = RunningIntegral(own.integral_action, self.controller)
        self._force_feedback: RunningForceFeedback | None = None
        if own.force_feedback is not None:
            self._force_feedback = RunningForceFeedback(
                own.force_feedback, self.controller
            )
        self._ramp: RunningRamp | None = None  # begins at the first state
        self._predictor: RunningPredictor | None = None
        self._period = 0.0
        self._friction_sent = self._friction = self._pressing = self._zero
        self._shown = self.state.q.copy(), self.state.v.copy()
        # The efforts on the model, less friction: one for each period from the last
        # measurement to the period that begins now.
        self._under_way: deque[Array] = deque()

    def effort(
        self,
        t: float,
        q: Array,
        v: Array,
        period: float,
        wrenches: Mapping[str, Array] = NO_WRENCHES,
    ) -> Array:
        """Return the effort to send now.

        Args:
            t: Time [s].
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,).
            period: Time until the next effort [s].
            wrenches: What sensors in the contacts measure; see `Measurement`.

        Returns:
            The effort, shape (nv,) [N·m or N], overwritten by the next call.

        Raises:
            HspControlError: If the measurement is not a valid state of the robot, or
                the effort is not finite.
        """
        own, last = self.compensation, self._period
        if self._filter is not None:
            v = self._filter.apply(np.asarray(v, dtype=float), last)
        if self._observer is not None:
            self._observe(self._observer, t, q, v, last)
        if own.predictor is not None:
            t, q, v = self._predict(own.predictor, t, q, v, period)
        if self.feels_contacts:
            assert self._force_feedback is not None
            self._force_feedback.measure(wrenches, pressed=last > 0.0)
        self.output = output = self._law(t, q, v)
        self._friction_sent = self._friction
        if self._changes_state:
            self._shown = self.state.q.copy(), self.state.v.copy()
        tau = self._tau
        tau[:] = output.tau
        self.controller.applied(tau, period)
        if self._integral is not None:
            self._integrate(self._integral, output, period)
        if self._force_feedback is not None:
            hindered = output.status >= Status.LIMITED
            self._force_feedback.advance(self.state.t, period, output.forces, hindered)
        if self._observer is not None or own.predictor is not None:
            self._pressing = self._expected(output)
            self._record_sent(tau - self._friction_sent + self._pressing)
        self._period = period
        return tau

    def applied(self, tau: Array, period: float) -> None:
        """Record the effort that really acts, if it differs from the one returned.

        Args:
            tau: Effort, shape (nv,) [N·m or N].
            period: Time until the next effort [s].
        """
        self.controller.applied(tau, period)
        if self._under_way:
            self._under_way[-1] = tau - self._friction_sent + self._pressing

    def evaluate(self, t: float, q: Array, v: Array) -> ControlOutput:
        """Evaluate the law at another state, with the present memory.

        The memory does not change, but `state` becomes that state. It serves the log,
        which records the output at the true state.

        Args:
            t: Time [s].
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
        """
        return self._law(t, q, v)

    def log_channels(self) -> Mapping[str, LogChannel]:
        """Return the log channels of the active compensators, by name."""
        found, unit = dict[str, LogChannel](), "N·m or N"
        if self._observer is not None:
            found["observer.disturbance"] = LogChannel(
                self._observer.disturbance, unit, "estimated disturbance r"
            )
            found |= self._wrenches(self._observer.disturbance)
        if self._feed_forward is not None:
            found["friction.feed_forward"] = LogChannel(
                self._friction_sent, unit, "feed-forward of friction"
            )
        if self._integral is not None:
            for name, integral in self._integral.integrals.items():
                found[f"task.{name}.integral"] = LogChannel(
                    integral, "m·s or rad·s", "∫e"
                )
        if self._force_feedback is not None:
            how = self.compensation.force_feedback
            assert how is not None
            for name, felt in self._force_feedback.felt.items():
                found[f"contact.{name}.{how.force}"] = LogChannel(
                    felt, "N", f"normal force, {how.force}"
                )
                found[f"contact.{name}.integral"] = LogChannel(
                    self._force_feedback.integrals[name],
                    "N",
                    "what force feedback adds to the commanded normal force",
                )
        if self._changes_state:
            found["shown.q"] = LogChannel(
                self._shown[0], "rad or m", "configuration at which the law is computed"
            )
            found["shown.v"] = LogChannel(
                self._shown[1], "rad/s or m/s", "velocity at which the law is computed"
            )
        return found

    def _wrenches(self, disturbance: Array) -> dict[str, LogChannel]:
        """Return the force at each task of a frame that explains a disturbance."""
        found, threshold = {}, self.controller.singularity_threshold
        for task in self.controller.tasks:
            if isinstance(task, CompliantTask) and task.wrench_unit is not None:
                found[f"observer.wrench.{task.name}"] = LogChannel(
                    task_wrench(task, self._measured, disturbance, threshold),
                    task.wrench_unit,
                    "estimated force on the robot, in world axes",
                )
        return found

    def _expected(self, output: ControlOutput) -> Array:
        """Return what the contact forces that the law expects do, shape (nv,)."""
        support = self.controller.active_stack.support
        if not support.size:
            return self._zero
        return np.asarray(support.map @ output.forces)

    # -- the links of the chain -------------------------------------------------------

    def _observe(
        self, observer: RunningObserver, t: float, q: Array, v: Array, period: float
    ) -> None:
        """Update the observer with the effort that acted since the last measurement."""
        acted = self._under_way[0] if self._under_way else self._zero
        state = self._measured.update(t, q, v)
        observer.update(state, acted, period)
        feedback = self._force_feedback
        if feedback is not None and not self.feels_contacts and self._under_way:
            feedback.estimate(state, observer.disturbance, self.output.forces)
        if self.controller.limits is not None:
            besides: Array = observer.disturbance - observer.cancelled
            if besides.any():  # what is cancelled causes nothing
                besides = np.asarray(np.linalg.solve(state.mass_matrix, besides), float)
            self.controller.disturbed(besides)

    def _predict(
        self, predictor: Predictor, t: float, q: Array, v: Array, period: float
    ) -> tuple[float, Array, Array]:
        """Return the time and the state at which the next effort will act."""
        # Before any effort is sent, the robot is assumed to stay where it is.
        observer = self._observer
        disturbance = self._zero if observer is None else observer.disturbance
        efforts = (tau + disturbance for tau in islice(self._under_way, 1, None))
        if self._predictor is None:
            self._predictor = RunningPredictor(self.controller.robot)
        q, v = self._predictor.predict(q, v, efforts, period)
        return t + predictor.effort_delay * period, q, v

    def _law(self, t: float, q: Array, v: Array) -> ControlOutput:
        modifier = self._modify if self._changes_effort else None
        self._friction = self._zero
        return self.controller.compute(t, q, v, modifier=modifier)

    def _modify(
        self, state: RobotState, active: ActiveStack, a: Array
    ) -> tuple[Array, Array | None]:
        """Return the acceleration to deliver, and the effort besides M a + N."""
        if self._ramp is None and self.compensation.start_up_ramp is not None:
            self._ramp = RunningRamp(self.compensation.start_up_ramp, state)
        if self._ramp is not None:
            a = self._ramp.blend(state, a)
        offset = self._zero
        if self._feed_forward is not None:
            offset = self._feed_forward.effort(state, active)
            self._friction = self._friction + active.share * offset
        if self._observer is not None:
            offset = offset - self._observer.cancelled
        return a, offset

    def _record_sent(self, tau: Array) -> None:
        """Append an effort to those under way, and drop the ones that have acted."""
        predictor = self.compensation.predictor
        waiting = 1 + (0 if predictor is None else predictor.periods)
        self._under_way.append(tau)
        while len(self._under_way) < waiting:
            self._under_way.append(tau)
        while len(self._under_way) > waiting:
            self._under_way.popleft()

    def _integrate(
        self, integral: RunningIntegral, output: ControlOutput, period: float
    ) -> None:
        """Integrate the errors of the fully active tasks over this period."""
        t, controller = self.state.t, self.controller
        starting = self._ramp is not None and self._ramp.weight(t) < 1.0
        limited = output.status >= Status.LIMITED
        saturated = bool(output.damped) or limited or starting
        errors: dict[str, Array | None] = {}
        for name, rows in controller.task_rows.items():
            if controller.weight_of(name, t) >= 1.0:
                errors[name] = output.task.error[rows]
        integral.advance(errors, period, saturated)


def task_wrench(
    task: Task, state: RobotState, disturbance: Array, threshold: float
) -> Array:
    """Return f = Λ J M⁻¹ r = J̄ᵀ r, shape (m,): the force at the rows of a task.

    If r = Jᵀf then this is f. Whatever else r is, f is the force that moves the task as
    r does. J̄ = M⁻¹JᵀΛ is bounded near singularities as the law's own pseudo-inverse is:
    a force along a lost direction, which the joints do not feel, is taken for zero.
    """
    J = task.evaluate(state, feedback=task.feedback()).jacobian
    m, nv = J.shape
    L, B, Q = np.zeros((nv, nv)), np.zeros((m, nv)), np.zeros((m, nv))
    X, part, force = np.zeros((m, m)), np.zeros(m), np.zeros(m)
    if not cholesky(state.mass_matrix, L):
        return np.full(m, np.nan)
    weighted_pseudo_inverse(J, L, VARYING, threshold, B, Q, X)
    apply_pseudo_inverse_transpose(Q, X, L, VARYING, disturbance.copy(), part, force)
    return force
