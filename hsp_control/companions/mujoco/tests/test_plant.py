"""MuJoCo as a plant: the same mechanics as Pinocchio's, and contact with the ground."""

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import further
from robot_texts import ARM
from wording import wording

import hsp_control as hsp
from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    FrameNotFoundError,
    ModelError,
    SimulationError,
)
from hsp_control.common.resources import bundled_robots
from hsp_control.companions.mujoco import ContactShape, Ground
from hsp_control.companions.mujoco.plant import Mujoco, MujocoPlant
from hsp_control.geometry.shapes import Box, Capsule, Cylinder, HalfSpace, Sphere
from hsp_control.robot.description.loading import load_model
from hsp_control.robot.description.sources import find_robot
from hsp_control.robot.friction import Friction
from hsp_control.simulation.plants import Push

mujoco = pytest.importorskip("mujoco")
from mujoco_oracle import mass_matrix  # noqa: E402

OTHERS: dict[str, str | None] = dict.fromkeys(
    ["ur5", "tiago", "baxter", "talos", "g1", "solo12", "go2", "kinova", "pr2"]
) | {"tiago_no_hand": "planar"}
"""Robots of example-robot-data and their root: joints of every kind, and mimic ones."""


@cache
def load(name: str) -> Robot:
    if name in bundled_robots():
        return Robot.load(name)
    if name == "zoo":
        return zoo()
    pytest.importorskip("example_robot_data")
    if name == "placed":  # a floating robot whose root is not at the origin
        whole = pin.Model()
        place = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.5, 1.0), np.array([1.0, 2.0, 3.0]))
        source = find_robot("solo12")
        whole = pin.appendModel(whole, load_model(source), 0, place)
        return Robot(whole, source)
    return Robot.load(name, root=OTHERS[name])  # type: ignore[arg-type]


def zoo() -> Robot:
    """Return a robot with every joint type that MuJoCo has, too."""
    model, parent = pin.Model(), 0
    axis = np.array([0.6, 0.0, 0.8])
    for joint in (
        pin.JointModelPlanar(),
        pin.JointModelPrismaticUnaligned(axis),
        pin.JointModelSpherical(),
        pin.JointModelRevoluteUnaligned(axis),
        pin.JointModelRUBY(),
        pin.JointModelPY(),
    ):
        place = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.5, 1.0), np.array([0.1, 0.2, 0.3]))
        name = joint.shortname()
        parent = model.addJoint(parent, joint, place, name)
        body = pin.Inertia.FromEllipsoid(1.0, 0.1, 0.2, 0.3)
        model.appendBodyToJoint(parent, body, place)
        model.addFrame(pin.Frame(name, parent, 0, place, pin.FrameType.BODY))
    return Robot(model, find_robot("planar3r"))


def velocity_map(plant: MujocoPlant, q: Array) -> Array:
    """Return T with qvel = T v."""
    T = np.zeros((plant.model.nv, plant.robot.nv))
    for column, unit in zip(T.T, np.eye(plant.robot.nv), strict=True):
        plant.coordinates.velocity_to_mujoco(q, unit, out := np.zeros(plant.model.nv))
        column[:] = out
    return T


