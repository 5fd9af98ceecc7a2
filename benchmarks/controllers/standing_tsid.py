"""TSID on two feet, with its own API, as in its exercise ``ex_2`` (Talos' legs).

Contacts are constraints (level 0) with a force at each corner. Centre of mass, hand and
trunk with weight 1 and the posture with a smaller weight are one cost.
"""

from collections.abc import Callable

import numpy as np
import tsid
from standing import CONTACT_DAMPING, FREQUENCY, FRICTION, GAIN, POSTURE_RATE, Standing

from hsp_control.common.arrays import Array

FORCE_WEIGHT = 1e-5  # regularisation of the forces, as in TSID's exercises


def make(
    case: Standing, *, posture_weight: float
) -> tuple[Callable[[float, Array, Array], Array], list[str]]:
    """Return the controller, and the list to which it appends the solver's status."""
    model, nv = case.robot.model, case.robot.nv
    robot = tsid.RobotWrapper(model, tsid.FLOATING_BASE_SYSTEM, False)
    problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
    problem.computeProblemData(0.0, case.q0, np.zeros(nv))
    kp, kv = FREQUENCY**2, 2.0 * FREQUENCY
    kept = [robot]  # TSID does not own its tasks

    # TSID's pyramid contains the cone of its coefficient; this one is inside our cone.
    friction = FRICTION / np.sqrt(2.0)
    for name in case.body.soles:
        contact = tsid.Contact6d(
            name, robot, name, case.corners.T.copy(), np.array([0.0, 0.0, 1.0]),
            friction, 0.0, 12.0 * case.weight,
        )  # fmt: skip
        contact.setKp(np.zeros(6))
        contact.setKd(CONTACT_DAMPING * np.ones(6))
        contact.setReference(robot.framePosition(problem.data(), _id(model, name)))
        problem.addRigidContact(contact, FORCE_WEIGHT)
        kept.append(contact)

    com = tsid.TaskComEquality("com", robot)
    com.setKp(kp * np.ones(3))
    com.setKd(kv * np.ones(3))
    hand = tsid.TaskSE3Equality("hand", robot, case.body.hand)
    trunk = tsid.TaskSE3Equality("trunk", robot, case.body.trunk)
    for task, mask in ((hand, (1, 1, 1, 0, 0, 0)), (trunk, (0, 0, 0, 1, 1, 1))):
        task.useLocalFrame(False)
        task.setKp(kp * np.ones(6))
        task.setKd(kv * np.ones(6))
        task.setMask(np.array(mask, dtype=float))
    posture = tsid.TaskJointPosture("posture", robot)
    posture.setKp(GAIN * POSTURE_RATE * np.ones(nv - 6))
    posture.setKd((GAIN + POSTURE_RATE) * np.ones(nv - 6))
    for task in (com, hand, trunk):
        problem.addMotionTask(task, 1.0, 1, 0.0)
    problem.addMotionTask(posture, posture_weight, 1, 0.0)

    bounds = tsid.TaskActuationBounds("effort", robot)
    effort = np.array(model.upperEffortLimit)[6:]
    bounds.setBounds(-effort, effort)
    problem.addActuationTask(bounds, 1.0, 0, 0.0)
    solver = tsid.SolverHQuadProgFast("qp")
    solver.resize(problem.nVar, problem.nEq, problem.nIn)
    kept += [com, hand, trunk, posture, bounds]

    trunk_sample = tsid.TrajectorySample(12, 6)
    place = np.concatenate([np.zeros(3), case.upright.T.ravel()])  # column-major
    trunk_sample.value(place)
    trunk_sample.derivative(np.zeros(6))
    trunk_sample.second_derivative(np.zeros(6))
    trunk.setReference(trunk_sample)
    posture_sample = tsid.TrajectorySample(nv - 6)
    posture_sample.value(case.q0[7:])
    posture_sample.derivative(np.zeros(nv - 6))
    posture_sample.second_derivative(np.zeros(nv - 6))
    posture.setReference(posture_sample)
    com_sample, hand_sample = tsid.TrajectorySample(3), tsid.TrajectorySample(12, 6)
    hand_place, hand_rate, hand_rate_dot = place.copy(), np.zeros(6), np.zeros(6)
    statuses: list[str] = []
    tau = np.zeros(nv)

    def compute(t: float, q: Array, v: Array) -> Array:
        desired = case.com.sample(t)
        com_sample.value(desired.position)
        com_sample.derivative(desired.velocity)
        com_sample.second_derivative(desired.acceleration)
        com.setReference(com_sample)
        desired = case.hand.sample(t)
        hand_place[:3], hand_rate[:3] = desired.position, desired.velocity
        hand_rate_dot[:3] = desired.acceleration
        hand_sample.value(hand_place)
        hand_sample.derivative(hand_rate)
        hand_sample.second_derivative(hand_rate_dot)
        hand.setReference(hand_sample)
        data = problem.computeProblemData(t, q, v)
        solution = solver.solve(data)
        statuses.append(str(int(solution.status)))
        if solution.status == 0:  # else hold the last effort
            tau[6:] = problem.getActuatorForces(solution)
        return tau

    compute.kept = kept  # type: ignore[attr-defined]
    tasks = [com, hand, trunk, posture]
    compute.parts = (problem, solver, tasks)  # type: ignore[attr-defined]
    return compute, statuses


def _id(model: object, name: str) -> int:
    return model.getFrameId(name)  # type: ignore[attr-defined, no-any-return]
