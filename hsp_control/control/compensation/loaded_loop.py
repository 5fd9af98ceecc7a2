"""The sampled loop of a whole robot whose bodies are not those of the model.

A robot with the mass matrix M̃ performs M̃⁻¹ M u where the law asks for the
acceleration u. That couples the tasks and the null space, which the law decouples for
its model. In coordinates y = T δq with T = Vᵀ Lᵀ, orthonormal in the metric W = L Lᵀ,
and J L⁻ᵀ = U [S 0] Vᵀ, all are one linear loop:

    y'' = T M̃⁻¹ M T⁻¹ u,
    u₁ = -S⁻¹ Uᵀ (Kp e + Kv e' + Ki ∫e),     e = U S y₁,
    u₂ = -(K_N + A₂₂) y₂' - K_N A₂ y - A₂₁ y₁',

with the field's slope A = -T (∂g/∂q) T⁻¹, without saddles. It is exact about a state
at rest of a robot without weight. A payload's weight adds a slow motion in the null
space.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.compensation.compensation import Compensation
from hsp_control.control.compensation.linear_loop import LinearLoop
from hsp_control.control.compensation.null_space_rates import (
    field_slope,
    without_saddles,
)
from hsp_control.control.controller import Controller
from hsp_control.robot import Robot, RobotState


class LoadedLoop(NamedTuple):
    """The loop of a whole robot, for any part of its difference from the model."""

    loop: LinearLoop  # loop of a robot that equals its model
    # M̃ - M in the loop's coordinates, relative to M: T M⁻¹ (M̃ - M) T⁻¹
    difference: Array
    # how many times as heavy as its model the robot is at the tasks, in the heaviest
    # direction: 1/β with the smallest eigenvalue β of J M̃⁻¹ M J#
    heavier: float

    def largest_part(self, wanted: float) -> float:
        """Return this part, or less: what is lighter must keep a tenth of its mass."""
        lightest = float(np.linalg.eigvals(self.difference).real.min())
        return wanted if lightest >= 0.0 else min(wanted, -0.9 / lightest)

    def with_part(self, s: float) -> LinearLoop:
        """Return the loop of a robot with s times the difference."""
        one = np.eye(len(self.difference))
        share: Array = np.asarray(np.linalg.inv(one + s * self.difference), float)
        return replace(self.loop, share=share)


def loaded_loop(
    controller: Controller,
    state: RobotState,
    plant: Robot,
    period: float,
    effort_delay: int,
    sensor_delay: int,
    compensation: Compensation,
) -> LoadedLoop | None:
    """Return the loop of the whole robot at a state."""
    robot = controller.robot
    M = state.mass_matrix
    others = plant.state(state.t, state.q, state.v).mass_matrix - M
    if robot.unactuated or controller.contacts or np.abs(others).max() < 1e-9:
        return None
    J = controller.stack(state).jacobian
    problem = controller.active_stack.resolution
    U, S, Vt = np.linalg.svd(np.linalg.solve(problem.problem.metric.L, J.T).T)
    m, n = J.shape
    if m > n or S.min(initial=np.inf) <= problem.threshold:
        return None
    if m < n and not controller.field.controls:
        return None
    T = Vt @ problem.problem.metric.L.T
    back = np.linalg.inv(T)
    into, out_of = (U / S).T, U * S  # S⁻¹ Uᵀ and U S
    rows = controller.active_stack.task_rows
    Kp, Kv, Ki = (np.zeros((m, m)) for _ in range(3))
    action = compensation.integral_action
    integral = {} if action is None else action.gains(controller.tasks)
    for task in controller.tasks:
        if (at := rows.get(task.name)) is None:
            continue
        own_p, own_v, *_ = controller.linear_feedback(task.name, state)[-np.inf]
        if task.order == 1:  # e' + K e = 0 with K in the place of Kp
            own_p, own_v = np.zeros_like(own_p), own_p
        Kp[at, at], Kv[at, at] = own_p, own_v
        if task.name in integral:
            Ki[at, at] = integral[task.name]
    kp, kv, ki = (np.zeros((n, n)) for _ in range(3))
    for gain, own in ((kp, Kp), (kv, Kv), (ki, Ki)):
        gain[:m, :m] = into @ own @ out_of
    if m < n:
        A = -(T @ field_slope(controller, state) @ back)[m:]
        A[:, m:] = without_saddles(A[:, m:])
        K = (T @ controller.null_space_gain @ back)[m:, m:]
        kp[m:], kv[m:] = K @ A, A
        kv[m:, m:] += K
    difference = T @ np.linalg.solve(M, others) @ back
    performed = np.linalg.inv(np.eye(n) + difference)
    beta = np.linalg.eigvals(out_of @ performed[:m, :m] @ into).real.min()
    loop = LinearLoop(kp, kv, ki, period, effort_delay, sensor_delay, compensation)
    return LoadedLoop(loop, difference, float(1.0 / beta))
