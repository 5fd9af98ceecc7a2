"""The abstract cost of a frame's Jacobian, with exact gradient and rate.

Let i and j be degrees of freedom of the chain to a frame, and J_j = (l_j, w_j) their
columns in world axes at the frame's origin. A motion of i changes J_j by

    w_i × (l_j, w_j)   if i comes before j in the chain, or both belong to one joint,
    (w_j × l_i, 0)     if j comes before i,

for revolute joints, prismatic joints and floating roots. A function φ(J) with
∂φ/∂J = B, columns (b_j, c_j), therefore has the gradient

    w_i · Σ_{j from i on} (l_j × b_j + w_j × c_j) + l_i · Σ_{j before i} (b_j × w_j)

which running sums give in O(n), without the kinematic Hessian. Its rate is exact too,
because J' is known exactly.
"""

from dataclasses import KW_ONLY, replace
from typing import Literal, NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import FieldError
from hsp_control.compiled.kernels import KernelCall, KernelCalls, kernel
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Axes
from hsp_control.geometry.scene import Start
from hsp_control.null_space.fields.cost import Cost
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import FrameMotion

Rows = Literal["position", "orientation", "pose"]


class JacobianTerms(NamedTuple):
    """φ(J), ∂φ/∂J and its rate at one state, for the k selected and scaled rows.

    Attributes:
        value: φ(J).
        slope: B = ∂φ/∂J, shape (k, nv).
        slope_rate: B', the time derivative of B along v, shape (k, nv).
    """

    value: float
    slope: Array
    slope_rate: Array


class JacobianCost(Cost):
    """f = φ(J) of k rows of a frame's Jacobian, in world axes at the frame's origin.

    A subclass implements `terms`, which returns φ, ∂φ/∂J and the rate of ∂φ/∂J. Value,
    gradient and gradient rate follow exactly. If one kernel computes the terms, it
    implements `terms_kernel` instead. The rows are those of the position, unless the
    subclass declares fields ``rows`` and ``length``, with defaults.
    """

    frame: str | None = None
    """Name of the frame [-]; the robot's end effector by default."""
    _: KW_ONLY
    axes: Axes = "xyz"
    """World axes of the position rows of the Jacobian, such as ``xy`` for a planar arm
    [-]; the rows are always in the order x, y, z."""

    @property
    def rows(self) -> Rows:
        """Which rows of the Jacobian count."""
        return "position"

    @property
    def length(self) -> float:
        """Length by which the orientation rows of a ``pose`` are multiplied [m]."""
        return 1.0

    def placed(self, start: Start) -> Self:
        """Return the cost with the name of its frame, checked."""
        robot = start.state.robot
        frame = self._frame(robot)
        with within("frame"):
            dofs, _ = _chain(robot, frame)
        selected = self._selected()
        if len(selected) > len(dofs):
            raise FieldError(
                f"{len(selected)} rows of frame {frame!r}, which only {len(dofs)} "
                "degrees of freedom move; these rows are singular everywhere"
            )
        return self if self.frame is not None else replace(self, frame=frame)

    def _frame(self, robot: Robot) -> str:
        return robot.end_effector if self.frame is None else self.frame

    def _selected(self) -> Indices:
        """Return the indices of the rows that count, shape (k,)."""
        kept = [i for i, axis in enumerate("xyz") if axis in self.axes]
        if self.rows != "position":
            kept = (kept if self.rows == "pose" else []) + [3, 4, 5]
        return np.array(kept, dtype=np.int64)

    def terms(self, J: Array, J_dot: Array) -> JacobianTerms:
        """Return φ, ∂φ/∂J and its rate for the k selected rows.

        Args:
            J: The selected rows, orientation rows scaled, shape (k, nv).
            J_dot: Their time derivative, shape (k, nv).
        """
        raise TypeError(f"{type(self).__name__} has neither terms nor terms_kernel")

    def terms_kernel(self, nv: int) -> KernelCall:
        """Return a kernel and its first arguments, instead of `terms`.

        The further arguments are J, J', ∂φ/∂J and its rate, shape (k, nv) each, and a
        scratch array of shape (8, k, nv). It writes ∂φ/∂J and its rate, and returns φ.
        """

        def write(
            J: Array, J_dot: Array, slope: Array, slope_rate: Array, scratch: Array
        ) -> float:
            value, slope[:], slope_rate[:] = self.terms(J, J_dot)
            return value

        return write, ()

    def value(self, state: RobotState) -> float:
        """Return f, which the calls before the last one give."""

        def make() -> tuple[None, KernelCalls]:
            return None, self.derivatives(state, *np.zeros((2, state.robot.nv)))[:-1]

        return float(state.prepared(self, "value", make)[1]())

    def derivatives(
        self, state: RobotState, gradient: Array, rate: Array
    ) -> KernelCalls:
        """Return the calls that write ∇f and (∇f)'; the last but one gives f."""
        frame, nv = state.frame(self._frame(state.robot)), state.robot.nv
        dofs, first = _chain(state.robot, self._frame(state.robot))
        selected = self._selected()
        length = self.length if self.rows == "pose" else 1.0
        rows = selected, np.where(selected < 3, 1.0, length)
        J, J_dot, slope, slope_rate = np.zeros((4, len(selected), nv))
        motion = frame.jacobian, frame.jacobian_dot
        function, parameters = self.terms_kernel(nv)
        scratch = np.zeros((8, len(selected), nv))
        work = np.zeros((2, 6, nv)), dofs, first, np.zeros((4, len(dofs) + 1, 3))
        slopes = slope, slope_rate
        return [
            (_select, (frame, *rows, J, J_dot)),
            (function, (*parameters, J, J_dot, *slopes, scratch)),
            (_raise_slope, (*motion, *slopes, *rows, *work, gradient, rate)),
        ]


