"""The abstract cost of a frame's Jacobian, with exact gradient and rate.

The gradient of a function of J follows from the columns of J, without the kinematic
Hessian: see engine/fields/jacobian_cost.hpp.
"""

from dataclasses import KW_ONLY, replace
from typing import Literal, NamedTuple, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import FieldError
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Axes
from hsp_control.engine.plans import PartCall, PartCalls
from hsp_control.geometry.scene import Start
from hsp_control.null_space.fields.cost import Cost
from hsp_control.robot import Robot, RobotState

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
    gradient and gradient rate follow exactly. If one call computes the terms, it
    implements `terms_call` instead. The rows are those of the position, unless the
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
        """The rows of the Jacobian that are used."""
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
        """Return the indices of the selected rows, shape (k,)."""
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
        raise TypeError(f"{type(self).__name__} has neither terms nor terms_call")

    def terms_call(self, nv: int) -> PartCall:
        """Return a kind of call with its arguments, instead of `terms`.

        The others are ``J``, ``J_dot``, ``slope`` and ``slope_rate``, shapes (k, nv).
        It writes the last two, ∂φ/∂J and its rate, and returns φ.
        """

        def write(J: Array, J_dot: Array, slope: Array, slope_rate: Array) -> float:
            value, slope[:], slope_rate[:] = self.terms(J, J_dot)
            return value

        return PartCall(write)

    def value(self, state: RobotState) -> float:
        """Return f, the result of the calls before the last one."""

        def make() -> tuple[None, PartCalls]:
            return None, self.derivatives(state, *np.zeros((2, state.robot.nv)))[:-1]

        return float(state.prepared(self, "value", make)[1]())

    def derivatives(self, state: RobotState, gradient: Array, rate: Array) -> PartCalls:
        """Return the calls that write ∇f and (∇f)'; the last but one returns f."""
        frame, nv = state.frame(self._frame(state.robot)), state.robot.nv
        dofs, first = _chain(state.robot, self._frame(state.robot))
        selected = self._selected()
        length = self.length if self.rows == "pose" else 1.0
        scale = np.where(selected < 3, 1.0, length)
        rows = {"selected": selected, "scale": scale}
        J, J_dot, slope, slope_rate = np.zeros((4, len(selected), nv))
        slopes = {"slope": slope, "slope_rate": slope_rate}
        return [
            PartCall(engine.SelectRows, frame=frame, **rows, J=J, J_dot=J_dot),
            self.terms_call(nv).given(J=J, J_dot=J_dot, **slopes),
            PartCall(
                engine.ChainGradient,
                J=frame.jacobian,
                J_dot=frame.jacobian_dot,
                **slopes,
                **rows,
                dofs=dofs,
                first=first,
                gradient=gradient,
                rate=rate,
            ),
        ]


def _chain(robot: Robot, frame: str) -> tuple[Indices, Indices]:
    """Return the degrees of freedom that move a frame, from the root on, shape (k,).

    And, of the same shape, the index among them at which its joint begins.
    """
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
