"""A smooth transition from holding still to the law."""

from collections.abc import Callable

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import CompensationError
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.compensation.stage import Alone, AloneCalls, Run, Stage
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import NonNegative, Positive
from hsp_control.engine.plans import PartCall, planned
from hsp_control.robot import Robot, RobotState


class StartUpRamp(Part, error=CompensationError):
    """The effort changes smoothly from holding still to the law.

    a = (1 - s) a_hold + s a_law with a_hold = -2 ω v + ω² (q_0 ⊖ q) and s from 0 to 1,
    twice continuously differentiable. At first the effort compensates gravity and acts
    as a spring to the first configuration q_0. The limits hold for the blend.
    """

    duration: Positive = 1.0
    """Time until the law is fully active, s = 1 [s]."""
    natural_frequency: NonNegative = 0.0
    """Natural frequency ω of the spring that holds the robot meanwhile [rad/s]; 0 is
    pure gravity compensation."""


class RunningRamp(Stage):
    """A start-up ramp in one run, with its start time and state."""

    _bound: tuple[Array, Callable[[], object]] | None = None

    def __init__(self, declared: StartUpRamp) -> None:
        self._declared = declared
        self._starting = np.zeros(1, dtype=np.int64)
        self._begun: tuple[float, Array] | None = None  # at the first state
        # of robots with single-DOF joints, as arrays
        self._begin, self._first = np.zeros(1), np.zeros(0)
        self._has_begun = np.zeros(1, dtype=np.int64)

    def act(self, run: Run, state: RobotState, active: ActiveStack) -> None:
        """Blend the law's acceleration with the holding one; see `Stage.act`."""
        if not _is_plain(state.robot):
            self._act_on_manifold(run, state)
            return
        if self._bound is None:
            own = np.zeros(state.robot.nv)
            plan = planned([self._call(state, own, self._starting)])
            self._bound = own, plan.call()
        own, blend = self._bound
        own[:] = run.a
        blend()
        run.a, run.starting = own.copy(), bool(self._starting[0])

    def _act_on_manifold(self, run: Run, state: RobotState) -> None:
        """Blend with Pinocchio's difference, for any joint."""
        if self._begun is None:
            self._begun = state.t, state.q.copy()
        begin, q0 = self._begun
        s = engine.smooth_step(state.t, begin, self._declared.duration)[0]
        run.starting = s < 1.0
        if run.starting:
            w = self._declared.natural_frequency
            away = state.robot.difference(state.q, q0)
            run.a = (1.0 - s) * (w * w * away - 2.0 * w * state.v) + s * run.a

    def alone(self, shared: Alone) -> AloneCalls | None:
        """Return the blend, for robots with single-DOF joints."""
        if not _is_plain(shared.state.robot):
            return None
        return AloneCalls(act=[self._call(shared.state, shared.a, shared.starting)])

    def _call(self, state: RobotState, a: Array, starting: Indices) -> PartCall:
        """Return the blend; the first call begins it."""
        if not len(self._first):
            self._first = np.zeros(state.robot.nq)
        return PartCall(
            engine.StartUp,
            time=state.time,
            q=state.q,
            v=state.v,
            joints=state.robot.single_dof_joints,
            duration=self._declared.duration,
            natural_frequency=self._declared.natural_frequency,
            begin=self._begin,
            first=self._first,
            begun=self._has_begun,
            starting=starting,
            a=a,
        )


def _is_plain(robot: Robot) -> bool:
    """Return whether all joints have one degree of freedom."""
    return len(robot.single_dof_joints) == robot.nv
