"""pink: differential inverse kinematics, integrated, then computed torque (RNEA).

pink's README settings: frame cost 1 (position and orientation), posture cost 1e-3, its
default damping 1e-12 and its default configuration and velocity limits, dead-beat frame
gain. The posture's gain per step is α dt, so that its null space has the same reference
flow v = P g. The effort M (a + Kp e + Kv e') + N tracks its plan in joint space.
"""

from collections.abc import Callable

import numpy as np
import pink
import pinocchio as pin
from pink.tasks import FrameTask, PostureTask

from hsp_control.common.arrays import Array
from shared.cases import FRAME, Case


def make(
    case: Case,
    *,
    solver: str = "quadprog",
    posture_cost: float = 1e-3,
    strict: bool = False,
) -> Callable[[float, Array, Array], Array]:
    """Return the controller; with ``strict`` the pose is pink's equality constraint."""
    model, dt = case.robot.model, case.period
    plan = pink.Configuration(model, model.createData(), case.q0)
    data = model.createData()
    orientation_cost = 1.0 if case.rows == 6 else 0.0
    hand = FrameTask(FRAME, position_cost=1.0, orientation_cost=orientation_cost)
    posture = PostureTask(cost=posture_cost, gain=case.posture_rate * dt)
    tasks = [posture] if strict else [hand, posture]
    constraints = [hand] if strict else None
    target = pin.SE3.Identity()
    velocity = np.zeros(model.nv)

    def compute(t: float, q: Array, v: Array) -> Array:
        desired = case.desired(t + dt)
        target.translation = desired.position.position
        target.rotation = desired.orientation.rotation
        hand.set_target(target)
        shift = case.repulsion(t, plan.q) / case.posture_rate if case.obstacle else 0.0
        posture.set_target(case.q0 + shift)
        next_velocity = pink.solve_ik(
            plan, tasks, dt, solver=solver, constraints=constraints
        )
        a = (next_velocity - velocity) / dt
        # The plan's velocity is constant in an interval: at t it is the mean of two.
        e, e_dot = plan.q - q, 0.5 * (velocity + next_velocity) - v
        tau = pin.rnea(model, data, q, v, a + case.kp * e + case.kv * e_dot)
        velocity[:] = next_velocity
        plan.integrate_inplace(next_velocity, dt)
        return tau

    return compute
