"""Several robots as one: every block equals the robot alone at its placement."""

import copy
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from loaded_robots import load
from robot_texts import ARM
from wording import wording

from hsp_control import (
    Controller,
    FramePosition,
    Gains,
    Hold,
    JointCentering,
    Robot,
    simulate,
)
from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    FrameNotFoundError,
    HspControlError,
    JointNotFoundError,
    ModelError,
)
from hsp_control.robot.description.loading import RobotPart, combine, placement
from hsp_control.robot.description.robot_description import ToolFrame
from hsp_control.robot.description.sources import RobotSource
from hsp_control.robot.integrators import Rk4

LEFT = placement([0.0, 0.3, 0.1], [0.0, 0.0, 0.0])
# tilted: gravity has another direction
RIGHT = placement([0.9, -0.4, 0.2], [0.7, -0.4, 2.5])
HERE = pin.SE3.Identity()


@cache
def pair() -> Robot:
    """Return two Pandas, the second one tilted."""
    return Robot.combine(
        {"left": (load("panda"), LEFT), "right": (load("panda"), RIGHT)}
    )


def alone(place: pin.SE3) -> Robot:
    """Return one Panda with the gravity of that placement."""
    down = place.rotation.T @ np.array([0.0, 0.0, -9.81])
    return Robot.load("panda", gravity=down)


ARMS = {"left": (slice(0, 7), LEFT), "right": (slice(7, 14), RIGHT)}


