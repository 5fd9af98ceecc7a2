"""TSID that walks: its tasks and contacts follow a plan for this law.

As in its exercise ``ex_4``: centre of mass, trunk and swing feet with weight 1 and the
posture with a smaller one are one cost; soles are constraints that come and go.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import tsid

from hsp_control import Controller
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

_FADED = 1e-6  # the least share of a force, as in this law


def make(
    controller: Controller, q0: Array, *, gain: float, posture_weight: float
) -> tuple[Callable[[float, Array, Array], Array], list[str]]:
    """Return the function of the effort, and the list of the solver's statuses.

    Args:
        controller: A controller that is made of a plan's parts: its contacts' schedules
            and its tasks' references are read in every step; it computes nothing.
        q0: Configuration at the start, shape (nq,).
        gain: K_N of the posture, whose α is 1 [1/s].
        posture_weight: The posture's weight [-].
    """
    model, nv = controller.robot.model, controller.robot.nv
    robot = tsid.RobotWrapper(model, tsid.FLOATING_BASE_SYSTEM, False)
    problem = tsid.InverseDynamicsFormulationAccForce("tsid", robot, False)
    problem.computeProblemData(0.0, q0, np.zeros(nv))
    weight = 9.81 * sum(inertia.mass for inertia in model.inertias)
    given: dict[str, Any] = {task.name: task for task in controller.tasks}

    soles = {}
    for contact in controller.contacts:
        made = sole(
            robot,
            contact.frame,
            contact.points,
            contact.friction,
            contact.damping,
            MAX_FORCE * weight,
        )
        made.setReference(frame_pose(model, problem, robot, contact.frame))
        problem.addRigidContact(made, FORCE_WEIGHT)
        soles[contact.name] = made

    body = given["center_of_mass"]
    com = center_of_mass(robot, _frequency(body))
    upright = given["trunk"]
    trunk = pose(robot, "trunk", upright.frame, (0, 0, 0, 1, 1, 1), _frequency(upright))
    rest = posture(robot, q0, gain, 1.0)
    add_tasks(problem, {com: 1.0, trunk: 1.0, rest: posture_weight})
    feet = {
        name: pose(robot, name, given[name].frame, (1,) * 6, _frequency(given[name]))
        for name in soles
    }
    bounds = effort_bounds(robot, np.array(model.upperEffortLimit)[6:])
    problem.addActuationTask(bounds, 1.0, 0, 0.0)
    solver = solver_of(problem)

    com_sample = tsid.TrajectorySample(3)
    trunk_sample = tsid.TrajectorySample(12, 6)
    foot_sample = tsid.TrajectorySample(12, 6)
    statuses: list[str] = []
    bearing, swinging = set(soles), set[str]()
    tau = np.zeros(nv)

    def switch(t: float, q: Array, v: Array) -> None:
        """Let contacts and feet come and go by the plan."""
        for contact in controller.contacts:
            name, made = contact.name, soles[contact.name]
            if contact.active(t) and name not in bearing:
                problem.computeProblemData(t, q, v)
                made.setReference(frame_pose(model, problem, robot, contact.frame))
                problem.addRigidContact(made, FORCE_WEIGHT)
                bearing.add(name)
            elif not contact.active(t) and name in bearing:
                problem.removeRigidContact(made.name, 0.0)
                bearing.remove(name)
            if name in bearing:  # its force fades, as in this law
                on = max(contact.weight(t), _FADED)
                made.setMaxNormalForce(MAX_FORCE * weight * on)
                problem.updateRigidContactWeights(made.name, FORCE_WEIGHT / on)
            swings = given[name].schedule.active(t)
            if swings and name not in swinging:
                problem.addMotionTask(feet[name], 1.0, 1, 0.0)
                swinging.add(name)
            elif not swings and name in swinging:
                problem.removeTask(name, 0.0)
                swinging.remove(name)

    def compute(t: float, q: Array, v: Array) -> Array:
        switch(t, q, v)
        write(com_sample, *body.followed.sample(t)[:3])
        com.setReference(com_sample)
        R, turning, turning_dot = upright.followed.sample(t)[:3]
        nothing = np.zeros(3)
        write(
            trunk_sample,
            place(nothing, R),
            np.append(nothing, turning),
            np.append(nothing, turning_dot),
        )
        trunk.setReference(trunk_sample)
        for name in swinging:
            followed = given[name].followed
            x, x_dot, x_ddot = followed.position.sample(t)[:3]
            R, turning, turning_dot = followed.orientation.sample(t)[:3]
            write(
                foot_sample,
                place(x, R),
                np.append(x_dot, turning),
                np.append(x_ddot, turning_dot),
            )
            feet[name].setReference(foot_sample)
        data = problem.computeProblemData(t, q, v)
        solution = solver.solve(data)  # it resizes itself
        statuses.append(str(int(solution.status)))
        if solution.status == 0:  # else hold the last effort
            tau[6:] = problem.getActuatorForces(solution)
        return tau

    # TSID does not own its tasks.
    kept = [robot, *soles.values(), com, trunk, rest, *feet.values(), bounds]
    compute.kept = kept  # type: ignore[attr-defined]
    return compute, statuses


def _frequency(task: Any) -> float:
    """Return ω0 of a task that is critically damped [rad/s]."""
    return float(task.gains.natural_frequency)
