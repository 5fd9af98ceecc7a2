"""From what is measured to the effort that goes out: the law among its compensation.

    measurement → velocity filter → predictor → law → start-up ramp
                → compensation → limits → effort rate → out

The observer's estimate and the friction feed-forward are an offset of the model's own
effort, M a + N + (friction) - r, which the controller's limits then keep as a whole.
Neither fights the other: the observer is told what was sent *less* the feed-forward,
for that has gone into friction (theory.md §8).
"""

from collections import deque
from collections.abc import Mapping
from itertools import islice

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation.status import LIMITED
from hsp_control.control.compensation.compensation import Compensation
from hsp_control.control.controller import Controller, ControlOutput
from hsp_control.control.log_channel import LogChannel
from hsp_control.robot import RobotState


class Command:
    """A controller and its compensation: one effort a period.

    Without compensation it is the controller, to the last bit. A run is one `restart`,
    then `effort` once a period, in order of time.

    Attributes:
        controller: The law.
        compensation: What is around it.
        state: What the law was last shown.
        output: What it last made of it.
    """

    state: RobotState
    output: ControlOutput

    def __init__(
        self, controller: Controller, compensation: Compensation | None = None
    ) -> None:
        """Set the controller and its compensation, if any.

        Raises:
            CompensationError: If a compensator does not fit the robot, tasks or limits.
            GainError: If integral action would not decay.
        """
        self.controller = controller
        self.compensation = Compensation() if compensation is None else compensation
        robot = controller.robot
        self.compensation.check(robot, controller.tasks, controller.limits)
        own = self.compensation
        self.state = RobotState(robot)
        self._measured = self.state if own.predictor is None else RobotState(robot)
        self._tau, self._nothing = np.zeros(robot.nv), np.zeros(robot.nv)
        self._measures = (own.velocity_filter or own.predictor) is not None
        self._modifies = any(
            part is not None
            for part in (
                own.momentum_observer,
                own.friction_feed_forward,
                own.start_up_ramp,
            )
        )
        self.restart()

    def restart(self) -> None:
        """Forget everything: what follows is another run."""
        own, robot = self.compensation, self.controller.robot
        self.controller.restart()
        if own.velocity_filter is not None:
            own.velocity_filter.restart()
        if own.momentum_observer is not None:
            own.momentum_observer.restart(robot)
        if own.friction_feed_forward is not None:
            own.friction_feed_forward.restart(robot)
        if own.integral_action is not None:
            own.integral_action.restart(self.controller.tasks)
        if own.effort_rate is not None:
            own.effort_rate.restart(robot)
        if own.start_up_ramp is not None:
            own.start_up_ramp.restart()
        self._period = 0.0
        self._paid = self._friction = self._nothing
        self._shown = self.state.q.copy(), self.state.v.copy()
        # What acts on the model in each period from the last one measured to the one
        # that begins: sent, less what friction has eaten.
        self._flight: deque[Array] = deque()

    def effort(self, t: float, q: Array, v: Array, period: float) -> Array:
        """Return the effort that goes out now, shape (nv,), its own buffer.

        Args:
            t: Time [s].
            q: Configuration as measured, shape (nq,).
            v: Velocity as measured, shape (nv,).
            period: Time until the next effort [s].

        Raises:
            HspControlError: If the measurement is not a state of the robot, or what the
                law makes of it is not finite.
        """
        own, last = self.compensation, self._period
        if own.velocity_filter is not None:
            v = own.velocity_filter.apply(np.asarray(v, dtype=float), last)
        if own.momentum_observer is not None:
            self._observe(t, q, v, last)
        if own.predictor is not None:
            t, q, v = self._ahead(t, q, v, period)
        state = self.state.update(t, q, v)
        if own.start_up_ramp is not None:
            own.start_up_ramp.begin(state)
        self.output = output = self._law(state)
        self._paid = self._friction
        if self._measures:
            self._shown = state.q.copy(), state.v.copy()
        tau = self._tau
        tau[:] = output.tau
        cut = own.effort_rate is not None and own.effort_rate.apply(tau, last)
        self.controller.applied(tau, period)
        if own.integral_action is not None:
            self._integrate(output, period, cut)
        if own.momentum_observer is not None or own.predictor is not None:
            self._sent(tau - self._paid)
        self._period = period
        return tau

    def applied(self, tau: Array, period: float) -> None:
        """Take note of the effort that acts in fact, where what follows changed it.

        Args:
            tau: Effort, shape (nv,).
            period: Time until the next effort [s].
        """
        self.controller.applied(tau, period)
        if self._flight:
            self._flight[-1] = tau - self._paid

    def at(self, t: float, q: Array, v: Array) -> ControlOutput:
        """Return what the law makes of another state now, with what is remembered.

        Nothing is remembered of it, but `state` becomes that state. A log asks for it,
        at the true state.
        """
        return self._law(self.state.update(t, q, v))

    def log_channels(self) -> Mapping[str, LogChannel]:
        """Return what to log of the compensation that are on, by name."""
        own, found = self.compensation, dict[str, LogChannel]()
        unit = "N·m or N"
        if (observer := own.momentum_observer) is not None:
            found["observer.disturbance"] = LogChannel(
                observer.disturbance, unit, "r: what pushes beside the model"
            )
        if own.friction_feed_forward is not None:
            found["friction.feed_forward"] = LogChannel(
                self._paid, unit, "effort that friction is to take"
            )
        if own.integral_action is not None:
            for name, integral in own.integral_action.integrals.items():
                found[f"task.{name}.integral"] = LogChannel(
                    integral, "m·s or rad·s", "∫e"
                )
        if self._measures:
            found["shown.q"] = LogChannel(
                self._shown[0], "rad or m", "what the law saw"
            )
            found["shown.v"] = LogChannel(
                self._shown[1], "rad/s or m/s", "what the law saw"
            )
        return found

    # -- the links of the chain -------------------------------------------------------

    def _observe(self, t: float, q: Array, v: Array, period: float) -> None:
        """Compare the momentum's change with what acted since the last measurement."""
        observer = self.compensation.momentum_observer
        assert observer is not None
        acted = self._flight[0] if self._flight else self._nothing
        observer.update(self._measured.update(t, q, v), acted, period)

    def _ahead(
        self, t: float, q: Array, v: Array, period: float
    ) -> tuple[float, Array, Array]:
        """Return time and state in which the next effort will act."""
        predictor, observer = (
            self.compensation.predictor,
            self.compensation.momentum_observer,
        )
        assert predictor is not None
        # Until something was sent, the robot is taken to stay where it is.
        pushed = self._nothing if observer is None else observer.disturbance
        efforts = (tau + pushed for tau in islice(self._flight, 1, None))
        q, v = predictor.ahead(self.controller.robot, q, v, efforts, period)
        return t + predictor.effort_delay * period, q, v

    def _law(self, state: RobotState) -> ControlOutput:
        return self.controller.compute(state, self._modify if self._modifies else None)

    def _modify(
        self, state: RobotState, mode: ActiveStack, a: Array
    ) -> tuple[Array, Array | None]:
        """Return the acceleration to deliver, and what it takes besides M a + N."""
        own = self.compensation
        if own.start_up_ramp is not None:
            a = own.start_up_ramp.blend(state, a)
        offset = self._nothing
        self._friction = self._nothing
        if own.friction_feed_forward is not None:
            self._friction = offset = own.friction_feed_forward.effort(state, mode)
        if own.momentum_observer is not None:
            offset = offset - own.momentum_observer.cancelled
        return a, offset

    def _sent(self, tau: Array) -> None:
        """Take note of an effort on its way; the first acts until the next arrives."""
        predictor = self.compensation.predictor
        waiting = 1 + (0 if predictor is None else predictor.periods)
        self._flight.append(tau)
        while len(self._flight) < waiting:
            self._flight.append(tau)
        while len(self._flight) > waiting:
            self._flight.popleft()

    def _integrate(self, output: ControlOutput, period: float, cut: bool) -> None:
        """Add this period's errors to their integrals."""
        action, ramp = (
            self.compensation.integral_action,
            self.compensation.start_up_ramp,
        )
        assert action is not None
        t, controller = self.state.t, self.controller
        starting = ramp is not None and ramp.share(t) < 1.0
        bound = output.damped or output.status >= LIMITED or cut or starting
        errors: dict[str, Array | None] = {}
        for name, rows in controller.task_rows.items():
            schedule = controller.schedules.get(name)
            if schedule is None or schedule.weight(t) >= 1.0:
                errors[name] = output.task.error[rows]
        action.advance(errors, period, bound)
