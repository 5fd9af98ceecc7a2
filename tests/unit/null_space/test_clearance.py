"""Clearance: distances in closed form, exact gradients and rates, the right pairs.

The oracles are points, segments and boxes by hand, differences of fourth order or more,
and Pinocchio's own Jacobians; the last word is the closed loop, where ‖e_N‖ may only
follow exp(-K_N t) if the field's rate holds everything that moves.
"""

import json
import logging
import struct
from collections.abc import Callable, Iterable
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from oracles import gradient, slope

from hsp_control import (
    Controller,
    Cost,
    Dop853,
    FramePosition,
    Gains,
    IdentityMetric,
    Obstacle,
    Rk4,
    Robot,
    Scene,
    load_experiment,
    simulate,
)
from hsp_control.common.exceptions import (
    FieldError,
    HspControlError,
    ModelError,
    SceneError,
)
from hsp_control.common.resources import bundled_robots
from hsp_control.geometry import LinkShape, Proximity, link_shapes, self_pairs
from hsp_control.geometry.capsule_fit import enclosing_capsule
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
)
from hsp_control.null_space.fields import (
    FieldSample,
    ObstacleClearance,
    SelfClearance,
)
from hsp_control.null_space.fields.barrier import CORE, barrier
from hsp_control.null_space.metrics import MetricSample
from hsp_control.robot.integrators import Integrator
from hsp_control.trajectories import (
    Hold,
    HoldOrientation,
    Lissajous,
    Spin,
    Trajectory,
    UniformLine,
)

pytestmark = pytest.mark.filterwarnings("error")
Array = NDArray[np.float64]


@cache
def load(name: str) -> Robot:
    """Return a robot; skip if example-robot-data is asked for and not there."""
    if name not in bundled_robots():
        pytest.importorskip("example_robot_data")
    return Robot.load(name)


def still(robot: Robot) -> Any:
    """Return the robot's state at home, at rest."""
    return robot.state(0.0, robot.home(), np.zeros(robot.nv))


def turned(*rpy: float) -> Array:
    """Return a rotation from roll, pitch and yaw."""
    return np.asarray(pin.rpy.rpyToMatrix(*rpy))


# -- the barrier -----------------------------------------------------------------------


def barrier_at(d: float, influence: float) -> tuple[float, float, float]:
    """Return b, b' and b'' at one distance."""
    slopes, bends = np.full(1, np.nan), np.full(1, np.nan)
    value = barrier(np.array([d]), influence, slopes, bends)
    return float(value), float(slopes[0]), float(bends[0])


@given(
    s=st.floats(-2.0, 1.5),
    influence=st.floats(0.01, 10.0),
)
def test_barrier_is_its_formula_and_its_own_derivatives(
    s: float, influence: float
) -> None:
    """-(1 - s)² ln s above the core, a parabola with the same tangent below.

    Differences of sixth order over a hundredth of the distance to where the formula
    changes; at the change itself the next test looks.
    """
    value, first, second = barrier_at(s * influence, influence)
    s = s * influence / influence
    if s >= 1.0:
        assert (value, first, second) == (0.0, 0.0, 0.0)
        return
    at = max(s, CORE)
    b = -((1.0 - at) ** 2) * np.log(at)
    b1 = 2.0 * (1.0 - at) * np.log(at) - (1.0 - at) ** 2 / at
    b2 = -2.0 * np.log(at) + 4.0 * (1.0 - at) / at + ((1.0 - at) / at) ** 2
    down = s - at
    expected = [b + b1 * down + 0.5 * b2 * down**2, b1 + b2 * down, b2]
    np.testing.assert_allclose(
        [value, first * influence, second * influence**2], expected, rtol=1e-13
    )
    step = 0.01 * min(abs(s - CORE), 1.0 - s, max(s, 0.1))
    if step > 1e-6:
        rise = slope(lambda x: barrier_at((s + x) * influence, influence)[0], step)
        bend = slope(lambda x: barrier_at((s + x) * influence, influence)[1], step)
        assert rise / influence == pytest.approx(first, rel=1e-7, abs=1e-7 / influence)
        assert bend / influence == pytest.approx(second, rel=1e-7, abs=1e-6 / influence)


@pytest.mark.parametrize("edge", [1.0, CORE])
@pytest.mark.parametrize("influence", [0.05, 1.0, 3.0])
def test_barrier_is_twice_continuously_differentiable(
    edge: float, influence: float
) -> None:
    """Across an edge, b, b' and b'' change by no more than their own slopes allow."""
    tiny = 1e-7
    below = np.array(barrier_at((edge - tiny) * influence, influence))
    above = np.array(barrier_at((edge + tiny) * influence, influence))
    units = influence ** np.array([0.0, 1.0, 2.0])
    # b''' is at most 6 at the influence, and 2/s³ + 4/s² + ... = 2.6e5 at the core.
    steepest = np.array([60.0, 3e3, 3e5]) if edge < 1.0 else np.array([1e-6, 1e-6, 7.0])
    assert (np.abs(above - below) * units <= steepest * 2.0 * tiny).all()


def test_barrier_grows_on_towards_contact_and_beyond() -> None:
    """b falls and is convex in d everywhere within its influence, finite in depth."""
    d = np.linspace(-1.0, 0.999, 4000)
    slopes, bends = np.zeros((2, len(d)))
    total = barrier(d, 1.0, slopes, bends)
    assert np.isfinite(total)
    assert (slopes < 0.0).all()
    assert (bends > 0.0).all()
    assert total == pytest.approx(sum(barrier_at(x, 1.0)[0] for x in d), rel=1e-13)


# -- capsules around points ------------------------------------------------------------


def outside(points: Array, first: Array, second: Array, radius: float) -> float:
    """Return by how much the farthest point stands out of a capsule."""
    along = second - first
    square = float(along @ along)
    s = (points - first) @ along / square if square > 0.0 else np.zeros(len(points))
    on_axis = first + np.clip(s, 0.0, 1.0)[:, None] * along
    return float(np.linalg.norm(points - on_axis, axis=1).max()) - radius


def volume(first: Array, second: Array, radius: float) -> float:
    """Return a capsule's volume."""
    length = float(np.linalg.norm(second - first))
    return np.pi * radius**2 * (length + 4.0 / 3.0 * radius)


@settings(max_examples=40)
@given(
    cloud=st.integers(1, 12).flatmap(
        lambda k: arrays(float, (k, 3), elements=st.integers(-8, 8).map(float))
    ),
    scale=st.sampled_from([0.01, 1.0, 30.0]),
)
def test_capsule_holds_every_point_and_is_no_larger_than_a_ball(
    cloud: Array, scale: float
) -> None:
    """Whatever the cloud: one point, equal ones, on a line, in a plane.

    The ball is the one about the points' mean.
    """
    points = scale * cloud
    first, second, radius = enclosing_capsule(points)
    assert outside(points, first, second, radius) <= 1e-9 * scale
    ball = float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())
    assert volume(first, second, radius) <= volume(first, first, ball) + 1e-9 * scale**3


@pytest.mark.parametrize("length", [0.0, 0.02, 0.1, 0.5])
def test_known_capsules_are_found_again(length: float) -> None:
    """Points on a capsule's surface, with rings where cylinder and caps meet.

    Polygons of 24 corners bound the ring's radius from below by cos(π/24) = 0.9914, and
    the search stops at 1e-5 of the size.
    """
    R, center, radius = turned(0.5, -1.1, 2.0), np.array([0.3, -0.2, 0.7]), 0.06
    turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    rise = np.linspace(0.0, 0.5 * np.pi, 7)
    surface = []
    for side in (-1.0, 1.0):
        for angle in rise:
            z = np.full(24, side * (0.5 * length + radius * np.sin(angle)))
            ring = radius * np.cos(angle)
            surface.append(np.stack([ring * np.cos(turn), ring * np.sin(turn), z], 1))
    points = center + np.concatenate(surface) @ R.T
    first, second, found = enclosing_capsule(points)
    assert outside(points, first, second, found) <= 1e-12
    exact = volume(np.zeros(3), np.array([0.0, 0.0, length]), radius)
    assert 0.97 * exact < volume(first, second, found) <= exact * (1.0 + 1e-4)
    if length > 0.1:
        assert abs((second - first) @ R[:, 2]) / length == pytest.approx(1.0, abs=0.01)
        assert found == pytest.approx(radius, rel=0.01)


