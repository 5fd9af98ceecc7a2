"""Shapes of robots from MuJoCo models: distances as in MuJoCo, and visuals."""

from typing import Any

import coal
import numpy as np
import pytest
from mjcf_texts import ARM, CELL

from hsp_control import Robot
from hsp_control.companions.mujoco import MujocoCoordinates
from hsp_control.companions.viewer.robot_drawing import RobotDrawing, read_visuals
from hsp_control.geometry import link_shapes
from hsp_control.geometry.enclosing import enclosing_ellipsoid_capsule
from hsp_control.geometry.links import self_pairs

mujoco = pytest.importorskip("mujoco")

WEDGE = "0 0 0  .2 0 0  0 .1 0  0 0 .15  .05 .05 -.1"
GEOMS = {
    "sphere": "<geom name='{}' type='sphere' size='.1' pos='.1 .05 0'/>",
    "capsule": "<geom name='{}' type='capsule' size='.05 .1' euler='20 30 40'/>",
    "cylinder": "<geom name='{}' type='cylinder' size='.05 .1' euler='20 30 40'/>",
    "box": "<geom name='{}' type='box' size='.05 .1 .15' euler='20 30 40'/>",
    "ellipsoid": "<geom name='{}' type='ellipsoid' size='.15 .05 .1' euler='9 3 4'/>",
    "mesh": "<geom name='{}' type='mesh' mesh='wedge' pos='.1 0 0' euler='20 30 40'/>",
}


def pair(first: str, second: str) -> Any:
    """Return a scene of two distant hinged bodies with one geom each."""
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
      <asset><mesh name="wedge" vertex="{WEDGE}"/></asset>
      <worldbody>
        <body name="a" pos="0 0 1"><joint axis="0 1 .3"/>{GEOMS[first].format("one")}
        </body>
        <body name="b" pos="1 0 1"><joint axis=".2 1 0"/>{GEOMS[second].format("two")}
        </body>
      </worldbody></mujoco>""")


@pytest.mark.parametrize("kind", GEOMS)
def test_distances_are_those_of_mujoco(kind: str) -> None:
    """Between every type of shape and a sphere, while they rotate."""
    model = pair(kind, "sphere")
    robot = Robot.from_mujoco(model)
    first, second = link_shapes(robot, "meshes")
    assert (first.link, second.link) == ("a", "b")
    coordinates, data = MujocoCoordinates.of(robot, model), mujoco.MjData(model)
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = rng.uniform(-3.0, 3.0, 2)
        coordinates.to_mujoco(q, np.zeros(2), data.qpos, data.qvel)
        mujoco.mj_kinematics(model, data)
        theirs = mujoco.mj_geomDistance(model, data, 0, 1, 10.0, None)
        ours = _distance(robot, q, first, second)
        assert ours == pytest.approx(theirs, abs=1e-5)


def _distance(robot: Robot, q: Any, first: Any, second: Any) -> float:
    data = robot.state(0.0, q, np.zeros(robot.nv)).data
    places = [data.oMi[shape.joint] * shape.placement for shape in (first, second)]
    poses = [coal.Transform3s(place.rotation, place.translation) for place in places]
    return float(
        coal.distance(
            first.geometry,
            poses[0],
            second.geometry,
            poses[1],
            coal.DistanceRequest(),
            coal.DistanceResult(),
        )
    )


@pytest.mark.parametrize("radii", [(0.3, 0.2, 0.1), (0.1, 0.3, 0.2), (0.2, 0.2, 0.2)])
def test_the_capsule_of_an_ellipsoid_contains_and_touches_it(radii: Any) -> None:
    place, radius, length = enclosing_ellipsoid_capsule(coal.Ellipsoid(*radii))
    assert np.linalg.det(place.rotation) == pytest.approx(1.0)
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = directions * radii  # on the ellipsoid
    local = points @ place.rotation
    beyond = np.maximum(np.abs(local[:, 2]) - 0.5 * length, 0.0)
    gaps = radius - np.hypot(np.hypot(local[:, 0], local[:, 1]), beyond)
    assert gaps.min() > -1e-12
    assert gaps.min() < 1e-3
    assert 0.5 * length + radius == pytest.approx(max(radii))


def scene(geoms: str, rest: str = "") -> Robot:
    text = f"""<mujoco><worldbody><geom type="plane" size="1 1 1"/>
      <body name="a"><joint axis="0 1 0"/>{geoms}</body></worldbody>{rest}</mujoco>"""
    return Robot.from_mujoco(mujoco.MjModel.from_xml_string(text))


def test_contype_and_group_determine_collisions_and_visuals() -> None:
    shown = "<geom size='.1' contype='0' conaffinity='0' group='{}' rgba='1 0 0 {}'/>"
    hull = "<geom size='.2' group='3'/>"
    both = scene(shown.format(2, 1) + hull)
    assert [s.geometry.radius for s in link_shapes(both, "meshes")] == [0.2]
    assert [(v.size, v.color) for v in read_visuals(both)] == [
        ((0.1,), (1.0, 0.0, 0.0, 1.0))
    ]
    hidden = scene(shown.format(4, 1) + hull)
    assert [v.size for v in read_visuals(hidden)] == [(0.2,)]
    invisible = scene(shown.format(1, 0) + hull)
    assert read_visuals(invisible) == []
    only_affinity = scene("<geom size='.3' contype='0'/>")
    assert [s.geometry.radius for s in link_shapes(only_affinity)] == [0.3]


def test_excluded_pairs_are_not_checked() -> None:
    pairs = []
    for exclude in ("", "<exclude body1='hand' body2='base'/>"):
        text = CELL.replace("</mujoco>", f"<contact>{exclude}</contact></mujoco>")
        robot = Robot.from_mujoco(mujoco.MjModel.from_xml_string(text), "base", ARM)
        links = link_shapes(robot)
        pairs.append(
            {(links[i].link, links[j].link) for i, j in self_pairs(robot, links)}
        )
    assert pairs[0] - pairs[1] == {("base", "hand")}


def test_it_is_drawn_with_its_meshes_in_place() -> None:
    model = pair("mesh", "ellipsoid")
    robot = Robot.from_mujoco(model)
    visuals = {visual.link: visual for visual in read_visuals(robot)}
    assert visuals["a"].mesh is not None
    vertices, triangles = visuals["a"].mesh
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    placement = robot.state(0.0, robot.neutral(), np.zeros(2)).data.oMi[1]
    pose = placement.homogeneous @ visuals["a"].pose
    ours = vertices @ pose[:3, :3].T + pose[:3, 3]
    wedge = np.array(WEDGE.split(), dtype=float).reshape(-1, 3)
    frame = data.xmat[1].reshape(3, 3)
    turned = np.zeros(9)
    quat = np.zeros(4)
    mujoco.mju_euler2Quat(quat, np.deg2rad([20.0, 30.0, 40.0]), "xyz")
    mujoco.mju_quat2Mat(turned, quat)
    theirs = (wedge @ turned.reshape(3, 3).T + [0.1, 0.0, 0.0]) @ frame.T + data.xpos[1]
    gaps = np.linalg.norm(ours[:, None] - theirs[None], axis=2).min(axis=0)
    assert gaps.max() < 1e-6  # MuJoCo stores vertices in single precision
    assert triangles.max() < len(vertices)
    drawn = [command.path for command in RobotDrawing(robot).draw()]
    assert len(drawn) == 2
    assert not any("placeholder" in path for path in drawn)
