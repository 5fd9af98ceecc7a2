"""Payloads and gravity that change, in a MuJoCo model of a robot."""

import importlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from hsp_control import engine
from hsp_control.companions.mujoco.coordinates import Joint
from hsp_control.companions.mujoco.mjcf import MIN_INERTIA, principal_inertia
from hsp_control.robot import Robot


class CarriedInMujoco:
    """Lets a MuJoCo model have the bodies and the gravity of an engine's dynamics.

    Attributes:
        dynamics: The dynamics; `write` sets the bodies that they carry.
    """

    def __init__(self, robot: Robot, model: Any, joints: Sequence[Joint]) -> None:
        """Set the model, whose bodies have the names of the robot's joints."""
        self.dynamics = robot.dynamics()
        self._model, count = model, robot.model.njoints
        self._joints = [joint.index for joint in joints]
        self._bodies = [model.body(joint.name).id for joint in joints]
        # mass, centre and inertia of each joint's body, then gravity, in one array
        self._numbers = np.zeros(13 * count + 3)
        mass, center, inertia, gravity = np.split(
            self._numbers, np.cumsum([count, 3 * count, 9 * count])
        )
        self._mass, self._center = mass, center.reshape(count, 3)
        self._inertia, self._gravity = inertia.reshape(count, 9), gravity
        self._read = engine.BodyInertias(
            dynamics=self.dynamics,
            mass=self._mass,
            center=self._center,
            inertia=self._inertia,
            gravity=gravity,
        )
        self._read()
        self._written = self._numbers.copy()

    def write(self) -> None:
        """Write the changes since the last time."""
        self._read()
        if np.array_equal(self._numbers, self._written):
            return
        self._written[:] = self._numbers
        mujoco, model = importlib.import_module("mujoco"), self._model
        model.opt.gravity = self._gravity
        for joint, body in zip(self._joints, self._bodies, strict=True):
            inertia = self._inertia[joint].reshape(3, 3)
            principal, axes = principal_inertia(inertia)
            model.body_mass[body] = max(self._mass[joint], MIN_INERTIA)
            model.body_ipos[body] = self._center[joint]
            model.body_inertia[body] = principal
            mujoco.mju_mat2Quat(model.body_iquat[body], axes.ravel())
        # quantities that MuJoCo derives from them, at its own reference posture
        mujoco.mj_setConst(model, mujoco.MjData(model))
