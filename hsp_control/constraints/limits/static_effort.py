"""Limits on the effort against gravity, as bounds on the acceleration."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.robot import RobotState

_STEP = 3e-4
"""Step of the differences along the motion [s]: rounding and truncation errors are
equal near 1e-7."""
_AHEAD, _NEAR = 0.5, 0.5
"""A motor gets a row if gravity takes more than the part _NEAR of what it may take, now
or within the time _AHEAD [s] at the present rate."""


@dataclass(frozen=True, eq=False)
class StaticEffort:
    """Gravity takes at most a part of every motor's effort.

    An effort limit alone bounds the acceleration, but lets the arm reach postures in
    which the motors cannot hold it: there it falls. The gravity effort of a motor,
    G_i(q), depends on the posture only, so this is a limit on postures. With
    h = share - |G_i|/effort_i, the rows require h'' + 2α h' + α² h ≥ 0 (an exponential
    control barrier function), with G_i'' = ∇G_i·a + the drift of G_i' at constant
    velocity.
    Robots with mimic joints are not supported.

    Attributes:
        effort: Maximum effort, shape (nv,) [N·m or N]; inf where unlimited.
        share: The part of it that gravity may take, in (0, 1].
    """

    effort: Array
    share: float

    def rows(
        self, state: RobotState, bandwidth: float, excluded: Indices
    ) -> tuple[Array, Array]:
        """Return the rows A a ≥ b of the motors near their limit.

        Args:
            state: The robot's state.
            bandwidth: α [1/s].
            excluded: Degrees of freedom that are left out: those between the root and a
                contact, whose efforts depend on the contact forces.

        Returns:
            A, shape (k, nv), and b, shape (k,).
        """
        robot, model = state.robot, state.robot.model
        data = state.made(self, "data", model.createData)
        slope = pin.computeGeneralizedGravityDerivatives(model, data, state.q)

        def gravity(dt: float) -> Array:
            """Return G(q ⊕ v dt), shape (nv,)."""
            q = pin.integrate(model, state.q, dt * state.v) if dt else state.q
            return np.array(pin.computeGeneralizedGravity(model, data, q))

        G, ahead, behind = gravity(0.0), gravity(_STEP), gravity(-_STEP)
        rate = slope @ state.v
        sign = np.where(G < 0.0, -1.0, 1.0)
        used, growth = sign * G / self.effort, sign * rate / self.effort
        soon = used + _AHEAD * np.maximum(growth, 0.0)
        near = np.isfinite(self.effort) & (soon > _NEAR * self.share)
        near[[*robot.unactuated, *excluded]] = False
        i = np.flatnonzero(near)
        side = (sign / self.effort)[i]
        drift = side * (ahead - 2.0 * G + behind)[i] / _STEP**2
        b = drift + 2.0 * bandwidth * growth[i] - bandwidth**2 * (self.share - used[i])
        return -side[:, None] * slope[i], b
