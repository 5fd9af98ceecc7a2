"""Check that shapes, obstacles and scenes are values, and what they refuse."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter
from values import assert_documented, assert_is_a_value

from hsp_control import Obstacle
from hsp_control.common.exceptions import HspControlError, SceneError
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
from hsp_control.trajectories import Circle, Hold, HoldOrientation, Spin

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
CLASSES: list[type[Part]] = [
    *(type(shape) for shape in SHAPES.values()),
    Obstacle,
    Scene,
]

OTHERS: list[tuple[Part, str, Any]] = [
    (SHAPES["sphere"], "radius", 0.2),
    (SHAPES["capsule"], "radius", 0.2),
    (SHAPES["capsule"], "length", 0.0),
    (SHAPES["cylinder"], "radius", 0.2),
    (SHAPES["cylinder"], "length", 0.2),
    (SHAPES["box"], "size", (0.1, 0.2, 0.4)),
    (SHAPES["mesh"], "file", "a.stl"),
    (SHAPES["mesh"], "scale", 1.0),
    (SHAPES["mesh"], "convex", False),
    (SHAPES["point_cloud"], "points", [[0.0, 0.1, 0.2]]),
    (SHAPES["point_cloud"], "resolution", 0.02),
    (SHAPES["height_field"], "size", (1.0, 1.0)),
    (SHAPES["height_field"], "heights", np.zeros((2, 3))),
    (CRATE, "name", "box"),
    (CRATE, "shape", Capsule(0.1, 0.4)),
    (CRATE, "center", HERE),
    (CRATE, "orientation", HoldOrientation((0.0, 0.0, 0.1))),
    (Scene([BALL]), "obstacles", [CRATE]),
]
"""A value, one of its fields, and another value for the field."""

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
    (Obstacle, "center", [0.0, 0.0, 0.0]),
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
def test_what_is_equal(value: Any) -> None:
    assert_is_a_value(value, globals())


@pytest.mark.parametrize(("value", "field", "other"), OTHERS)
def test_what_differs(value: Any, field: str, other: Any) -> None:
    """Any one field makes a difference; the value itself stays."""
    before = repr(value)
    changed = replace(value, **{field: other})
    assert changed != value
    assert value == eval(before)
    assert len({value, changed, replace(value)}) == 2


def test_kinds_differ() -> None:
    assert Capsule(0.1, 0.4) != Cylinder(0.1, 0.4)
    assert HalfSpace() == HalfSpace()
    assert len(set(VALUES)) == len(VALUES)


@pytest.mark.parametrize(("cls", "field", "wrong"), WRONG)
def test_one_error_names_class_and_field(
    cls: type[Part], field: str, wrong: Any
) -> None:
    with pytest.raises(SceneError) as caught:
        cls(**{**VALID[cls], field: wrong})
    assert type(caught.value) is SceneError
    assert re.match(rf"{cls.__name__}: {field}[.:]", str(caught.value))
    assert "\n" not in str(caught.value)


def test_every_field_was_tried_and_is_documented_with_its_unit() -> None:
    for cls in CLASSES:
        assert_documented(cls)
        names = {field.name for field in value_fields(cls)}
        assert names == {field for c, field, _ in WRONG if c is cls}, cls
        assert names == {field for v, field, _ in OTHERS if type(v) is cls}, cls


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
    """By the name of the class and its fields, as JSON data."""
    about = json.loads(json.dumps(shape_to_log(shape)))
    assert shape_from_log(type(shape).__name__, about) == shape


@pytest.mark.parametrize("kind", ["", "Torus", "sphere", "Shape", "Obstacle"])
def test_logs_with_unknown_shapes(kind: str) -> None:
    assert shape_from_log(kind, {}) is None


def test_files_of_meshes(tmp_path: Path) -> None:
    """As text or as a path; relative ones begin at a folder."""
    assert Mesh("a/b.stl") == Mesh(Path("a") / "b.stl")
    assert Mesh("a.stl").file == "a.stl"
    mesh = Mesh("a.stl", 1e-3, convex=True)
    assert mesh.located(tmp_path) == Mesh(tmp_path / "a.stl", 1e-3, convex=True)
    assert mesh.located(".") == Mesh(Path.cwd() / "a.stl", 1e-3, convex=True)
    assert mesh.located(tmp_path).located("/elsewhere") == mesh.located(tmp_path)
    assert all(s.located(tmp_path) is s for s in SHAPES.values() if type(s) is not Mesh)


# --- obstacles and scenes ------------------------------------------------------------


def test_obstacles_stand_along_the_worlds_axes_by_default() -> None:
    place = BALL.placement(3.0)
    np.testing.assert_array_equal(place.rotation, np.eye(3))
    np.testing.assert_array_equal(place.translation, [0.4, 0.3, 0.5])
    assert BALL.orientation == HoldOrientation((0, 0, 0))


def test_orientations_without_a_rotation_begin_along_the_worlds_axes() -> None:
    """Nothing starts here, as a robot does; an obstacle is at home in the world."""
    crate = replace(CRATE, orientation=Spin([0.0, 0.0, 1.0], 2.0))
    assert crate.orientation == Spin([0.0, 0.0, 1.0], 2.0, rotation=np.eye(3))
    np.testing.assert_array_equal(crate.placement(0.0).rotation, np.eye(3))


@pytest.mark.parametrize(
    ("center", "message"),
    [
        (Hold([0.0, 0.0]), "its dimension is 2; needs 3 (x, y, z)"),
        (Hold(), "point is missing: nothing starts here"),
        (
            replace(THERE, origin="start"),
            "origin: start is not available here; use origin: world",
        ),
    ],
)
def test_centers_that_are_not_in_the_world(center: Any, message: str) -> None:
    with pytest.raises(SceneError) as caught:
        Obstacle("ball", Sphere(0.1), center)
    assert str(caught.value) == f"Obstacle: center: {message}"


def test_scenes_are_mappings_in_their_order() -> None:
    scene = Scene(each for each in (CRATE, BALL))
    assert list(scene) == ["crate", "ball"]
    assert dict(scene) == {"crate": CRATE, "ball": BALL}
    assert (len(scene), len(Scene())) == (2, 0)
    assert scene["ball"] is BALL
    assert "ball" in scene
    assert "bell" not in scene
    assert 3 not in scene  # type: ignore[comparison-overlap]
    assert scene != Scene([BALL, CRATE])  # the order is that of the log's columns
    assert Scene(scene.values()) == scene
    with pytest.raises(TypeError, match="item assignment"):
        scene["ball"] = BALL  # type: ignore[index]


def test_unknown_obstacles_are_named() -> None:
    with pytest.raises(SceneError) as caught:
        Scene([BALL, CRATE])["bell"]
    assert str(caught.value) == (
        "no obstacle 'bell'; did you mean 'ball'? (the scene has ball, crate)"
    )
    with pytest.raises(SceneError, match=r"no obstacle 'a' \(the scene has none\)"):
        Scene()["a"]


def test_obstacles_in_yaml_are_named_by_their_keys() -> None:
    """As are those of a mapping in Python, whose names must be the same."""
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
