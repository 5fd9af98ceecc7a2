"""Check that wrong shapes, obstacles and starts in contact are refused by name."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from clearance_cases import AIR, load, still
from odd_robots import collision, odd_robot

from hsp_control import (
    Obstacle,
    Scene,
    load_experiment,
)
from hsp_control.common.exceptions import (
    FieldError,
    HspControlError,
    ModelError,
    SceneError,
)
from hsp_control.geometry import Proximity, link_shapes
from hsp_control.geometry.shapes import (
    Box,
    Capsule,
    Cylinder,
    HeightField,
    Mesh,
    PointCloud,
    Sphere,
)
from hsp_control.null_space.fields import (
    ObstacleClearance,
    SelfClearance,
)
from hsp_control.trajectories import (
    Hold,
)

pytestmark = pytest.mark.filterwarnings("error")


BALL = Obstacle("ball", Sphere(0.1), Hold([0.5, 0.3, 0.5]))
MISTAKES: list[tuple[Callable[[Path], Any], type[HspControlError], str]] = [
    (lambda _: ObstacleClearance(load("panda"), []), FieldError,
     "field 'obstacle_clearance' needs at least one obstacle"),
    (lambda _: ObstacleClearance(load("panda"), [BALL], influence=0.0), FieldError,
     "field 'obstacle_clearance': influence 0.0 must be positive"),
    (lambda _: ObstacleClearance(load("panda"), [BALL], influence=-1.0), FieldError,
     "influence -1.0 must be positive"),
    (lambda _: SelfClearance(load("panda"), influence=float("nan"), name="mine"),
     FieldError, "field 'mine': influence nan must be positive"),
    (lambda _: SelfClearance(load("panda"), influence=float("inf")), FieldError,
     "influence inf must be positive"),
    (lambda _: ObstacleClearance(load("panda"), [BALL], links=["panda_lnk3"]),
     FieldError, "field 'obstacle_clearance': link 'panda_lnk3' has no geometry; did "
     "you mean 'panda_link3'? (links with geometry: panda_link0, panda_link1, "),
    (lambda _: ObstacleClearance(load("panda"), [BALL], links=["panda_link0"]),
     FieldError, "there are no pairs of shapes to keep apart"),
    (lambda _: ObstacleClearance(load("panda"), [BALL], links=[]), FieldError,
     "there are no pairs of shapes to keep apart"),
    (lambda _: Proximity(load("panda"), link_shapes(load("panda")), [], []), FieldError,
     "there are no pairs of shapes to keep apart"),
    (lambda at: SelfClearance(odd_robot(at, collision('<sphere radius="1"/>'))),
     FieldError, "there are no pairs of shapes to keep apart"),
    (lambda _: ObstacleClearance(load("panda"), [BALL], proxy="boxes"),  # type: ignore[arg-type]
     ModelError, "proxy 'boxes' is not one of capsules, spheres, hulls, meshes"),
    (lambda at: ObstacleClearance(
        load("panda"), [Obstacle("it", Mesh(at / "no.stl"), AIR)]),
     SceneError, "/no.stl"),
    (lambda at: Mesh(at / "no.stl").geometry(), SceneError, "mesh: no such file "),
    (lambda at: Mesh(at).geometry(), SceneError, "mesh: no such file "),
    (lambda at: Mesh(junk(at)).geometry(), SceneError, "mesh: cannot read "),
    (lambda at: Mesh(junk(at)).bounding_radius, SceneError, "junk.stl: "),
    (lambda at: Mesh(at / "a.stl", scale=0.0), SceneError,
     "mesh: scale is 0.0; must be greater than 0"),
    (lambda _: Sphere(-0.1), SceneError, "sphere: radius is -0.1; must be at least 0"),
    (lambda _: Sphere(float("nan")), SceneError, "sphere: radius is nan"),
    (lambda _: Sphere(float("inf")), SceneError, "sphere: radius is inf"),
    (lambda _: Capsule(0.0, 0.1), SceneError,
     "capsule: radius is 0.0; must be greater than 0"),
    (lambda _: Capsule(0.1, -0.1), SceneError,
     "capsule: length is -0.1; must be at least 0"),
    (lambda _: Cylinder(0.1, 0.0), SceneError, "cylinder: length is 0.0"),
    (lambda _: Box((0.1, 0.2)), SceneError, "box: size is [0.1, 0.2]; needs 3 lengths"),  # type: ignore[arg-type]
    (lambda _: Box((0.1, 0.0, 0.2)), SceneError, "box: y is 0.0; must be greater"),
    (lambda _: PointCloud([]), SceneError,
     "point cloud: needs one or more points of 3 finite numbers"),
    (lambda _: PointCloud(np.zeros((0, 3))), SceneError, "one or more points"),  # type: ignore[arg-type]
    (lambda _: PointCloud([[0.0, 0.0]]), SceneError, "points of 3 finite numbers"),
    (lambda _: PointCloud([[0.0, 0.0, 0.0], [1.0]]), SceneError,
     "points of 3 finite numbers"),
    (lambda _: PointCloud([[0.0, 0.0, np.nan]]), SceneError,
     "points of 3 finite numbers"),
    (lambda _: PointCloud([[0.0, 0.0, 0.0]], 0.0), SceneError, "resolution is 0.0"),
    (lambda _: HeightField((1.0, 0.0), [[0, 0], [0, 0]]), SceneError,
     "heightfield: y is 0.0; must be greater than 0"),
    (lambda _: HeightField((1.0,), [[0, 0], [0, 0]]), SceneError,  # type: ignore[arg-type]
     "height field: size is [1.0]; needs 2 lengths"),
    (lambda _: HeightField((1.0, 1.0), [[0, 0]]), SceneError,
     "height field: heights must be at least 2 rows of 2 finite numbers"),
    (lambda _: HeightField((1.0, 1.0), [[0, 0], [0]]), SceneError,
     "height field: its rows have different lengths"),
    (lambda _: HeightField((1.0, 1.0), [[0, 0], [0, float("inf")]]), SceneError,
     "height field: heights must"),
    (lambda _: Obstacle("it", Sphere(0.1), Hold([0.0, 0.0])), SceneError,
     "obstacle 'it': its centre has dimension 2; needs 3 (x, y, z)"),
    (lambda _: Scene([BALL, BALL]), SceneError, "two obstacles have the name 'ball'"),
    (lambda _: Scene([BALL])["bell"], SceneError,
     "no obstacle 'bell'; did you mean 'ball'? (the scene has ball)"),
]  # fmt: skip


def junk(folder: Path) -> Path:
    """Write a file that is no mesh."""
    file = folder / "junk.stl"
    file.write_bytes(b"solid nothing\nendsolid nothing\n")
    return file


@pytest.mark.parametrize(
    ("make", "error", "message"), MISTAKES, ids=[m[2][:40] for m in MISTAKES]
)
def test_every_mistake_is_named(
    make: Callable[[Path], Any],
    error: type[HspControlError],
    message: str,
    tmp_path: Path,
) -> None:
    with pytest.raises(error) as caught:
        make(tmp_path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


TOUCHING = {
    "robot": {"name": "panda"},
    "tasks": {"hand": {"type": "frame_position", "trajectory": {"type": "hold"}}},
    "scene": {
        "obstacles": {
            "ball": {
                "shape": {"type": "sphere", "radius": 0.1},
                "center": {"type": "hold", "point": [0.2, 0.0, 0.7]},
            }
        }
    },
    "null_space": {"fields": [{"type": "obstacle_clearance"}]},
    "simulation": {"duration": 0.02},
}


def test_a_start_in_contact_is_refused_where_the_configuration_says_so() -> None:
    """A barrier cannot push out what is inside already; the pair and depth are said."""
    with pytest.raises(SceneError) as caught:
        load_experiment(TOUCHING)
    robot = load("panda")
    ball = Obstacle("ball", Sphere(0.1), Hold([0.2, 0.0, 0.7]))
    field = ObstacleClearance(robot, [ball])
    d, pair = field.proximity.nearest(still(robot))
    assert d < 0.0
    assert str(caught.value).endswith(
        f"null_space.fields.0: the robot starts in contact: {pair}, {-d:.3g} m deep; "
        "change the start or move the obstacle"
    )
    assert "to ball" in pair
    apart = json.loads(
        json.dumps(TOUCHING).replace("[0.2, 0.0, 0.7]", "[0.2, 0.3, 0.7]")
    )
    assert load_experiment(apart).run().status == "completed"


def test_a_start_in_contact_with_itself_is_refused() -> None:
    fields = [{"type": "self_clearance"}]
    folded = {
        "joints": {"panda_joint2": 1.7, "panda_joint4": -3.0, "panda_joint6": 0.0}
    }
    data = TOUCHING | {"null_space": {"fields": fields}, "start": folded}
    with pytest.raises(
        SceneError, match=r"the robot starts in contact: panda_\w+ to panda_\w+, "
    ):
        load_experiment(data)
