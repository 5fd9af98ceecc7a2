"""pink, its velocity integrated and differentiated, then computed torque (RNEA).

Costs and damping are those of pink's example ``arm_panda.py``: hand 1 and 1, with a
Levenberg-Marquardt damping of 1, posture 1e-3, damping 1e-3, DAQP; its own limits of
positions and velocities. Its plan is followed in joint space with Kp = 100 1/s² and
Kv = 20 1/s, which are not pink's.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import pink
import pinocchio as pin
from pink.tasks import DampingTask, FrameTask, PostureTask

if TYPE_CHECKING:
    from shared.edge_loop import Case, Compute

KP, KV = 100.0, 20.0  # [1/s², 1/s]


def make(case: "Case", model: Any) -> "Compute":
    """Return the controller."""
    from shared.edge_loop import PERIOD

    data = model.createData()
    plan = pink.Configuration(model, model.createData(), case.q0)
    hand = FrameTask(
        case.frame,
        position_cost=1.0,
        orientation_cost=1.0 if case.rows == 6 else 0.0,
        lm_damping=1.0,
    )
    posture, damping = PostureTask(cost=1e-3), DampingTask(cost=1e-3)
    posture.set_target(case.q0)
    velocity = np.zeros(model.nv)

    def compute(t: float, q: Any, v: Any) -> Any:
        x = case.desired(t + PERIOD).position
        hand.set_target(pin.SE3(case.rotation, x))
        tasks = [hand, posture, damping]
        following = pink.solve_ik(plan, tasks, PERIOD, solver="daqp")
        a = (following - velocity) / PERIOD
        # The plan's velocity is constant in a period: at t it is the mean of two.
        e, e_dot = plan.q - q, 0.5 * (velocity + following) - v
        tau = pin.rnea(model, data, q, v, a + KP * e + KV * e_dot)
        velocity[:] = following
        plan.integrate_inplace(following, PERIOD)
        return tau

    return compute
