"""What the gripper's process takes from a datagram, without a gripper."""

from typing import Any

import pytest

from hsp_control.companions.franka.client import GripperClient

SENDER = ("127.0.0.1", 5)


def gripper() -> GripperClient:
    made = GripperClient.__new__(GripperClient)
    made.sender, made.last_time = ("", 0), -10.0
    return made


@pytest.mark.parametrize(
    ("message", "opening"),
    [({}, 0.01), ({"value": [0.02]}, 0.02), ({"value": [0]}, 0.0),
     ({"values": [[0.01], [0.03]]}, 0.03)],
)  # fmt: skip
def test_an_opening_is_read(message: Any, opening: float) -> None:
    assert gripper().read(message, SENDER, 0.01) == opening


@pytest.mark.parametrize(
    "message",
    [[], None, 1, "x", {"value": "0.02"}, {"value": 0.02}, {"value": []},
     {"value": [True]}, {"value": [None]}, {"value": ["0"]}, {"value": [0.02, 5.0]},
     {"value": [-0.01]}, {"value": [2.0]}, {"value": [float("nan")]},
     {"value": {"0": 0.02}}, {"values": []}, {"values": "12"}, {"values": {}}],
    ids=repr,
)  # fmt: skip
def test_nothing_else_moves_the_fingers(message: Any) -> None:
    """A text was a number by its first letter: "0.02" closed the gripper."""
    with pytest.raises((ValueError, LookupError, TypeError)):
        gripper().read(message, SENDER, 0.01)
