"""Simulated robots that are too heavy for their motors, and feasible values."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.gains_in_force import rounded_down
from hsp_control.declaration import within
from hsp_control.robot import Robot
from hsp_control.robot.description.access import ANYWHERE
from hsp_control.simulation.plants.model_changes import Inertias
from hsp_control.simulation.plants.plant_part import PlantPart

SLOW = 10.0
"""A motor that needs longer to reach its joint's speed limit moves nothing [s]."""


def heavy_plant(plant: PlantPart, robot: Robot, q: Array) -> Iterator[str]:
    """Yield fields of a plant that are too heavy for the motors, and feasible values.

    Too heavy are an effort against gravity at a configuration, and an inertia with
    which a motor needs `SLOW` to reach its speed limit. Only motors with limits are
    checked.
    """
    if robot.unactuated:
        return
    # one field after the other, so that each is checked for its own effect
    so_far = replace(plant, inertias=Inertias(), payload=None, motor_inertia=0.0)
    before = so_far.simulated(robot, ANYWHERE)
    for field in ("inertias", "payload", "motor_inertia"):
        value = getattr(plant, field)
        if value is None or value == Inertias() or not np.any(value):
            continue
        so_far = replace(so_far, **{field: value})
        with within("plant"):
            after = so_far.simulated(robot, ANYWHERE)
        for of in (_too_heavy, _too_slow):
            if message := of(plant, field, before, after, q):
                yield message
                break
        before = after


def _too_heavy(
    plant: PlantPart, field: str, before: Robot, after: Robot, q: Array
) -> str:
    """Return the joint that gravity overloads most, and the load that it can hold."""
    if field == "motor_inertia":
        return ""
    limit, had, has = after.model.effortLimit, _gravity(before, q), _gravity(after, q)
    limit = np.where(limit > 0.0, limit, np.inf)
    if (np.abs(had) > limit).any() or not (np.abs(has) > limit).any():
        return ""
    j = int(np.argmax(np.abs(has) / limit))
    unit, name = _unit(after, j), after.dof_names[j]
    requires = f"gravity requires {abs(has[j]):.3g} {unit} of {name!r}"
    start = f"{requires} at the start, its limit is {limit[j]:.3g}"
    if field == "payload" and plant.payload is not None:
        mass, change = plant.payload.mass, has - had
        room = np.where(change > 0.0, limit - had, limit + had)
        most = mass * float(np.min(room / np.maximum(np.abs(change), 1e-300)))
        return f"plant.payload.mass is {mass:g} kg: {start}; at most {_kg(most)} kg"
    factor = plant.inertias.mass_factor
    most = factor * float(np.min(limit / np.maximum(np.abs(has), 1e-300)))
    return f"plant.inertias.mass_factor is {factor:g}: {start}; at most {_kg(most)}"


def _too_slow(
    plant: PlantPart, field: str, before: Robot, after: Robot, q: Array
) -> str:
    """Return the joint that is slowest to reach its limit, and a feasible value."""
    if field == "payload":
        return ""
    effort, speed = after.model.effortLimit, after.model.velocityLimit
    known = (effort > 0.0) & np.isfinite(effort) & (speed > 0.0) & np.isfinite(speed)
    effort = np.where(known, effort, np.inf)
    rest = np.zeros(after.nv)
    had, has = (
        np.diag(each.state(0.0, q, rest).mass_matrix).copy() for each in (before, after)
    )
    times = np.where(known, has * speed, 0.0) / effort
    if (np.where(known, had * speed, 0.0) / effort > SLOW).any():
        return ""
    if not (times > SLOW).any():
        return ""
    j = int(times.argmax())
    takes = (
        f"{after.dof_names[j]!r} with its {effort[j]:.3g} {_unit(after, j)} takes "
        f"{times[j]:.3g} s to its speed limit"
    )
    most = SLOW * effort / np.where(known, speed, 1.0)
    if field == "motor_inertia":
        value = float(np.broadcast_to(plant.motor_inertia, (after.nv,))[j])
        return (
            f"plant.motor_inertia is {value:g}: {takes}; at most "
            f"{_kg(most[j] - had[j])}"
        )
    rotors = after.model.armature  # which no factor of the bodies changes
    part = float(np.min(((most - rotors) / np.maximum(has - rotors, 1e-300))[known]))
    own = plant.inertias
    name = "mass_factor" if own.mass_factor > own.inertia_factor else "inertia_factor"
    value = getattr(own, name)
    return f"plant.inertias.{name} is {value:g}: {takes}; at most {_kg(part * value)}"


def _gravity(robot: Robot, q: Array) -> Array:
    rest = np.zeros(robot.nv)
    return np.array(robot.inverse_dynamics(q, rest, rest))


def _unit(robot: Robot, j: int) -> str:
    return "N·m" if robot.units[j] == "rad" else "N"


def _kg(value: float) -> str:
    return rounded_down(value) if value > 0.0 else "0"
