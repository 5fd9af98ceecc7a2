"""Keep the joints off their limits, and leave them alone elsewhere."""

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
    """f = Σ w_i (b(q_i - lower_i) + b(upper_i - q_i)), zero in the middle of the range.

    b is the barrier of `fields.barrier`; it begins at a fraction of half the range
    from a limit. Joints without limits, continuous ones and a floating root
    are left free.
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
            zone: Where it begins, as a fraction of half the range, within (0, 1].
            weights: w_i ≥ 0, one number or one per freedom, shape (nv,).
            name: What the log calls it.

        Raises:
            FieldError: If the zone is out of range, a weight negative, or no joint has
                limits.
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
        # Distances are measured in units of the zone: the barrier begins at 1.
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
    """Write ∇f and ∇²f v, and return f."""
    for i in range(v.shape[0]):
        gradient[i] = rate[i] = 0.0
    f = 0.0
    for k in range(limited.shape[0]):
        i, at = limited[k, 0], limited[k, 1]
        below, slope_below, bend_below = barrier_at((q[at] - lower[k]) / unit[k])
        above, slope_above, bend_above = barrier_at((upper[k] - q[at]) / unit[k])
        f += weights[k] * (below + above)
        gradient[i] = weights[k] * (slope_below - slope_above) / unit[k]
        bend = (bend_below + bend_above) / (unit[k] * unit[k])
        rate[i] = weights[k] * bend * v[i]
    return f
