"""The stage: background, lights, floor and camera."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array, matrix_view
from hsp_control.companions.plots import palette
from hsp_control.companions.viewer import threejs
from hsp_control.companions.viewer.commands import (
    CAMERA,
    Json,
    LegendEntry,
    PageCommand,
    page_command,
    path_element,
    set_object,
    set_property,
    set_transform,
    translucent,
)
from hsp_control.config.scenario import ViewSettings
from hsp_control.robot import Robot

_HAZE = 0.19  # share of grey in the background's colour at the horizon
_GRID = "#8794A1"
_LIGHT_FROM = np.array([0.5, -0.45, 1.6])
_FINE = 1e-3
_SHADOW = translucent(palette.MUTED, 0.4)


def draw_stage(
    points: Array, floor: float, view: ViewSettings
) -> Iterator[PageCommand]:
    """Yield the background, the lights and the floor; points (K, 3) [m]."""
    yield from draw_background(view)
    center = 0.5 * (points.min(axis=0) + points.max(axis=0))
    size = scene_size(points)
    dark = is_dark(view.background)
    yield from _lights(center, size, view.light, dark=dark)
    yield from _floor(center, size, floor, view.background)
    yield set_property("/floor/grid", "visible", view.show.grid)


def draw_background(view: ViewSettings) -> Iterator[PageCommand]:
    """Yield the background alone."""
    sky = view.background
    horizon = palette.blend(sky, palette.MUTED, _HAZE)
    yield set_property("/Background", "top_color", palette.fractions(sky))
    yield set_property("/Background", "bottom_color", palette.fractions(horizon))


def stage_legend(view: ViewSettings) -> list[LegendEntry]:
    """Return the legend's entries of the floor."""
    return [
        LegendEntry("grid", _GRID, ("/floor/grid",), view.show.grid, plain=True),
        LegendEntry("shadow", _SHADOW, ("/floor/shadow",), plain=True),
    ]


def is_dark(color: str) -> bool:
    """Return whether white is easier to read on ``#RRGGBB`` than black."""
    red, green, blue = (channel**2.2 for channel in palette.fractions(color))
    return bool(0.2126 * red + 0.7152 * green + 0.0722 * blue < 0.18)


def in_sight(subject: Array, others: Array) -> Array:
    """Return the subject's points, and others clipped to the subject's size."""
    size = scene_size(subject)
    low, high = subject.min(axis=0) - size, subject.max(axis=0) + size
    return np.vstack([subject, np.clip(others, low, high)])


def scene_size(points: Array) -> float:
    """Return the distance of the farthest of the points from their middle [m]."""
    center = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return max(float(np.linalg.norm(points - center, axis=1).max()), _FINE)


class _Studio(NamedTuple):
    """How strong the lights are, the shadow and the grid."""

    sky: float
    key: float
    fill: float  # from behind: on a dark stage it draws the robot's edge
    fill_color: int
    shadow: float  # opacity
    grid: float  # opacity


_LIGHT = _Studio(0.57, 0.44, 0.14, 0xFFFFFF, 0.16, 0.55)
_DARK = _Studio(0.16, 0.62, 0.45, 0xBFD9FF, 0.5, 0.3)


def _lights(
    center: Array, size: float, strength: float, *, dark: bool
) -> Iterator[PageCommand]:
    studio = _DARK if dark else _LIGHT
    sky = threejs.light("HemisphereLight", studio.sky * strength, groundColor=0xD5DCE2)
    fill = threejs.light(
        "DirectionalLight", studio.fill * strength, color=studio.fill_color
    )
    back = np.array([-_LIGHT_FROM[0], 1.2 * abs(_LIGHT_FROM[1]), 0.6])
    yield set_object("/lights/sky", threejs.group([sky]))
    yield set_object("/lights/fill", threejs.group([fill]))
    yield set_transform("/lights/fill", threejs.pose_at(back * 4.0 * size))
    # The light points at the origin; objects that cast shadows must be in its view.
    around = float(np.linalg.norm(center)) + 1.3 * size
    distance = 4.0 * around
    key = threejs.light(
        "DirectionalLight",
        studio.key * strength,
        castShadow=True,
        shadow={
            "radius": 4.5,
            "bias": -2e-4,
            "normalBias": 4e-3 * around,
            "mapSize": [1024, 1024],
            "camera": {
                "uuid": threejs.unique_name(),
                "type": "OrthographicCamera",
                "left": -around,
                "right": around,
                "top": around,
                "bottom": -around,
                "near": distance - 2.0 * around,
                "far": distance + 2.0 * around,
            },
        },
    )
    towards = _LIGHT_FROM / np.linalg.norm(_LIGHT_FROM)
    yield set_object("/lights/key", threejs.group([key]))
    yield set_transform("/lights/key", threejs.pose_at(towards * distance))


