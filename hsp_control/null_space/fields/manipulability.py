"""Measures of the Jacobian: manipulability and condition."""

from dataclasses import KW_ONLY
from typing import Literal, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.errors import FieldError
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Matrix, Positive
from hsp_control.engine.plans import PartCall
from hsp_control.geometry.scene import Start
from hsp_control.null_space.fields.jacobian_cost import JacobianCost, Rows

FLOOR = 1e-6
"""Its square is added to the squared singular values, so that all slopes are finite."""


class Manipulability(JacobianCost, type="manipulability"):
    """f = -det(G), -√det(G) or -½ log det(G), with G = J W⁻¹ Jᵀ of a frame's rows.

    Yoshikawa (1985) maximises √det(J Jᵀ). Towards a singularity the slope of the
    logarithm grows, and the slope of the determinant vanishes. W is a constant metric.
    """

    _: KW_ONLY
    form: Literal["determinant", "root", "log"] = "root"
    """Function of det(G) [-]: the determinant itself, its square root, or its
    logarithm."""
    rows: Rows = "position"
    """Rows of the Jacobian [-]."""
    length: Positive = 1.0
    """Length that is equivalent to one radian [m], for rows of metres and radians."""
    metric: Matrix | None = None
    """W, symmetric and positive definite, shape (nv, nv) [-]; the identity by
    default."""

    def __post_init__(self) -> None:
        """Check the metric."""
        if self.metric is None:
            return
        W = np.asarray(self.metric)
        if W.shape[0] != W.shape[1] or not np.allclose(W, W.T):
            raise FieldError(f"metric has shape {W.shape}; needs (nv, nv), symmetric")
        if np.linalg.eigvalsh(W)[0] <= 0.0:
            raise FieldError("metric is not positive definite")

    def placed(self, start: Start) -> Self:
        """Return the cost with the name of its frame; see `JacobianCost.placed`."""
        nv = start.state.robot.nv
        if self.metric is not None and len(np.asarray(self.metric)) != nv:
            with within("metric"):
                shape = np.shape(self.metric)
                raise FieldError(f"metric has shape {shape}; needs ({nv}, {nv})")
        return super().placed(start)

    def terms_call(self, nv: int) -> PartCall:
        """Return the call; see `JacobianCost.terms_call`."""
        weighted = self.metric is not None
        W_inv = np.linalg.inv(np.array(self.metric)) if weighted else np.eye(nv)
        # Larger if the entries of W are small: it must exceed the rounding error of G.
        floor = FLOOR**2 * max(1.0, 0.1 * float(np.trace(W_inv)) / nv)
        power = {"log": 0, "root": 1, "determinant": 2}[self.form]
        return PartCall(
            engine.Manipulability,
            inverse_metric=np.ascontiguousarray(W_inv),
            weighted=weighted,
            floor=floor,
            power=power,
        )


class InverseCondition(JacobianCost, type="inverse_condition"):
    """f = -k²/(tr G · tr G⁻¹), G = J Jᵀ of k rows.

    -f is the square of the inverse condition number in the Frobenius norm: 1 where all
    singular values are equal, 0 at a singularity. It is smooth everywhere, whereas
    σ_min/σ_max is not smooth where two singular values are equal.
    """

    _: KW_ONLY
    rows: Rows = "position"
    """Rows of the Jacobian [-]."""
    length: Positive = 1.0
    """Length that is equivalent to one radian [m], for rows of metres and radians."""

    def terms_call(self, nv: int) -> PartCall:
        """Return the call; see `JacobianCost.terms_call`."""
        return PartCall(engine.InverseCondition, floor=FLOOR**2)
