"""Integrators on the configuration manifold: SciPy's DOP853 and two fixed steps.

A chart q = base ⊕ δ turns the motion into an ordinary one of y = (δ, v), with δ' = v
for joints of one freedom and δ' = J_r(δ)⁻¹ v for a floating root.
"""

from collections.abc import Callable
from typing import Protocol

import numpy as np
import pinocchio as pin
from scipy.integrate import DOP853

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError, SimulationError
from hsp_control.robot.robot import Robot

Dynamics = Callable[[float, Array, Array], Array]
"""(t, q, v) ↦ v'."""

Equation = Callable[[float, Array], Array]
"""(t, y) ↦ y'."""

CHART_RADIUS = 1.0
"""How far a root may turn [rad] before its chart is laid anew (singular at 2π)."""


class Chart:
    """Coordinates y = (δ, v) about a configuration."""

    def __init__(self, robot: Robot, base: Array) -> None:
        """Lay the chart at a configuration, shape (nq,)."""
        self.robot = robot
        self.base = base.copy()

    def point(self, y: Array) -> tuple[Array, Array]:
        """Return (q, v)."""
        nv = self.robot.nv
        return self.robot.integrate(self.base, y[:nv]), y[nv:]

    def rate(self, y: Array, a: Array) -> Array:
        """Return y' for an acceleration."""
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
                "the motion diverged: within one step a root turns so far that its "
                "coordinates end"
            ) from None

    def equation(self, dynamics: Dynamics) -> Equation:
        """Return the ordinary differential equation (t, y) ↦ y'."""
        return lambda t, y: self.rate(y, dynamics(t, *self.point(y)))

    def worn(self, y: Array) -> bool:
        """Return whether the chart should be laid anew."""
        reach = float(np.abs(y[: self.robot.nv]).max())
        return not self.robot.flat and reach > CHART_RADIUS


class Integrator(Protocol):
    """Carries (q, v) from one time to the next."""

    def advance(
        self, robot: Robot, dynamics: Dynamics, t: float, end: float, q: Array, v: Array
    ) -> tuple[Array, Array]:
        """Return (q, v) at time ``end`` [s]."""
        ...


class Rk4:
    """The classical fourth-order Runge-Kutta step, in the chart at its start."""

    def __init__(self, step: float) -> None:
        """Set the largest step [s]; each interval is cut into equal ones.

        Raises:
            SimulationError: If it is not positive.
        """
        self.step = _positive(step, "step")

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


class SemiImplicitEuler:
    """v ← v + h v', then q ← q ⊕ h v: first order, cheap, well-behaved."""

    def __init__(self, step: float) -> None:
        """Set the largest step [s]; each interval is cut into equal ones.

        Raises:
            SimulationError: If it is not positive.
        """
        self.step = _positive(step, "step")

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


class Dop853:
    """Dormand and Prince's adaptive eighth-order method, SciPy's implementation.

    It first tries to take an interval in one step, which the tolerance then judges. A
    trial that strays so far that the dynamics fail there is shortened, like any other
    that misses the tolerance.
    """

    def __init__(self, rtol: float = 1e-9, atol: float = 1e-9) -> None:
        """Set the relative and absolute tolerance of a step.

        Raises:
            SimulationError: If one is not positive.
        """
        self.rtol, self.atol = _positive(rtol, "rtol"), _positive(atol, "atol")

    def advance(
        self, robot: Robot, dynamics: Dynamics, t: float, end: float, q: Array, v: Array
    ) -> tuple[Array, Array]:
        """Return (q, v) at ``end``; see `Integrator.advance`.

        Raises:
            SimulationError: If the tolerance cannot be met however small the step.
            HspControlError: If the dynamics fail however small the step.
        """
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
                        f"the integrator gave up at t = {solver.t:.6g} s: "
                        f"{trial.failure or message}"
                    ) from trial.failure
                if chart.worn(solver.y):
                    break
            t = float(solver.t)
            q, v = chart.point(solver.y)
        return q, v


class _Trial:
    """An equation that is NaN where it fails, so that SciPy rejects the step."""

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


def _positive(value: float, name: str) -> float:
    if not 0.0 < value < np.inf:
        raise SimulationError(f"integrator: {name} is {value}; must be positive")
    return value


def number_of_steps(duration: float, step: float) -> int:
    """Return the least number of equal steps, none longer than ``step``."""
    return max(1, int(np.ceil(duration / step - 1e-9)))
