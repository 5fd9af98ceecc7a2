"""Integrators on the configuration manifold: SciPy's DOP853 and two fixed-step ones.

In a chart q = base ⊕ δ the motion is an ordinary differential equation of y = (δ, v),
with δ' = v for single-dof joints and δ' = J_r(δ)⁻¹ v for a root.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import partial
from math import ceil

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.entry_points import own_names
from hsp_control.common.errors import HspControlError, SimulationError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Positive
from hsp_control.engine import Plan
from hsp_control.engine.plans import TIME, AnyCall, PartCall, PartCalls, planned
from hsp_control.robot.kinematics import Term
from hsp_control.robot.robot import Robot

Dynamics = Callable[[float, Array, Array], Array]
"""(t, q, v) ↦ v'."""

Equation = Callable[[float, Array], Array]
"""(t, y) ↦ y'."""

CHART_RADIUS = 1.0
"""A new chart starts when a root has rotated by this [rad]; charts end at 2π."""


class TangentChart:
    """Coordinates y = (δ, v), shape (2 nv,), with q = base ⊕ δ."""

    def __init__(self, robot: Robot, base: Array) -> None:
        self.robot = robot
        self.base = base.copy()

    def point(self, y: Array) -> tuple[Array, Array]:
        """Return (q, v), shapes (nq,) and (nv,)."""
        nv = self.robot.nv
        return self.robot.integrate(self.base, y[:nv]), y[nv:]

    def rate(self, y: Array, a: Array) -> Array:
        """Return y' for an acceleration a, shape (nv,).

        Raises:
            SimulationError: If δ is at the singularity of the chart.
        """
        nv = self.robot.nv
        return np.concatenate([self.velocity(y[:nv], y[nv:]), a])

    def velocity(self, delta: Array, v: Array) -> Array:
        """Return δ' for the velocity v, both of shape (nv,).

        Raises:
            SimulationError: If δ is at the singularity of the chart.
        """
        if self.robot.flat:
            return v
        J_r = pin.dIntegrate(
            self.robot.model, self.base, delta, pin.ArgumentPosition.ARG1
        )
        try:
            return np.asarray(np.linalg.solve(J_r, v))
        except np.linalg.LinAlgError:
            raise SimulationError(
                "the motion diverged: the root rotates by a full turn within one "
                "step; use a smaller step"
            ) from None

    def equation(self, dynamics: Dynamics) -> Equation:
        """Return the ordinary differential equation (t, y) ↦ y'."""
        return lambda t, y: self.rate(y, dynamics(t, *self.point(y)))

    def needs_new_base(self, y: Array) -> bool:
        """Return whether δ is so large that a new chart should start there."""
        largest = float(np.abs(y[: self.robot.nv]).max())
        return not self.robot.flat and largest > CHART_RADIUS


Bind = Callable[[Array, Array], Term]
"""(q, v) ↦ v', computed for the values that these two arrays have then."""

Advance = Callable[[float, float, Array, Array], tuple[Array, Array]]
"""(t, end, q, v) ↦ (q, v) at the end, in new arrays."""


class Integrator(Part, ABC, family="integrators", error=SimulationError):
    """Integrates the motion from one time to another."""

    @abstractmethod
    def begin(self, robot: Robot, bind_dynamics: Bind) -> Advance:
        """Return an integration of a robot's motion, with its own memory.

        Args:
            robot: The robot.
            bind_dynamics: Makes v' of the arrays q and v.
        """

    def advance(
        self, robot: Robot, dynamics: Dynamics, t: float, end: float, q: Array, v: Array
    ) -> tuple[Array, Array]:
        """Return (q, v) at time ``end`` [s]; `begin` is faster for several intervals.

        Args:
            robot: The robot.
            dynamics: (t, q, v) ↦ v', shape (nv,).
            t: Start time [s].
            end: End time [s].
            q: Configuration at the start, shape (nq,).
            v: Velocity at the start, shape (nv,).
        """
        return self.begin(robot, bound(dynamics))(t, end, q, v)

    @property
    def longest_step(self) -> float | None:
        """The longest step [s]; None: it adapts its steps."""
        return None


