"""From what was asked for to an experiment that can be played with."""

from os import PathLike
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ConfigError
from hsp_control.common.resources import bundled_configs
from hsp_control.common.suggestions import listing
from hsp_control.config import Experiment
from hsp_control.config.document import Document
from hsp_control.config.experiment import build
from hsp_control.config.source import read_document
from hsp_control.play.session import ROW
from hsp_control.robot import Robot
from hsp_control.robot.description.sources import is_robot

_PERIOD = 0.001  # control period where a configuration has none [s]


def playable(
    source: str | PathLike[str], *overrides: str, **reading: Any
) -> Experiment:
    """Return the experiment of `playable_document`."""
    return build(playable_document(source, *overrides, **reading))


def playable_document(
    source: str | PathLike[str], *overrides: str, strict: bool = False, **reading: Any
) -> Document:
    """Return a configuration that can be played with, or one for a robot.

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
    center, radius = _beside_the_elbow(robot)
    pose = robot.nv >= 6
    has_home = bool(np.any(robot.home() != robot.neutral()))
    return {
        "title": f"{name}: take its hand, move the ball, pull at a link",
        "robot": {"name": name},
        **({} if has_home else {"start": "auto"}),
        "scene": {
            "obstacles": {
                "ball": {
                    "shape": {"type": "sphere", "radius": radius},
                    "center": {"type": "hold", "point": center},
                }
            }
        },
        "tasks": {"hand": {"type": "frame_pose" if pose else "frame_position"}},
        "null_space": {
            "gain": 10,
            "fields": [
                {"type": "obstacle_clearance", "obstacles": ["ball"],
                 "influence": 3.0 * radius},
                {"type": "target_posture", "target": "start"},
            ],
        },
    }  # fmt: skip


def _beside_the_elbow(robot: Robot) -> tuple[list[float], float]:
    """Return the centre and the radius of a ball beside the robot's elbow [m]."""
    state = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    points = np.array([place.translation for place in state.data.oMi][1:])
    hand = state.position(robot.end_effector)
    reach = float(np.linalg.norm(hand - points[0]).max())
    size = max(reach, float(np.ptp(points, axis=0).max()), 1e-3)
    elbow: Array = points[np.argmin(np.abs(np.linalg.norm(points - hand, axis=1)
                                           - 0.5 * size))]  # fmt: skip
    across = np.cross(hand - points[0], [0.0, 0.0, 1.0])
    if np.linalg.norm(across) < 1e-3 * size:
        across = np.array([0.0, 1.0, 0.0])
    away = across / np.linalg.norm(across)
    radius = 0.1 * size
    return [float(x) for x in elbow + 5.0 * radius * away], float(f"{radius:.3g}")
