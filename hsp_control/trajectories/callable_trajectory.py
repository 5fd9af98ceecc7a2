"""Any Python function of time as a trajectory."""

from collections.abc import Callable

from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TrajectoryError
from hsp_control.trajectories import checks, time_derivatives
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample

PointFunction = Callable[[float], ArrayLike]


class CallableTrajectory(Trajectory):
    """x(t) = f(t); derivatives that are not given are numerical.

    They are central differences of sixth order over seven points (`time_derivatives`),
    with an error of about 1e-10 for motions of a few rad/s. The function must be
    smooth, and defined three steps before and after every sampled time. For pickling it
    must be defined at the top level of a module.

    Attributes:
        function: f, time [s] to a point of shape (n,).
        velocity: f', or None.
        acceleration: f'', or None.
        step: Time between the seven points [s].
    """

    __slots__ = ("_dimension", "acceleration", "function", "step", "velocity")

    def __init__(
        self,
        function: PointFunction,
        dimension: int,
        velocity: PointFunction | None = None,
        acceleration: PointFunction | None = None,
        step: float = time_derivatives.STEP,
    ) -> None:
        """Set the function and the derivatives that are known.

        Args:
            function: f, time [s] to a point of shape (n,).
            dimension: n.
            velocity: f', time [s] to shape (n,), if known.
            acceleration: f'', time [s] to shape (n,), if known.
            step: Time between the points of the differences [s].

        Raises:
            TrajectoryError: If the dimension is not a positive integer, or the step is
                not positive.
        """
        if dimension < 1 or dimension != int(dimension):
            raise TrajectoryError(
                f"dimension must be a positive integer; dimension = {dimension}"
            )
        self._dimension = int(dimension)
        self.function = function
        self.velocity = velocity
        self.acceleration = acceleration
        self.step = checks.positive(step, "step")

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return self._dimension

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
        return checks.array(function(t), f"{name}({t:g})", (self._dimension,))
