"""Whether commanded forces can be had, as far as that is known before a run."""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.constraints.contacts import SlidingContact
from hsp_control.control import Controller
from hsp_control.control.actuation.support import Support
from hsp_control.robot import RobotState
from hsp_control.simulation.reach_check import target_of
from hsp_control.tasks import CenterOfMass, FramePose, FramePosition
from hsp_control.tasks.axes import axis_indices

_TIMES = 41
"""At how many times of a run commands are looked at."""
_KEPT = 0.99
"""Share of a command from which on it is kept."""


def missed_forces(
    controller: Controller,
    q0: Array,
    duration: float,
    push_off: float = 0.0,
) -> Iterator[str]:
    """Yield what there is to say of commanded forces that will be missed.

    A force that the robot cannot have at rest: within efforts, friction and balance, in
    the posture of the start, with its centre of mass where a task moves it. And a slide
    that the plant's surface pushes off (`PlantPart.push_off`). ``controller`` is not
    changed.
    """
    if all(contact.force is None for contact in controller.contacts):
        return
    controller, rest = controller.preview(), np.zeros(controller.robot.nv)
    least: dict[str, tuple[float, str]] = {}  # share of a command and what to say of it
    for t in map(float, np.linspace(0.0, duration, _TIMES)):
        controller.compute(t, q0, rest)  # what is commanded then
        support = controller.active_stack.support
        pressed = _pressed(support)
        share = _share(controller, support, t) if pressed else 1.0
        for contact in support.contacts:
            force, kept = pressed.get(contact.name, 0.0), share
            told = (
                f"at most {kept * force:.3g} of {force:.3g} N can be had at rest, "
                "within efforts, friction and balance"
            )
            if isinstance(contact, SlidingContact) and contact.slides and push_off:
                speed = _slip(controller, contact, t)
                needed = speed * push_off * _mass(contact, controller.state)
                if force < kept * needed:
                    kept = force / needed
                    told = (
                        f"it slides at {speed:.2g} m/s, and the plant's surface pushes "
                        f"it off below {needed:.3g} N; {force:.3g} N are commanded"
                    )
            if force > 0.0 and kept < least.get(contact.name, (_KEPT, ""))[0]:
                least[contact.name] = kept, f"at t = {t:.3g} s {told}"
    for name, (_, message) in least.items():
        yield f"contact {name!r}: {message}"


def _pressed(support: Support) -> dict[str, float]:
    """Return the commanded normal forces [N] by contact."""
    return {
        contact.name: float(support.reference.reshape(-1, 3)[points, 2].sum())
        for contact, points in zip(support.contacts, support.points, strict=True)
        if contact.force is not None and support.reference.reshape(-1, 3)[points].any()
    }


def _share(controller: Controller, support: Support, t: float) -> float:
    """Return the largest share of the commands with which the robot can rest.

    A linear programme in the forces at the points and that share.
    """
    from scipy.optimize import linprog  # here: SciPy takes long to import

    state, robot, n = controller.state, controller.robot, support.size
    equal: list[Array] = []
    given: list[Array] = []
    if len(robot.unactuated) == 6:
        blocks = [
            np.vstack([contact.axes, pin.skew(support.positions[k]) @ contact.axes])
            for contact, points in zip(support.contacts, support.points, strict=True)
            for k in range(points.start, points.stop)
        ]
        weight = -pin.computeTotalMass(robot.model) * robot.model.gravity.linear
        center = _center(controller, state, t)
        equal.append(np.hstack([*blocks, np.zeros((6, 1))]))
        given.append(np.concatenate([weight, np.cross(center, weight)]))
    for contact, points in zip(support.contacts, support.points, strict=True):
        if contact.force is None:
            continue
        rows = np.eye(n, n + 1)[3 * points.start : 3 * points.stop]
        rows[:, -1] = -support.reference[3 * points.start : 3 * points.stop]
        free = contact.force.dimension == 1 and not contact.slides
        equal.append(rows[2::3] if free else rows)
        given.append(np.zeros(len(equal[-1])))
    # cones and the efforts N - F f, each above a lower bound
    limit, tau = np.full(robot.nv, np.inf), state.nonlinear_effects
    if controller.limits is not None:
        limit[:] = controller.limits.effort
    limit[list(robot.unactuated)] = np.inf
    rows = np.vstack([support.cone, support.map, -support.map])
    least = np.concatenate([np.zeros(len(support.cone)), tau - limit, -tau - limit])
    found = linprog(
        -np.eye(n + 1)[-1],
        -np.hstack([rows, np.zeros((len(rows), 1))])[np.isfinite(least)],
        -least[np.isfinite(least)],
        np.vstack(equal),
        np.concatenate(given),
        [*zip(support.lower, support.upper, strict=True), (0.0, 1.0)],
    )
    return 1.0 if found.x is None else float(found.x[-1])


def _center(controller: Controller, state: RobotState, t: float) -> Array:
    """Return where the centre of mass is to be, shape (3,) [m]."""
    center = state.centroidal.position.copy()
    for task in controller.tasks:
        if isinstance(task, CenterOfMass) and not task.remembers:
            center[axis_indices(task.axes)] = task.trajectory.sample(t).position
    return np.asarray(center)


def _slip(controller: Controller, contact: SlidingContact, t: float) -> float:
    """Return the speed at which tasks move a contact along its plane [m/s]."""
    speed, h, across = 0.0, 1e-4, contact.axes[:, :2].T
    for task in controller.tasks:
        if not isinstance(task, FramePose | FramePosition) or task.remembers:
            continue
        if task.frame_name == contact.frame:
            now, then = (
                target_of(task, t).translation,
                target_of(task, t + h).translation,
            )
            speed = max(speed, float(np.linalg.norm(across @ (then - now))) / h)
    return speed


def _mass(contact: SlidingContact, state: RobotState) -> float:
    """Return what a contact's frame weighs along the normal [kg]."""
    row = contact.axes[:, 2] @ state.frame(contact.frame).jacobian[:3]
    return 1.0 / float(row @ np.linalg.solve(state.mass_matrix, row))