# -- what stands for the links ---------------------------------------------------------


def placed(robot: Robot, shapes: Iterable[LinkShape], q: Array) -> list[pin.SE3]:
    """Return where shapes are in the world, by plain Pinocchio."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    return [data.oMi[shape.joint] * shape.placement for shape in shapes]


def numbers(element: ElementTree.Element | None, key: str) -> Array:
    """Return an attribute's three numbers, zeros where it is not written."""
    text = element.get(key) if element is not None else None
    return np.array([float(x) for x in (text or "0 0 0").split()])


@pytest.mark.parametrize(
    ("name", "count"), [("panda", 13), ("iiwa14", 9), ("planar3r", 3)]
)
def test_a_cylinder_and_two_balls_become_one_capsule(name: str, count: int) -> None:
    """The URDF's triples, read as XML: same link, size, place and direction."""
    robot = load(name)
    capsules = link_shapes(robot)
    assert len(capsules) == count
    left = list(zip(capsules, placed(robot, capsules, robot.home()), strict=True))
    state = still(robot)
    for link in ElementTree.parse(robot.source.urdf).iter("link"):
        for item in link.iter("collision"):
            cylinder, origin = item.find("geometry/cylinder"), item.find("origin")
            if cylinder is None:
                continue
            frame = state.frame(str(link.get("name")))
            center = frame.position + frame.rotation @ numbers(origin, "xyz")
            axis = frame.rotation @ turned(*numbers(origin, "rpy"))[:, 2]
            (match,) = (
                (shape, place)
                for shape, place in left
                if shape.link == link.get("name")
                and isinstance(shape.geometry, coal.Capsule)
                and np.linalg.norm(place.translation - center) < 1e-12
            )
            left.remove(match)
            shape, place = match
            assert shape.geometry.radius == float(cylinder.get("radius", ""))
            assert 2.0 * shape.geometry.halfLength == float(cylinder.get("length", ""))
            assert abs(place.rotation[:, 2] @ axis) == pytest.approx(1.0, abs=1e-12)
    assert not left  # and nothing else


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


def corners(shape: LinkShape) -> Array:
    """Return a mesh's or a box's vertices in the joint's frame."""
    if isinstance(shape.geometry, coal.Box):
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        vertices = signs * shape.geometry.halfSide
    else:
        vertices = np.array(shape.geometry.vertices())
    return vertices @ shape.placement.rotation.T + shape.placement.translation


def ends(shape: LinkShape) -> tuple[Array, Array, float]:
    """Return a capsule's or a ball's ends in the joint's frame, and its radius."""
    half = getattr(shape.geometry, "halfLength", 0.0) * shape.placement.rotation[:, 2]
    center = shape.placement.translation
    return center - half, center + half, float(shape.geometry.radius)


def test_capsules_hold_every_vertex_of_a_mesh() -> None:
    """The UR5's links, more tightly than a ball about their mean.

    Capsules are therefore also on the safe side of distances to the meshes.
    """
    robot = load("ur5")
    meshes, capsules = link_shapes(robot, "meshes"), link_shapes(robot)
    assert len(meshes) == len(capsules) == 8  # seven meshes and a box
    for mesh, capsule in zip(meshes, capsules, strict=True):
        assert (mesh.link, mesh.joint) == (capsule.link, capsule.joint)
        points = corners(mesh)
        assert -0.005 < outside(points, *ends(capsule)) <= 1e-9
        ball = float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())
        share = volume(*ends(capsule)) / volume(points[0], points[0], ball)
        assert share < (1.0 + 1e-9 if len(points) == 8 else 0.9)  # a cube's is a ball
    obstacle = Obstacle("ball", Sphere(0.05), Hold([0.4, 0.3, 0.5]))
    both = [
        ObstacleClearance(robot, [obstacle], proxy=proxy)  # type: ignore[arg-type]
        for proxy in ("capsules", "meshes")
    ]
    rng = np.random.default_rng(2)
    for _ in range(20):
        state = robot.state(0.0, robot.random_configuration(rng), np.zeros(6))
        safe, true = (field.least_distance(state) for field in both)
        assert true - 0.15 < safe <= true + 1e-6


def test_hulls_are_the_meshes_hulls() -> None:
    """Convex, and as wide as the mesh in every direction."""
    robot = load("ur5")
    rng = np.random.default_rng(15)
    directions = rng.normal(size=(50, 3))
    meshes, hulls = link_shapes(robot, "meshes"), link_shapes(robot, "hulls")
    for mesh, hull in zip(meshes, hulls, strict=True):
        np.testing.assert_array_equal(
            mesh.placement.homogeneous, hull.placement.homogeneous
        )
        if isinstance(mesh.geometry, coal.Box):
            assert isinstance(hull.geometry, coal.Box)
            continue
        assert isinstance(hull.geometry, coal.Convex)
        of_mesh = np.array(mesh.geometry.vertices()) @ directions.T
        of_hull = np.array(hull.geometry.points()) @ directions.T
        np.testing.assert_allclose(of_hull.max(axis=0), of_mesh.max(axis=0), atol=1e-9)


@pytest.mark.parametrize("name", ["panda", "iiwa14", "ur5"])
def test_beads_cover_their_capsule_and_stand_out_little(name: str) -> None:
    """No farther apart than the radius r: the cover is √1.25 r thick at the most."""
    robot = load(name)
    rng = np.random.default_rng(3)
    capsules, beads = link_shapes(robot), link_shapes(robot, "spheres")
    assert all(isinstance(bead.geometry, coal.Sphere) for bead in beads)
    assert len(beads) > 2 * len(capsules)
    owned = 0
    for capsule in capsules:
        first, second, radius = ends(capsule)
        axis = second - first
        own = [
            bead
            for bead in beads
            if bead.joint == capsule.joint
            and abs(outside(bead.placement.translation[None], first, second, 0.0))
            < 1e-9
            and radius - 1e-12 <= bead.geometry.radius <= np.sqrt(1.25) * radius + 1e-12
        ]
        owned += len(own)
        u = rng.normal(size=(400, 3))
        u /= np.linalg.norm(u, axis=1)[:, None]
        along = np.where(u @ axis > 0.0, 1.0, 0.0)  # caps, then the side
        side = rng.uniform(size=400) < 0.5
        across = u - np.outer(u @ axis, axis) / max(float(axis @ axis), 1e-30)
        across /= np.linalg.norm(across, axis=1)[:, None]
        along[side] = rng.uniform(size=side.sum())
        surface = (
            first + along[:, None] * axis + radius * np.where(side[:, None], across, u)
        )
        reach = np.stack(
            [
                np.linalg.norm(surface - bead.placement.translation, axis=1)
                - bead.geometry.radius
                for bead in own
            ]
        )
        assert reach.min(axis=0).max() <= 1e-12, capsule.link
    assert owned >= len(beads)


ONE_LINK = """<robot name="odd">
  <link name="base">{base}</link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
  <link name="arm">{inertial}{arm}</link>
  <joint name="bend" type="revolute">
    <parent link="arm"/><child link="hand"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
  <link name="hand">{inertial}</link>
</robot>"""
INERTIAL = (
    '<inertial><origin xyz="0.1 0.1 0"/><mass value="1"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def collision(
    geometry: str, xyz: str = "0.1 0.02 -0.03", rpy: str = "0.3 -0.2 1"
) -> str:
    """Return a URDF's collision element."""
    return (
        f'<collision><origin xyz="{xyz}" rpy="{rpy}"/>'
        f"<geometry>{geometry}</geometry></collision>"
    )