def bound(dynamics: Dynamics) -> Bind:
    """Return dynamics as integrators call them: of the same arrays every time."""

    def bind_dynamics(q: Array, v: Array) -> Term:
        value = np.zeros_like(v)

        def compute(t: float) -> None:
            value[:] = dynamics(t, q, v)

        return Term(value, [PartCall(compute, t=TIME)])

    return bind_dynamics


class FixedStep(Integrator):
    """An integrator with steps of equal length."""

    step: Positive = 1e-3
    """Integration step [s]; an integer fraction of the control period. Any other
    interval is divided into equal steps that are not longer."""

    @property
    def longest_step(self) -> float:
        """The longest step [s]."""
        return self.step


class Rk4(FixedStep, type="rk4"):
    """The classical fourth-order Runge-Kutta step, with a new chart in every step."""

    def begin(self, robot: Robot, bind_dynamics: Bind) -> "Steps":
        """Return the running integrator; see `Integrator.begin`."""
        return _Rk4Stages(robot, bind_dynamics, self.step)


class SemiImplicitEuler(FixedStep, type="semi_implicit_euler"):
    """The semi-implicit Euler step, of first order: v ← v + h v', q ← q ⊕ h v."""

    def begin(self, robot: Robot, bind_dynamics: Bind) -> "Steps":
        """Return the running integrator; see `Integrator.begin`."""
        return _EulerStep(robot, bind_dynamics, self.step)


def number_of_steps(duration: float, step: float) -> int:
    """Return the smallest number of equal steps that are not longer than ``step``."""
    return max(1, ceil(duration / step - 1e-9))


