"""TSID with its own API: a pose (or masked pose) task, a posture task, effort bounds.

As in its exercise ``ex_1`` (UR5): one weighted level with eiquadprog-fast. With
``strict``, the pose is an equality constraint, level 0, and only the posture is in the
cost: TSID's form of a null space.
"""

from collections.abc import Callable

import numpy as np
import tsid

from hsp_control.common.arrays import Array
from shared.cases import FRAME, Case


def make(
    case: Case,
    *,
    posture_weight: float = 1e-3,
    strict: bool = False,
    exact_rate: bool = False,
) -> Callable[[float, Array, Array], Array]:
    """Return the controller; with ``exact_rate`` it uses this package's g'."""
    model, nv = case.robot.model, case.robot.nv
    robot = tsid.RobotWrapper(model, tsid.FIXED_BASE_SYSTEM, False)
    problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
    problem.computeProblemData(0.0, case.q0, np.zeros(nv))

    hand = tsid.TaskSE3Equality("hand", robot, FRAME)
    hand.useLocalFrame(False)
    hand.setKp(case.kp * np.ones(6))
    hand.setKd(case.kv * np.ones(6))
    if case.rows == 3:
        hand.setMask(np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    problem.addMotionTask(hand, 1.0, 0 if strict else 1, 0.0)

    posture = tsid.TaskJointPosture("posture", robot)
    posture.setKp(case.posture_kp * np.ones(nv))
    posture.setKd(case.posture_kv * np.ones(nv))
    problem.addMotionTask(posture, posture_weight, 1, 0.0)

    bounds = tsid.TaskActuationBounds("effort", robot)
    effort = np.array(model.upperEffortLimit)
    bounds.setBounds(-effort, effort)
    problem.addActuationTask(bounds, 1.0, 0, 0.0)

    solver = tsid.SolverHQuadProgFast("qp")
    solver.resize(problem.nVar, problem.nEq, problem.nIn)
    hand_sample = tsid.TrajectorySample(12, 6)
    posture_sample = tsid.TrajectorySample(nv)
    posture_sample.value(case.q0)
    posture_sample.derivative(np.zeros(nv))
    place, rate, rate_dot = np.zeros(12), np.zeros(6), np.zeros(6)
    kept = (robot, hand, posture, bounds)  # TSID does not own its tasks

    def compute(t: float, q: Array, v: Array) -> Array:
        x, R = case.desired(t)
        place[:3], place[3:] = x.position, R.rotation.T.ravel()  # column-major
        rate[:3], rate[3:] = x.velocity, R.angular_velocity
        rate_dot[:3], rate_dot[3:] = x.acceleration, R.angular_acceleration
        hand_sample.value(place)
        hand_sample.derivative(rate)
        hand_sample.second_derivative(rate_dot)
        hand.setReference(hand_sample)
        if exact_rate:
            a_0 = case.exact_acceleration(t, q, v)
            own = case.posture_kp * (case.q0 - q) - case.posture_kv * v
            posture_sample.second_derivative(a_0 - own)
        elif case.obstacle:
            push = case.null_space_gain * case.repulsion(t, q)
            posture_sample.second_derivative(push)
        posture.setReference(posture_sample)
        data = problem.computeProblemData(t, q, v)
        solution = solver.solve(data)
        if solution.status != 0:
            raise RuntimeError(f"TSID found no solution at t = {t:.4f} s")
        return problem.getActuatorForces(solution)

    compute.kept = kept  # type: ignore[attr-defined]
    compute.parts = (problem, solver, [hand, posture])  # type: ignore[attr-defined]
    return compute
