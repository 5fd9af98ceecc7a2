"""TSID on two feet, with its own API, as in its exercise ``ex_2`` (Talos' legs).

Contacts are constraints (level 0) with a force at each corner. Centre of mass, hand and
trunk with weight 1 and the posture with a smaller weight are one cost.
"""

from collections.abc import Callable

import numpy as np
import tsid

from hsp_control.common.arrays import Array
from shared.controllers.tsid_parts import (
    FORCE_WEIGHT,
    MAX_FORCE,
    add_tasks,
    center_of_mass,
    effort_bounds,
    frame_pose,
    place,
    pose,
    posture,
    sole,
    solver_of,
    write,
)
from shared.standing import (
    CONTACT_DAMPING,
    FREQUENCY,
    FRICTION,
    GAIN,
    POSTURE_RATE,
    Standing,
)


def make(
    case: Standing, *, posture_weight: float
) -> tuple[Callable[[float, Array, Array], Array], list[str]]:
    """Return the controller, and the list to which it appends the solver's status."""
    model, nv = case.robot.model, case.robot.nv
    robot = tsid.RobotWrapper(model, tsid.FLOATING_BASE_SYSTEM, False)
    problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
    problem.computeProblemData(0.0, case.q0, np.zeros(nv))
    kept = [robot]  # TSID does not own its tasks

    most = MAX_FORCE * case.weight
    for name in case.body.soles:
        contact = sole(robot, name, case.corners, FRICTION, CONTACT_DAMPING, most)
        contact.setReference(frame_pose(model, problem, robot, name))
        problem.addRigidContact(contact, FORCE_WEIGHT)
        kept.append(contact)

    com = center_of_mass(robot, FREQUENCY)
    hand = pose(robot, "hand", case.body.hand, (1, 1, 1, 0, 0, 0), FREQUENCY)
    trunk = pose(robot, "trunk", case.body.trunk, (0, 0, 0, 1, 1, 1), FREQUENCY)
    rest = posture(robot, case.q0, GAIN, POSTURE_RATE)
    tasks = [com, hand, trunk, rest]
    add_tasks(problem, dict(zip(tasks, (1.0, 1.0, 1.0, posture_weight), strict=True)))

    bounds = effort_bounds(robot, np.array(model.upperEffortLimit)[6:])
    problem.addActuationTask(bounds, 1.0, 0, 0.0)
    solver = solver_of(problem)
    kept += [*tasks, bounds]

    trunk_sample = tsid.TrajectorySample(12, 6)
    upright = place(np.zeros(3), case.upright)
    write(trunk_sample, upright, np.zeros(6), np.zeros(6))
    trunk.setReference(trunk_sample)
    com_sample, hand_sample = tsid.TrajectorySample(3), tsid.TrajectorySample(12, 6)
    hand_place, hand_rate, hand_rate_dot = upright.copy(), np.zeros(6), np.zeros(6)
    statuses: list[str] = []
    tau = np.zeros(nv)

    def compute(t: float, q: Array, v: Array) -> Array:
        write(com_sample, *case.com.sample(t)[:3])
        com.setReference(com_sample)
        desired = case.hand.sample(t)
        hand_place[:3], hand_rate[:3] = desired.position, desired.velocity
        hand_rate_dot[:3] = desired.acceleration
        write(hand_sample, hand_place, hand_rate, hand_rate_dot)
        hand.setReference(hand_sample)
        data = problem.computeProblemData(t, q, v)
        solution = solver.solve(data)
        statuses.append(str(int(solution.status)))
        if solution.status == 0:  # else hold the last effort
            tau[6:] = problem.getActuatorForces(solution)
        return tau

    compute.kept = kept  # type: ignore[attr-defined]
    compute.parts = (problem, solver, tasks)  # type: ignore[attr-defined]
    return compute, statuses
