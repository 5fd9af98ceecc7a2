"""The computation of a control period: estimators, then the plan, then the effort."""

from collections.abc import Mapping, Sequence
from typing import Generic, Protocol, TypeVar

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.control.estimation import Estimator, RunningEstimator, begun
from hsp_control.control.measurement import Inertial, LogChannel, Measurement
from hsp_control.control.output import ControlOutput
from hsp_control.control.plans import MotionPlan, RunningPlan
from hsp_control.robot import RobotState


class EffortSource(Protocol):
    """Computes the efforts of a loop: a `CompensatedController` or a wrapper of one.

    One that has an attribute ``feels_contacts`` which is true gets the wrenches of
    `Measurement` as a fifth argument of `effort`.
    """

    @property
    def controller(self) -> Controller:
        """The controller."""

    @property
    def output(self) -> ControlOutput:
        """The controller's last output."""

    @property
    def state(self) -> RobotState:
        """The state for which the controller computed it."""

    def restart(self, *, origin: float | None = None) -> None:
        """Clear all memory for a new run; see `Controller.restart`."""

    def effort(self, t: float, q: Array, v: Array, period: float) -> Array:
        """Return the effort, shape (nv,), for a measurement at time t [s].

        Args:
            t: Time [s].
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,).
            period: How long the effort will be held [s].
        """

    def applied(self, tau: Array, period: float) -> None:
        """Record the effort, shape (nv,), that the motors actually apply."""

    def log_channels(self) -> Mapping[str, LogChannel]:
        """Return its log of the last effort besides the controller's, by name."""


Source_co = TypeVar("Source_co", bound=EffortSource, covariant=True)


class ControlChain(Generic[Source_co]):
    """From a measurement to an effort, in simulations and on robots alike.

    measurement → estimators → plan → compensated controller → effort
    """

    def __init__(
        self,
        compensated: Source_co,
        plan: MotionPlan | None = None,
        estimators: Sequence[Estimator] = (),
    ) -> None:
        self.compensated = compensated  # computes the efforts
        self._plan, self._estimators = plan, tuple(estimators)
        self._feels = bool(getattr(compensated, "feels_contacts", False))
        # whether more is needed of a measurement than q and v
        self.needs_sensors = plan is not None or bool(estimators) or self._feels
        self._estimating: list[RunningEstimator] = []
        # the run of the plan; None without one, or before `begin`
        self.plan: RunningPlan | None = None
        self._status = 0.0

    @property
    def is_bare(self) -> bool:
        """Whether the controller gets measurements as they are, without a plan."""
        return not (self.needs_sensors or self._estimators)

    def begin(self, inertial: Inertial | None, state: RobotState | None = None) -> None:
        """Begin a run: the memory of an earlier one is cleared.

        ``inertial``, a reading of the inertial measurement unit, gives its placement. A
        plan starts at ``state``; without one it starts with the first effort.
        """
        controller = self.compensated.controller
        if self._plan is not None:
            self.plan = self._plan.begin(controller)
        self._estimating = begun(self._estimators, controller, inertial)
        self.compensated.restart(origin=0.0)
        if self.plan is not None and state is not None:
            self.plan.start(state)

    def effort(self, measured: Measurement, period: float) -> Array:
        """Return the effort (nv,) to send now; once a period, in order of time."""
        for each in self._estimating:
            measured = each.update(measured)
        if self.plan is not None:
            self.plan.update(measured)
        given = measured.t, measured.q, measured.v, period
        wrenches = (measured.wrenches,) if self._feels else ()
        tau = self.compensated.effort(*given, *wrenches)
        if self._estimating:
            self._status = float(self.compensated.output.status)
        return tau

    def log_channels(self, q: Array, v: Array) -> Mapping[str, LogChannel]:
        """Return the values to log, estimates with errors from the true q and v."""
        channels = self.compensated.log_channels()
        if self.plan is not None:
            channels = {**channels, **self.plan.log_channels()}
        for each in self._estimating:
            channels = {**channels, **each.log_channels(q, v)}
        if self._estimating:
            # The law that is logged is that at the true state.
            status = LogChannel(
                self._status, "-", "status of the step at the estimated state"
            )
            channels = {**channels, "estimate.status": status}
        return channels
