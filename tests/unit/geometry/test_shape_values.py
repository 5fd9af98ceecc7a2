"""Shapes, obstacles and scenes are values; their refusals."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from pydantic import TypeAdapter
from values import assert_is_a_value

from hsp_control import Obstacle
from hsp_control.common.errors import HspControlError, SceneError
from hsp_control.declaration import Part
from hsp_control.declaration.families import value_fields
from hsp_control.geometry.scene import Scene
from hsp_control.geometry.shapes import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    HeightField,
    Mesh,
    PointCloud,
    Shape,
    Sphere,
    shape_from_log,
    shape_to_log,
)
from hsp_control.trajectories import Circle, Hold, Spin

HERE, THERE = Hold([0.4, 0.3, 0.5]), Circle(0.2, 1.5, [0.5, 0.0, 0.5])
TURNING = Spin([0.0, 0.6, 0.8], 1.0, rotation=(0.1, 0.2, 0.3))
BALL = Obstacle("ball", Sphere(0.1), HERE)
CRATE = Obstacle("crate", Box((0.2, 0.3, 0.4)), THERE, TURNING)
SHAPES: dict[str, Shape] = {
    "sphere": Sphere(0.1),
    "capsule": Capsule(0.1, 0.4),
    "cylinder": Cylinder(0.1, 0.4),
    "box": Box((0.1, 0.2, 0.3)),
    "plane": HalfSpace(),
    "mesh": Mesh(Path("parts/a.stl"), 1e-3, convex=True),
    "point_cloud": PointCloud([[0.0, 0.1, 0.2], [0.3, 0.4, 0.5]], 0.01),
    "height_field": HeightField((1.0, 2.0), [[0.0, 0.1, 0.2], [0.3, 0.4, 0.5]]),
}
VALUES: list[Part] = [*SHAPES.values(), BALL, CRATE, Scene(), Scene([BALL, CRATE])]


NAN = float("nan")
WRONG: list[tuple[type[Part], str, Any]] = [
    (Sphere, "radius", -0.1),
    (Sphere, "radius", NAN),
    (Sphere, "radius", float("inf")),
    (Sphere, "radius", True),
    (Capsule, "radius", 0.0),
    (Capsule, "length", -0.1),
    (Cylinder, "radius", 0.0),
    (Cylinder, "length", 0.0),
    (Box, "size", (0.1, 0.2)),
    (Box, "size", (0.1, 0.0, 0.2)),
    (Box, "size", 0.1),
    (Mesh, "file", 3),
    (Mesh, "scale", 0.0),
    (Mesh, "convex", "yes"),
    (PointCloud, "points", []),
    (PointCloud, "points", [[0.0, 0.0]]),
    (PointCloud, "points", [[0.0, 0.0, 0.0], [1.0]]),
    (PointCloud, "points", [[0.0, 0.0, NAN]]),
    (PointCloud, "resolution", 0.0),
    (HeightField, "size", (1.0,)),
    (HeightField, "size", (1.0, 0.0)),
    (HeightField, "heights", [[0.0, 0.0]]),
    (HeightField, "heights", [[0.0, 0.0], [0.0, 0.0, 0.0]]),
    (HeightField, "heights", [[0.0, 0.0], [0.0, float("inf")]]),
    (Obstacle, "name", ""),
    (Obstacle, "name", "two\nlines"),
    (Obstacle, "name", 3),
    (Obstacle, "shape", 0.1),
    (Obstacle, "shape", {"type": "sphere", "radius": -0.1}),
    (Obstacle, "center", [0.0, 0.0]),
    (Obstacle, "center", Hold([0.0, 0.0])),
    (Obstacle, "center", Hold()),
    (Obstacle, "center", Hold([0.0, 0.0, 0.0], origin="start")),
    (Obstacle, "orientation", HERE),
    (Scene, "obstacles", [BALL, BALL]),
    (Scene, "obstacles", [Sphere(0.1)]),
    (Scene, "obstacles", {"bell": BALL}),
    (Scene, "obstacles", 3),
]
VALID: dict[type[Part], dict[str, Any]] = {
    type(value): {f.name: getattr(value, f.name) for f in value_fields(value)}
    for value in VALUES
}


# --- values --------------------------------------------------------------------------


@pytest.mark.parametrize("value", VALUES, ids=lambda value: type(value).__name__)
def test_equality(value: Any) -> None:
    assert_is_a_value(value, globals())


@pytest.mark.parametrize(("cls", "field", "wrong"), WRONG)
def test_one_error_names_class_and_field(
    cls: type[Part], field: str, wrong: Any
) -> None:
    with pytest.raises(SceneError) as caught:
        cls(**{**VALID[cls], field: wrong})
    assert type(caught.value) is SceneError
    assert re.match(rf"{cls.__name__}: {field}[.:]", str(caught.value))
    assert "\n" not in str(caught.value)


# --- shapes --------------------------------------------------------------------------


def test_shapes_have_their_names_in_yaml() -> None:
    assert Shape.family is not None
    for name, shape in SHAPES.items():
        assert type(shape).yaml_type == name
        data = {"type": name, **shape_to_log(shape)}
        assert TypeAdapter(Shape).validate_python(data) == shape
    bundled = {n for n, c in Shape.family.members.items() if "hsp_control" in str(c)}
    assert bundled == set(SHAPES)


@pytest.mark.parametrize("shape", SHAPES.values(), ids=SHAPES)
def test_logs_describe_shapes(shape: Shape) -> None:
    """As JSON data: the class name and the fields."""
    about = json.loads(json.dumps(shape_to_log(shape)))
    assert shape_from_log(type(shape).__name__, about) == shape


# --- obstacles and scenes ------------------------------------------------------------


@pytest.mark.parametrize(("center", "message"), [
    (Hold([0.0, 0.0]), "its dimension is 2; needs 3 (x, y, z)"),
    (Hold(), "point is missing: nothing starts here"),
    (
        replace(THERE, origin="start"),
        "origin: start is not available here; use origin: world",
    ),
])  # fmt: skip
def test_centers_that_are_not_in_the_world(center: Any, message: str) -> None:
    with pytest.raises(SceneError) as caught:
        Obstacle("ball", Sphere(0.1), center)
    assert str(caught.value) == f"Obstacle: center: {message}"


def test_obstacles_in_yaml_are_named_by_their_keys() -> None:
    """Keys of a mapping are names, in Python too, and must agree with the
    obstacles'."""
    ball: dict[str, Any] = {
        "shape": {"type": "sphere", "radius": 0.1},
        "center": {"type": "hold", "point": [0.4, 0.3, 0.5]},
    }
    data = {"obstacles": {"ball": ball, "other": ball}}
    scene = TypeAdapter(Scene).validate_python(data)
    assert scene == Scene([BALL, replace(BALL, name="other")])
    assert "name" not in ball
    same: Any = {"ball": BALL}
    assert Scene(same) == Scene([BALL])
    flat: Any = {"ball": ball | {"center": {"type": "hold", "point": [0.0]}}}
    others: dict[str, Any] = {
        "'bell' has another name, 'ball'": {"bell": BALL},
        "unknown key 'name'; the key 'bell' is the name": {
            "bell": {"name": "ball", **ball}
        },
    }
    for message, other in others.items():
        with pytest.raises(HspControlError, match=message):
            Scene(other)
    with pytest.raises(SceneError, match=r"^Scene: obstacles\.ball\.center: its dim"):
        Scene(flat)
