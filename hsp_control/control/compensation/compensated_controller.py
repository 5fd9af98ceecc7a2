"""The chain from a measurement to an effort: the law and its compensators.

    measurement → velocity filter → predictor → law → start-up ramp
                → friction and disturbance offset → limits → effort

The friction feed-forward and the observer's estimate r are an offset of the effort of
the model, M a + N + friction - r; the controller's limits hold for the sum. The two do
not cancel each other: the observer gets the effort sent minus the feed-forward, because
friction consumes that part. For the same reason it gets the contact forces that the
controller expects, so that r contains all other forces.
"""

from collections.abc import Mapping
from copy import deepcopy
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.keywords import suggesting
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.compensation.compensation import Compensation
from hsp_control.control.compensation.momentum_observer import RunningObserver
from hsp_control.control.compensation.stage import Run, Stage
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import NO_WRENCHES, LogChannel
from hsp_control.control.output import ControlOutput
from hsp_control.robot import RobotState


class CompensatedController:
    """A controller with its compensators: computes one effort per period.

    Without compensators (`Compensation(momentum_observer=None)`) it returns the
    controller's effort, bit for bit. A run is one `restart`, then one `effort` per
    period, in order of time. The compensators' memory of a run is
    that of this object.

    Attributes:
        controller: The controller.
        compensation: The compensators.
        state: The last state at which the law was evaluated.
        output: The controller's output there.
        stages: The compensators of the present run, in the order of the chain.
        feels_contacts: Whether `effort` needs the wrenches that sensors in contacts
            measure.
    """

    state: RobotState
    output: ControlOutput

    @suggesting
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
        self._measured = self.state
        if own.predictor is not None:
            self._measured = self.state.another()
        self._tau = np.zeros(robot.nv)
        feedback = own.force_feedback
        self.feels_contacts = feedback is not None and feedback.force == "measured"
        self._changes_state = (own.velocity_filter or own.predictor) is not None
        self.restart()

    def __setstate__(self, saved: dict[str, Any]) -> None:
        """Go on with the state of the copy's own controller."""
        vars(self).update(saved)
        self.state = self.controller.state
        measured = self.state
        if self.compensation.predictor is not None:  # with the controller's payloads
            own = self._measured
            measured = self.state.another().update(own.t, own.q, own.v)
        self._measured = self._run.measured = measured

    def __copy__(self) -> "CompensatedController":
        """Return a copy that continues independently, of the same robot object."""
        return deepcopy(self, {id(self.state.robot): self.state.robot})

    def restart(self, *, origin: float | None = None) -> None:
        """Reset all memory, for a new run; see `Controller.restart`."""
        self.controller.restart(origin=origin)
        ahead = self.compensation.predictor
        periods = 0 if ahead is None else ahead.periods
        self._run = run = Run(self.controller, self._measured, periods)
        self.stages = self.compensation.begin(self.controller)
        observes = any(isinstance(each, RunningObserver) for each in self.stages)
        self._remembers = observes or ahead is not None
        self._acting = [x for x in self.stages if type(x).act is not Stage.act]
        self._pressing = run.none
        self._shown = self.state.q.copy(), self.state.v.copy()

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
            wrenches: Readings of sensors in the contacts; see `Measurement`.

        Returns:
            The effort, shape (nv,) [N·m or N], overwritten by the next call.

        Raises:
            HspControlError: If the measurement is not a valid state of the robot, or
                the effort is not finite.
        """
        run = self._run
        run.t, run.q, run.v, run.period, run.wrenches = t, q, v, period, wrenches
        self.controller.model_at(t)
        for stage in self.stages:
            stage.measure(run)
        self.output = run.output = self._law(run.t, run.q, run.v)
        run.friction_sent = run.friction
        if self._changes_state:
            self._shown = self.state.q.copy(), self.state.v.copy()
        tau = self._tau
        tau[:] = self.output.tau
        self.controller.applied(tau, period)
        for stage in self.stages:
            stage.finish(run)
        if self._remembers:
            self._pressing = self._expected(self.output)
            sent = tau - run.friction_sent + self._pressing
            run.under_way.append(sent)
            while len(run.under_way) < (run.under_way.maxlen or 0):
                run.under_way.append(sent)
        run.last_period = period
        return tau

    def applied(self, tau: Array, period: float) -> None:
        """Record the effort that really acts, if it differs from the one returned.

        Args:
            tau: Effort, shape (nv,) [N·m or N].
            period: Time until the next effort [s].
        """
        self.controller.applied(tau, period)
        run = self._run
        if run.under_way:
            run.under_way[-1] = tau - run.friction_sent + self._pressing

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
        found = dict[str, LogChannel]()
        for stage in self.stages:
            found |= stage.log_channels(self._run)
        if self._changes_state:
            found["shown.q"] = LogChannel(
                self._shown[0], "rad or m", "configuration at which the law is computed"
            )
            found["shown.v"] = LogChannel(
                self._shown[1], "rad/s or m/s", "velocity at which the law is computed"
            )
        return found

    def _expected(self, output: ControlOutput) -> Array:
        """Return the effort of the contact forces that the law expects, shape (nv,)."""
        support = self.controller.active_stack.support
        if not support.size:
            return self._run.none
        return np.asarray(support.map @ output.forces)

    def _law(self, t: float, q: Array, v: Array) -> ControlOutput:
        self._run.friction = self._run.none
        modifier = self._modify if self._acting else None
        return self.controller.compute(t, q, v, modifier=modifier)

    def _modify(
        self, state: RobotState, active: ActiveStack, a: Array
    ) -> tuple[Array, Array | None]:
        """Return the acceleration to deliver, and the effort besides M a + N."""
        run = self._run
        run.a, run.effort = a, run.none
        for stage in self._acting:
            stage.act(run, state, active)
        return run.a, run.effort
