"""Check that states, gravity and copies of robots combined into one do not mix."""

import copy
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from robot_cases import by_pickle, load

from hsp_control import Robot
from hsp_control.common.exceptions import (
    ModelError,
)


def pair() -> tuple[Robot, dict[str, tuple[Robot, pin.SE3]]]:
    """Return an arm, the planar arm upside down and a walking one, as one robot."""
    up = pin.SE3(pin.rpy.rpyToMatrix(np.pi, 0.2, 0.3), np.array([1.0, 2.0, 0.5]))
    own = {
        "left": (load("panda"), pin.SE3.Identity()),
        "flat": (load("planar3r"), up),
        "dog": (load("solo12"), pin.SE3.Identity()),
    }
    return Robot.combine(own), own


def test_combined_robots_do_not_mix() -> None:
    """Each part moves, weighs and is limited as if alone, where it was put."""
    both, own = pair()
    assert (both.nq, both.nv) == (7 + 6 + 19, 7 + 3 + 18)
    rng = np.random.default_rng(29)
    q = both.random_configuration(rng)
    v, a = rng.standard_normal((2, both.nv))
    state = both.state(0.0, q, v)
    M, M_dot = state.mass_matrix.copy(), state.mass_matrix_rate.copy()
    tau = state.inverse_dynamics(a)
    lower, upper = both.position_limits()
    home = both.joint_positions(both.home())
    start_q = start_v = 0
    for name, (robot, place) in own.items():
        of_q = slice(start_q, start_q + robot.nq)
        of_v = slice(start_v, start_v + robot.nv)
        start_q, start_v = of_q.stop, of_v.stop
        # Gravity as the part feels it, which may hang from the ceiling.
        turned = copy.deepcopy(robot)
        turned.model.gravity.linear = place.rotation.T @ robot.model.gravity.linear
        alone = turned.state(0.0, q[of_q], v[of_v])
        for actual, expected in (
            (M[of_v, of_v], alone.mass_matrix),
            (M_dot[of_v, of_v], alone.mass_matrix_rate),
            (tau[of_v], alone.inverse_dynamics(a[of_v])),
            (lower[of_v], robot.position_limits()[0]),
            (upper[of_v], robot.position_limits()[1]),
            (home[of_v], robot.joint_positions(robot.home())),
        ):
            np.testing.assert_allclose(actual, expected, rtol=1e-12, atol=1e-12)
        M[of_v, of_v] = 0.0
        assert [f"{name}_{joint}" for joint in robot.joint_names] == [
            joint for joint in both.joint_names if joint.startswith(f"{name}_")
        ]
        # The last frame: moved to where the part stands, by its own joints alone.
        frame, mine = robot.frame_names[-1], alone.frame(robot.frame_names[-1])
        there = state.frame(f"{name}_{frame}")
        np.testing.assert_allclose(there.position, place.act(mine.position), atol=1e-14)
        R = np.kron(np.eye(2), place.rotation)
        for what in ("jacobian", "jacobian_dot"):
            moved = getattr(there, what).copy()
            np.testing.assert_allclose(
                moved[:, of_v], R @ getattr(mine, what), rtol=0, atol=1e-12
            )
            moved[:, of_v] = 0.0
            assert not moved.any()
    assert not M.any()  # nothing outside the blocks


@pytest.mark.parametrize("duplicate", [by_pickle, copy.deepcopy])
def test_combined_robot_round_trip(duplicate: Callable[[Robot], Robot]) -> None:
    both, own = pair()
    other = duplicate(both)
    assert other.joint_names == both.joint_names
    assert [part.prefix for part in other.parts] == [f"{name}_" for name in own]
    assert [part.source for part in other.parts] == [r.source for r, _ in own.values()]
    np.testing.assert_array_equal(other.home(), both.home())
    assert load("panda").parts[0].source == load("panda").source


def test_robots_that_cannot_be_combined() -> None:
    here = pin.SE3.Identity()
    with pytest.raises(ModelError, match="two or more, with different names"):
        Robot.combine({"only": (load("panda"), here)})
    with pytest.raises(
        ModelError, match="a robot with mimic joints cannot be combined"
    ):
        Robot.combine({"a": (load("panda"), here), "b": (load("panda_fingers"), here)})


def test_gravity_of_combined_robots_is_their_own() -> None:
    here = pin.SE3.Identity()
    weightless = {
        name: (Robot.load(robot, gravity=(0.0, 0.0, 0.0)), here)
        for name, robot in (("a", "panda"), ("b", "iiwa14"))
    }
    both = Robot.combine(weightless)
    state = both.state(0.0, both.home(), np.zeros(both.nv))
    np.testing.assert_allclose(state.nonlinear_effects, 0.0, rtol=0, atol=1e-12)
    with pytest.raises(ModelError, match="differ in gravity"):
        Robot.combine({**weightless, "c": (load("iiwa14"), here)})
