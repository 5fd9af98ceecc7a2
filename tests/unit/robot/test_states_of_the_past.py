"""No result depends on an earlier state, for robots of every kind.

Pinocchio's algorithms store intermediate results in their data. The n-th result of one
robot is compared with the first one of another, bit for bit.
"""

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from robot_cases import everything
from robot_kinds import KINDS, TEXTS

import hsp_control as hsp
from hsp_control import Robot, engine
from hsp_control.common.arrays import Array
from hsp_control.null_space.metrics import MassMatrixMetric
from hsp_control.robot.friction import JointFriction
from hsp_control.simulation.plants import Push
from hsp_control.simulation.plants.rigid_body import RigidBodyPlant, StickingPlant

kinds = pytest.mark.parametrize("kind", KINDS)


class Used:
    """All functions of one robot, to be called repeatedly."""

    def __init__(self, robot: Robot) -> None:
        self.robot = robot
        self.state = robot.state(0.0, robot.neutral(), np.zeros(robot.nv))
        self.frame = robot.frame_names[-1]
        friction = JointFriction.of(robot, coulomb=0.3, viscous=0.2)
        push = Push(self.frame, force=(1.0, 2.0, 3.0), duration=10.0)
        self.pushed = RigidBodyPlant(robot, [push])
        self.free = RigidBodyPlant(robot)
        self.sticking = StickingPlant(robot, friction)
        self.controller = None
        if not robot.unactuated:
            hold = hsp.Hold(self.state.position(self.frame) + 0.05)
            task = hsp.FramePosition(self.frame, hold)
            metric = MassMatrixMetric()
            field = hsp.TargetPosture()
            self.controller = hsp.Controller(
                robot, [task], field, limits=None, metric=metric, start=robot.neutral()
            )

    def everything(self, t: float, q: Array, v: Array, tau: Array) -> dict[str, Array]:
        """Return copies of all results at a state."""
        found = everything(self.state.update(t, q, v), self.frame)
        found["forward dynamics"] = self.robot.forward_dynamics(q, v, tau)
        found["inverse dynamics"] = self.robot.inverse_dynamics(q, v, tau)
        found["pushed"] = self.pushed.acceleration(t, q, v, tau)
        bound = self.free.bind(q, v, tau)
        self.state.run(bound.calls)
        found["bound plant"] = bound.value.copy()
        self.sticking.reset(t, q, v)
        found["sticking q"], found["sticking v"] = self.sticking.advance(
            t, t + 2e-3, tau
        )
        if self.controller is not None:
            out = self.controller.compute(t, q, v)
            found["tau"] = out.tau.copy()
            found["acceleration"] = out.acceleration.copy()
        c = self.state.centroidal
        for name in ("position", "jacobian", "jacobian_dot", "momentum_matrix_dot"):
            found[f"centroidal {name}"] = getattr(c, name).copy()
        return found


@kinds
def test_the_nth_state_is_a_fresh_one(kind: str, tmp_path: Path) -> None:
    robot = KINDS[kind](tmp_path)
    used = Used(robot)
    rng = np.random.default_rng(7)
    for k in range(4):
        q, t = robot.random_configuration(rng), 0.1 * k
        v, tau = rng.standard_normal((2, robot.nv))
        actual = used.everything(t, q, v, tau)
        expected = Used(KINDS[kind](tmp_path)).everything(t, q, v, tau)
        assert actual.keys() == expected.keys()
        for name, value in expected.items():
            np.testing.assert_array_equal(actual[name], value, err_msg=f"{name}, {k}")


@kinds
def test_forward_dynamics_are_the_inverse_of_inverse_dynamics(
    kind: str, tmp_path: Path
) -> None:
    """M disagrees with RNEA.

    Pinocchio's CRBA omits the coupling of a multi-DOF joint between a leader and its
    follower.
    """
    robot, rng = KINDS[kind](tmp_path), np.random.default_rng(8)
    for _ in range(5):
        q = robot.random_configuration(rng)
        v, a = rng.standard_normal((2, robot.nv))
        tau = robot.inverse_dynamics(q, v, a)
        found = robot.forward_dynamics(q, v, tau)
        np.testing.assert_allclose(found, a, rtol=0, atol=1e-9)


