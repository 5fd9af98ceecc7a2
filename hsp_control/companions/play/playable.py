"""Builds an experiment for `hsp play` from the command's arguments."""

from os import PathLike
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ConfigError
from hsp_control.common.resources import bundled_configs
from hsp_control.common.suggestions import listing
from hsp_control.companions.play.session import ROW
from hsp_control.companions.plots.palette import STAGE
from hsp_control.config import Experiment
from hsp_control.config.document import Document, read_document
from hsp_control.config.loaded_scenario import load_scenario
from hsp_control.geometry.links import link_shapes
from hsp_control.robot import Robot
from hsp_control.robot.description.sources import is_robot

_PERIOD = 0.001  # control period where a configuration has none [s]


def playable(
    source: str | PathLike[str], *overrides: str, **reading: Any
) -> Experiment:
    """Return the experiment of `playable_document`."""
    document = playable_document(source, *overrides, **reading)
    return Experiment.of(load_scenario(document).from_zero())


def playable_document(
    source: str | PathLike[str], *overrides: str, strict: bool = False, **reading: Any
) -> Document:
    """Return a configuration for `hsp play`, also of a robot alone.

    ``source`` is one for `load_experiment`, or a robot with a fixed base, by name or
    URDF: its hand holds its pose, with a ball beside its elbow. Without a control
    period it gets one of a millisecond, and rows of about 10 ms.
    """
    if str(source) not in bundled_configs() and is_robot(str(source)):
        document = Document(_for_robot(str(source)), {}, str(source))
    else:
        document = read_document(source, strict=strict, **reading)
    for assignment in overrides:
        document.override(assignment)
    if not (document.to_dict().get("view") or {}).get("background"):
        document.override(f'view.background="{STAGE}"')
    settings = document.to_dict().get("simulation") or {}
    period = settings.get("control_period")
    if period is None:
        period = _PERIOD
        document.override(f"simulation.control_period={period}")
        document.override(f"simulation.integrator={{type: rk4, step: {period}}}")
    if isinstance(period, int | float) and period > 0.0:
        row = max(round(ROW / period), 1) * period
        document.override(f"simulation.log_period={row!r}")
        document.override(f"simulation.duration={row!r}")
    return document


def _for_robot(name: str) -> dict[str, Any]:
    """Return the configuration of a robot that holds its hand, beside a ball."""
    robot = Robot.load(name)
    if robot.unactuated:
        known = [
            config
            for config, path in bundled_configs().items()
            if f"name: {name}" in path.read_text()
        ]
        listed = f", for example {listing(known, limit=3)}" if known else ""
        raise ConfigError(
            f"{name} has a free-flyer root, which needs contacts: give a "
            f"configuration{listed}"
        )
    size, elbow, forward, across = _build_of(robot)
    radius = _rounded(0.13 * size)
    eye = elbow + size * (3.4 * forward + 1.9 * across + [0.0, 0.0, 1.2])
    floor = {"shape": {"type": "plane"}, "center": {"type": "hold", "point": [0, 0, 0]}}
    ball = {
        "shape": {"type": "sphere", "radius": radius},
        "center": {"type": "hold", "point": _listed(elbow + 6.0 * radius * across)},
    }
    clear = _above_the_floor(robot, 0.05 * size)
    below = {"type": "obstacle_distance", "obstacles": ["floor"], "links": clear}
    pose = robot.nv >= 6
    has_home = bool(np.any(robot.home() != robot.neutral()))
    return {
        "title": f"{name}: drag its hand, push the ball against its elbow",
        "robot": {"name": name},
        **({} if has_home else {"start": "auto"}),
        "scene": {"obstacles": {"ball": ball, **({"floor": floor} if clear else {})}},
        "tasks": {"hand": {"type": "frame_pose" if pose else "frame_position"}},
        "limits": {
            "barriers": [*([below] if clear else []), {"type": "self_distance"}]
        },
        "null_space": {
            "gain": 10,
            "fields": [
                {"type": "obstacle_clearance", "obstacles": ["ball"],
                 "influence": _rounded(2.5 * radius)},
                {"type": "target_posture", "target": "start"},
            ],
        },
        "view": {
            "camera": _listed(eye),
            "target": _listed(elbow * [1, 1, 0.75] + 0.4 * size * forward),
        },
    }  # fmt: skip


def _build_of(robot: Robot) -> tuple[float, Array, Array, Array]:
    """Return a robot's size [m], its elbow [m], and horizontal unit vectors at home.

    The first points to the hand, the second to the left of it.
    """
    state = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    hand = state.position(robot.end_effector)
    points = np.array([*(place.translation for place in state.data.oMi[1:]), hand])
    along = hand - points[0]
    size = max(float(np.linalg.norm(along)), float(np.ptp(points, axis=0).max()), 1e-3)
    away = np.linalg.norm(np.cross(points - points[0], along), axis=1)
    elbow = points[int(np.argmax(away))]
    if away.max() < 0.1 * size**2:  # a straight arm
        elbow = points[
            np.argmin(np.abs(np.linalg.norm(points - hand, axis=1) - size / 2))
        ]
    forward = along * [1.0, 1.0, 0.0]
    length = float(np.linalg.norm(forward))
    forward = forward / length if length > 1e-3 * size else np.array([1.0, 0.0, 0.0])
    return size, elbow, forward, np.cross([0.0, 0.0, 1.0], forward)


def _above_the_floor(robot: Robot, height: float) -> list[str]:
    """Return the moving links that are at least this high at home [m]."""
    state = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    lowest: dict[str, float] = {}
    for shape in link_shapes(robot, "spheres"):
        center = state.data.oMi[shape.joint].act(shape.placement.translation)
        bottom = float(center[2] - shape.geometry.radius)
        if shape.joint > 0:
            lowest[shape.link] = min(lowest.get(shape.link, np.inf), bottom)
    return [link for link, bottom in lowest.items() if bottom > height]


def _listed(point: Array) -> list[float]:
    return [_rounded(x) for x in point]


def _rounded(x: float) -> float:
    return float(f"{x:.3g}")