def test_placement_is_a_position_and_roll_pitch_yaw() -> None:
    """As in a URDF: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    place = placement([1.0, 2.0, 3.0], [0.3, -0.2, 1.1])
    (cr, cp, cy), (sr, sp, sy) = (f([0.3, -0.2, 1.1]) for f in (np.cos, np.sin))
    Rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    Ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    Rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    np.testing.assert_allclose(place.rotation, Rz @ Ry @ Rx, atol=1e-15)
    np.testing.assert_array_equal(place.translation, [1.0, 2.0, 3.0])


def test_combined_robots_do_not_mix() -> None:
    """Kinematics, gravity and limits of a part equal those of the robot alone.

    A tilted Panda, a planar arm (cos, sin) upside down, and a floating quadruped.
    """
    up = pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.2, 0.3), np.array([1.0, 2.0, 0.5]))
    own = {
        "left": (load("panda"), RIGHT),
        "flat": (load("planar3r"), up),
        "dog": (load("solo12"), pin.SE3.Identity()),
    }
    both = Robot.combine(own)
    assert (both.nq, both.nv) == (7 + 6 + 19, 7 + 3 + 18)
    rng = np.random.default_rng(29)
    q = both.random_configuration(rng)
    v, a = rng.standard_normal((2, both.nv))
    state = both.state(0.0, q, v)
    M, M_dot = state.mass_matrix.copy(), state.mass_matrix_rate.copy()
    tau = state.inverse_dynamics(a)
    back = both.forward_dynamics(q, v, tau)
    np.testing.assert_allclose(back, a, rtol=0, atol=1e-9)  # M of condition 1e4
    lower, upper = both.position_limits()
    home = both.joint_positions(both.home())
    start_q = start_v = 0
    for name, (robot, place) in own.items():
        of_q = slice(start_q, start_q + robot.nq)
        of_v = slice(start_v, start_v + robot.nv)
        start_q, start_v = of_q.stop, of_v.stop
        # Gravity in the part's axes; it may hang from the ceiling.
        turned = copy.deepcopy(robot)
        turned.model.gravity.linear = place.rotation.T @ robot.model.gravity.linear
        alone = turned.state(0.0, q[of_q], v[of_v])
        for actual, expected in (
            (M[of_v, of_v], alone.mass_matrix),
            (M_dot[of_v, of_v], alone.mass_matrix_rate),
            (state.nonlinear_effects[of_v], alone.nonlinear_effects),
            (tau[of_v], alone.inverse_dynamics(a[of_v])),
            (lower[of_v], robot.position_limits()[0]),
            (upper[of_v], robot.position_limits()[1]),
            (home[of_v], robot.joint_positions(robot.home())),
        ):
            np.testing.assert_allclose(actual, expected, rtol=1e-12, atol=1e-12)
        M[of_v, of_v] = M_dot[of_v, of_v] = 0.0
        # The last frame, at the part's placement, moved by its own joints alone.
        frame, mine = robot.frame_names[-1], alone.frame(robot.frame_names[-1])
        there = state.frame(f"{name}_{frame}")
        R = np.kron(np.eye(2), place.rotation)
        np.testing.assert_allclose(there.position, place.act(mine.position), atol=1e-14)
        np.testing.assert_allclose(there.drift, R @ mine.drift, atol=1e-12)
        for what in ("jacobian", "jacobian_dot"):
            moved = getattr(there, what).copy()
            expected = R @ getattr(mine, what)
            np.testing.assert_allclose(moved[:, of_v], expected, rtol=0, atol=1e-12)
            moved[:, of_v] = 0.0
            assert not moved.any()
    assert not M.any()  # nothing outside the blocks
    assert not M_dot.any()


def test_each_arm_moves_as_if_alone() -> None:
    """Two tasks and centering on both: the same path as the arm alone.

    With a block-diagonal Jacobian and metric the law decouples. Rk4 makes the same
    steps, so that differences are rounding.
    """
    both = pair()
    q0 = both.home() + np.tile(0.1 * np.arange(7), 2)

    def task(robot: Robot, prefix: str, target: Array) -> FramePosition:
        name = f"{prefix}panda_tcp"
        return FramePosition(name, Hold(target), gains=Gains(100.0, 20.0))

    away = np.array([0.05, -0.05, 0.03])
    state = both.state(0.0, q0, np.zeros(14))
    tasks = [
        task(both, f"{arm}_", state.position(f"{arm}_panda_tcp") + away) for arm in ARMS
    ]
    options = {"duration": 0.3, "log_period": 0.1, "integrator": Rk4(0.005)}
    together = simulate(
        Controller(both, tasks, JointCentering()),
        q0,
        **options,  # type: ignore[arg-type]
    )
    for arm, (own, place) in ARMS.items():
        single = alone(place)
        start = single.state(0.0, q0[own], np.zeros(7)).position("panda_tcp")
        turned = place.rotation.T @ away
        apart = simulate(
            Controller(single, [task(single, "", start + turned)], JointCentering()),
            q0[own],
            **options,  # type: ignore[arg-type]
        )
        for what in ("q", "v", "tau"):
            np.testing.assert_allclose(
                together[what][:, own], apart[what], rtol=0, atol=1e-10, err_msg=arm
            )


# -- refusals --------------------------------------------------------------------


def source() -> RobotSource:
    """Return the source of the Panda."""
    return load("panda").source


MISTAKES: list[tuple[Callable[[], object], type[HspControlError], str]] = [
    (lambda: Robot.combine({"only": (load("panda"), HERE)}), ModelError,
     "... two or more ... ['only_']"),
    (lambda: combine([]), ModelError, "... different names ... []"),
    (lambda: combine([(RobotPart("a_", source(), HERE), load("panda").model)] * 2),
     ModelError, "... different names ... ['a_', 'a_']"),
    (lambda: Robot.combine({"a": (load("panda"), HERE),
                            "b": (Robot.load("panda", gravity=[0, 0, 0]), HERE)}),
     ModelError, "... differ in gravity"),
    (lambda: Robot.combine({"a": (load("panda"), HERE),
                            "b": (Robot.load("panda", locked={}), HERE)}),
     ModelError, "... b_panda: ... mimic joints ... mimic=False"),
    (lambda: Robot.combine({"a": (pair(), HERE), "b": (load("panda"), HERE)}),
     ModelError, "... a_panda+panda ... already"),
    (lambda: pair().frame_id("panda_tcp"), FrameNotFoundError, "no ... 'panda_tcp'"),
    (lambda: pair().velocity_index("left_panda_joint8"), JointNotFoundError,
     "no ... 'left_panda_joint8' ... 'left_panda_joint"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("make", "error", "message"), MISTAKES, ids=[m[2][:40] for m in MISTAKES]
)
def test_every_mistake_is_named(
    make: Callable[[], object], error: type[HspControlError], message: str
) -> None:
    with pytest.raises(error) as caught:
        make()
    assert re.search(wording(message), str(caught.value))


def test_a_link_may_have_a_joints_name(tmp_path: Path) -> None:
    """Pinocchio finds frames by name alone; the hands of Z1 and SO-100 are such."""
    file = tmp_path / "arm.urdf"
    file.write_text(ARM.replace('"lower"', '"elbow"'))
    arm = Robot.load(file, tool_frames={"tip": ToolFrame("elbow", (0.0, 0.0, 0.5))})
    assert arm.model.frames[arm.frame_id("elbow")].type == pin.FrameType.BODY
    both = Robot.combine({"left": (arm, LEFT), "right": (arm, RIGHT)})
    q, rest = np.array([0.3, -0.4]), np.zeros(2)
    alone = arm.state(0.0, q, rest)
    state = both.state(0.0, np.concatenate([q, q]), np.zeros(4))
    assert not any("\t" in name for name in both.frame_names)
    for prefix, place in (("left", LEFT), ("right", RIGHT)):
        for frame in ("elbow", "tip"):
            found = state.position(f"{prefix}_{frame}")
            expected = place.act(alone.position(frame))
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
