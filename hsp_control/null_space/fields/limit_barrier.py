"""The cost of joints near their limits, zero in the middle of the range."""

from dataclasses import KW_ONLY
from typing import Self

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Fraction, Weights
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields.barrier import barrier_at
from hsp_control.null_space.fields.compiled_cost import CompiledCost, Derivatives
from hsp_control.null_space.fields.joint_centering import limited_joints, per_dof
from hsp_control.robot import RobotState


class LimitBarrier(CompiledCost, type="limit_barrier"):
    """f = Σ w_i (b((q_i - lower_i)/u_i) + b((upper_i - q_i)/u_i)).

    u_i is ``zone`` times half the range, and b the function `barrier_at`: a joint adds
    to f only within the distance u_i of a limit. Joints without limits, continuous
    joints and a floating root do not count.
    """

    zone: Fraction = 0.3
    """Width of the zone before a limit, as a fraction of half the range, at most 1
    [-]."""
    _: KW_ONLY
    weights: Weights = 1.0
    """w_i of the joints [1/s], one number or nv."""

    def placed(self, start: Start) -> Self:
        """Return the cost, checked; see `NullSpaceField.placed`.

        Raises:
            FieldError: If the weights do not fit the robot, or no joint has limits.
        """
        robot = start.state.robot
        with within("weights"):
            per_dof(self.weights, robot.nv)
        if not limited_joints(robot).size:
            raise FieldError(f"no joint of {robot.name} has limits")
        return self

    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        robot = state.robot
        limited, (low, high) = limited_joints(robot), robot.position_limits()
        dofs = limited[:, 0]
        lower, upper = low[dofs], high[dofs]
        return bind(
            _limit_barrier,
            state.q,
            state.v,
            limited,
            lower,
            upper,
            0.5 * self.zone * (upper - lower),  # u_i
            per_dof(self.weights, robot.nv)[dofs],
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
