"""The last stage before the robot: limit efforts and their rates, block NaN and inf."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import RobotLimits
from hsp_control.live.nearest_effort import nearest_effort
from hsp_control.live.sent_efforts import SentEfforts
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot

_TOLERANCE = 0.5
"""Tolerance of a stopped robot's effort beyond the limits, relative to them: its own
stop, or another load, may need more."""

_SURE = 5
"""Consecutive periods without a measurement that a bad connection may have."""


_LASTING = 0.01
"""Time over which an effort that has to last is averaged [s]."""


class EffortLimiter:
    """Converts an effort into the sent value, within effort and rate limits."""

    def __init__(
        self,
        robot: Robot,
        settings: LiveSettings,
        period: float,
        limits: RobotLimits | None = None,
    ) -> None:
        self._robot, self._settings, self._limits = robot, settings, limits
        self._rest = np.zeros(robot.nv)
        self._compensates = settings.compensates_gravity
        self._upper = settings.effort_limits(robot, limits)
        # The controller's limits may decrease at run time: efforts follow at their
        # rate.
        self._largest = np.maximum(self._upper, settings.effort_limits(robot))
        self._step = settings.rate_limits(robot) * period
        # the value sent last, shape (nv,): tau, or tau - g(q)
        self.sent: Array = np.zeros(robot.nv)
        # the effort that the motors then apply, shape (nv,): tau
        self.applied: Array = np.zeros(robot.nv)
        # g(q) at the last configuration, shape (nv,)
        self.gravity: Array = np.zeros(robot.nv)
        kept = max(settings.missing, settings.watchdog) + _SURE
        self._recent = SentEfforts(self._largest, kept)
        self._mean_of = int(np.clip(round(_LASTING / period), 1, kept))
        # Bounds on the effort that may be in force, now and before the last one.
        self._least: Array = np.zeros(robot.nv)
        self._most: Array = np.zeros(robot.nv)
        self._before = self._least, self._most
        self._unanswered, self._says = 0, False
        nearest_effort(self.sent, self.sent, self.sent, np.eye(robot.nv))  # compiles

    @property
    def effort_limits(self) -> Array:
        """The upper limits of the motors' efforts, shape (nv,); `follow` sets them."""
        return self._upper

    def follow(self, limits: RobotLimits | None) -> None:
        """Use the controller's present limits, which may change in a run."""
        if limits is not self._limits:
            self._limits = limits
            self._upper[:] = self._settings.effort_limits(self._robot, limits)
            self._largest = np.maximum(self._upper, self._largest)

    def reset(self, q: Array) -> None:
        """Start at rest at q, shape (nq,): brakes or motors provide g(q)."""
        self.gravity = self._robot.inverse_dynamics(q, self._rest, self._rest)
        self.sent = np.zeros(self._robot.nv)
        if not self._compensates:
            self.sent = np.clip(self.gravity, -self._upper, self._upper)
        self.applied = self.sent + self._added_by_robot
        self._least = self._most = self.sent.copy()
        self._before = self._least, self._most
        self._unanswered, self._says = 0, False
        self._recent.restart(self.sent)

    @property
    def _added_by_robot(self) -> Array | float:
        return self.gravity if self._compensates else 0.0

    def contradiction(self, effort: Array, *, halted: bool) -> str | None:
        """Return why the robot cannot have an effort, shape (nv,), or None if it can.

        It has one that was sent (`SentEfforts`), or its own after it has halted.
        """
        if halted:
            most = self._largest * (1.0 + _TOLERANCE)
            least, most = -most - self._added_by_robot, most - self._added_by_robot
            spare = np.zeros(effort.size)
        else:
            least, most, spare = self._recent.bounds_of(effort)
        beyond = np.maximum(effort - most, least - effort) - spare
        i = int(beyond.argmax())
        if beyond[i] <= 0.0:
            return None
        return (
            f"the robot reports an effort of {effort[i]:.6g} at "
            f"{self._robot.dof_names[i]}; it can have {least[i]:.6g} to {most[i]:.6g}"
        )

    def robot_has(self, effort: Array | None) -> bool:
        """Use the effort reported by the robot; return whether it differs.

        The last sent one may be lost, or still in transit: either is possible, unless
        they are too far apart for one step from both. None: it reports none.
        """
        self._unanswered, self._says = 0, effort is not None
        if effort is None or np.array_equal(effort, self.sent):
            self._least = self._most = self.sent.copy()
            return False
        # Rounding must not move an effort beyond the limits.
        borne = self._added_by_robot
        has = np.clip(effort, -self._largest - borne, self._largest - borne)
        other = np.where(np.abs(has - self.sent) > 2.0 * self._step, has, self.sent)
        self._least, self._most = np.minimum(has, other), np.maximum(has, other)
        self.applied = has + borne
        return True

    @property
    def lasting(self) -> Array | None:
        """The effort for a period without a measurement, shape (nv,): tau.

        The mean of 10 ms, and in the periods after the first one None: it is held. The
        last effort is that of a moment: the noise of one sample, which acts for one
        period, would act until the next measurement.
        """
        if self._unanswered > 1:
            return None
        return self._recent.mean(self._mean_of) + self._added_by_robot

    def no_measurement(self) -> None:
        """Add a period without a measurement; a dead line received the sent efforts."""
        self._unanswered += 1
        if self._says and self._unanswered <= _SURE:
            least, most = self._before
            self._least = np.minimum(least, self.sent)
            self._most = np.maximum(most, self.sent)

    def apply(self, tau: Array, q: Array, inertia: Array | None = None) -> bool:
        """Compute ``sent``; return False, and keep the last one, if tau is not finite.

        The effort is clipped to its limits first, then the sent value to its rate. If
        some value satisfies both limits, the result does. The rate is relative to all
        efforts that the robot may have.

        With the mass matrix ``inertia``, shape (nv, nv), a joint whose effort can
        follow at once keeps its acceleration while that of a heavier joint lags behind
        (`nearest_effort`). With clipping joint by joint, an arm that must stop while it
        accelerates would accelerate its wrist.
        """
        if not np.isfinite(tau).all():
            return False
        if self._compensates:
            self.gravity = self._robot.inverse_dynamics(q, self._rest, self._rest)
        wanted = np.clip(tau, -self._upper, self._upper) - self._added_by_robot
        lower, upper = self._most - self._step, self._least + self._step
        within = np.clip(wanted, lower, upper)
        if inertia is not None and not np.array_equal(within, wanted):
            borne = self._added_by_robot
            lower = np.clip(-self._upper - borne, lower, upper)
            upper = np.clip(self._upper - borne, lower, upper)
            nearest = nearest_effort(wanted, lower, upper, inertia)
            within = within if nearest is None else nearest
        self.sent = within
        self.applied = self.sent + self._added_by_robot
        self._before = self._least, self._most
        self._least = self._most = self.sent.copy()
        self._recent.add(self.sent)
        return True

    def hold(self, q: Array) -> None:
        """Keep ``sent``; ``applied`` follows g(q) if the robot compensates gravity."""
        if self._compensates:
            self.gravity = self._robot.inverse_dynamics(q, self._rest, self._rest)
        self.applied = self.sent + self._added_by_robot

    def replace_sent(self, sent: Array) -> None:
        """Set ``sent``, shape (nv,), to a different effort of the robot."""
        self.sent = sent
        self._least = self._most = sent.copy()
        self.applied = sent + self._added_by_robot
