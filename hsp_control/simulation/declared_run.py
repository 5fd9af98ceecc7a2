"""The configuration of a run that was made in Python: with it, its log repeats it."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any

from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    HspControlError,
    ModelError,
    SceneError,
)
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits
from hsp_control.control.changes import Change
from hsp_control.control.controller import Controller
from hsp_control.control.estimation import Estimator
from hsp_control.control.fitting import Base
from hsp_control.control.plans import MotionPlan
from hsp_control.declaration.nested import keyed, with_parts_replaced
from hsp_control.declaration.own_modules import own_modules
from hsp_control.declaration.plain_data import plain_data
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.metrics import Metric
from hsp_control.robot import Robot
from hsp_control.robot.description.robot_description import RobotDescription
from hsp_control.robot.recorded import robot_record
from hsp_control.simulation.initial_state import InitialState
from hsp_control.tasks import Task


def declared_controller(
    controller: Controller, **others: Any
) -> tuple[dict[str, Any] | None, str]:
    """Return the configuration of a controller as data; or None, and why.

    Args:
        controller: The controller.
        others: Further parts of the configuration, by their keys.
    """
    own = controller._declared
    try:
        parts = others | controller_data(
            *(_described(own.robot), own.tasks, own.field, own.gain, own.metric),
            *(own.threshold, own.limits, own.contacts, own.base, own.scene),
        )
        config: dict[str, Any] = plain_data(parts, defaults=True)
    except HspControlError as error:
        return None, str(error)
    config["imports"] = list(dict.fromkeys(own_modules(parts)))
    return config, ""


def with_duration(
    config: Mapping[str, Any] | None, duration: float | None
) -> dict[str, Any] | None:
    """Return a run's configuration with the duration that it was given [s].

    Args:
        config: The configuration; None: there is none.
        duration: None: a log of it is repeated over its own duration, see
        `Rollout.config`.
    """
    if config is None:
        return None
    return {**config, "simulation": {**config["simulation"], "duration": duration}}


def _described(robot: Robot) -> RobotDescription:
    """Return a robot's description; of one from a model, its name alone."""
    if robot.description is not None:
        return robot.description
    # The log has the model itself, so that the name is never looked up.
    if why := robot_record(robot).get("missing"):
        raise ModelError(why)
    return RobotDescription(robot.name or "robot")


def declared_run(
    controller: Controller,
    q: Array,
    v: Array,
    *,
    plan: MotionPlan | None,
    estimators: Sequence[Estimator],
    **others: Any,
) -> dict[str, Any]:
    """Return the configuration of a run as meta data of its log.

    Args:
        controller: The controller.
        q: Where the run begins, shape (nq,).
        v: The velocity there, shape (nv,).
        plan: The plan, which only an `Experiment` can repeat.
        estimators: Estimators, as the plan.
        others: Further parts of the configuration, by their keys.

    Returns:
        ``config``, in which all is data; or None, and why, as ``config_lost``.
    """
    if plan is not None or estimators:
        lost = "its plan and estimators were given to the loop, not to an Experiment"
        return {"config": None, "config_lost": lost}
    start = controller._declared.start
    begin = InitialState(configuration=q, velocity=v, relative_to=start)
    config, lost = declared_controller(controller, start=begin, **others)
    return {"config": config, **({"config_lost": lost} if lost else {})}


def controller_data(
    robot: RobotDescription,
    tasks: Sequence[Task],
    field: NullSpaceField | None,
    gain: ArrayLike,
    metric: Metric | None,
    threshold: float,
    limits: Limits | None,
    contacts: Sequence[Contact],
    base: Base | None,
    scene: Scene | Iterable[Obstacle],
    changes: Sequence[Change] = (),
) -> dict[str, Any]:
    """Return the configuration of a controller; see `hsp_control.config.Scenario`.

    The parts' own obstacles are in its scene, and the parts refer to their names.
    """
    scene = scene if isinstance(scene, Scene) else Scene(scene)
    known = dict(scene)

    def name_of(obstacle: Obstacle) -> str:
        if known.setdefault(obstacle.name, obstacle) != obstacle:
            raise SceneError(f"two obstacles have the name {obstacle.name!r}")
        return obstacle.name

    named = partial(with_parts_replaced, kind=Obstacle, change=name_of)
    null_space = {
        "gain": gain,
        "metric": metric,
        "fields": named(() if field is None else tuple(terms_of(field))),
        "singularity_threshold": threshold,
    }
    return {
        "robot": robot,
        "tasks": keyed(tasks),
        "null_space": null_space,
        "limits": named(limits),
        "contacts": keyed(contacts),
        "base": base,
        "changes": named(tuple(changes)),
        "scene": scene if len(known) == len(scene) else Scene(known.values()),
    }
