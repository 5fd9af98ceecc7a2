"""The cost of joints near their limits, zero in the middle of the range."""

from typing import Any

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.null_space.fields.barrier import barrier_at
from hsp_control.null_space.fields.compiled_cost import CompiledCost, Derivatives
from hsp_control.null_space.fields.joint_centering import check_weights, limited_joints
from hsp_control.robot import Robot, RobotState


class LimitBarrier(CompiledCost):
    """f = Σ w_i (b((q_i - lower_i)/u_i) + b((upper_i - q_i)/u_i)).

    u_i is ``zone`` times half the range, and b the function `barrier_at`: a joint adds
    to f only within the distance u_i of a limit. Joints without limits, continuous
    joints and a floating root do not count.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        zone: float = 0.3,
        weights: Any = 1.0,
        name: str = "limit_barrier",
    ) -> None:
        """Set the cost.

        Args:
            robot: The robot.
            zone: Distance from a limit at which the cost begins, as a fraction of half
                the range, within (0, 1].
            weights: w_i ≥ 0, one number or one per degree of freedom, shape (nv,).
            name: Name of the field in the log.

        Raises:
            FieldError: If the zone is out of range, a weight is negative or not finite,
                or no joint has limits.
        """
        super().__init__(robot, name)
        if not 0.0 < zone <= 1.0:
            raise FieldError(f"field {name!r}: zone {zone} must be within (0, 1]")
        w = check_weights(weights, robot.nv, name)
        lower, upper = robot.position_limits()
        self._limited = limited_joints(robot)
        if not self._limited.size:
            raise FieldError(f"field {name!r}: no joint of {robot.name} has limits")
        dofs = self._limited[:, 0]
        self._weights = w[dofs]
        self._lower, self._upper = lower[dofs], upper[dofs]
        # u_i, the width of the zone: the barrier begins at a distance of 1 unit.
        self._unit = 0.5 * zone * (self._upper - self._lower)

    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        return bind(
            _limit_barrier,
            state.q,
            state.v,
            self._limited,
            self._lower,
            self._upper,
            self._unit,
            self._weights,
            gradient,
            rate,
        )


@kernel
def _limit_barrier(
    q: Array,
    v: Array,
    limited: Indices,
    lower: Array,
    upper: Array,
    unit: Array,
    weights: Array,
    gradient: Array,
    rate: Array,
) -> float:
    """Write ∇f and (∇f)' = ∇²f v, and return f."""
    for i in range(v.shape[0]):
        gradient[i] = rate[i] = 0.0
    f = 0.0
    for k in range(limited.shape[0]):
        i, at = limited[k, 0], limited[k, 1]
        b_lower, slope_lower, curvature_lower = barrier_at((q[at] - lower[k]) / unit[k])
        b_upper, slope_upper, curvature_upper = barrier_at((upper[k] - q[at]) / unit[k])
        f += weights[k] * (b_lower + b_upper)
        gradient[i] = weights[k] * (slope_lower - slope_upper) / unit[k]
        curvature = (curvature_lower + curvature_upper) / (unit[k] * unit[k])
        rate[i] = weights[k] * curvature * v[i]
    return f
