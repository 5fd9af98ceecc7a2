"""Capsules around points, cylinders and meshes, and the spheres in them."""

import logging
from pathlib import Path

import coal
import numpy as np
import pytest
from clearance_cases import ends, outside
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from loaded_robots import load
from odd_robots import collision, odd_robot
from places import THOROUGH

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ModelError
from hsp_control.geometry import link_shapes
from hsp_control.geometry.enclosing import enclosing_capsule

# --- capsules around points ----------------------------------------------------------


def volume(first: Array, second: Array, radius: float) -> float:
    """Return a capsule's volume."""
    length = float(np.linalg.norm(second - first))
    return np.pi * radius**2 * (length + 4.0 / 3.0 * radius)


@pytest.mark.slow
@settings(max_examples=40 if THOROUGH else 12)
@given(
    cloud=st.integers(1, 12).flatmap(
        lambda k: arrays(float, (k, 3), elements=st.integers(-8, 8).map(float))
    ),
    scale=st.sampled_from([0.01, 1.0, 30.0]),
)
def test_capsule_holds_every_point_and_is_no_larger_than_a_ball(
    cloud: Array, scale: float
) -> None:
    """For any cloud: one point, equal ones, on a line, in a plane.

    The ball is centred at the points' mean.
    """
    points = scale * cloud
    first, second, radius = enclosing_capsule(points)
    assert outside(points, first, second, radius) <= 1e-9 * scale
    ball = float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())
    assert volume(first, second, radius) <= volume(first, first, ball) + 1e-9 * scale**3


# --- shapes of links -----------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", ["panda", "iiwa14", "ur5"])
def test_beads_cover_their_capsule_and_stand_out_little(name: str) -> None:
    """Spheres at most r apart: the cover is at most √1.25 r thick."""
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


BALL = collision('<sphere radius="0.1"/>')


def test_primitives_serve_and_the_missing_mesh_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    mesh = collision('<mesh filename="package://acme_arm/upper.stl"/>')
    robot = odd_robot(tmp_path, arm=mesh, base=BALL)
    with caplog.at_level(logging.WARNING):
        (ball,) = link_shapes(robot)
        (again,) = link_shapes(robot, "hulls")
    assert ball.link == again.link == "base"
    (record,) = caplog.records  # logged once
    text = record.getMessage()
    assert "of 1 links are missing, which distances therefore do not see: arm" in text
    assert "(package://acme_arm/upper.stl)" in text
    assert "ROS_PACKAGE_PATH=<the folder that contains acme_arm>" in text


@pytest.mark.parametrize(("name", "hint"), [
    ("package://acme_arm/upper.stl", "ROS_PACKAGE_PATH=<the folder that contains"),
    ("upper.stl", "the path is relative to the URDF"),
])  # fmt: skip
def test_nothing_is_left(name: str, hint: str, tmp_path: Path) -> None:
    robot = odd_robot(tmp_path, arm=collision(f'<mesh filename="{name}"/>'))
    with pytest.raises(ModelError, match=f"no file '{name}', and no other .*{hint}"):
        link_shapes(robot)