def _floor(
    center: Array, size: float, height: float, background: str
) -> Iterator[PageCommand]:
    dark = is_dark(background)
    studio = _DARK if dark else _LIGHT
    pose = threejs.pose_at([center[0], center[1], height])
    shadow = threejs.shadow_catcher(12.0 * size, studio.shadow)
    pool = [_pool(size, background)] if dark else []
    yield set_object("/floor/shadow", threejs.group([*pool, shadow]))
    yield set_transform("/floor/shadow", pose)
    step = _round_step(size / 4.0)
    middle = np.round(center[:2] / step) * step
    yield set_object("/floor/grid", threejs.group([_grid(size, step, studio.grid)]))
    yield set_transform("/floor/grid", threejs.pose_at([*middle, height]))


_RINGS, _SEGMENTS = 12, 48


def _pool(size: float, background: str) -> Json:
    """Return a pool of light on a dark floor, which fades with the distance."""
    radii = np.linspace(0.0, 1.0, _RINGS + 1)
    angles = np.linspace(0.0, 2.0 * np.pi, _SEGMENTS + 1)
    around = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(_SEGMENTS + 1)])
    rings = radii[:, None, None] * around
    inner, outer = rings[:-1], rings[1:]
    first = inner[:, :-1], outer[:, :-1], outer[:, 1:]
    second = inner[:, :-1], outer[:, 1:], inner[:, 1:]
    points = np.concatenate(
        [np.stack(t, axis=2).reshape(-1, 3) for t in (first, second)]
    )
    colors = np.empty((len(points), 4))
    colors[:, :3] = palette.fractions(palette.blend(background, palette.PAPER, 0.4))
    colors[:, 3] = np.clip(1.0 - np.linalg.norm(points, axis=1), 0.0, 1.0) ** 2
    return threejs.painted(2.8 * size * points, colors)


def _grid(size: float, step: float, opacity: float) -> Json:
    """Return grid lines in x and y that fade with the distance from the middle."""
    reach = 2.6 * size
    ticks = np.arange(-np.floor(reach / step), np.floor(reach / step) + 1.0) * step
    cuts = np.linspace(-reach, reach, 41)
    along = np.column_stack([cuts[:-1], cuts[1:]]).ravel()
    lines = np.array([(tick, place, 0.0) for tick in ticks for place in along])
    points = np.vstack([lines, lines[:, [1, 0, 2]]])
    colors = np.empty((len(points), 4))
    colors[:, :3] = palette.fractions(_GRID)
    distance = np.linalg.norm(points, axis=1) / reach
    colors[:, 3] = opacity * np.clip(1.0 - distance, 0.0, 1.0) ** 1.5
    return threejs.segments(points, colors)