def odd_robot(folder: Path, arm: str = "", base: str = "") -> Robot:
    """Return a robot of two links with the given geometry."""
    file = folder / "odd.urdf"
    file.write_text(ONE_LINK.format(base=base, arm=arm, inertial=INERTIAL))
    return Robot.load(file)


def test_boxes_lone_cylinders_and_balls(tmp_path: Path) -> None:
    """A box's corners are held; a cylinder without balls gets them; a ball stays."""
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


def write_stl(
    file: Path, vertices: Array, triangles: list[tuple[int, int, int]]
) -> Path:
    """Write a binary STL."""
    body = b"".join(
        struct.pack("<12fH", 0, 0, 0, *np.asarray(vertices)[list(t)].ravel(), 0)
        for t in triangles
    )
    file.write_bytes(bytes(80) + struct.pack("<I", len(triangles)) + body)
    return file


OCTAHEDRON = np.array(
    [
        [0.2, 0, 0],
        [-0.2, 0, 0],
        [0, 0.15, 0],
        [0, -0.15, 0],
        [0, 0, 0.25],
        [0, 0, -0.25],
    ]
)
FACES = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4),
         (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]  # fmt: skip


def test_a_mesh_of_the_robots_own_that_cannot_be_read(tmp_path: Path) -> None:
    robot = odd_robot(tmp_path, collision('<mesh filename="nowhere.stl"/>'))
    with pytest.raises(
        ModelError, match=r"odd\.urdf: a collision mesh: .*nowhere\.stl"
    ):
        link_shapes(robot)
    (tmp_path / "octa.stl").write_bytes(b"not a mesh at all")
    robot = odd_robot(tmp_path, collision(f'<mesh filename="{tmp_path}/octa.stl"/>'))
    with pytest.raises(ModelError, match=r"odd\.urdf: a collision mesh: "):
        link_shapes(robot)
    write_stl(tmp_path / "octa.stl", OCTAHEDRON, FACES)
    (capsule,) = link_shapes(robot)
    own = pin.SE3(turned(0.3, -0.2, 1.0), np.array([0.1, 0.02, -0.03]))
    points = np.array([own.act(p) for p in OCTAHEDRON])
    assert abs(outside(points, *ends(capsule))) < 1e-6  # its numbers are single


FLAT = {
    "triangle": (OCTAHEDRON[[0, 2, 4]], [(0, 1, 2)]),
    "rectangle": (np.eye(4, 3) * [0.1, 0.2, 0.0] + [0, 0, 0.1], [(0, 1, 3), (0, 3, 1)]),
    "needle": (np.outer(np.arange(5.0), [0.1, 0.0, 0.0]), [(0, 1, 2), (2, 3, 4)]),
}


@pytest.mark.parametrize("proxy", ["capsules", "spheres", "hulls", "meshes"])
@pytest.mark.parametrize("which", FLAT)
def test_flat_meshes_are_links_too(which: str, proxy: Any, tmp_path: Path) -> None:
    """They have no hull, at which Coal ends the process; a capsule holds them."""
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
    field = ObstacleClearance(robot, [ball], proxy=proxy)
    state = robot.state(0.0, robot.neutral(), np.zeros(2))
    assert 0.3 < field.least_distance(state) < 0.9


def test_meshes_without_a_place_or_a_hull(tmp_path: Path) -> None:
    file = write_stl(tmp_path / "odd.stl", OCTAHEDRON * [np.nan, 1.0, 1.0], FACES)
    robot = odd_robot(tmp_path, collision('<mesh filename="odd.stl"/>'))
    message = r"odd\.stl has a corner at a NaN or an infinity$"
    for proxy in ("capsules", "meshes"):
        with pytest.raises(
            ModelError, match=rf"odd\.urdf: a collision mesh: .*{message}"
        ):
            link_shapes(robot, proxy)  # type: ignore[arg-type]
    with pytest.raises(SceneError, match=message):
        Mesh(file).geometry()
    write_stl(file, *FLAT["triangle"])
    Mesh(file).geometry()
    with pytest.raises(SceneError, match=r"is flat and has no convex hull; needs conv"):
        Mesh(file, convex=True).geometry()


def test_unknown_proxies_are_named() -> None:
    with pytest.raises(ModelError) as caught:
        link_shapes(load("panda"), "capsule")  # type: ignore[arg-type]
    assert str(caught.value) == (
        "proxy 'capsule': choose among capsules, spheres, hulls, meshes"
    )


def test_a_robot_without_geometry_gets_capsules_and_one_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """From joint to joint, and a ball at the last; said once for all its fields."""
    robot = odd_robot(tmp_path)
    rounded = Obstacle("ball", Sphere(0.1), Hold([1.0, 0.0, 0.0]))
    flat = Obstacle("box", Box((0.1, 0.1, 0.1)), Hold([-1.0, 0.0, 0.0]))
    with caplog.at_level(logging.WARNING):
        stand, arm, hand = link_shapes(robot)
        ObstacleClearance(robot, [rounded, flat])
        SelfClearance(robot)
    assert [record.getMessage() for record in caplog.records] == [
        "odd has no collision geometry: using capsules of radius 0.05 m between its "
        "joints"
    ]
    assert (stand.link, stand.joint, arm.link, arm.joint) == ("universe", 0, "turn", 1)
    np.testing.assert_allclose(ends(stand)[:2], [[0, 0, 0], [0, 0, 0.3]], atol=1e-15)
    np.testing.assert_allclose(ends(arm)[:2], [[0, 0, 0], [0.4, 0, 0]], atol=1e-15)
    assert (hand.link, hand.joint, hand.geometry.radius) == ("bend", 2, 0.05)
    np.testing.assert_array_equal(hand.placement.homogeneous, np.eye(4))


