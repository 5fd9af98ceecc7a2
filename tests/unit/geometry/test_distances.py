"""Distances, witness points and gradients against closed forms."""

from collections.abc import Callable
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest
from clearance_cases import placed
from loaded_robots import load
from odd_robots import FACES, OCTAHEDRON, write_stl

from hsp_control import Obstacle, Robot
from hsp_control.common.arrays import Array
from hsp_control.geometry import LinkShape, Proximity
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
from hsp_control.null_space.fields import ObstacleClearance
from hsp_control.trajectories import Hold, HoldOrientation


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
    """Return the linear Jacobian of a point on a link, by Pinocchio."""
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


@pytest.mark.slow
@pytest.mark.parametrize(("link", "other"), [
    ("sphere", "sphere"),
    ("sphere", "capsule"),
    ("capsule", "sphere"),
    ("capsule", "capsule"),
    ("sphere", "plane"),
    ("capsule", "plane"),
    ("sphere", "box"),
])  # fmt: skip
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
                continue  # penetration into a box is defined differently
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


def test_pairs_of_all_kinds_together_equal_single_ones() -> None:
    """Spheres and other solids are computed separately; the order of pairs is kept."""
    robot, rng = load("panda"), np.random.default_rng(9)
    links = [LinkShape("own", 7, random_place(rng, 0.1), Sphere(0.05).geometry())]
    obstacles = []
    for kind in ("box", "sphere", "plane", "capsule", "box"):
        place = random_place(rng, 0.6)
        where = Hold(place.translation), HoldOrientation(place.rotation)
        obstacles.append(Obstacle(f"{kind}{len(obstacles)}", KINDS[kind](rng), *where))
    mixed = Proximity(robot, links, obstacles, [(0, 1 + k) for k in range(5)])
    state = robot.state(0.0, robot.random_configuration(rng), np.zeros(7))
    distances, gradient = mixed.measure(state), np.zeros(7)
    for k, obstacle in enumerate(obstacles):
        alone = Proximity(robot, links, [obstacle], [(0, 1)])
        assert alone.measure(state)[0] == distances[k]
        np.testing.assert_array_equal(mixed.witness(k), alone.witness(0))
        gradient += alone.gradient(state, np.ones(1))
    np.testing.assert_allclose(mixed.gradient(state, np.ones(5)), gradient, atol=1e-14)


SOLIDS: dict[str, Shape] = {
    "ball": Sphere(0.1),
    "box": Box([0.1, 0.1, 0.1]),
    "capsule": Capsule(radius=0.05, length=0.2),
    "cylinder": Cylinder(radius=0.05, length=0.2),
    "hull": PointCloud(
        0.1 * np.array([[-1.0, -1, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    ),
}


@pytest.mark.parametrize("shape", SOLIDS)
@pytest.mark.parametrize("offset", [0.0, 1e-200, 1e-13, 1e-9])
def test_nothing_is_nan_where_a_normal_has_no_direction(
    shape: str, offset: float
) -> None:
    """The obstacle's centre is at a link's origin, or very near it."""
    robot, rng = load("panda"), np.random.default_rng(0)
    state = robot.state(0.0, robot.random_configuration(rng), rng.standard_normal(7))
    for link in range(1, 8):
        center = state.frame(f"panda_link{link}").position + offset
        field = ObstacleClearance([Obstacle("it", SOLIDS[shape], Hold(center))])
        values = robot.state(state.t, state.q, state.v)
        assert np.isfinite(field.gradient(values)).all()
        assert np.isfinite(field.gradient_rate(values)).all()


def test_meshes_hulls_clouds_and_terrain(tmp_path: Path) -> None:
    """Shapes that replace others: a convex mesh its hull, a notched one not; a flat
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
    assert Mesh(convex, 1e-3).bounding_radius == pytest.approx(0.25)
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
        assert outer == pytest.approx(0.17, abs=1e-7)  # the face over the notch
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
