"""The momentum observer of De Luca: an estimate of disturbance efforts.

A. De Luca, R. Mattone, "Actuator failure detection and isolation using generalized
momenta", ICRA 2003. With p = M v, p' = tau + Cᵀv - G + d for a disturbance d, and

    r' = K_O (d - r)

is a low-pass of d. It needs no measured acceleration.

White noise n of the velocity passes through Δp/h: r of the first order carries K_O M n,
as the law's own damping carries Kv M n. Two poles at 2 K_O,

    r₁' = 2 K_O (d - r₁),        r' = 2 K_O (r₁ - r),

are as late for slow disturbances, 1/K_O, and carry M n √(2 K_O³ h): at 50 1/s and 1 kHz
a third of that. Of all pairs of poles with this delay it is the least.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY
from math import exp
from typing import Literal, NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import CompensationError
from hsp_control.constraints.limits.joint_numbers import Positives, by_dof
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.compensation.stage import Alone, AloneCalls, Run, Stage
from hsp_control.control.measurement import LogChannel
from hsp_control.control.task_names import TaskNames
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import Flag, Positive
from hsp_control.engine.plans import PartCall
from hsp_control.law import VARYING
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.state import as_given
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import CompliantTask

LARGE_SHARE = 0.25
"""Unexplained effort relative to its limit above which mass errors cannot be the cause:
the robot does not move like its model [-]."""


class MomentumObserver(Part, error=CompensationError):
    """The efforts that the model does not explain are estimated, and cancelled.

    Over a period h with a constant effort, the mean of the disturbance d is
    Δp/h - tau - (mean of Cᵀv - G), to second order in h. The estimate r moves towards
    it by the part 1 - exp(-K_O h), the exact step of the filter, so the observer by
    itself is stable for every K_O h.

    The cancelled part of r is clipped. Otherwise the robot would resist a person who
    holds it, or a collision, with its full effort. With ``cancel`` off it only
    estimates: a hand with an impedance then yields to the forces that the log shows.
    """

    bandwidth: Positive = 50.0
    """Rate K_O at which the estimate converges [1/s]; 20 to 50 is usual."""
    clip: Positives | None = None
    """Largest effort that is cancelled [N·m or N], one number or nv; unlimited by
    default."""
    _: KW_ONLY
    cancel: Flag = True
    """Whether the estimate is cancelled [-]; false: it is only logged."""
    order: Literal[1, 2] = 1
    """Order of the low-pass [-]: 1, a pole at K_O; 2, two poles at 2 K_O, which is as
    late and carries less noise."""

    def __post_init__(self) -> None:
        """Check that nothing is clipped if nothing is cancelled."""
        if self.clip is not None and not self.cancel:
            raise CompensationError(
                "clip bounds the effort that is cancelled, and cancel is false; remove "
                "one of the two"
            )

    def check(self, robot: Robot) -> None:
        """Check that the observer fits the robot."""
        self._bounds(robot)

    def begin(self, robot: Robot) -> "RunningObserver":
        """Return the observer of a robot for one run; its estimate is zero."""
        return RunningObserver(self.bandwidth, self._bounds(robot), self.order)

    def _bounds(self, robot: Robot) -> Array:
        """Return the maximum of |r| that is cancelled, shape (nv,) [N·m or N]."""
        if not self.cancel:
            return np.zeros(robot.nv)
        with within("clip"):
            return by_dof(self.clip, robot.nv, error=CompensationError)


class _BoundObserver(NamedTuple):
    """An observer's calls at one state, and the arrays that they share with Python."""

    state: RobotState
    acted: Array
    period: Array
    besides: Array
    observe: Callable[[], object]
    explain: Callable[[], object]


