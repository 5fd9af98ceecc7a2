"""TSID with its own API: a pose, a posture and effort bounds in one weighted QP.

Gains and weights are those of its exercise ``ur5_conf.py``: hand Kp = 5 1/s² and weight
1, posture 1 1/s² and 1e-3, both critically damped.
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import tsid

if TYPE_CHECKING:
    from shared.edge_loop import Case, Compute

KP, POSTURE_KP, POSTURE_WEIGHT = 5.0, 1.0, 1e-3  # [1/s², 1/s², -]


def make(case: "Case", model: Any) -> "Compute":
    """Return the controller."""
    nv = model.nv
    robot = tsid.RobotWrapper(model, tsid.FIXED_BASE_SYSTEM, False)
    problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
    problem.computeProblemData(0.0, case.q0, np.zeros(nv))
    hand = tsid.TaskSE3Equality("hand", robot, case.frame)
    hand.useLocalFrame(False)
    hand.setKp(KP * np.ones(6))
    hand.setKd(2.0 * np.sqrt(KP) * np.ones(6))
    hand.setMask(np.array([1.0] * case.rows + [0.0] * (6 - case.rows)))
    problem.addMotionTask(hand, 1.0, 1, 0.0)
    posture = tsid.TaskJointPosture("posture", robot)
    posture.setKp(POSTURE_KP * np.ones(nv))
    posture.setKd(2.0 * np.sqrt(POSTURE_KP) * np.ones(nv))
    problem.addMotionTask(posture, POSTURE_WEIGHT, 1, 0.0)
    bounds = tsid.TaskActuationBounds("effort", robot)
    effort = np.array(model.effortLimit)
    bounds.setBounds(-effort, effort)
    problem.addActuationTask(bounds, 1.0, 0, 0.0)
    solver = tsid.SolverHQuadProgFast("qp")
    solver.resize(problem.nVar, problem.nEq, problem.nIn)
    target, kept = tsid.TrajectorySample(12, 6), tsid.TrajectorySample(nv)
    kept.value(case.q0)
    kept.derivative(np.zeros(nv))
    target.derivative(np.zeros(6))
    target.second_derivative(np.zeros(6))
    posture.setReference(kept)
    own = (robot, hand, posture, bounds)  # TSID does not own its tasks

    def compute(t: float, q: Any, v: Any) -> Any:
        place = np.concatenate([case.desired(t).position, case.rotation.T.ravel()])
        target.value(place)  # the rotation's columns follow each other
        hand.setReference(target)
        solution = solver.solve(problem.computeProblemData(t, q, v))
        if solution.status != 0:
            raise RuntimeError(f"TSID found no solution at t = {t:.4f} s")
        return problem.getActuatorForces(solution)

    compute.kept = own  # type: ignore[attr-defined]
    return compute
