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
    good to about 1e-10 for motions of a few rad/s. The function must be smooth, and
    defined three steps before and after every time asked for; anything but n finite
    numbers raises `TrajectoryError`. To be pickled it must be defined at the top of a
    module.

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
        """Follow ``function``.

        Args:
            function: f, time [s] to a point of shape (n,).
            dimension: n.
            velocity: f', if known.
            acceleration: f'', if known.
            step: Time between the points of the differences [s].

        Raises:
            TrajectoryError: If the dimension is not a positive integer.
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
        """Return the point at time t; see `Trajectory.sample`."""
        out = self._output(out)
        velocity, acceleration = self._rates(t)
        out.position[:] = self._call(self.function, "function", t)
        out.velocity[:] = velocity
        out.acceleration[:] = acceleration
        return out

    def _rates(self, t: float) -> tuple[Array, Array]:
        """Return f' and f'', each by the least differentiation that is left to do."""
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