class RunningObserver(Stage):
    """A momentum observer in one run: it keeps the estimate and the last momentum."""

    _bound: _BoundObserver | None = None

    def __init__(
        self,
        bandwidth: float,
        clip: Array,
        order: int = 1,
        most_per_period: float = np.inf,
    ) -> None:
        # K_O [1/s], the maximum of |r| that is cancelled, shape (nv,), and of K_O h [-]
        self._bandwidth, self._clip = bandwidth, np.array(clip)
        self._most_per_period = most_per_period
        # the low-pass's states, the last of them r, shape (nv,) [N·m or N]
        self._memory = np.zeros((order, len(clip)))
        self.cancelled: Array = np.zeros(len(clip))
        # p and Cᵀv - G at the last measurement, and whether there was one
        self._momentum, self._drift = np.zeros((2, len(clip)))
        self._begun = np.zeros(1, dtype=np.int64)
        self._names = TaskNames()

    @property
    def disturbance(self) -> Array:
        """The estimate r, shape (nv,) [N·m or N]; a view."""
        r: Array = self._memory[-1]
        return r

    def update(self, state: RobotState, tau: Array, period: float) -> Array:
        """Return r; ``tau`` is the effort on the model in the period that ends."""
        bound = self._bound
        if bound is None or bound.state is not state:
            acted, length, besides = np.zeros(len(tau)), np.zeros(1), np.zeros(len(tau))
            calls = self._calls(state, acted, length)
            explain = self._unexplained(state, besides)
            each = (state.plan([call]).call() for call in (calls, explain))
            bound = self._bound = _BoundObserver(state, acted, length, besides, *each)
        bound.acted[:], bound.period[:] = tau, period
        bound.observe()
        return self.disturbance

    def _calls(self, state: RobotState, acted: Array, period: Array) -> PartCall:
        return PartCall(
            engine.ObserveMomentum,
            M=state.inertia,
            M_dot=state.inertia_rate,
            v=state.v,
            nonlinear_effects=state.effects,
            acted=acted,
            period=period,
            bandwidth=self._bandwidth,
            most_per_period=self._most_per_period,
            clip=self._clip,
            memory=self._memory,
            momentum=self._momentum,
            drift=self._drift,
            begun=self._begun,
            cancelled=self.cancelled,
        )

    def measure(self, run: Run) -> None:
        """Learn from the effort that acted; see `Stage.measure`."""
        acted = run.under_way[0] if run.under_way else run.none
        state = run.measured.update(run.t, run.q, run.v)
        run.disturbance = self.update(state, acted, run.last_period)
        if run.controller.limits is not None:
            assert self._bound is not None
            self._bound.explain()
            run.controller.disturbed(self._bound.besides)

    def _unexplained(self, state: RobotState, besides: Array) -> PartCall:
        """Return the call for the acceleration of the part that is not cancelled."""
        return PartCall(
            engine.Unexplained,
            M=state.inertia,
            disturbance=self.disturbance,
            cancelled=self.cancelled,
            acceleration=besides,
        )

    def alone(self, shared: Alone) -> AloneCalls:
        """Return its calls; see `Stage.alone`."""
        state = shared.state
        observe = [
            self._calls(state, shared.acted, shared.period),
            self._unexplained(state, shared.disturbance),
        ]
        act = PartCall(engine.Subtract, x=self.cancelled, out=shared.effort)
        return AloneCalls(observe=observe, act=[act])

    def act(self, run: Run, state: RobotState, active: ActiveStack) -> None:
        """Cancel the estimate; see `Stage.act`."""
        run.effort = run.effort - self.cancelled

    def log_channels(self, run: Run) -> Mapping[str, LogChannel]:
        """Return r, and the force at every task of a frame that explains it."""
        r, meaning = self.disturbance, "estimated disturbance r"
        found = {"observer.disturbance": LogChannel(r, "N·m or N", meaning)}
        share = np.abs(r) / run.controller.robot.largest_efforts()
        found["observer.share"] = LogChannel(
            np.array(share.max()),
            "-",
            f"largest |r| of an effort limit; above {LARGE_SHARE:g} the model does not "
            "describe the robot",
        )
        threshold = run.controller.singularity_threshold
        tasks = [each for level in run.controller.planned_levels for each in level]
        names = self._names.update(tasks)
        for each in tasks:
            task = each.task
            if isinstance(task, CompliantTask) and task.wrench_unit is not None:
                found[f"observer.wrench.{names[each.key]}"] = LogChannel(
                    task_wrench(task, run.measured, r, threshold),
                    task.wrench_unit,
                    "estimated force on the robot, in world axes",
                )
        return found


def low_pass(
    d: Array, memory: Sequence[Array], bandwidth: float, period: float
) -> tuple[Array, ...]:
    """Return the states of a low-pass after a period in which its input was d.

    As many equal poles as ``memory`` has states, together 1/bandwidth late. Each step
    is exact for an input that is constant in the period.
    """
    share = 1.0 - exp(-len(memory) * bandwidth * period)
    after = list[Array]()
    for state in memory:
        d = state + share * (d - state)
        after.append(d)
    return tuple(after)


def task_wrench(
    task: Task, state: RobotState, disturbance: Array, threshold: float
) -> Array:
    """Return f = Λ J M⁻¹ r = J̄ᵀ r, shape (m,): the force at the rows of a task.

    If r = Jᵀf then this is f. Whatever else r is, f is the force that moves the task as
    r does. J̄ = M⁻¹JᵀΛ is bounded near singularities as the law's own pseudo-inverse is:
    a force along a lost direction, which the joints do not feel, is taken for zero.
    """
    given = as_given(task, state)
    J = task.evaluate(given, feedback=task.feedback()).jacobian
    force = np.zeros(len(J))
    try:
        L = np.linalg.cholesky(state.mass_matrix)
    except np.linalg.LinAlgError:
        return np.full(len(J), np.nan)
    engine.TaskForce(
        J=J,
        L=L,
        form=VARYING,
        threshold=threshold,
        effort=np.array(disturbance),
        force=force,
    )()
    return force
