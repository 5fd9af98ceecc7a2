"""MuJoCo as an oracle for robots made from its models."""

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from hsp_control import Robot, RobotState
from hsp_control.companions.mujoco import MujocoCoordinates
from hsp_control.companions.mujoco.scene import Names


@dataclass
class Differences:
    """The largest differences to MuJoCo, relative to the largest number or to 1.

    That of the bias is also relative to the mass matrix, whose rounding it contains.
    """

    mass_matrix: float = 0.0
    bias: float = 0.0
    poses: float = 0.0
    jacobians: float = 0.0

    @property
    def largest(self) -> float:
        """The largest difference."""
        return max(self.mass_matrix, self.bias, self.poses, self.jacobians)


def differences(robot: Robot, model: Any, qpos: Any, count: int = 3) -> Differences:
    """Compare a robot with MuJoCo at random states.

    Mass matrix, bias (Coriolis and gravity), poses of all bodies and sites, and the
    Jacobians of all sites.

    Args:
        robot: The robot, from `Robot.from_mujoco`.
        model: The scene.
        qpos: Positions of the joints that are not in the robot.
        count: The number of states.
    """
    rng = np.random.default_rng(0)
    coordinates = MujocoCoordinates.of(robot, model)
    data = mujoco.MjData(model)
    found = Differences()
    for _ in range(count):
        q, v = robot.random_configuration(rng), rng.standard_normal(robot.nv)
        data.qpos[:], data.qvel[:] = qpos, 0.0
        coordinates.to_mujoco(q, v, data.qpos, data.qvel)
        mujoco.mj_forward(model, data)
        state = robot.state(0.0, q, v)
        T = velocity_map(coordinates, q, model.nv)
        _compare_dynamics(found, state, T, model, data)
        _compare_kinematics(found, state, T, model, data)
    return found


def velocity_map(coordinates: MujocoCoordinates, q: Any, size: int) -> Any:
    """Return T(q) of qvel = T v, shape (size, nv)."""
    columns = np.eye(coordinates.robot.nv)
    T = np.zeros((size, len(columns)))
    for column, unit in enumerate(columns):
        coordinates.velocity_to_mujoco(q, unit, T[:, column])
    return T


def mass_matrix(model: Any, data: Any) -> Any:
    """Return MuJoCo's mass matrix; the arguments changed with MuJoCo 4."""
    M = np.zeros((model.nv, model.nv))
    if hasattr(data, "qM"):
        mujoco.mj_fullM(model, M, data.qM)
    else:
        mujoco.mj_fullM(model, data, M)
    return M


def _compare_dynamics(
    found: Differences, state: RobotState, T: Any, model: Any, data: Any
) -> None:
    """With qvel = T v: Tᵀ M T a + Tᵀ (M T' v + bias) = Tᵀ qfrc."""
    upper = np.triu(state.mass_matrix)
    ours = upper + np.triu(upper, 1).T
    M = mass_matrix(model, data)
    theirs = T.T @ M @ T
    found.mass_matrix = max(found.mass_matrix, _relative(ours - theirs, theirs, 0.0))
    bias = T.T @ (M @ _frame_acceleration(state, model) + data.qfrc_bias)
    difference = state.nonlinear_effects - bias
    rounded = max(1.0, float(np.abs(theirs).max()))  # Coriolis forces are M times v²
    found.bias = max(found.bias, _relative(difference, bias, rounded))


def _frame_acceleration(state: RobotState, model: Any) -> Any:
    """Return T' v: MuJoCo's free joints use world axes, ours body axes.

    d/dt (R v_lin) = R (v_lin' + ω × v_lin).
    """
    names, joints = Names(model), state.robot.joints
    acceleration = np.zeros(model.nv)
    for index, name in enumerate(names.joints):
        if name in joints and joints[name].nv == 6:
            at, own = int(model.jnt_dofadr[index]), joints[name].idx_v
            linear, angular = state.v[own : own + 3], state.v[own + 3 : own + 6]
            body = names.bodies[model.jnt_bodyid[index]]
            turned = state.frame(body).rotation @ np.cross(angular, linear)
            acceleration[at : at + 3] = turned
    return acceleration


def _compare_kinematics(
    found: Differences, state: RobotState, T: Any, model: Any, data: Any
) -> None:
    names = Names(model)
    known = set(state.robot.frame_names)
    for body in range(1, model.nbody):
        if names.bodies[body] in known:
            frame = state.frame(names.bodies[body])
            _compare_pose(found, frame, data.xpos[body], data.xmat[body])
    for site in range(model.nsite):
        if names.sites[site] in known:
            frame = state.frame(names.sites[site])
            _compare_pose(found, frame, data.site_xpos[site], data.site_xmat[site])
            linear, angular = np.zeros((2, 3, model.nv))
            mujoco.mj_jacSite(model, data, linear, angular, site)
            jacobian = np.vstack([linear, angular]) @ T
            difference = _relative(frame.jacobian - jacobian, jacobian)
            found.jacobians = max(found.jacobians, difference)


def _compare_pose(found: Differences, frame: Any, position: Any, matrix: Any) -> None:
    turned = np.abs(frame.rotation - matrix.reshape(3, 3)).max()
    moved = _relative(frame.position - position, position)
    found.poses = max(found.poses, float(turned), moved)


def _relative(difference: Any, reference: Any, least: float = 1.0) -> float:
    scale = max(least, float(np.abs(reference).max(initial=0.0)))
    return float(np.abs(difference).max(initial=0.0)) / scale
