"""Costs of a frame's Jacobian: in closed form, and finite at every singularity.

`test_every_field.py` has each of them at random states, beside its oracle.
"""

import re
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from field_cases import placed
from hypothesis import given, settings
from hypothesis import strategies as st
from loaded_robots import load
from oracles import close
from places import THOROUGH
from wording import wording

from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    FieldError,
    FrameNotFoundError,
    HspControlError,
)
from hsp_control.declaration.quantities import Positive
from hsp_control.null_space.fields import InverseCondition, Manipulability
from hsp_control.null_space.fields.jacobian_cost import (
    JacobianCost,
    JacobianTerms,
    Rows,
)
from hsp_control.robot import differences

HANDS = {
    "planar3r": "tip",
    "panda": "panda_tcp",
    "iiwa14": "iiwa_link_ee",
    "ur5": "tool0",
    "kinova": "j2s6s200_end_effector",  # three continuous joints
}


def coupling(nv: int) -> Array:
    """Return a metric that couples all joints."""
    A = np.eye(nv) + 0.2 * np.random.default_rng(nv).normal(size=(nv, nv))
    return A.T @ A


# -- values ----------------------------------------------------------------------------


def test_the_planar_arm_in_closed_form() -> None:
    """With its last link folded away, √det(J Jᵀ) of joints 1 and 2 is |sin q2|.

    Rows (-s1 - s12, c1 + c12) and (-s12, c12) of two links of 1 m.
    """
    robot = load("planar3r")
    field = Manipulability("link3", axes="xy")
    for q1, q2 in np.random.default_rng(5).uniform(0.3, 2.8, (10, 2)):
        q = robot.integrate(robot.neutral(), np.array([q1, q2, 0.4]))
        state = robot.state(0.0, q, np.array([0.3, -0.7, 0.2]))
        # The floor of 1e-12 in G is small against σ² of 0.02 and more.
        assert field.value(state) == pytest.approx(-np.sin(q2), abs=1e-10)
        close(field.gradient(state), [0.0, -np.cos(q2), 0.0], 1e-9)
        close(field.gradient_rate(state), [0.0, -0.7 * np.sin(q2), 0.0], 1e-8)


# -- singularities ---------------------------------------------------------------------


def singular_members(robot: Robot, frame: str, axes: str) -> dict[str, JacobianCost]:
    """Return every cost, with metrics of large and of small numbers."""
    members: dict[str, JacobianCost] = {}
    every: tuple[Any, ...] = ("position", "orientation", "pose")[: 2 * len(axes) - 3]
    for rows in every:
        for form in ("determinant", "root", "log"):
            for unit in (1.0, 1e-8, 1e4):
                options: Any = {"form": form, "metric": unit * coupling(robot.nv)}
                members[f"{form} {rows} {unit}"] = Manipulability(
                    frame, rows=rows, axes=axes, **options
                )
        members[f"condition {rows}"] = InverseCondition(frame, rows=rows, axes=axes)
    return members


@pytest.mark.slow
@pytest.mark.parametrize("name", HANDS if THOROUGH else ["planar3r", "panda"])
def test_finite_at_every_singularity(name: str) -> None:
    """Joints at multiples of 45°: stretched, folded, wrist aligned, all combined."""
    robot = load(name)
    planar = name == "planar3r"
    frame, axes = HANDS[name], "xy" if planar else "xyz"
    members = singular_members(robot, frame, axes)
    worst = np.inf

    @settings(max_examples=60)
    @given(
        joints=st.lists(
            st.sampled_from([0.0, 0.25, -0.25, 0.5, -0.5, 1.0]),
            min_size=robot.nv,
            max_size=robot.nv,
        ),
        turn=st.floats(-3.0, 3.0),
        seed=st.integers(0, 99),
    )
    def finite(joints: list[float], turn: float, seed: int) -> None:
        nonlocal worst
        angles = np.pi * np.array(joints)
        angles[0] = turn  # off the world's axes, where zeros are not exact
        q = robot.integrate(robot.neutral(), angles)
        v = np.random.default_rng(seed).normal(size=robot.nv)
        state = robot.state(0.0, q, v)
        J = state.frame(frame).jacobian
        worst = min(worst, np.linalg.svd(J[:2] if planar else J)[1][-1])
        for which, field in members.items():
            assert np.isfinite(field.value(state)), which
            assert np.isfinite(field.gradient(state)).all(), which
            assert np.isfinite(field.gradient_rate(state)).all(), which

    finite()
    assert worst < 1e-12  # some of them were exactly singular


# -- refusals --------------------------------------------------------------------

