"""Parts of TSID's problems on two feet, with its own API, for standing and walking."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import tsid
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array

FORCE_WEIGHT = 1e-5  # regularisation of the forces, as in TSID's exercises
MAX_FORCE = 12.0  # of a sole, in robot weights


def sole(
    robot: Any, frame: str, corners: Array, friction: float, damping: float, most: float
) -> Any:
    """Return a contact of a flat sole, which is kept still by damping alone.

    Args:
        robot: TSID's robot.
        frame: The frame of the sole; also the contact's name.
        corners: Corners in that frame, shape (4, 3) [m].
        friction: The coefficient of the cone.
        damping: Kd [1/s].
        most: The largest normal force [N].
    """
    # TSID's pyramid contains the cone of its coefficient; this one is inside our cone.
    inner = friction / np.sqrt(2.0)
    up = np.array([0.0, 0.0, 1.0])
    contact = tsid.Contact6d(
        frame, robot, frame, corners.T.copy(), up, inner, 0.0, most
    )
    contact.setKp(np.zeros(6))
    contact.setKd(damping * np.ones(6))
    return contact


def center_of_mass(robot: Any, frequency: float) -> Any:
    """Return the task of the centre of mass, critically damped with ω0 [rad/s]."""
    task = tsid.TaskComEquality("com", robot)
    task.setKp(frequency**2 * np.ones(3))
    task.setKd(2.0 * frequency * np.ones(3))
    return task


def pose(
    robot: Any, name: str, frame: str, mask: Sequence[int], frequency: float
) -> Any:
    """Return the task of some components of a frame, in world axes.

    Args:
        robot: TSID's robot.
        name: The task's name.
        frame: The frame.
        mask: Which of position and orientation count, 1 or 0, six.
        frequency: ω0, critically damped [rad/s].
    """
    task = tsid.TaskSE3Equality(name, robot, frame)
    task.useLocalFrame(False)
    task.setKp(frequency**2 * np.ones(6))
    task.setKd(2.0 * frequency * np.ones(6))
    task.setMask(np.array(mask, dtype=float))
    return task


def posture(robot: Any, q0: Array, gain: float, rate: float) -> Any:
    """Return the posture task that is K_N (g - v) + g' with g = -α (q - q0).

    Args:
        robot: TSID's robot.
        q0: The configuration, with that of the root, shape (nq,).
        gain: K_N [1/s].
        rate: α [1/s].
    """
    joints = q0[7:]
    task = tsid.TaskJointPosture("posture", robot)
    task.setKp(gain * rate * np.ones(len(joints)))
    task.setKd((gain + rate) * np.ones(len(joints)))
    sample = tsid.TrajectorySample(len(joints))
    write(sample, joints, np.zeros(len(joints)), np.zeros(len(joints)))
    task.setReference(sample)
    return task


def effort_bounds(robot: Any, effort: Array) -> Any:
    """Return the bounds of the motors, shape (nv - 6,) [N·m or N]."""
    task = tsid.TaskActuationBounds("effort", robot)
    task.setBounds(-effort, effort)
    return task


def write(sample: Any, x: ArrayLike, x_dot: ArrayLike, x_ddot: ArrayLike) -> None:
    """Write a reference, its first and its second derivative into a sample."""
    sample.value(np.asarray(x))
    sample.derivative(np.asarray(x_dot))
    sample.second_derivative(np.asarray(x_ddot))


def place(position: ArrayLike, rotation: Array) -> Array:
    """Return a pose in TSID's terms: the rotation's columns follow, shape (12,)."""
    return np.concatenate([np.asarray(position), rotation.T.ravel()])


def frame_pose(model: Any, problem: Any, robot: Any, frame: str) -> Any:
    """Return where a frame is, for the data of the last step."""
    return robot.framePosition(problem.data(), model.getFrameId(frame))


def solver_of(problem: Any) -> Any:
    """Return a solver of a problem's size."""
    solver = tsid.SolverHQuadProgFast("qp")
    solver.resize(problem.nVar, problem.nEq, problem.nIn)
    return solver


def add_tasks(problem: Any, weights: Mapping[Any, float]) -> None:
    """Add weighted tasks to the cost."""
    for task, weight in weights.items():
        problem.addMotionTask(task, weight, 1, 0.0)
