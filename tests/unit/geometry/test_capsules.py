"""Check capsules around points, cylinders and meshes, and the beads in them."""

from xml.etree import ElementTree

import coal
import numpy as np
import pytest
from clearance_cases import ends, load, outside, placed, still, turned
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from hsp_control import Obstacle
from hsp_control.geometry import LinkShape, link_shapes
from hsp_control.geometry.capsule_fit import enclosing_capsule
from hsp_control.geometry.shapes import Sphere
from hsp_control.null_space.fields import ObstacleClearance
from hsp_control.trajectories import Hold

Array = NDArray[np.float64]


# --- capsules around points ----------------------------------------------------------


def volume(first: Array, second: Array, radius: float) -> float:
    """Return a capsule's volume."""
    length = float(np.linalg.norm(second - first))
    return np.pi * radius**2 * (length + 4.0 / 3.0 * radius)


@pytest.mark.slow
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


# --- what stands for the links -------------------------------------------------------


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


def corners(shape: LinkShape) -> Array:
    """Return a mesh's or a box's vertices in the joint's frame."""
    if isinstance(shape.geometry, coal.Box):
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        vertices = signs * shape.geometry.halfSide
    else:
        vertices = np.array(shape.geometry.vertices())
    return vertices @ shape.placement.rotation.T + shape.placement.translation


@pytest.mark.slow
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
        ObstacleClearance([obstacle], proxy=proxy)  # type: ignore[arg-type]
        for proxy in ("capsules", "meshes")
    ]
    rng = np.random.default_rng(2)
    for _ in range(20):
        state = robot.state(0.0, robot.random_configuration(rng), np.zeros(6))
        safe, true = (field.minimum_distance(state) for field in both)
        assert true - 0.15 < safe <= true + 1e-6


@pytest.mark.slow
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
