"""Shapes of a robot's links and their placements."""

import logging
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin
import pytest
from clearance_cases import ends, outside, placed, turned
from loaded_robots import load
from odd_robots import FACES, OCTAHEDRON, collision, odd_robot, write_stl

from hsp_control import Obstacle
from hsp_control.common.errors import ModelError, SceneError
from hsp_control.geometry import link_shapes
from hsp_control.geometry.shapes import Box, Mesh, Sphere
from hsp_control.null_space.fields import ObstacleClearance, SelfClearance
from hsp_control.robot.description.mesh_files import find_problem
from hsp_control.trajectories import Hold


@pytest.mark.parametrize("name", ["panda", "iiwa14", "ur5"])
@pytest.mark.parametrize("proxy", ["meshes", "hulls"])
def test_shapes_hang_where_pinocchio_puts_them(name: str, proxy: str) -> None:
    """Also on the Panda, whose fingers are locked here and are joints in the URDF."""
    robot = load(name)
    shapes = link_shapes(robot, proxy)  # type: ignore[arg-type]
    source = robot.source
    full = pin.buildModelFromUrdf(str(source.urdf))
    kind, folders = pin.GeometryType.COLLISION, [str(f) for f in source.package_dirs]
    items = pin.buildGeomFromUrdf(full, str(source.urdf), kind, package_dirs=folders)
    q = robot.random_configuration(np.random.default_rng(1))
    at = pin.neutral(full)
    for joint in robot.joint_names:
        index = full.joints[full.getJointId(joint)].idx_q
        at[index] = q[robot.joints[joint].idx_q]
    data, placements = full.createData(), pin.GeometryData(items)
    pin.updateGeometryPlacements(full, data, items, placements, at)
    assert len(shapes) == items.ngeoms
    for shape, item, own, theirs in zip(
        shapes, items.geometryObjects, placed(robot, shapes, q), placements.oMg,
        strict=True,
    ):  # fmt: skip
        assert shape.link == full.frames[item.parentFrame].name
        np.testing.assert_allclose(own.homogeneous, theirs.homogeneous, atol=1e-12)