def _round_step(length: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is at most a length."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * max(n for n in (1.0, 2.0, 5.0) if n * power <= length * 1.001))


FIELD_OF_VIEW = 32.0
"""Vertical field of view [deg]: narrow, for little perspective distortion."""
_THICKNESS = 0.11  # radius of the balls around the points, over the size of the scene
_DEFAULT_DIRECTION = np.array([1.0, -1.35, 0.62])
_COS_STEEP = np.cos(np.radians(30.0))
_MAX_POINTS = 300
VIEWS = {
    "front": np.array([1.0, 0.0, 0.12]),
    "side": np.array([0.0, -1.0, 0.12]),
    "top": np.array([0.0, 0.0, 1.0]),
    "tool": _DEFAULT_DIRECTION,
}
"""Directions from the target to the eye of the views by name."""


def look_at(
    robot: Robot,
    points: Array,
    eye: ArrayLike | str | None = None,
    target: ArrayLike | None = None,
    *,
    fit: bool = False,
) -> PageCommand:
    """Return the command that places the camera.

    A planar arm is seen along its joint axes, any other robot from its front and above.
    ``eye`` None: far enough to see all ``points``, (K, 3) [m]; ``fit``: only its
    direction. A name is one of `VIEWS`; the page has them all.
    """
    named = eye if isinstance(eye, str) else None
    if isinstance(eye, str):
        eye = None
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    center = middle if target is None or fit else np.asarray(target, float)
    direction = viewing_direction(robot, eye, center if target is None else target)
    stride = max(1, len(points) // _MAX_POINTS)
    view: dict[str, object] = {
        "points": points[::stride].tolist(),
        "radius": _THICKNESS * scene_size(points),
        "size": scene_size(points),
        "views": {name: _from(direction) for name, direction in VIEWS.items()},
        **_tool_of(robot),
        "view": named,
    }
    if eye is not None and not fit:
        view["eye"] = np.asarray(eye, float).tolist()
    else:
        view["direction"] = direction.tolist()
    return page_command(
        "camera",
        CAMERA,
        "camera",
        **view,
        target=center.tolist(),
        up=_up(direction),
        field_of_view=FIELD_OF_VIEW,
    )


def _from(direction: Array) -> Json:
    return {"direction": direction.tolist(), "up": _up(direction)}


def _up(direction: Array) -> list[float]:
    """Return the direction that is up in the picture."""
    steep = abs(direction[2]) > _COS_STEEP * np.linalg.norm(direction)
    return [0.0, 1.0, 0.0] if steep else [0.0, 0.0, 1.0]


def _tool_of(robot: Robot) -> Json:
    """Return the node of the joint that carries the end effector, and its point [m]."""
    frame = robot.model.frames[robot.frame_id(robot.end_effector)]
    joint = path_element(robot.model.names[frame.parentJoint])
    point = frame.placement.translation.tolist()
    return {"tool": f"/robot/{joint}", "tool_point": point}


def viewing_direction(
    robot: Robot, eye: ArrayLike | str | None, target: ArrayLike | None
) -> Array:
    """Return the direction from the target to the eye, shape (3,), not normalised."""
    if isinstance(eye, str):
        return VIEWS[eye]
    if eye is not None:
        return np.subtract(eye, np.zeros(3) if target is None else target)
    normal = plane_normal(robot)
    return _DEFAULT_DIRECTION if normal is None else normal


def right_direction(
    robot: Robot, eye: ArrayLike | str | None, target: ArrayLike | None
) -> Array:
    """Return the horizontal direction to the right in the picture, a unit vector."""
    direction = viewing_direction(robot, eye, target)
    right = np.array([-direction[1], direction[0], 0.0])
    length = float(np.linalg.norm(right))
    return right / length if length > 1e-6 else np.array([1.0, 0.0, 0.0])


def plane_normal(robot: Robot) -> Array | None:
    """Return the normal of a planar arm's plane, towards the eye; None if spatial."""
    if any(joint.nv != 1 for joint in list(robot.model.joints)[1:]):
        return None
    data = robot.model.createData()
    J = matrix_view(pin.computeJointJacobians(robot.model, data, robot.neutral()))
    turns = np.linalg.norm(J[3:], axis=0) > 0.5
    if not turns.any():
        return None
    normal = J[3:, turns][:, 0]
    parallel = np.abs(np.abs(normal @ J[3:, turns]) - 1.0) < 1e-9
    across = np.abs(normal @ J[:3, ~turns]) < 1e-9
    if not (parallel.all() and across.all()):
        return None
    # Seen from above; if the plane is vertical, with x or y to the right.
    towards = normal @ np.array([0.1, -1.0, 10.0])
    return np.asarray(normal if towards > 0.0 else -normal)