def random_state(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    return robot.random_configuration(rng), rng.normal(size=robot.nv)


@pytest.mark.parametrize("name", [*bundled_robots(), *OTHERS, "placed", "zoo"])
def test_mass_matrix_and_bias_agree_with_pinocchio(name: str) -> None:
    """M = TᵀM'T and N = Tᵀ(N' + M'T'v), T' by differences; power is invariant."""
    robot = load(name)
    plant = MujocoPlant(robot, Mujoco())
    rng = np.random.default_rng(1)
    for _ in range(3):
        q, v = random_state(robot, rng)
        plant.reset(0.0, q, v)
        mujoco.mj_forward(plant.model, plant.data)
        full = mass_matrix(plant.model, plant.data)
        state = robot.state(0.0, q, v)
        M = np.triu(state.mass_matrix) + np.triu(state.mass_matrix, 1).T
        N = state.nonlinear_effects
        T, h = velocity_map(plant, q), 1e-6
        ahead, behind = (
            velocity_map(plant, robot.integrate(q, s * h * v)) for s in (1.0, -1.0)
        )
        T_rate = (ahead - behind) / (2.0 * h)
        np.testing.assert_allclose(T.T @ full @ T, M, rtol=0, atol=1e-11 * M.max())
        bias = T.T @ (plant.data.qfrc_bias + full @ T_rate @ v)
        np.testing.assert_allclose(bias, N, rtol=0, atol=1e-9 * np.abs(N).max())
        tau = rng.normal(size=robot.nv)
        plant.coordinates.effort_to_mujoco(q, tau, f := np.ones(plant.model.nv))
        np.testing.assert_allclose(T.T @ f, tau, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", [*bundled_robots(), *OTHERS, "placed", "zoo"])
def test_states_go_there_and_back(name: str) -> None:
    robot = load(name)
    plant = MujocoPlant(robot, Mujoco())
    rng = np.random.default_rng(2)
    for _ in range(10):
        q, v = random_state(robot, rng)
        plant.reset(0.0, q, v)
        q_back, v_back = plant.coordinates.from_mujoco(plant.data.qpos, plant.data.qvel)
        assert np.abs(robot.difference(q, q_back)).max() < 1e-14
        assert np.abs(v - v_back).max() < 1e-13


# --- contacts ------------------------------------------------------------------------


def standing(name: str) -> tuple[Robot, Array, list[str], Array]:
    """Return a robot, its stance in the air, its feet and its springs [N·m/rad]."""
    robot = load(name)
    q = robot.home()
    feet = {
        "talos": ["left_sole_link", "right_sole_link"],
        "g1": ["left_ankle_roll_link", "right_ankle_roll_link"],
        "solo12": ["FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"],
        "go2": ["FL_foot", "FR_foot", "RL_foot", "RR_foot"],
    }[name]
    stance = {"talos": "half_sitting", "solo12": "straight_standing", "go2": "standing"}
    if name in stance:
        model = robot.model.copy()
        pin.loadReferenceConfigurations(model, str(robot.source.srdf), False)
        q = np.array(model.referenceConfigurations[stance[name]])
    stiffness = {"talos": 5000.0, "g1": 500.0, "solo12": 10.0, "go2": 100.0}[name]
    light = re.compile("gripper|head|wrist|arm_.*_[567]_")
    springs = np.array(
        [20.0 if light.search(f) else stiffness for f in robot.dof_names]
    )
    springs[:6] = 0.0
    return robot, q, feet, springs


def stand(
    plant: MujocoPlant, q: Array, springs: Array, duration: float
) -> tuple[Array, Array, dict[str, Array]]:
    """Hold the joints with springs, starting at touchdown; return the final state."""
    robot = plant.robot
    reference = q.copy()
    reference[2] -= plant.clearance(q)
    x, v = reference, np.zeros(robot.nv)
    plant.reset(0.0, x, v)
    for k in range(round(duration / 0.001)):
        t, tau = 0.001 * k, springs * robot.difference(x, reference)
        x, v = plant.advance(t, t + 0.001, tau)
    tau = springs * robot.difference(x, reference)
    log_channels = plant.log_channels(duration, x, v, tau)
    found = {name: np.asarray(reading.value) for name, reading in log_channels.items()}
    return robot.difference(reference, x)[:6], v, found


def dampers(springs: Array) -> Friction:
    """Return the springs' damping: implicit, since they are stiff."""
    return Friction(viscous=0.03 * springs)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["talos", "solo12", *further("g1", "go2")])
def test_a_legged_robot_stands_on_its_own_feet(name: str) -> None:
    """It stands at rest on its feet's collision geometry, within 2 cm and 2°.

    It sinks by the deflection of its springs. The ground carries its weight, and the
    moments of the forces about the centre of mass cancel.
    """
    robot, q, feet, springs = standing(name)
    plant = MujocoPlant(
        robot,
        Mujoco(
            contacts=[ContactShape(foot) for foot in feet],
            friction=dampers(springs),
        ),
    )
    moved, v, forces = stand(plant, q, springs, 3.0)
    assert np.abs(moved[:3]).max() < 0.02
    assert np.abs(moved[3:]).max() < 0.035
    assert np.abs(v).max() < 0.1
    total = sum(forces[f"plant.contact.{foot}.force"] for foot in feet)
    weight = 9.81 * sum(inertia.mass for inertia in robot.model.inertias)
    np.testing.assert_allclose(total, [0.0, 0.0, weight], rtol=0, atol=0.01 * weight)
    assert all(
        forces[f"plant.contact.{foot}.force"][2] > 0.05 * weight for foot in feet
    )


def ball(radius: float = 0.1) -> Robot:
    """Return a ball of 2 kg that floats freely."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "root")
    model.appendBodyToJoint(
        joint, pin.Inertia.FromSphere(2.0, radius), pin.SE3.Identity()
    )
    model.addFrame(pin.Frame("body", joint, 0, pin.SE3.Identity(), pin.FrameType.BODY))
    return Robot(model, find_robot("planar3r"))


def test_a_contact_force_is_the_grounds_on_the_robot_about_the_frame() -> None:
    """A block at rest under a frame beside it: f = m g, moment = r × f."""
    robot = ball()
    aside = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.2]))
    kind = pin.FrameType.OP_FRAME
    robot.model.addFrame(pin.Frame("aside", 1, 0, aside, kind))
    robot = Robot(robot.model, robot.source)
    shape = ContactShape("aside", Box((0.2, 0.2, 0.2)), (-0.5, 0.0, -0.2))
    plant = MujocoPlant(robot, Mujoco(contacts=[shape], ground=Ground(height=1.0)))
    q = np.array([0.0, 0.0, 1.1, 0.0, 0.0, 0.0, 1.0])
    plant.reset(0.0, q, np.zeros(6))
    q, v = plant.advance(0.0, 1.0, np.zeros(6))
    log_channels = plant.log_channels(1.0, q, v, np.zeros(6))
    force, moment = (
        log_channels[f"plant.contact.aside.{k}"].value for k in ("force", "moment")
    )
    weight = 2.0 * 9.81
    np.testing.assert_allclose(force, [0.0, 0.0, weight], rtol=0, atol=1e-3)
    np.testing.assert_allclose(moment, [0.0, 0.5 * weight, 0.0], rtol=0, atol=1e-3)
    assert log_channels["plant.contact.aside.force"].unit == "N"


@pytest.mark.parametrize(("mu", "slides"), [(0.3, True), (0.7, False)])
def test_friction_of_the_ground_is_coulombs(mu: float, slides: bool) -> None:
    """A block under gravity tilted by 27° (tan = 0.5): a = g (sin - µ cos), or at
    rest."""
    robot = ball()
    tilt = np.arctan(0.5)
    robot.model.gravity.linear = 9.81 * np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    contact = ContactShape("body", Box((0.2, 0.2, 0.02)))
    ground = Ground(friction=mu)
    plant = MujocoPlant(robot, Mujoco(contacts=[contact], ground=ground))
    plant.reset(0.0, np.array([0, 0, 0.01, 0, 0, 0, 1.0]), np.zeros(6))
    _, v = plant.advance(0.0, 0.5, np.zeros(6))
    expected = 9.81 * (np.sin(tilt) - mu * np.cos(tilt)) if slides else 0.0
    assert v[0] == pytest.approx(0.5 * expected, abs=0.02)


def test_shapes_touch_where_they_are() -> None:
    robot = ball()
    q = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    for shape, height in [
        (Sphere(0.1), 0.9),
        (Box((0.2, 0.4, 0.6)), 0.7),
        (Capsule(0.1, 0.4), 0.7),
        (Cylinder(0.1, 0.4), 0.8),
    ]:
        for offset in (0.0, 0.3):
            contact = ContactShape("body", shape, (0.0, 0.0, offset))
            plant = MujocoPlant(
                robot, Mujoco(contacts=[contact], ground=Ground(height=0.2))
            )
            found = plant.clearance(q)
            assert found == pytest.approx(height + offset - 0.2, abs=1e-6), shape


# --- refusals ------------------------------------------------------------------------


def test_a_floating_root_has_no_motor() -> None:
    plant = MujocoPlant(ball(), Mujoco())
    plant.reset(0.0, np.array([0, 0, 0, 0, 0, 0, 1.0]), np.zeros(6))
    with pytest.raises(
        SimulationError, match=r"^the effort at t = 0 s pushes the floa"
    ):
        plant.advance(0.0, 0.01, np.full(6, 2e-3))


def test_a_joint_without_counterpart_is_refused() -> None:
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelSphericalZYX(), pin.SE3.Identity(), "neck")
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    robot = Robot(model, find_robot("planar3r"))
    with pytest.raises(
        ModelError, match=r"joint 'neck' is a JointModelSphericalZYX, wh"
    ):
        MujocoPlant(robot, Mujoco())


def test_impossible_inertias_are_refused() -> None:
    """MuJoCo requires A + B >= C of principal inertias; Pinocchio accepts any."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "hip")
    inertia = pin.Inertia(1.0, np.zeros(3), np.diag([1.0, 1.0, 3.0]))
    model.appendBodyToJoint(joint, inertia, pin.SE3.Identity())
    with pytest.raises(SimulationError, match=r"^MuJoCo rejects planar3r: .*inertia"):
        MujocoPlant(Robot(model, find_robot("planar3r")), Mujoco())


@pytest.mark.parametrize(("options", "kind", "message"), [
    ({"contacts": [ContactShape("panda_tpc", Sphere(0.1))]},
     FrameNotFoundError,
     "contacts.panda_tpc: no ... 'panda_tpc' ... 'panda_tcp'"),
    ({"pushes": [Push("panda_tpc")]},
     FrameNotFoundError,
     "pushes.0.frame: no ... 'panda_tpc' ... 'panda_tcp'"),
])  # fmt: skip
def test_settings_that_are_none(options: Any, kind: Any, message: str) -> None:
    with pytest.raises(kind, match=wording(message)):
        MujocoPlant(load("panda"), Mujoco(**options))


def test_clearance_is_of_contacts() -> None:
    with pytest.raises(
        SimulationError, match=r"^panda has no contacts with the ground"
    ):
        MujocoPlant(load("panda"), Mujoco()).clearance(load("panda").home())


def test_a_foot_that_cannot_touch_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bare.urdf").write_text(ARM)
    robot = Robot.load(tmp_path / "bare.urdf")
    message = r"^contacts.upper: no collision geometry is fixed to it; give a shape$"
    with pytest.raises(SimulationError, match=message):
        MujocoPlant(robot, Mujoco(contacts=[ContactShape("upper")]))
    message = r"^ContactShape: shape: plane is not possible here; needs a sphere, "
    with pytest.raises(SimulationError, match=message):
        ContactShape("leg", HalfSpace())
    message = r"^contacts.base: it is fixed to the world and never moves$"
    with pytest.raises(SimulationError, match=message):
        MujocoPlant(robot, Mujoco(contacts=[ContactShape("base", Sphere(0.1))]))


def test_a_motion_that_diverges_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It leaves no file, as MuJoCo does by default."""
    monkeypatch.chdir(tmp_path)
    robot = load("panda")
    plant = MujocoPlant(robot, Mujoco())
    plant.reset(0.0, robot.home(), np.zeros(7))
    with pytest.raises(
        SimulationError, match=r"^the motion diverged before t = 0.01 s"
    ):
        plant.advance(0.0, 0.01, np.full(7, 1e14))
    assert not list(tmp_path.iterdir())


def test_mujoco_carries_the_payload_of_a_time_line() -> None:
    """Mass matrix and gravity for the present fraction; the hand does not sag."""
    robot = load("panda")
    q, rest = robot.home(), np.zeros(7)
    made = hsp.Controller(robot, [hsp.FramePose("panda_tcp")], start=q)
    made.at(0.1).ramp(0.2).payload(
        "panda_tcp", 2.0, center=[0.02, 0.0, 0.05], inertia=[0.01, 0.02, 0.015]
    )
    made.at(0.15).ramp(0.1).gravity([0.0, 1.0, -9.0])
    plant = MujocoPlant(robot, Mujoco())
    made.followed_by(plant.dynamics)
    plant.reset(0.0, q, rest)
    for t in (0.0, 0.21, 0.4):  # before, in both ramps, after
        made.compute(t, q, rest)
        plant.advance(t, t + 1e-9, rest)
        expected = robot.mass_matrix(q, made.state.dynamics)
        found = mass_matrix(plant.model, plant.data)
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(plant.model.opt.gravity, [0.0, 1.0, -9.0])
    made.restart()
    none = hsp.compensation.Compensation(momentum_observer=None)
    given: dict[str, Any] = {"duration": 0.6, "control_period": 1e-3}
    run = hsp.simulate(made, q, plant=Mujoco(), compensation=none, **given)
    there = [robot.state(0.0, each, rest).position("panda_tcp") for each in run.q]
    # With the previous bodies the hand sags by 20 mm.
    np.testing.assert_allclose(there, [there[0]] * len(there), rtol=0.0, atol=1e-9)


def test_the_clock_of_mujoco_is_that_of_the_run() -> None:
    """Also of one that does not start at 0, as its users' callbacks see it."""
    robot = Robot.load("panda")
    plant, rest = MujocoPlant(robot, Mujoco()), np.zeros(7)
    plant.reset(2.0, robot.home(), rest)
    plant.advance(2.0, 2.003, rest)
    assert plant.data.time == pytest.approx(2.003)