def test_robots_without_geometry_keep_clear_of_each_other(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Each is given capsules where it stands, beside one that has its own."""
    robot, panda = odd_robot(tmp_path), load("panda")
    there = pin.SE3(turned(0.0, 0.0, 1.0), np.array([2.0, 0.0, 0.1]))
    both = Robot.combine({"odd": (robot, there), "arm": (panda, pin.SE3.Identity())})
    with caplog.at_level(logging.WARNING):
        shapes = link_shapes(both)
    assert len(shapes) == 3 + 13
    assert [record.getMessage() for record in caplog.records] == [
        "odd_odd has no collision geometry: using capsules of radius 0.05 m between "
        "its joints"
    ]
    stand = next(shape for shape in shapes if shape.link == "odd_universe")
    np.testing.assert_allclose(
        ends(stand)[:2], [[2.0, 0.0, 0.1], [2.0, 0.0, 0.4]], atol=1e-12
    )
    pairs = SelfClearance(both, influence=5.0).proximity.pairs
    names = {frozenset((shapes[i].link, shapes[j].link)) for i, j in pairs}
    assert frozenset(("odd_universe", "arm_panda_link1")) in names
    assert frozenset(("odd_universe", "odd_turn")) not in names
    assert frozenset(("odd_universe", "odd_bend")) in names


# -- distances in closed form ----------------------------------------------------------


def nearest_on_segments(
    a: tuple[Array, Array], b: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return the nearest points of two segments: inside both, or at one's end."""
    (p, p2), (r, r2) = a, b
    d, e, w = p2 - p, r2 - r, p - r
    candidates = []
    system = np.array([[d @ d, -d @ e], [d @ e, -e @ e]])
    if abs(np.linalg.det(system)) > 1e-14:
        s, t = np.linalg.solve(system, [-d @ w, -e @ w])
        if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
            return p + s * d, r + t * e
    for x in (p, p2):
        t = np.clip((x - r) @ e / max(float(e @ e), 1e-300), 0.0, 1.0)
        candidates.append((x, r + t * e))
    for y in (r, r2):
        s = np.clip((y - p) @ d / max(float(d @ d), 1e-300), 0.0, 1.0)
        candidates.append((p + s * d, y))
    return min(candidates, key=lambda pair: float(np.linalg.norm(pair[0] - pair[1])))


def closed_form(
    one: Shape, at: pin.SE3, other: Shape, there: pin.SE3
) -> tuple[float, Array]:
    """Return the signed distance of a ball or capsule to a shape, and its normal."""

    def segment(shape: Shape, place: pin.SE3) -> tuple[Array, Array]:
        half = 0.5 * getattr(shape, "length", 0.0) * place.rotation[:, 2]
        return place.translation - half, place.translation + half

    ours = segment(one, at)
    radius: float = one.radius  # type: ignore[attr-defined]
    if isinstance(other, HalfSpace):
        normal = there.rotation[:, 2]
        heights = [float(normal @ (x - there.translation)) for x in ours]
        return min(heights) - radius, normal
    if isinstance(other, Box):
        inside = there.actInv(at).translation
        half = 0.5 * np.array(other.size)
        away = at.translation - there.act(np.clip(inside, -half, half))
        if not away.any():
            return -radius, away
    else:
        x, y = nearest_on_segments(ours, segment(other, there))
        away = x - y
        radius += other.radius  # type: ignore[attr-defined]
    gap = float(np.linalg.norm(away))
    return gap - radius, away / gap


def random_place(rng: np.random.Generator, spread: float) -> pin.SE3:
    """Return a placement near the origin."""
    quaternion = rng.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    return pin.SE3(pin.Quaternion(quaternion).matrix(), rng.uniform(-spread, spread, 3))


def point_jacobian(robot: Robot, q: Array, joint: int, point: Array) -> Array:
    """Return the linear Jacobian of a point that a joint carries, by Pinocchio."""
    data = robot.model.createData()
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    J = pin.computeJointJacobians(robot.model, data, q)
    J = pin.getJointJacobian(robot.model, data, joint, axes)
    arm = point - data.oMi[joint].translation
    return J[:3] - pin.skew(arm) @ J[3:]


KINDS: dict[str, Callable[[np.random.Generator], Shape]] = {
    "sphere": lambda rng: Sphere(rng.uniform(0.0, 0.15)),
    "capsule": lambda rng: Capsule(rng.uniform(0.02, 0.1), rng.uniform(0.05, 0.4)),
    "plane": lambda rng: HalfSpace(),
    "box": lambda rng: Box(tuple(rng.uniform(0.05, 0.3, 3))),
}


@pytest.mark.parametrize(
    ("link", "other"),
    [
        ("sphere", "sphere"),
        ("sphere", "capsule"),
        ("capsule", "sphere"),
        ("capsule", "capsule"),
        ("sphere", "plane"),
        ("capsule", "plane"),
        ("sphere", "box"),
    ],
)
def test_distance_witnesses_and_gradient_in_closed_form(link: str, other: str) -> None:
    """Signed distances, apart and overlapping, and ∇d = Jᵀn with Pinocchio's own J.

    Coal computes these pairs in closed form but the box's, by GJK to 1e-10.
    """
    robot = load("panda")
    rng = np.random.default_rng([7, *link.encode(), *other.encode()])
    seen = {"apart": 0, "overlapping": 0}
    for _ in range(25):
        own, place, joint = KINDS[link](rng), random_place(rng, 0.2), rng.integers(2, 8)
        shape = KINDS[other](rng)
        links = [LinkShape("own", int(joint), place, own.geometry())]
        start = robot.random_configuration(rng)
        there = random_place(rng, 0.2)
        there.translation += placed(robot, links, start)[0].translation
        obstacle = Obstacle(
            "it", shape, Hold(there.translation), HoldOrientation(there.rotation)
        )
        proximity = Proximity(robot, links, [obstacle], [(0, 1)])
        for q in (start + 0.3 * rng.normal(size=7) for _ in range(4)):
            (at,) = placed(robot, links, q)
            d, n = closed_form(own, at, shape, there)
            if other == "box" and d <= 0.0:
                continue  # how deep a ball is in a box is another matter
            if (
                other == "plane"
                and link == "capsule"
                and abs(at.rotation[:, 2] @ n) < 0.01
            ):
                continue
            state = robot.state(0.0, q, np.zeros(7))
            tolerance = 1e-8 if other == "box" else 1e-12
            (measured,) = proximity.measure(state)
            assert measured == pytest.approx(d, abs=tolerance)
            seen["apart" if d > 0.0 else "overlapping"] += 1
            first, second = proximity.witness(0)[0], proximity.witness(0)[1]
            np.testing.assert_allclose(first - second, d * n, rtol=0, atol=1e-7)
            expected = point_jacobian(robot, q, int(joint), first).T @ n
            np.testing.assert_allclose(
                proximity.gradient(state, np.ones(1)), expected, rtol=0, atol=1e-7
            )
            assert proximity.nearest(state) == (measured, "own to it")
    assert seen["apart"] > 10
    assert other == "box" or seen["overlapping"] > 3, seen


def test_two_links_of_one_robot_push_each_other() -> None:
    """∇d = (J₁ - J₂)ᵀ n, both links moving, in either order of the pair."""
    robot = load("panda")
    rng = np.random.default_rng(8)
    shapes = [Capsule(0.05, 0.2), Sphere(0.04)]
    places, joints = [random_place(rng, 0.1), random_place(rng, 0.1)], [3, 7]
    links = [
        LinkShape(f"l{k}", joint, place, shape.geometry())
        for k, (joint, place, shape) in enumerate(
            zip(joints, places, shapes, strict=True)
        )
    ]
    proximity = Proximity(robot, links, [], [(0, 1)])
    swapped = Proximity(robot, links, [], [(1, 0)])
    for q in (robot.random_configuration(rng) for _ in range(10)):
        state = robot.state(0.0, q, np.zeros(7))
        a, b = placed(robot, links, q)
        d, n = closed_form(shapes[0], a, shapes[1], b)
        np.testing.assert_allclose(proximity.measure(state), d, rtol=0, atol=1e-12)
        np.testing.assert_allclose(swapped.measure(state), d, rtol=0, atol=1e-12)
        first, second = proximity.witness(0)[0], proximity.witness(0)[1]
        expected = n @ (
            point_jacobian(robot, q, 3, first) - point_jacobian(robot, q, 7, second)
        )
        for either in (proximity, swapped):
            np.testing.assert_allclose(
                either.gradient(state, np.array([2.0])), 2.0 * expected, atol=1e-12
            )
            assert not either.gradient(state, np.zeros(1)).any()


def test_a_pair_that_is_named_twice_counts_once() -> None:
    """As do obstacles; the distances stay beside the pairs that they belong to."""
    robot = load("panda")
    links = link_shapes(robot)
    once = Proximity(robot, links, [], [(1, 10), (0, 5), (2, 9)])
    twice = Proximity(robot, links, [], [(1, 10), (0, 5), (5, 0), (1, 10), (2, 9)])
    state = still(robot)
    np.testing.assert_array_equal(once.measure(state), twice.measure(state))
    np.testing.assert_array_equal(
        once.gradient(state, np.ones(3)), twice.gradient(state, np.ones(3))
    )
    ball = Obstacle("ball", Sphere(0.1), Hold([0.4, 0.2, 0.6]))
    one, two = (ObstacleClearance(robot, [ball] * k, influence=1.0) for k in (1, 2))
    assert one.value(state) == two.value(state) > 0.1
    np.testing.assert_array_equal(one.gradient(state), two.gradient(state))


def test_meshes_hulls_clouds_and_terrain(tmp_path: Path) -> None:
    """What stands for what: a convex mesh is its hull, a notched one is not; a flat
    terrain is a plane; a cloud is its cubes, whichever way Coal names the witnesses.
    """
    robot = load("panda")
    ball = LinkShape("ball", 7, pin.SE3.Identity(), coal.Sphere(0.03))

    def distance(shape: Shape, q: Array, where: Array) -> Proximity:
        proximity = Proximity(
            robot, [ball], [Obstacle("it", shape, Hold(where))], [(0, 1)]
        )
        proximity.measure(robot.state(0.0, q, np.zeros(7)))
        return proximity

    convex = write_stl(tmp_path / "octa.stl", 1e3 * OCTAHEDRON, FACES)
    notched = OCTAHEDRON.copy()
    notched[4] = [0.0, 0.0, -0.1]  # its top pushed in
    hollow = write_stl(tmp_path / "hollow.stl", notched, FACES)
    assert Mesh(convex, 1e-3).reach == pytest.approx(0.25)
    rng = np.random.default_rng(9)
    for _ in range(20):
        q = robot.random_configuration(rng)
        center = robot.state(0.0, q, np.zeros(7)).data.oMi[7].translation.copy()
        u = rng.normal(size=3)
        where = center - 0.45 * u / np.linalg.norm(u)
        mesh = distance(Mesh(convex, 1e-3), q, where).distances[0]
        hull = distance(Mesh(convex, 1e-3, convex=True), q, where).distances[0]
        assert mesh == pytest.approx(hull, abs=1e-7)
        above = center - [0.01, 0.02, 0.2]
        inner = distance(Mesh(hollow), q, above).distances[0]
        outer = distance(Mesh(hollow, convex=True), q, above).distances[0]
        assert outer == pytest.approx(0.17, abs=1e-7)  # the lid over the notch
        assert inner > outer + 0.02

        points = rng.uniform(-0.2, 0.2, (6, 3))
        cloud = distance(PointCloud(points.tolist(), 0.01), q, where)
        gaps = np.linalg.norm(center - where - points, axis=1) - 0.03
        # A point lies in its cube of 0.01 m: √3 · 0.01 m from its farthest corner.
        assert abs(cloud.distances[0] - gaps.min()) <= 0.0174
        first, second = cloud.witness(0)[0], cloud.witness(0)[1]
        assert np.linalg.norm(first - center) == pytest.approx(0.03, abs=1e-7)
        assert np.linalg.norm(second - where - points, axis=1).min() <= 0.0174
        n = (first - second) / cloud.distances[0]
        np.testing.assert_allclose(
            cloud.gradient(robot.state(0.0, q, np.zeros(7)), np.ones(1)),
            point_jacobian(robot, q, 7, first).T @ n,
            atol=1e-7,
        )

        flat = distance(
            HeightField((8.0, 8.0), [[0.2] * 3] * 4), q, np.array([0.0, 0.0, -1.5])
        )
        assert flat.distances[0] == pytest.approx(center[2] - 0.03 + 1.3, abs=1e-7)
        slope_along_x = [[-0.8, 0.8], [-0.8, 0.8]]  # 0.2 m a metre over 8 m
        tilted = distance(
            HeightField((8.0, 8.0), slope_along_x), q, np.array([0, 0, -1.5])
        )
        normal = np.array([-0.2, 0.0, 1.0]) / np.hypot(0.2, 1.0)
        height = normal @ (center - [0.0, 0.0, -1.5])
        assert tilted.distances[0] == pytest.approx(height - 0.03, abs=1e-7)


# -- gradient and rate on whole robots -------------------------------------------------

AIR = Lissajous([0.5, 0.3, 0.5], [0.1, 0.15, 0.05], [1.0, 2.0, 1.5])
LOW = Lissajous([0.1, 0.2, -0.15], [0.1, 0.15, 0.05], [1.0, 2.0, 1.5])
TURNING = Spin(turned(0.3, 0.4, 0.5), [0.0, 0.6, 0.8], 0.7)
RIPPLES = (
    0.1
    * np.sin(3.0 * np.linspace(-1.0, 1.0, 9))[None, :]
    * np.cos(2.0 * np.linspace(-1.0, 1.0, 9))[:, None]
)
CLOUD = 0.5 * OCTAHEDRON
OBSTACLES: dict[str, Callable[[Path], Obstacle]] = {
    "sphere": lambda _: Obstacle("it", Sphere(0.15), AIR, TURNING),
    "point": lambda _: Obstacle("it", Sphere(0.0), AIR, TURNING),
    "capsule": lambda _: Obstacle("it", Capsule(0.08, 0.3), AIR, TURNING),
    "cylinder": lambda _: Obstacle("it", Cylinder(0.1, 0.3), AIR, TURNING),
    "box": lambda _: Obstacle("it", Box((0.2, 0.3, 0.25)), AIR, TURNING),
    "plane": lambda _: Obstacle(
        "it", HalfSpace(), LOW, HoldOrientation(turned(0.1, 0.1, 0.0))
    ),
    "mesh": lambda octa: Obstacle("it", Mesh(octa), AIR, TURNING),
    "hull": lambda octa: Obstacle("it", Mesh(octa, convex=True), AIR, TURNING),
    "cloud": lambda _: Obstacle("it", PointCloud(CLOUD.tolist(), 0.02), AIR, TURNING),
    "height field": lambda _: Obstacle(
        "it", HeightField((2.0, 2.0), RIPPLES.tolist()), LOW
    ),
}


def flowing(field: Cost, state: Any, step: float) -> Array:
    """Return the rate of a gradient by differences of sixth order along the flow."""
    robot, q, v = state.robot, state.q.copy(), state.v.copy()
    return slope(
        lambda s: field.gradient(
            robot.state(state.t + s, robot.integrate(q, s * v), v)
        ),
        step,
    )


def agree(one: Array, other: Array) -> bool:
    """Return whether differences by two steps tell the same."""
    return bool(np.abs(one - other).max() <= 1e-8 * np.abs(other).max())


@pytest.mark.parametrize("kind", OBSTACLES)
@pytest.mark.parametrize("name", ["panda", "iiwa14"])
def test_gradient_and_rate_for_every_shape(
    name: str, kind: str, tmp_path: Path
) -> None:
    """Against differences of the value, and of the gradient along the flow in time.

    Where the nearest feature changes, between caps and side or face and edge, the rate
    jumps, and differences across the jump are wrong: they disagree with themselves at
    half the step, and that state is passed over. At few, or nothing would be shown.
    """
    robot = load(name)
    octa = write_stl(tmp_path / "octa.stl", OCTAHEDRON, FACES)
    obstacle = OBSTACLES[kind](octa)
    links = [n for n in (s.link for s in link_shapes(robot)) if n[-1] not in "01"]
    field = ObstacleClearance(robot, [obstacle], influence=0.3, links=links)
    rng = np.random.default_rng([11, *kind.encode()])
    agreed = passed_over = 0
    while agreed < 5:
        q, v = robot.random_configuration(rng), 0.5 * rng.normal(size=robot.nv)
        state = robot.state(0.7, q, v)
        if not 0.06 < field.least_distance(state) < 0.25:
            continue
        g, g_dot = field.gradient(state), field.gradient_rate(state)

        def value(x: Array, q: Array = q, v: Array = v) -> float:
            return field.value(robot.state(0.7, robot.integrate(q, x), v))

        by_value = [gradient(value, robot.nv, h) for h in (1e-3, 5e-4)]
        by_flow = [flowing(field, state, h) for h in (1e-3, 5e-4)]
        if not (agree(*by_value) and agree(*by_flow)):
            passed_over += 1
            continue
        agreed += 1
        # A barrier at d > 0.06 m by steps of 5e-4 rad m: (5e-4/0.06)⁶ · 7!/140 = 1e-11;
        # the field's own rate, of fourth order by 1e-3: (1e-3/0.06)⁴ · 5!/30 = 3e-7 at
        # worst, 1e-9 where d is not that small and the arm not that quick.
        scale = float(np.abs(g).max())
        np.testing.assert_allclose(g, by_value[1], rtol=0, atol=1e-9 * scale)
        scale = float(np.abs(g_dot).max())
        np.testing.assert_allclose(g_dot, by_flow[1], rtol=0, atol=3e-8 * scale)
        assert scale > 1e-2
    assert passed_over <= 5, f"{passed_over} states near an edge"


def test_gradient_by_hulls_is_as_good_as_gjk() -> None:
    """The Panda's cylinders and a cylinder: 1e-4, with Coal's own tolerance 1e-2."""
    robot = load("panda")
    obstacle = Obstacle("it", Cylinder(0.1, 0.3), AIR, TURNING)
    field = ObstacleClearance(robot, [obstacle], influence=0.4, proxy="hulls")
    rng = np.random.default_rng(16)
    agreed = 0
    while agreed < 8:
        q = robot.random_configuration(rng)
        state = robot.state(0.7, q, np.zeros(7))
        if not 0.06 < field.least_distance(state) < 0.3:
            continue
        agreed += 1

        def value(x: Array, q: Array = q) -> float:
            return field.value(robot.state(0.7, q + x, np.zeros(7)))

        expected = gradient(value, 7, 1e-3)
        scale = float(np.abs(expected).max())
        np.testing.assert_allclose(
            field.gradient(state), expected, rtol=0, atol=2e-4 * scale
        )


def rate_at_one_time(field: Cost, state: Any) -> Array:
    """Return the gradient's rate with the obstacles frozen where they are."""
    return slope(lambda s: field.gradient(state.displaced(0.0, s * state.v)), 5e-4)


def test_a_frozen_obstacle_or_witness_point_is_measurably_wrong() -> None:
    """The rate needs ∂∇f/∂t and the sliding of the nearest point along the link.

    The latter is frozen by hanging a point on the link, and one on the obstacle, where
    the nearest points are now: distance and gradient are equal, the rate is not.
    """
    robot = load("panda")
    obstacle = Obstacle("ball", Sphere(0.1), AIR)
    field = ObstacleClearance(robot, [obstacle], influence=0.4)
    rng = np.random.default_rng(12)
    in_time, in_place = [], []
    while len(in_time) < 12:
        q, v = robot.random_configuration(rng), 0.5 * rng.normal(size=7)
        state = robot.state(0.7, q, v)
        if not 0.05 < field.least_distance(state) < 0.25:
            continue
        true = field.gradient_rate(state)
        frozen = rate_at_one_time(field, state)
        in_time.append(float(np.abs(true - frozen).max() / np.abs(true).max()))

        field.value(state)
        proximity = field.proximity
        k = int(np.argmin(proximity.distances))
        link = proximity.links[proximity.pairs[k][0]]
        alone = ObstacleClearance(robot, [obstacle], influence=0.4, links=[link.link])
        place = state.data.oMi[link.joint]
        hung = LinkShape(
            link.link,
            link.joint,
            pin.SE3(np.eye(3), place.actInv(proximity.witness(k)[0])),
            coal.Sphere(0.0),
        )
        offset = proximity.witness(k)[1] - obstacle.placement(0.7).translation
        moving = Obstacle("point", Sphere(0.0), Shifted(AIR, offset))
        points = Proximity(robot, [hung], [moving], [(0, 1)])
        if len(alone.proximity.pairs) > 1:
            continue  # a link of two capsules
        one = np.array([barrier_at(float(proximity.distances[k]), 0.4)[1]])
        np.testing.assert_allclose(
            points.gradient(state, one), alone.gradient(state), rtol=0, atol=1e-9
        )

        def rate(p: Proximity, state: Any = state, q: Array = q, v: Array = v) -> Array:
            def along(s: float) -> Array:
                here = robot.state(0.7 + s, robot.integrate(q, s * v), v)
                (d,) = p.measure(here)
                return p.gradient(here, np.array([barrier_at(float(d), 0.4)[1]]))

            return slope(along, 5e-4)

        sliding = alone.gradient_rate(state)
        stuck = rate(points)
        in_place.append(float(np.abs(sliding - stuck).max() / np.abs(sliding).max()))
    assert np.median(in_time) > 0.2, in_time
    assert max(in_place) > 0.2, in_place


class Shifted(Trajectory):
    """A trajectory moved by a constant."""

    def __init__(self, base: Trajectory, offset: Array) -> None:
        self.base, self.offset = base, offset

    @property
    def dimension(self) -> int:
        return self.base.dimension

    def sample(self, t: float, out: Any = None) -> Any:
        sample = self.base.sample(t)
        return sample._replace(position=sample.position + self.offset)


def test_a_floor_has_no_edge_where_links_lie_level() -> None:
    """A capsule's lower end changes where it lies along the floor; the beads' does not.

    The forearm is turned through the horizontal. With capsules the gradient jumps by a
    third there, from one step to the next.
    """
    robot = load("panda")
    floor = Obstacle("floor", HalfSpace(), Hold([0.0, 0.0, 0.0]))
    field = ObstacleClearance(robot, [floor], influence=0.9, links=["panda_link5"])
    links = [s for s in link_shapes(robot) if s.link == "panda_link5"]
    capsules = Proximity(
        robot, links, [floor], [(k, len(links)) for k in range(len(links))]
    )

    def jump(of: Callable[[Any], Array]) -> float:
        gradients = [
            of(robot.state(0.0, np.array([0, 0.3, 0, a, 0, 1, 0]), np.zeros(7))).copy()
            for a in np.linspace(-1.3, -1.2, 201)
        ]
        steps = [float(np.abs(b - a).max()) for a, b in pairwise(gradients)]
        return max(steps) / float(np.abs(gradients).max())

    def by_capsules(state: Any) -> Array:
        slopes = np.array(
            [barrier_at(float(d), 0.9)[1] for d in capsules.measure(state)]
        )
        return capsules.gradient(state, slopes)

    assert jump(by_capsules) > 0.2
    assert jump(field.gradient) < 0.01


# -- far away, and once per state ------------------------------------------------------


def evaluate(field: Cost, state: Any) -> FieldSample:
    """Return g and g' in the identity metric."""
    metric = IdentityMetric()
    nv = state.robot.nv
    sample = metric.evaluate(state, MetricSample.allocate(nv))
    out = FieldSample(np.full(nv, np.nan), np.full(nv, np.nan))
    return field.evaluate(state, sample, metric.form, out)


@pytest.mark.parametrize("gap", [0.001, 0.04, 0.06, 0.2])
def test_exactly_zero_beyond_the_influence(gap: float) -> None:
    """Not small but 0, near the influence's edge as well, and g' with it.

    At 1 mm the differences of the rate reach in or not: the barrier's edge is so flat
    that what they see there is below 1e-6.
    """
    robot = load("panda")
    state = robot.state(0.3, robot.home(), np.linspace(-0.3, 0.3, 7))
    ball = Obstacle("ball", Sphere(0.1), Hold([0.5, 0.5, 0.5]))
    d = ObstacleClearance(robot, [ball]).least_distance(state)
    field = ObstacleClearance(robot, [ball], influence=d - gap)
    g, g_dot = evaluate(field, state)
    np.testing.assert_array_equal(g, 0.0)
    np.testing.assert_array_equal(g_dot, 0.0)
    assert field.value(state) == 0.0
    within = ObstacleClearance(robot, [ball], influence=d + 0.05)
    assert np.abs(evaluate(within, state).g).max() > 1e-4
    assert np.abs(evaluate(within, state).g_dot).max() > 1e-4


def test_the_rate_is_zero_however_quick_the_obstacle() -> None:
    """Out of influence g is zero in a neighbourhood, so that g' is zero exactly.

    At 20 m/s a ball comes 4 cm nearer within a differences' step of 2 ms: differencing
    would see it inside, and give a rate that is not there yet.
    """
    robot = load("panda")
    start = np.array([0.5, 0.5, 0.5])
    state = robot.state(0.0, robot.home(), np.zeros(7))
    resting = Obstacle("ball", Sphere(0.1), Hold(start))
    field = ObstacleClearance(robot, [resting])
    d = field.least_distance(state)
    k = int(np.argmin(field.proximity.distances))
    n = field.proximity.witness(k)[0] - field.proximity.witness(k)[1]
    ball = Obstacle("ball", Sphere(0.1), UniformLine(start, 20.0 * n / d))
    for gap in (0.001, 0.03, 0.051):
        quick = ObstacleClearance(robot, [ball], influence=d - gap)
        np.testing.assert_array_equal(evaluate(quick, state).g, 0.0)
        np.testing.assert_array_equal(quick.gradient_rate(state), 0.0)
    near = ObstacleClearance(robot, [ball], influence=d + 0.01)
    assert np.abs(near.gradient_rate(state)).max() > 0.0


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Count the calls of Pinocchio's distance computation."""
    made: list[int] = []
    measure = pin.computeDistances

    def counting(*arguments: Any) -> Any:
        made.append(1)
        return measure(*arguments)

    monkeypatch.setattr(pin, "computeDistances", counting)
    return made


def test_distances_are_measured_once_per_state(calls: list[int]) -> None:
    """However often they are asked for; and four times more along the flow, for g'.

    That is Coal's part; distances in closed form have an exact rate.
    """
    robot = load("panda")
    ball = Obstacle("ball", Sphere(0.1), AIR)
    field = ObstacleClearance(robot, [ball], influence=1.0, proxy="hulls")
    state = still(robot)
    for _ in range(2):
        field.value(state)
        field.gradient(state)
        field.least_distance(state)
        field.proximity.nearest(state)
    assert len(calls) == 1
    evaluate(field, state)
    assert len(calls) == 5
    state.update(0.0, robot.home() + 0.01, np.zeros(7))
    field.gradient(state)
    field.value(state)
    assert len(calls) == 6
    far = ObstacleClearance(robot, [ball], influence=0.01, proxy="hulls")
    del calls[:]
    evaluate(far, state)
    assert len(calls) == 1
    del calls[:]
    evaluate(ObstacleClearance(robot, [ball], influence=1.0), state)
    assert not calls


def test_distances_are_those_of_the_state_that_is_asked_for() -> None:
    """Also where a state is gone and another has taken its place in memory."""
    robot = load("panda")
    field = ObstacleClearance(robot, [Obstacle("ball", Sphere(0.1), AIR)])
    rng = np.random.default_rng(13)
    postures = [robot.random_configuration(rng) for _ in range(8)]
    passing = [field.least_distance(robot.state(0.0, q, np.zeros(7))) for q in postures]
    kept = [robot.state(0.0, q, np.zeros(7)) for q in postures]
    assert passing == [field.least_distance(state) for state in kept]
    assert len(set(passing)) == len(postures)
    first = field.least_distance(kept[0])
    assert first == field.least_distance(kept[0]) == passing[0]


# -- the robot's own links -------------------------------------------------------------


def names(field: SelfClearance) -> set[frozenset[str]]:
    """Return the pairs of links that are watched."""
    links = field.proximity.links
    return {frozenset((links[i].link, links[j].link)) for i, j in field.proximity.pairs}


def disabled(robot: Robot) -> set[frozenset[str]]:
    """Return the pairs that the SRDF leaves out."""
    assert robot.source.srdf is not None
    return {
        frozenset((pair.attrib["link1"], pair.attrib["link2"]))
        for pair in ElementTree.parse(robot.source.srdf).iter("disable_collisions")
    }


def test_pairs_of_links_that_are_watched() -> None:
    """All pairs but neighbours, links of one joint, the SRDF's, and what overlaps."""
    robot = load("panda")
    links = link_shapes(robot)
    watched = names(SelfClearance(robot))
    without = disabled(robot)
    parents = list(robot.model.parents)
    expected = {
        frozenset((a.link, b.link))
        for i, a in enumerate(links)
        for b in links[i + 1 :]
        if a.joint != b.joint
        and parents[a.joint] != b.joint
        and parents[b.joint] != a.joint
        and frozenset((a.link, b.link)) not in without
    }
    by_srdf_or_chain = {
        frozenset((links[i].link, links[j].link)) for i, j in self_pairs(robot, links)
    }
    assert by_srdf_or_chain == expected
    assert frozenset(("panda_link0", "panda_hand")) in watched
    assert frozenset(("panda_link3", "panda_link4")) not in watched  # neighbours
    assert frozenset(("panda_hand", "panda_leftfinger")) not in watched  # one joint
    assert without  # the SRDF says something
    assert not watched & without
    assert watched <= expected
    home = still(robot)
    state_of = Proximity(robot, links, [], self_pairs(robot, links))
    overlap = {
        pair
        for pair, d in zip(state_of.pairs, state_of.measure(home), strict=True)
        if d <= 0.0
    }
    field = SelfClearance(robot)
    assert set(field.proximity.pairs) == set(state_of.pairs) - overlap
    assert field.least_distance(home) > 0.0


def test_pairs_between_robots_are_all_kept() -> None:
    """Neither the SRDFs nor the chains say anything about links of two robots."""
    panda, iiwa = load("panda"), load("iiwa14")
    beside = pin.SE3(turned(0.0, 0.0, np.pi), np.array([1.1, 0.0, 0.0]))
    both = Robot.combine({"a": (panda, pin.SE3.Identity()), "b": (iiwa, beside)})
    watched = names(SelfClearance(both))
    mine = {shape.link for shape in link_shapes(panda)}
    theirs = {shape.link for shape in link_shapes(iiwa)}
    for a in mine:
        for b in theirs:
            standing = a == "panda_link0" and b == "iiwa_link_0"
            assert (frozenset((f"a_{a}", f"b_{b}")) in watched) is not standing
    own = {frozenset(f"a_{x}" for x in pair) for pair in names(SelfClearance(panda))}
    own |= {frozenset(f"b_{x}" for x in pair) for pair in names(SelfClearance(iiwa))}
    across = {pair for pair in watched if len({name[0] for name in pair}) == 2}
    assert watched - across == own
    assert own


def test_pairs_that_overlap_at_home_are_left_out() -> None:
    """Shoulders 15 cm apart, 9 cm thick: there is no keeping them clear."""
    panda = load("panda")
    near = pin.SE3(turned(0.0, 0.0, np.pi), np.array([-0.15, 0.0, 0.0]))
    both = Robot.combine({"a": (panda, pin.SE3.Identity()), "b": (panda, near)})
    field = SelfClearance(both)
    watched = names(field)
    assert frozenset(("a_panda_link1", "b_panda_link1")) not in watched
    assert frozenset(("a_panda_link0", "b_panda_link1")) not in watched
    assert frozenset(("a_panda_link1", "b_panda_hand")) in watched
    assert field.least_distance(still(both)) > 0.0


def test_each_robot_is_the_others_moving_obstacle() -> None:
    """Gradient and rate of the pairs between two arms that both move."""
    panda = load("panda")
    beside = pin.SE3(turned(0.0, 0.0, np.pi), np.array([1.0, 0.1, 0.0]))
    both = Robot.combine({"a": (panda, pin.SE3.Identity()), "b": (panda, beside)})
    field = SelfClearance(both, influence=0.3)
    rng = np.random.default_rng(14)
    agreed = 0
    while agreed < 4:
        q, v = both.random_configuration(rng), 0.5 * rng.normal(size=14)
        state = both.state(0.0, q, v)
        d, pair = field.proximity.nearest(state)
        one, two = (name[:2] for name in pair.split(" to "))
        if not 0.06 < d < 0.25 or one == two:
            continue
        g, g_dot = field.gradient(state), field.gradient_rate(state)

        def value(x: Array, q: Array = q, v: Array = v) -> float:
            return field.value(both.state(0.0, both.integrate(q, x), v))

        by_value = [gradient(value, 14, h) for h in (1e-3, 5e-4)]
        by_flow = [flowing(field, state, h) for h in (1e-3, 5e-4)]
        if not (agree(*by_value) and agree(*by_flow)):
            continue
        agreed += 1
        scale = float(np.abs(g).max())
        np.testing.assert_allclose(g, by_value[1], rtol=0, atol=1e-9 * scale)
        scale = float(np.abs(g_dot).max())
        np.testing.assert_allclose(g_dot, by_flow[1], rtol=0, atol=3e-8 * scale)
        assert np.abs(g[:7]).max() > 1e-2
        assert np.abs(g[7:]).max() > 1e-2


# -- the loop closed -------------------------------------------------------------------

PASSING = Lissajous([0.1, 0.45, 0.7], [0.1, 0.1, 0.2], [2.0, 3.0, 2.5])
LOOPS = {
    "ball": Obstacle("ball", Sphere(0.1), PASSING),
    "box": Obstacle(
        "box", Box((0.2, 0.15, 0.25)), PASSING, Spin(np.eye(3), [0.0, 0.6, 0.8], 1.0)
    ),
    "floor": Obstacle(
        "floor",
        HalfSpace(),
        Lissajous([0.0, 0.0, 0.15], [0.0, 0.0, 0.05], [0.0, 0.0, 3.0]),
        HoldOrientation(turned(0.2, -0.1, 0.0)),
    ),
}
GAIN = 5.0


def run(
    field: Cost, duration: float, integrator: Integrator
) -> tuple[Array, Array, Any]:
    """Return ‖e_N‖ and what it shall be while the hand holds still, from rest."""
    robot = load("panda")
    hand = "panda_tcp"
    hold = FramePosition(robot, hand, Hold(still(robot).position(hand)), Gains(100, 20))
    rollout = simulate(
        Controller(robot, [hold], field, null_space_gain=GAIN),
        robot.home(),
        duration=duration,
        log_period=0.02,
        integrator=integrator,
    )
    norm = rollout["null_space_norm"]
    return norm, norm[0] * np.exp(-GAIN * rollout.t), rollout


@pytest.mark.parametrize("which", LOOPS)
def test_the_null_space_error_is_exponential_beside_a_moving(which: str) -> None:
    """‖e_N‖ = ‖e_N(0)‖ exp(-K_N t), to 1e-6 of its start, while the obstacle passes.

    The rate jumps where the nearest point moves from a capsule's side to its end, and
    where the links' balls roll over the edges of a box that turns; the exponential does
    not, as an integrator that shortens its steps there shows: 3e-7.
    """
    robot = load("panda")
    # Not the shoulder, which stands in the floor and cannot leave it.
    links = [s.link for s in link_shapes(robot) if s.joint > 2]
    field = ObstacleClearance(robot, [LOOPS[which]], influence=0.3, links=links)
    norm, expected, rollout = run(field, 1.2, Dop853(1e-9, 1e-9))
    assert norm[0] > 0.1
    np.testing.assert_allclose(norm, expected, rtol=0, atol=1e-6 * norm[0])
    assert np.abs(rollout["field.g"][30:]).max() > 0.5  # it did push all the time
    assert rollout["distance.obstacle_clearance"].min() > 0.05
    assert np.abs(rollout["task.panda_tcp.error"]).max() < 1e-8


class Frozen(ObstacleClearance):
    """The same without ∂g/∂t."""

    def gradient_rate(self, state: Any) -> Array:
        return rate_at_one_time(self, state)


def test_without_the_obstacles_velocity_it_is_not() -> None:
    field = Frozen(load("panda"), [LOOPS["ball"]], influence=0.3)
    norm, expected, _ = run(field, 0.6, Rk4(0.005))
    assert np.abs(norm - expected).max() > 0.3 * norm[0]


# -- what cannot be --------------------------------------------------------------------

BALL = Obstacle("ball", Sphere(0.1), Hold([0.5, 0.3, 0.5]))
MISTAKES: list[tuple[Callable[[Path], Any], type[HspControlError], str]] = [
    (lambda _: ObstacleClearance(load("panda"), []), FieldError,
     "field 'obstacle_clearance': there is no obstacle to keep clear of"),
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
     "you mean 'panda_link3'? (those that have: panda_link0, panda_link1, "),
    (lambda _: ObstacleClearance(load("panda"), [BALL], links=["panda_link0"]),
     FieldError, "no pair of shapes is left to keep apart"),
    (lambda _: ObstacleClearance(load("panda"), [BALL], links=[]), FieldError,
     "no pair of shapes is left to keep apart"),
    (lambda _: Proximity(load("panda"), link_shapes(load("panda")), [], []), FieldError,
     "no pair of shapes is left to keep apart"),
    (lambda at: SelfClearance(odd_robot(at, collision('<sphere radius="1"/>'))),
     FieldError, "no pair of shapes is left to keep apart"),
    (lambda _: ObstacleClearance(load("panda"), [BALL], proxy="boxes"),  # type: ignore[arg-type]
     ModelError, "proxy 'boxes': choose among capsules, spheres, hulls, meshes"),
    (lambda at: ObstacleClearance(
        load("panda"), [Obstacle("it", Mesh(at / "no.stl"), AIR)]),
     SceneError, "/no.stl"),
    (lambda at: Mesh(at / "no.stl").geometry(), SceneError, "mesh: no file "),
    (lambda at: Mesh(at).geometry(), SceneError, "mesh: no file "),
    (lambda at: Mesh(junk(at)).geometry(), SceneError, "mesh: cannot read "),
    (lambda at: Mesh(junk(at)).reach, SceneError, "junk.stl: "),
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
    (lambda _: Box((0.1, 0.2)), SceneError, "box: size [0.1, 0.2] needs 3 edges"),  # type: ignore[arg-type]
    (lambda _: Box((0.1, 0.0, 0.2)), SceneError, "box: y is 0.0; must be greater"),
    (lambda _: PointCloud([]), SceneError,
     "point cloud: needs one or more points of 3 numbers"),
    (lambda _: PointCloud(np.zeros((0, 3))), SceneError, "one or more points"),  # type: ignore[arg-type]
    (lambda _: PointCloud([[0.0, 0.0]]), SceneError, "points of 3 numbers"),
    (lambda _: PointCloud([[0.0, 0.0, 0.0], [1.0]]), SceneError, "points of 3 numbers"),
    (lambda _: PointCloud([[0.0, 0.0, np.nan]]), SceneError, "points of 3 numbers"),
    (lambda _: PointCloud([[0.0, 0.0, 0.0]], 0.0), SceneError, "resolution is 0.0"),
    (lambda _: HeightField((1.0, 0.0), [[0, 0], [0, 0]]), SceneError,
     "heightfield: y is 0.0; must be greater than 0"),
    (lambda _: HeightField((1.0,), [[0, 0], [0, 0]]), SceneError,  # type: ignore[arg-type]
     "height field: size [1.0] needs 2 extents"),
    (lambda _: HeightField((1.0, 1.0), [[0, 0]]), SceneError,
     "height field: heights need 2 rows of 2 numbers or more"),
    (lambda _: HeightField((1.0, 1.0), [[0, 0], [0]]), SceneError,
     "height field: its rows differ in length"),
    (lambda _: HeightField((1.0, 1.0), [[0, 0], [0, float("inf")]]), SceneError,
     "height field: heights need"),
    (lambda _: Obstacle("it", Sphere(0.1), Hold([0.0, 0.0])), SceneError,
     "obstacle 'it': its centre has dimension 2; needs 3 (x, y, z)"),
    (lambda _: Scene([BALL, BALL]), SceneError, "two obstacles are called 'ball'"),
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


def test_shapes_say_how_far_they_reach() -> None:
    assert Sphere(0.2).reach == 0.2
    assert Capsule(0.1, 0.4).reach == pytest.approx(0.3)
    assert Cylinder(0.3, 0.8).reach == pytest.approx(0.5)
    assert Box((0.2, 0.4, 0.4)).reach == pytest.approx(0.3)
    assert HalfSpace().reach == np.inf
    assert PointCloud([[0.0, 0.3, 0.4]], 0.1).reach == pytest.approx(0.7)
    assert HeightField((0.6, 0.8), [[0, 0], [0, 1.2]]).reach == pytest.approx(1.3)


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
        "move the start, or the obstacle"
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