def reductions(folder: Path) -> Iterator[tuple[str, Robot, Robot, Array, Array]]:
    """Yield robots with mimic joints, the same without, G and o: q_free = G q + o."""
    for kind, text in TEXTS.items():
        if "<mimic" not in text:
            continue
        file = folder / f"{kind}.urdf"
        file.write_text(text)
        robot, free = Robot.load(file), Robot.load(file, mimic=False)
        # as in the URDF: q_free = A q_free + B q + b, link by link of a chain
        A, B, b = (np.zeros((free.nv, *each)) for each in ((free.nv,), (robot.nv,), ()))
        for name in robot.joint_names:
            own, there = (each.velocity_index(name) for each in (robot, free))
            B[there, own] = np.eye(free.joints[name].nv)
        joints = ElementTree.fromstring(text).findall("joint")
        mimics = {j.get("name"): j.find("mimic") for j in joints}
        for name in free.joint_names:
            mimic = mimics[name]
            if mimic is not None:
                b[free.velocity_index(name)] = float(mimic.attrib["offset"])
                leader = free.velocity_index(mimic.attrib["joint"])
                ratio = float(mimic.attrib["multiplier"])
                A[free.velocity_index(name), leader] = ratio
        chains = np.linalg.inv(np.eye(free.nv) - A)
        yield kind, robot, free, chains @ B, chains @ b


def test_mimic_joints_move_as_free_ones_that_are_moved_so(tmp_path: Path) -> None:
    """Placements, M, efforts and their rates, from the robot without mimic."""
    found = set()
    rng = np.random.default_rng(9)
    for kind, robot, free, G, o in reductions(tmp_path):
        found.add(kind)
        for _ in range(4):
            dq, v, a = rng.uniform(-1.0, 1.0, (3, robot.nv))
            q = robot.integrate(robot.neutral(), dq)
            q_free = free.integrate(free.neutral(), G @ dq + o)
            ours, theirs = robot.state(0.0, q, v), free.state(0.0, q_free, G @ v)
            close = {"rtol": 0, "atol": 1e-9, "err_msg": kind}
            for frame in free.frame_names:
                one, other = ours.frame(frame), theirs.frame(frame)
                np.testing.assert_allclose(one.position, other.position, **close)
                np.testing.assert_allclose(one.rotation, other.rotation, **close)
                np.testing.assert_allclose(one.jacobian, other.jacobian @ G, **close)
                np.testing.assert_allclose(one.drift, other.drift, **close)
            M = G.T @ theirs.mass_matrix @ G
            np.testing.assert_allclose(ours.mass_matrix, M, **close)
            M_dot = G.T @ theirs.mass_matrix_rate @ G
            np.testing.assert_allclose(
                ours.mass_matrix_rate, M_dot, rtol=0, atol=1e-6, err_msg=kind
            )
            effort = G.T @ theirs.inverse_dynamics(G @ a)
            np.testing.assert_allclose(ours.inverse_dynamics(a), effort, **close)
            one, other = ours.centroidal, theirs.centroidal
            for name in ("position", "velocity"):
                np.testing.assert_allclose(
                    getattr(one, name), getattr(other, name), **close
                )
            for name in (
                "jacobian",
                "jacobian_dot",
                "momentum_matrix",
                "momentum_matrix_dot",
            ):
                np.testing.assert_allclose(
                    getattr(one, name), getattr(other, name) @ G, **close
                )
    assert found >= {"lift below an arm", "chain of mimics", "follower first"}


@kinds
def test_a_mass_matrix_does_not_depend_on_earlier_results(
    kind: str, tmp_path: Path
) -> None:
    """After any earlier use of the dynamics' memory."""
    robot, rng = KINDS[kind](tmp_path), np.random.default_rng(2)
    for _ in range(3):
        q = robot.random_configuration(rng)
        v, tau = rng.standard_normal((2, robot.nv))
        fresh = np.zeros((robot.nv, robot.nv))
        engine.MassMatrix(dynamics=robot.dynamics(), q=q, M=fresh)()
        robot.forward_dynamics(q, v, tau)
        robot.inverse_dynamics(robot.random_configuration(rng), v, tau)
        robot.mass_matrix(robot.random_configuration(rng))
        np.testing.assert_array_equal(robot.mass_matrix(q), fresh)
