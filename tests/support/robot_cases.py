"""Robots of every kind, random states, and their terms.

The kinds are fixed, planar and floating roots, continuous joints (nq ≠ nv) and joints
that mimic others.
"""

import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest

from hsp_control import Robot, RobotState
from hsp_control.common.arrays import Array

BUNDLED = ("planar3r", "panda", "iiwa14")
ROBOTS: dict[str, tuple[str, dict[str, Any]]] = {
    "planar3r": ("planar3r", {}),  # three continuous joints
    "panda": ("panda", {}),
    "panda_fingers": ("panda", {"locked": {}}),  # one finger mimics the other
    "iiwa14": ("iiwa14", {}),
    "ur5": ("ur5", {}),
    "tiago": ("tiago", {}),  # two continuous joints among 48
    "tiago_pro": ("tiago_pro", {}),  # continuous and mimic joints
    "talos_arm_planar": ("talos_arm", {"root": "planar"}),
    "talos_arm_free_flyer": ("talos_arm", {"root": "free_flyer"}),
    "panda_fingers_free_flyer": ("panda", {"locked": {}, "root": "free_flyer"}),
    "solo12": ("solo12", {}),
}


@cache
def load(case: str) -> Robot:
    name, options = ROBOTS[case]
    if name not in BUNDLED:
        pytest.importorskip("example_robot_data")
    return Robot.load(name, **options)


def draw(case: str, seed: int) -> tuple[Robot, Array, Array, np.random.Generator]:
    """Return a robot at a random configuration and velocity."""
    robot, rng = load(case), np.random.default_rng(seed)
    q = robot.random_configuration(rng)
    return robot, q, rng.standard_normal(robot.nv), rng


def everything(state: RobotState, frame: str) -> dict[str, Array]:
    """Return copies of all terms of a state."""
    kinematics = state.frame(frame)
    names = ("rotation", "position", "jacobian", "jacobian_dot", "velocity", "drift")
    terms = {name: np.array(getattr(kinematics, name)) for name in names}
    terms["mass_matrix"] = state.mass_matrix.copy()
    terms["mass_matrix_rate"] = state.mass_matrix_rate.copy()
    terms["nonlinear_effects"] = state.nonlinear_effects.copy()
    terms["effort"] = state.inverse_dynamics(np.ones(state.robot.nv)).copy()
    return terms


def assert_equal_terms(
    actual: dict[str, Array], expected: dict[str, Array], atol: float = 0.0
) -> None:
    assert actual.keys() == expected.keys()
    for name, value in expected.items():
        np.testing.assert_allclose(
            actual[name], value, rtol=atol, atol=atol, err_msg=name
        )


def by_pickle(robot: Robot) -> Robot:
    return pickle.loads(pickle.dumps(robot))
