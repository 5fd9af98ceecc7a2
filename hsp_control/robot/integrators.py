"""Integrators on the configuration manifold: SciPy's DOP853 and two fixed-step ones.

In a chart q = base ⊕ δ the motion is an ordinary differential equation of y = (δ, v),
with δ' = v for single-dof joints and δ' = J_r(δ)⁻¹ v for a root.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError, SimulationError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Positive
from hsp_control.robot.robot import Robot

Dynamics = Callable[[float, Array, Array], Array]
"""(t, q, v) ↦ v'."""

Equation = Callable[[float, Array], Array]
"""(t, y) ↦ y'."""

CHART_RADIUS = 1.0
"""A new chart starts when a root has rotated by this [rad]; charts end at 2π."""


class Chart:
    """Coordinates y = (δ, v), shape (2 nv,), with q = base ⊕ δ."""

    def __init__(self, robot: Robot, base: Array) -> None:
        """Create the chart about a configuration, shape (nq,)."""
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
        delta, v = y[:nv], y[nv:]
        if self.robot.flat:
            return np.concatenate([v, a])
        J_r = pin.dIntegrate(
            self.robot.model, self.base, delta, pin.ArgumentPosition.ARG1
        )
        try:
            return np.concatenate([np.linalg.solve(J_r, v), a])
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


class Integrator(Part, ABC, family="integrators", error=SimulationError):
    """Integrates the motion from one time to another."""

    @abstractmethod
    def advance(
        self, robot: Robot, dynamics: Dynamics, t: float, end: float, q: Array, v: Array
    ) -> tuple[Array, Array]:
        """Return (q, v) at time ``end`` [s].

        Args:
            robot: The robot.
            dynamics: (t, q, v) ↦ v', shape (nv,).
            t: Start time [s].
            end: End time [s].
            q: Configuration at the start, shape (nq,).
            v: Velocity at the start, shape (nv,).
        """

    @property
    def longest_step(self) -> float | None:
        """The longest step [s]; None: it adapts its steps."""
        return None


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
    """The classical fourth-order Runge-Kutta step, with a new chart in each step."""

    def advance(
        self, robot: Robot, dynamics: Dynamics, t: float, end: float, q: Array, v: Array
    ) -> tuple[Array, Array]:
        """Return (q, v) at ``end``; see `Integrator.advance`."""
        steps = number_of_steps(end - t, self.step)
        h = (end - t) / steps
        for k in range(steps):
            q, v = self._advance_one(robot, dynamics, t + k * h, h, q, v)
        return q, v

    def _advance_one(
        self, robot: Robot, dynamics: Dynamics, t: float, h: float, q: Array, v: Array
    ) -> tuple[Array, Array]:
        chart = Chart(robot, q)
        slope = chart.equation(dynamics)
        y = np.concatenate([np.zeros(robot.nv), v])
        k1 = slope(t, y)
        k2 = slope(t + h / 2, y + h / 2 * k1)
        k3 = slope(t + h / 2, y + h / 2 * k2)
        k4 = slope(t + h, y + h * k3)
        return chart.point(y + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4))


class SemiImplicitEuler(FixedStep, type="semi_implicit_euler"):
    """The semi-implicit Euler step, of first order: v ← v + h v', q ← q ⊕ h v."""

    def advance(
        self, robot: Robot, dynamics: Dynamics, t: float, end: float, q: Array, v: Array
    ) -> tuple[Array, Array]:
        """Return (q, v) at ``end``; see `Integrator.advance`."""
        steps = number_of_steps(end - t, self.step)
        h = (end - t) / steps
        for k in range(steps):
            v = v + h * dynamics(t + k * h, q, v)
            q = robot.integrate(q, h * v)
        return q, v


class Dop853(Integrator, type="dop853"):
    """Dormand and Prince's adaptive eighth-order method, from SciPy.

    The first trial step covers the whole interval. A step is shortened if it misses the
    tolerance, or if the dynamics raise an error at one of its trial states.
    """

    rtol: Positive = 1e-9
    """Relative tolerance of a step [-]."""
    atol: Positive = 1e-9
    """Absolute tolerance of a step [rad, m, rad/s or m/s]."""

    def advance(
        self, robot: Robot, dynamics: Dynamics, t: float, end: float, q: Array, v: Array
    ) -> tuple[Array, Array]:
        """Return (q, v) at ``end``; see `Integrator.advance`.

        Raises:
            SimulationError: If no step, however small, meets the tolerance.
            HspControlError: If the dynamics raise this error at every step size.
        """
        from scipy.integrate import DOP853  # here: SciPy takes long to import

        while t < end:
            chart = Chart(robot, q)
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


class _Trial:
    """An equation that returns NaN where it fails, so that SciPy rejects the step.

    Attributes:
        failure: The last error, or None.
    """

    def __init__(self, equation: Equation) -> None:
        self.equation = equation
        self.failure: Exception | None = None

    def __call__(self, t: float, y: Array) -> Array:
        if np.isfinite(y).all():
            try:
                return self.equation(t, y)
            except (HspControlError, ArithmeticError, np.linalg.LinAlgError) as failure:
                self.failure = failure
        return np.full(y.shape, np.nan)


def number_of_steps(duration: float, step: float) -> int:
    """Return the smallest number of equal steps that are not longer than ``step``."""
    return max(1, int(np.ceil(duration / step - 1e-9)))
