"""What ``hsp check`` says about a robot or a start that will make trouble."""

from collections.abc import Iterator

from hsp_control.common.exceptions import ConfigurationError
from hsp_control.common.suggestions import listing
from hsp_control.config import Experiment
from hsp_control.inspection.strength import too_weak
from hsp_control.robot import Robot
from hsp_control.robot.description.inertias import impossible_inertias
from hsp_control.robot.description.urdf_checks import read_urdf
from hsp_control.simulation.start_search import posture_search


def robot_advice(robot: Robot) -> Iterator[str]:
    """Yield lines about links whose inertias no body can have."""
    description = robot.description
    if description is None or description.project_inertias:
        return
    for part in robot.parts:
        placed = (description.parts or {}).get(part.prefix.removesuffix("_"))
        if placed is not None and placed.project_inertias:
            continue
        if part.source.shapes is not None:  # no URDF: MuJoCo has checked its inertias
            continue
        links = [found.link for found in impossible_inertias(read_urdf(part.source))]
        if links:
            yield (
                f"{part.prefix}{part.source.name}: no body can have the inertias of "
                f"{listing(links, limit=6)}; project_inertias: true takes the nearest "
                "possible ones (see hsp inspect)."
            )


def start_advice(experiment: Experiment, damped: str = "") -> Iterator[str]:
    """Yield lines about a start that is singular, in collision or cannot be held.

    Where it is singular or in collision, a better one follows.
    """
    robot, null_space = experiment.robot, experiment.scenario.null_space
    if damped:
        yield (
            f"The tasks {damped} are singular at the start: the law is damped there, "
            "not exact."
        )
    if robot.unactuated:
        return
    limits = experiment.controller.limits
    if limits is not None:
        for joint, why in too_weak(robot, experiment.q0, limits.effort):
            yield f"At the start {joint} cannot hold the robot: {why}."
    tasks = experiment.scenario.tasks.values()
    search = posture_search(robot, tasks, experiment.scene)
    start = search.judge(experiment.q0)
    depth, pair = search.overlap(experiment.q0)
    if depth > 0.0:
        yield f"The start is in collision: {pair} overlap by {depth:.3g} m."
    elif not damped:
        return
    try:
        found = search.rounded(search.find(null_space.singularity_threshold))
    except ConfigurationError as error:
        yield f"No better start is known: {error}."
        return
    yield (
        "A better start (smallest singular value of the tasks "
        f"{found.regularity:.3g} instead of {start.regularity:.3g}):"
    )
    yield f"    start: {search.start_line(found)}"
    yield "or start: auto, which finds it."
