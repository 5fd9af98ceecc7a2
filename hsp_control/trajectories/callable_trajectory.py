"""Any Python function of time as a trajectory."""

from collections.abc import Callable

from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import Positive, PositiveCount
from hsp_control.trajectories import checks, time_derivatives
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample

PointFunction = Callable[[float], ArrayLike]


class CallableTrajectory(Trajectory):
    """x(t) = f(t); derivatives that are not given are numerical.

    They are central differences of sixth order over seven points (`time_derivatives`),
    with an error of about 1e-10 for motions of a few rad/s. The function must be
    smooth, and defined three steps before and after every sampled time. For pickling it
    must be defined at the top level of a module.
    """

    function: PointFunction
    """f, time [s] to a point of shape (n,)."""
    dimension: PositiveCount
    """The number n of coordinates [-]."""
    velocity: PointFunction | None = None
    """f', time [s] to shape (n,), if known."""
    acceleration: PointFunction | None = None
    """f'', time [s] to shape (n,), if known."""
    step: Positive = time_derivatives.STEP
    """Time between the seven points of the differences [s]."""

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return x(t), x'(t) and x''(t); see `Trajectory.sample`.

        Raises:
            TrajectoryError: If a function does not return n finite numbers.
        """
        out = self._output(out)
        velocity, acceleration = self._rates(t)
        out.position[:] = self._call(self.function, "function", t)
        out.velocity[:] = velocity
        out.acceleration[:] = acceleration
        return out

    def _rates(self, t: float) -> tuple[Array, Array]:
        """Return f' and f'', each from the highest derivative that is given."""
        f, v, a = self.function, self.velocity, self.acceleration
        if v is None:
            rates = time_derivatives.both_derivatives(
                lambda s: self._call(f, "function", s), t, self.step
            )
            return rates if a is None else (rates[0], self._call(a, "acceleration", t))
        if a is None:
            return self._call(v, "velocity", t), time_derivatives.first_derivative(
                lambda s: self._call(v, "velocity", s), t, self.step
            )
        return self._call(v, "velocity", t), self._call(a, "acceleration", t)

    def _call(self, function: PointFunction, name: str, t: float) -> Array:
        return checks.array(function(t), f"{name}({t:g})", (self.dimension,))