def test_a_capsule_is_a_shape_and_what_is_none_leaves_the_others(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    """The parser would drop all shapes of the link."""
    robot = odd_robot(
        tmp_path,
        collision('<ellipsoid size="0.1 0.1 0.2"/>')
        + collision("<sphere/>")
        + collision('<capsule radius="0.04" length="0.3"/>')
        + collision('<box size="0.2 0.3 0.1"/>'),
    )
    with caplog.at_level(logging.WARNING):
        capsule, box = link_shapes(robot, "meshes")
    assert (capsule.geometry.radius, capsule.geometry.halfLength) == (0.04, 0.15)
    assert isinstance(box.geometry, coal.Box)
    assert "of 1 links cannot be read, which distances therefore" in caplog.text
    assert f"{capsule.link!r} (<ellipsoid> is none of <box>, <cylinder>" in caplog.text
    assert capfd.readouterr().err == ""


def test_boxes_lone_cylinders_and_balls(tmp_path: Path) -> None:
    """A box's corners are enclosed; a cylinder gets end balls; a ball is unchanged."""
    robot = odd_robot(
        tmp_path,
        collision('<box size="0.2 0.3 0.1"/>')
        + collision('<cylinder radius="0.04" length="0.3"/>')
        + collision('<sphere radius="0.07"/>')
        # Not closed: these balls are no part of the cylinder above.
        + collision('<sphere radius="0.04"/>', "0.1 0.02 0.3"),
    )
    box, cylinder, ball, other = link_shapes(robot)
    own = pin.SE3(turned(0.3, -0.2, 1.0), np.array([0.1, 0.02, -0.03]))
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    points = np.array([own.act(p) for p in 0.5 * signs * [0.2, 0.3, 0.1]])
    assert abs(outside(points, *ends(box))) < 1e-6
    first, second, radius = ends(cylinder)
    assert radius == 0.04
    np.testing.assert_allclose(
        [first, second],
        [own.act(np.array([0.0, 0.0, z])) for z in (-0.15, 0.15)],
        atol=1e-15,
    )
    assert isinstance(ball.geometry, coal.Sphere)
    assert isinstance(other.geometry, coal.Sphere)
    assert (ball.geometry.radius, other.geometry.radius) == (0.07, 0.04)


def test_a_mesh_of_the_robots_own_that_cannot_be_read(tmp_path: Path) -> None:
    robot = odd_robot(tmp_path, collision('<mesh filename="nowhere.stl"/>'))
    with pytest.raises(
        ModelError, match=r"odd\.urdf: a collision mesh: .*nowhere\.stl"
    ):
        link_shapes(robot)
    (tmp_path / "octa.stl").write_bytes(b"not a mesh at all")
    robot = odd_robot(tmp_path, collision(f'<mesh filename="{tmp_path}/octa.stl"/>'))
    with pytest.raises(
        ModelError,
        match=r"odd\.urdf: a collision mesh: .*octa\.stl: .* STL ",
    ):
        link_shapes(robot)
    write_stl(tmp_path / "octa.stl", OCTAHEDRON, FACES)
    (capsule,) = link_shapes(robot)
    own = pin.SE3(turned(0.3, -0.2, 1.0), np.array([0.1, 0.02, -0.03]))
    points = np.array([own.act(p) for p in OCTAHEDRON])
    assert abs(outside(points, *ends(capsule))) < 1e-6  # stored in single precision


@pytest.mark.parametrize(
    ("ending", "heading"),
    [
        (
            "ply",
            "ply\nformat ascii 1.0\nelement vertex {}\nelement face 1\nend_header\n",
        ),
        ("off", "OFF\n# a comment\n{} 1 0\n"),
    ],
)
def test_a_mesh_that_declares_more_than_it_has(
    ending: str, heading: str, tmp_path: Path
) -> None:
    """Assimp would read so many elements for hours."""
    file = tmp_path / f"endless.{ending}"
    file.write_text(heading.format(3))
    assert not find_problem(file)
    file.write_text(heading.format(99999999999))
    robot = odd_robot(tmp_path, collision(f'<mesh filename="{file.name}"/>'))
    with pytest.raises(ModelError, match=rf"{file.name}: .*\b100000000000\b"):
        link_shapes(robot)


FLAT = {
    "triangle": (OCTAHEDRON[[0, 2, 4]], [(0, 1, 2)]),
    "rectangle": (np.eye(4, 3) * [0.1, 0.2, 0.0] + [0, 0, 0.1], [(0, 1, 3), (0, 3, 1)]),
    "needle": (np.outer(np.arange(5.0), [0.1, 0.0, 0.0]), [(0, 1, 2), (2, 3, 4)]),
}


@pytest.mark.slow
@pytest.mark.parametrize("proxy", ["capsules", "spheres", "hulls", "meshes"])
@pytest.mark.parametrize("which", FLAT)
def test_flat_meshes_are_links_too(which: str, proxy: Any, tmp_path: Path) -> None:
    """Flat meshes have no hull (Coal ends the process there); a capsule encloses
    them."""
    vertices, triangles = FLAT[which]
    write_stl(tmp_path / "flat.stl", vertices, triangles)
    robot = odd_robot(tmp_path, collision('<mesh filename="flat.stl"/>'))
    shapes = link_shapes(robot, proxy)
    own = pin.SE3(turned(0.3, -0.2, 1.0), np.array([0.1, 0.02, -0.03]))
    points = np.array([own.act(p) for p in vertices[np.unique(triangles)]])
    if proxy == "capsules":
        assert abs(outside(points, *ends(shapes[0]))) < 1e-6
    elif proxy == "spheres":
        assert len(shapes) <= 101
        gaps = [
            np.linalg.norm(points - b.placement.translation, axis=1) - b.geometry.radius
            for b in shapes
        ]
        assert np.min(gaps, axis=0).max() < 1e-6
    ball = Obstacle("ball", Sphere(0.05), Hold(own.act(np.array([0.0, 0.0, 0.9]))))
    field = ObstacleClearance([ball], proxy=proxy)
    state = robot.state(0.0, robot.neutral(), np.zeros(2))
    assert 0.3 < field.minimum_distance(state) < 0.9


def test_meshes_without_a_place_or_a_hull(tmp_path: Path) -> None:
    file = write_stl(tmp_path / "odd.stl", OCTAHEDRON * [np.nan, 1.0, 1.0], FACES)
    robot = odd_robot(tmp_path, collision('<mesh filename="odd.stl"/>'))
    message = r"odd\.stl contains NaN or inf$"
    for proxy in ("capsules", "meshes"):
        with pytest.raises(
            ModelError, match=rf"odd\.urdf: a collision mesh: .*{message}"
        ):
            link_shapes(robot, proxy)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match=message):
        Mesh(file).geometry()
    write_stl(file, *FLAT["triangle"])
    Mesh(file).geometry()
    with pytest.raises(SceneError, match=r"is flat and has no convex hull; use conv"):
        Mesh(file, convex=True).geometry()


def test_a_robot_without_geometry_gets_capsules_and_one_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """From joint to joint, and a ball at the last; logged once for all fields."""
    robot = odd_robot(tmp_path)
    rounded = Obstacle("ball", Sphere(0.1), Hold([1.0, 0.0, 0.0]))
    flat = Obstacle("box", Box((0.1, 0.1, 0.1)), Hold([-1.0, 0.0, 0.0]))
    state = robot.state(0.0, robot.neutral(), np.zeros(2))
    with caplog.at_level(logging.WARNING):
        stand, arm, hand = link_shapes(robot)
        ObstacleClearance([rounded, flat]).value(state)
        SelfClearance().value(state)
    assert [record.getMessage() for record in caplog.records] == [
        "odd has no collision geometry: using capsules of radius 0.05 m between its "
        "joints"
    ]
    assert (stand.link, stand.joint, arm.link, arm.joint) == ("universe", 0, "turn", 1)
    np.testing.assert_allclose(ends(stand)[:2], [[0, 0, 0], [0, 0, 0.3]], atol=1e-15)
    np.testing.assert_allclose(ends(arm)[:2], [[0, 0, 0], [0.4, 0, 0]], atol=1e-15)
    assert (hand.link, hand.joint, hand.geometry.radius) == ("bend", 2, 0.05)
    np.testing.assert_array_equal(hand.placement.homogeneous, np.eye(4))
