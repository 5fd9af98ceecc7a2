"""Postures that motors can hold, as bounds on the acceleration."""

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import LimitError
from hsp_control.robot import Robot, RobotState

_STEP = 3e-4
"""Of the differences along the flow [s]: rounding and truncation meet near 1e-7."""
_AHEAD, _WORTH = 0.5, 0.5
"""An effort is worth a row while gravity takes more than this part of what it may, now
or so soon [s] at the present rate."""


class StaticEffort:
    """Gravity takes at most a part of every motor's effort.

    A limit on efforts alone bounds an acceleration; whether the motor can hold the arm
    there it does not ask, and an arm that cannot be held falls, however it accelerates.
    What gravity asks of a motor, G_i(q), is a function of the posture, and so this is a
    limit on postures. With h = share - |G_i|/effort_i, the rows ask for
    h'' + 2α h' + α² h ≥ 0 (an exponential control barrier function), with
    G_i'' = ∇G_i·a + the drift of G_i' at constant velocity.

    Attributes:
        effort: Greatest effort, shape (nv,) [N·m or N].
        share: The part of it that gravity may take.
    """

    def __init__(self, robot: Robot, effort: Array, share: float) -> None:
        """Set the efforts (nv,) and the part of them that gravity may take.

        Raises:
            LimitError: If the part is not between 0 and 1, or joints mimic others.
        """
        if not 0.0 < share <= 1.0:
            raise LimitError(
                f"static_effort is {share}; must be a part of the effort, more than 0 "
                "and at most 1"
            )
        if robot.mimics:
            raise LimitError(
                f"static_effort does not know joints that mimic others, as those of "
                f"{robot.name} do"
            )
        self.effort, self.share = effort, float(share)
        self._model, self._data = robot.model, robot.model.createData()
        self._motors = np.isfinite(effort)
        self._motors[list(robot.unactuated)] = False

    def rows(
        self, state: RobotState, bandwidth: float, carrying: Indices
    ) -> tuple[Array, Array]:
        """Return (A, b) with A a ≥ b, shapes (k, nv) and (k,), of the motors at hand.

        Args:
            state: The robot's state.
            bandwidth: α [1/s].
            carrying: Freedoms that are left out: between the root and a contact, where
                the efforts depend on the contacts' forces.
        """
        slope = pin.computeGeneralizedGravityDerivatives(
            self._model, self._data, state.q
        )
        G, ahead, behind = (self._gravity(state, step) for step in (0.0, _STEP, -_STEP))
        rate = slope @ state.v
        sign = np.where(G < 0.0, -1.0, 1.0)
        used, growth = sign * G / self.effort, sign * rate / self.effort
        soon = used + _AHEAD * np.maximum(growth, 0.0)
        near = self._motors & (soon > _WORTH * self.share)
        near[carrying] = False
        i = np.flatnonzero(near)
        side = (sign / self.effort)[i]
        drift = side * (ahead - 2.0 * G + behind)[i] / _STEP**2
        b = drift + 2.0 * bandwidth * growth[i] - bandwidth**2 * (self.share - used[i])
        return -side[:, None] * slope[i], b

    def _gravity(self, state: RobotState, dt: float) -> Array:
        """Return G(q ⊕ v dt), shape (nv,)."""
        q = pin.integrate(self._model, state.q, dt * state.v) if dt else state.q
        return np.array(pin.computeGeneralizedGravity(self._model, self._data, q))