class Steps(ABC):
    """Makes steps of equal length: the memory of a `FixedStep`, called as `Advance`.

    Attributes:
        q: Configuration where v' is computed, shape (nq,).
        v: Velocity there, shape (nv,).
        acceleration: v' there.
        interval: Beginning and end of the integration [s], shape (2,).
        now: Beginning of the present step [s], shape (1,).
        h: The step [s], shape (1,).
        take: Integrates q and v over the interval.
        native: Whether `take` runs no function of Python; a part of a step, for example
            v', may be one.
    """

    def __init__(self, robot: Robot, bind_dynamics: Bind, longest: float) -> None:
        """Allocate, and bind the calls of a step."""
        self.robot = robot
        self.q, self.v = robot.neutral(), np.zeros(robot.nv)
        self.acceleration = bind_dynamics(self.q, self.v)
        self.interval, self.now, self.h = np.zeros(2), np.zeros(1), np.zeros(1)
        step = Plan(planned(self._calls()).steps())
        self.take = engine.EqualSteps(
            calls=step,
            interval=self.interval,
            longest=longest,
            now=self.now,
            h=self.h,
        )
        self.native = not self.take.python

    @abstractmethod
    def _calls(self) -> PartCalls:
        """Return the calls of a step."""

    def __call__(self, t: float, end: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return (q, v) at ``end``; see `Integrator.advance`."""
        self.q[:], self.v[:] = q, v
        self.interval[0], self.interval[1] = t, end
        self.take()
        return self.q.copy(), self.v.copy()

    def compute_at(self, fraction: float) -> PartCalls:
        """Return the calls that write v' at this fraction of the step."""
        calls = self.acceleration.calls
        plan = planned(calls)
        if not plan.follow:
            return calls
        now, h = self.now, self.h
        return [PartCall(lambda: plan.run(now.item() + fraction * h.item()))]


class _EulerStep(Steps):
    def _calls(self) -> PartCalls:
        robot = self.robot
        self._moved = np.zeros(robot.nv)
        q, a = self.q if robot.linear else np.zeros(0), self.acceleration.value
        step = PartCall(
            engine.EulerStep, h=self.h, a=a, q=q, v=self.v, moved=self._moved
        )
        place = [] if robot.linear else [PartCall(self._place)]
        return [*self.compute_at(0.0), step, *place]

    def _place(self) -> None:
        self.q[:] = self.robot.integrate(self.q, self._moved)


class _Rk4Stages(Steps):
    """The four stages of a step, in the chart q = base ⊕ δ."""

    def _calls(self) -> PartCalls:
        robot = self.robot
        self._D, A = np.zeros((2, 4, robot.nv))
        self._delta, v0 = np.zeros((2, robot.nv))
        self._chart = TangentChart(robot, self.q)
        self._base = self._chart.base
        base, q = self._base, self.q
        begin = PartCall(engine.Rk4Begin, q=q, v=self.v, base=base, v0=v0, D=self._D)
        if not robot.linear:
            base = q = np.zeros(0)
        slopes = {"h": self.h, "D": self._D, "A": A, "a": self.acceleration.value}
        point = {"base": base, "v0": v0, "delta": self._delta, "q": q, "v": self.v}
        parts: list[AnyCall] = [begin, *self.compute_at(0.0)]
        for i, fraction in enumerate((0.5, 0.5, 1.0)):
            stage = {"stage": i, "fraction": fraction}
            parts.append(PartCall(engine.Rk4Stage, **stage, **slopes, **point))
            if not robot.linear:
                parts.append(PartCall(self._place, stage=i + 1))
            parts += self.compute_at(fraction)
        parts.append(PartCall(engine.Rk4End, **slopes, **point))
        if not robot.linear:
            parts.append(PartCall(self._place, stage=None))
        return parts

    def _place(self, stage: int | None) -> None:
        """Compute the chart of a robot whose coordinates are not a vector space."""
        self.q[:] = self.robot.integrate(self._base, self._delta)
        if stage is not None and not self.robot.flat:
            self._D[stage] = self._chart.velocity(self._delta, self.v)


class Dop853(Integrator, type="dop853"):
    """Dormand and Prince's adaptive eighth-order method, from SciPy.

    The first trial step covers the whole interval. A step is shortened if it misses the
    tolerance, or if the dynamics raise an error at one of its trial states.
    """

    rtol: Positive = 1e-9
    """Relative tolerance of a step [-]."""
    atol: Positive = 1e-9
    """Absolute tolerance of a step [rad, m, rad/s or m/s]."""

    def begin(self, robot: Robot, bind_dynamics: Bind) -> Advance:
        """Return the running integrator; see `Integrator.begin`."""
        return partial(self._advance, robot, _of_new_arrays(robot, bind_dynamics))

    def _advance(
        self, robot: Robot, dynamics: Dynamics, t: float, end: float, q: Array, v: Array
    ) -> tuple[Array, Array]:
        from scipy.integrate import DOP853  # here: importing SciPy is slow

        while t < end:
            chart = TangentChart(robot, q)
            trial = _Trial(chart.equation(dynamics))
            solver = DOP853(
                trial,
                t,
                np.concatenate([np.zeros(robot.nv), v]),
                end,
                first_step=end - t,
                rtol=self.rtol,
                atol=self.atol,
            )
            while solver.status == "running":
                trial.failure = None
                with np.errstate(over="ignore", invalid="ignore"):  # in rejected trials
                    message = solver.step()
                if isinstance(trial.failure, HspControlError) and message is not None:
                    raise trial.failure
                if message is not None:
                    raise SimulationError(
                        f"the integrator failed at t = {solver.t:.6g} s: "
                        f"{trial.failure or message}"
                    ) from trial.failure
                if chart.needs_new_base(solver.y):
                    break
            t = float(solver.t)
            q, v = chart.point(solver.y)
        return q, v


def _of_new_arrays(robot: Robot, bind_dynamics: Bind) -> Dynamics:
    """Return dynamics that copy their arguments to the bound arrays."""
    q, v = robot.neutral(), np.zeros(robot.nv)
    acceleration = bind_dynamics(q, v)
    compute = planned(acceleration.calls)

    def dynamics(t: float, q_new: Array, v_new: Array) -> Array:
        q[:], v[:] = q_new, v_new
        compute.run(t)
        return acceleration.value

    return dynamics


class _Trial:
    """An equation that returns NaN where it fails, so that SciPy rejects the step."""

    def __init__(self, equation: Equation) -> None:
        self.equation = equation
        self.failure: Exception | None = None  # the last error, or None

    def __call__(self, t: float, y: Array) -> Array:
        if np.isfinite(y).all():
            try:
                return self.equation(t, y)
            except (HspControlError, ArithmeticError, np.linalg.LinAlgError) as failure:
                self.failure = failure
        return np.full(y.shape, np.nan)


__dir__ = own_names(__name__)