PANDA = {"frame": "panda_tcp"}
MISTAKES: list[tuple[type, dict[str, Any], type[HspControlError], str]] = [
    (Manipulability, {"frame": "panda_tpc"}, FrameNotFoundError,
     "frame: no ... 'panda_tpc' ... 'panda_tcp'"),
    (Manipulability, {"form": "rot"}, FieldError,
     "Manipulability: form: unknown ... 'rot' ... 'root'"),
    (Manipulability, {"rows": "positions"}, FieldError,
     "Manipulability: rows: unknown ... 'positions' ... 'position'"),
    (InverseCondition, {"axes": "xw"}, FieldError, "... axes: 'xw' ... distinct"),
    (Manipulability, {"length": 0.0}, FieldError, "... length: 0.0 ... too small"),
    (InverseCondition, {"size": 1.0}, FieldError, "... size: unknown ... 'size'"),
    (Manipulability, {"metric": np.ones((6, 7))}, FieldError,
     "Manipulability: metric ... (6, 7) ... (nv, nv)"),
    (Manipulability, {"metric": np.ones((7, 7))}, FieldError,
     "Manipulability: metric ... positive definite"),
    (Manipulability, {"metric": np.eye(6)}, FieldError,
     "metric ... (6, 6) ... (7, 7)"),
    (Manipulability, {"frame": "panda_link2"}, FieldError,
     "... 3 rows ... 'panda_link2' ... 2 degrees"),
    (InverseCondition, {"frame": "panda_link5", "rows": "pose"}, FieldError,
     "... 6 rows ... 'panda_link5' ... 5 degrees"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "options", "error", "message"), MISTAKES, ids=lambda x: str(x)[:30]
)
def test_every_mistake_is_named(
    kind: type, options: dict[str, Any], error: type[HspControlError], message: str
) -> None:
    robot = load("panda")
    with pytest.raises(error) as caught:
        placed(
            kind(**(PANDA | options)),
            robot.state(0.0, robot.home(), np.zeros(robot.nv)),
        )
    assert re.search(wording(message), str(caught.value))


class Reach(JacobianCost):
    """A user's cost: minus half the square of the pose rows' Frobenius norm."""

    rows: Rows = "pose"
    length: Positive = 0.5

    def terms(self, J: Array, J_dot: Array) -> JacobianTerms:
        return JacobianTerms(-0.5 * float((J * J).sum()), -J, -J_dot)


@pytest.mark.parametrize("rows", ["position", "orientation", "pose"])
def test_a_user_s_own_cost_of_the_jacobian(rows: Rows) -> None:
    """Value, gradient and rate follow from its terms."""
    robot, frame = load("panda"), HANDS["panda"]
    rng = np.random.default_rng(10)
    q, v = robot.random_configuration(rng), rng.normal(size=robot.nv)
    state = robot.state(0.0, q, v)
    field = placed(Reach(rows=rows), state)
    assert field.frame == robot.end_effector == frame
    kept = {"position": [0, 1, 2], "orientation": [3, 4, 5], "pose": [*range(6)]}[rows]
    scale = np.array([1.0 if k < 3 or rows != "pose" else 0.5 for k in kept])[:, None]
    data, index = robot.model.createData(), robot.frame_id(frame)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    J = scale * pin.computeFrameJacobian(robot.model, data, q, index, axes)[kept]
    assert field.value(state) == pytest.approx(-0.5 * (J * J).sum(), rel=1e-14)
    close(field.gradient(state), differences.gradient(field.value, state), 1e-10)
    rate = differences.rate_along_flow(field.gradient, state)
    close(field.gradient_rate(state), rate, 1e-9)


def test_frames_beyond_a_joint_that_mimics() -> None:
    """Each joint is summed once; frames before it or on other branches work, too."""
    robot = Robot.load("panda", locked={})
    assert robot.mimics
    at_home = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    reported = (
        "frame: ... 'panda_rightfinger' ... 'panda_finger_joint2' ... mimic: false"
    )
    with pytest.raises(FieldError, match=wording(reported)):
        placed(Manipulability("panda_rightfinger"), at_home)
    free = Robot.load("panda", locked={}, mimic=False)
    q = free.random_configuration(np.random.default_rng(9))
    state = free.state(0.0, q, np.ones(9))
    beyond = Manipulability("panda_rightfinger", rows="pose")
    close(beyond.gradient(state), differences.gradient(beyond.value, state), 1e-9)
    # The leading finger is an ordinary prismatic joint, with or without followers.
    leading = Manipulability("panda_leftfinger")
    state = robot.state(0.0, q[:8], np.ones(8))
    other = free.state(0.0, q, np.ones(9))
    close(leading.gradient(state), leading.gradient(other)[:8], 1e-13)