@kernel
def _select(
    motion: FrameMotion, selected: Indices, scale: Array, J: Array, J_dot: Array
) -> None:
    """Write the selected rows of J and J', scaled."""
    J_frame, J_frame_dot = motion.jacobian, motion.jacobian_dot
    for k in range(J.shape[0]):
        for j in range(J.shape[1]):
            J[k, j] = scale[k] * J_frame[selected[k], j]
            J_dot[k, j] = scale[k] * J_frame_dot[selected[k], j]


@kernel
def _raise_slope(
    J: Array,
    J_dot: Array,
    slope: Array,
    slope_rate: Array,
    selected: Indices,
    scale: Array,
    B: Array,
    dofs: Indices,
    first: Indices,
    sums: Array,
    gradient: Array,
    rate: Array,
) -> None:
    """Write ∇f and (∇f)' from ∂φ/∂J of the selected, scaled rows."""
    for k in range(slope.shape[0]):
        for j in range(slope.shape[1]):
            B[0, selected[k], j] = scale[k] * slope[k, j]
            B[1, selected[k], j] = scale[k] * slope_rate[k, j]
    for i in range(gradient.shape[0]):
        gradient[i] = rate[i] = 0.0
    chain_gradient(J, J_dot, B[0], B[1], dofs, first, sums, gradient, rate)


@kernel
def chain_gradient(
    J: Array,
    J_dot: Array,
    B: Array,
    B_dot: Array,
    dofs: Indices,
    first: Indices,
    sums: Array,
    gradient: Array,
    rate: Array,
) -> None:
    """Write the gradient of φ(J) and its rate from B = ∂φ/∂J, as the module describes.

    ``dofs`` (k,) are those that move the frame, from the root on, and the entries that
    are written; ``first`` (k,) is where in ``dofs`` the joint of each begins. J, B: (6,
    nv).
    """
    k = dofs.shape[0]
    carried, carried_dot, before, before_dot = sums[0], sums[1], sums[2], sums[3]
    for a in range(3):
        carried[k, a] = carried_dot[k, a] = 0.0
        before[0, a] = before_dot[0, a] = 0.0
    for p in range(k):
        j = dofs[p]
        for a in range(3):
            y, z = (a + 1) % 3, (a + 2) % 3
            before[p + 1, a] = (
                before[p, a] + B[y, j] * J[3 + z, j] - B[z, j] * J[3 + y, j]
            )
            before_dot[p + 1, a] = (
                before_dot[p, a]
                + B_dot[y, j] * J[3 + z, j]
                - B_dot[z, j] * J[3 + y, j]
                + B[y, j] * J_dot[3 + z, j]
                - B[z, j] * J_dot[3 + y, j]
            )
    for r in range(k):
        p = k - 1 - r
        j = dofs[p]
        for a in range(3):
            y, z = (a + 1) % 3, (a + 2) % 3
            total = total_dot = 0.0
            for block in (0, 3):  # l × b, then w × c
                total += J[block + y, j] * B[block + z, j]
                total -= J[block + z, j] * B[block + y, j]
                total_dot += J_dot[block + y, j] * B[block + z, j]
                total_dot -= J_dot[block + z, j] * B[block + y, j]
                total_dot += J[block + y, j] * B_dot[block + z, j]
                total_dot -= J[block + z, j] * B_dot[block + y, j]
            carried[p, a] = carried[p + 1, a] + total
            carried_dot[p, a] = carried_dot[p + 1, a] + total_dot
    for p in range(k):
        i, f = dofs[p], first[p]
        gradient[i] = rate[i] = 0.0
        for a in range(3):
            gradient[i] += J[3 + a, i] * carried[f, a] + J[a, i] * before[f, a]
            rate[i] += J_dot[3 + a, i] * carried[f, a] + J[3 + a, i] * carried_dot[f, a]
            rate[i] += J_dot[a, i] * before[f, a] + J[a, i] * before_dot[f, a]


def _chain(robot: Robot, frame: str) -> tuple[Indices, Indices]:
    """Return ``dofs`` and ``first`` of `chain_gradient`, shape (k,) each."""
    model = robot.model
    dofs: list[int] = []
    first: list[int] = []
    for joint_id in list(
        model.supports[model.frames[robot.frame_id(frame)].parentJoint]
    ):
        joint = model.joints[joint_id]
        if joint_id == 0:
            continue
        if joint.nvExtended != joint.nv:
            raise FieldError(
                f"frame {frame!r} is moved by {model.names[joint_id]!r}, which mimics "
                "another joint; choose a frame before it, or load with mimic: false"
            )
        first.extend([len(dofs)] * joint.nv)
        dofs.extend(range(joint.idx_v, joint.idx_v + joint.nv))
    return np.array(dofs, dtype=np.int64), np.array(first, dtype=np.int64)
