"""Isotropy: keep the frame equally able to move every way."""

import numpy as np

from hsp_control.arrays import Array
from hsp_control.fields.jacobian_cost import JacobianCost, JacobianTerms, Rows
from hsp_control.fields.manipulability import FLOOR
from hsp_control.robot import Robot


class InverseCondition(JacobianCost):
    """f = -k²/(tr G · tr G⁻¹), G = J Jᵀ of k rows: minus the inverse condition number.

    In the Frobenius norm, squared: 1 where all singular values agree, 0 at a
    singularity, and smooth everywhere, which σ_min/σ_max is not where two meet.
    """

    def __init__(
        self,
        robot: Robot,
        frame: str,
        *,
        rows: Rows = "position",
        axes: str = "xyz",
        length: float = 1.0,
        name: str = "inverse_condition",
    ) -> None:
        """Set the cost; see `JacobianCost` for the arguments."""
        super().__init__(robot, frame, rows=rows, axes=axes, length=length, name=name)

    def terms(self, J: Array, J_dot: Array) -> JacobianTerms:
        """Return f, its slope 2φ(J/tr G - G⁻²J/tr G⁻¹) with φ = -f, and its rate."""
        k = len(J)
        G = J @ J.T + FLOOR**2 * np.eye(k)
        G_dot = J_dot @ J.T
        G_dot += G_dot.T
        G_inv = np.linalg.inv(G)
        G_inv_dot = -G_inv @ G_dot @ G_inv
        square = G_inv @ G_inv
        square_dot = G_inv_dot @ G_inv + G_inv @ G_inv_dot
        size, size_dot = float(np.trace(G)), float(np.trace(G_dot))
        stretch, stretch_dot = float(np.trace(G_inv)), float(np.trace(G_inv_dot))
        phi = k**2 / (size * stretch)
        phi_dot = -phi * (size_dot / size + stretch_dot / stretch)
        inner = J / size - square @ J / stretch
        inner_dot = (
            J_dot / size
            - J * size_dot / size**2
            - (square_dot @ J + square @ J_dot) / stretch
            + square @ J * stretch_dot / stretch**2
        )
        return JacobianTerms(
            -phi, 2.0 * phi * inner, 2.0 * (phi_dot * inner + phi * inner_dot)
        )
