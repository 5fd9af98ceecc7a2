"""TSID: a hand task and a posture task, with bounds of efforts and speeds.

Tasks, bounds, weights and gains are those of its exercise ``tsid_manipulator.py`` with
``ur5_reaching_conf.py``, with the whole efforts and speeds instead of 40 % of them.
Where its QP has no solution, the effort stays as it was.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import tsid

if TYPE_CHECKING:
    from shared.edge_loop import Case, Compute

HAND, POSTURE = 100.0, 1.0  # Kp, critically damped [1/s²]
HAND_WEIGHT, POSTURE_WEIGHT = 1.0, 1e-3


def make(case: "Case", model: Any) -> "Compute":
    """Return the controller."""
    from shared.edge_loop import PERIOD

    nv = model.nv
    peer = tsid.RobotWrapper(model, tsid.FIXED_BASE_SYSTEM, False)
    problem = tsid.InverseDynamicsFormulationAccForce("tsid", peer, False)
    problem.computeProblemData(0.0, case.q0, np.zeros(nv))

    hand = tsid.TaskSE3Equality("hand", peer, case.frame)
    hand.useLocalFrame(False)
    hand.setKp(HAND * np.ones(6))
    hand.setKd(2.0 * np.sqrt(HAND) * np.ones(6))
    hand.setMask(np.array([1.0] * case.rows + [0.0] * (6 - case.rows)))
    problem.addMotionTask(hand, HAND_WEIGHT, 1, 0.0)
    posture = tsid.TaskJointPosture("posture", peer)
    posture.setKp(POSTURE * np.ones(nv))
    posture.setKd(2.0 * np.sqrt(POSTURE) * np.ones(nv))
    problem.addMotionTask(posture, POSTURE_WEIGHT, 1, 0.0)

    efforts = tsid.TaskActuationBounds("effort", peer)
    efforts.setBounds(-model.effortLimit, model.effortLimit)
    problem.addActuationTask(efforts, 1.0, 0, 0.0)
    joints = tsid.TaskJointBounds("joints", peer, PERIOD)
    joints.setVelocityBounds(-model.velocityLimit, model.velocityLimit)
    problem.addMotionTask(joints, 1.0, 0, 0.0)

    solver = tsid.SolverHQuadProgFast("qp")
    solver.resize(problem.nVar, problem.nEq, problem.nIn)
    kept = tsid.TrajectorySample(nv)
    kept.value(case.q0)
    kept.derivative(np.zeros(nv))
    kept.second_derivative(np.zeros(nv))
    posture.setReference(kept)
    sample = tsid.TrajectorySample(12, 6)
    place, rate, rate_dot = np.zeros(12), np.zeros(6), np.zeros(6)
    place[3:] = case.rotation.T.ravel()  # column-major
    tau, unsolved = np.zeros(nv), [0]

    def compute(t: float, q: Any, v: Any) -> Any:
        place[:3], rate[:3], rate_dot[:3] = case.desired(t)
        sample.value(place)
        sample.derivative(rate)
        sample.second_derivative(rate_dot)
        hand.setReference(sample)
        solution = solver.solve(problem.computeProblemData(t, q, v))
        if solution.status == 0:
            tau[:] = problem.getActuatorForces(solution)
        else:
            unsolved[0] += 1
        return tau.copy()

    compute.kept = (peer, hand, posture, efforts, joints)  # type: ignore[attr-defined]
    compute.unsolved = unsolved  # type: ignore[attr-defined]
    return compute
