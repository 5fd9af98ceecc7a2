"""Check the names of frames and joints, and that copies of a robot equal it."""

import copy
import pickle
import re
from collections.abc import Callable

import numpy as np
import pytest
from robot_cases import ROBOTS, assert_equal_terms, by_pickle, draw, everything, load

from hsp_control import Robot
from hsp_control.common.exceptions import (
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
)

# --- names ---------------------------------------------------------------------------


def test_unknown_frame() -> None:
    robot, q, v, _ = draw("panda", seed=22)
    message = (
        "no frame 'panda_hnad'; did you mean 'panda_hand'? (the model has universe"
    )
    for ask in (robot.frame_id, robot.state(0.0, q, v).frame):
        with pytest.raises(FrameNotFoundError, match=re.escape(message)) as caught:
            ask("panda_hnad")
        assert isinstance(caught.value, LookupError)
    with pytest.raises(FrameNotFoundError, match="did you mean 'panda_hand'"):
        robot.frame_id("hand")


@pytest.mark.parametrize(
    ("joint", "hint"),
    [
        ("panda_joint8", "; did you mean 'panda_joint"),
        ("panda_finger_joint1", "; did you mean 'panda_joint"),  # locked
        ("universe", " (the model has panda_joint1, "),  # Pinocchio's, not a joint
        ("panda_hand", " (the model has panda_joint1, "),  # a frame
    ],
)
def test_unknown_joint(joint: str, hint: str) -> None:
    with pytest.raises(JointNotFoundError, match=re.escape(f"no joint {joint!r}")) as e:
        load("panda").velocity_index(joint)
    assert hint in str(e.value)
    assert isinstance(e.value, LookupError)


# --- persistence ---------------------------------------------------------------------


@pytest.mark.parametrize("case", ROBOTS)
@pytest.mark.parametrize("duplicate", [by_pickle, copy.deepcopy])
def test_pickle_and_deep_copy_round_trip(
    case: str, duplicate: Callable[[Robot], Robot]
) -> None:
    """The other robot is another object that says the same, to the last bit."""
    robot, q, v, _ = draw(case, seed=28)
    if robot.mimics and duplicate is by_pickle:
        # Pinocchio would restore a model that ends the process when it is used.
        with pytest.raises(
            ModelError, match=r"mimic joints cannot be pickled; .*False"
        ):
            pickle.dumps(robot)
        return
    other = duplicate(robot)
    assert other is not robot
    assert other.model is not robot.model
    assert other.source == robot.source
    assert repr(other) == repr(robot)
    for name in ("joint_names", "dof_names", "frame_names", "unit_blocks"):
        assert getattr(other, name) == getattr(robot, name)
    np.testing.assert_array_equal(other.home(), robot.home())
    frame = robot.frame_names[-1]
    assert_equal_terms(
        everything(other.state(0.0, q, v), frame),
        everything(robot.state(0.0, q, v), frame),
    )
    np.testing.assert_array_equal(
        other.forward_dynamics(q, v, v), robot.forward_dynamics(q, v, v)
    )
