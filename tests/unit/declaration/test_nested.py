"""Parts inside parts are found and replaced, wherever they are."""

import pytest

from hsp_control.common.errors import TrajectoryError
from hsp_control.declaration.nested import parts_within, with_parts_replaced
from hsp_control.tasks import FramePose, FramePosition
from hsp_control.trajectories import Circle, ComposedPose, Hold, HoldOrientation, Line

CIRCLE = Circle(radius=0.1, angular_rate=1.0)
POSE = FramePose("hand", ComposedPose(CIRCLE, HoldOrientation()))
TASKS = {"pose": POSE, "others": [FramePosition("elbow", Hold([0.0, 0.0, 1.0]))]}


def test_parts_are_found_in_order() -> None:
    assert list(parts_within(TASKS, Circle)) == [CIRCLE]
    assert list(parts_within((CIRCLE, TASKS), Circle)) == [CIRCLE, CIRCLE]
    assert list(parts_within(TASKS, Line)) == []


def test_parts_are_replaced_and_the_rest_stays_the_same_object() -> None:
    larger = Circle(radius=0.2, angular_rate=1.0)
    changed = with_parts_replaced(TASKS, Circle, lambda circle: larger)
    assert list(parts_within(changed, Circle)) == [larger]
    assert changed["pose"].frame == "hand"
    assert changed["others"] is TASKS["others"]
    assert with_parts_replaced(TASKS, Line, lambda line: larger) is TASKS


def test_an_error_has_the_place_of_the_part() -> None:
    def refuse(circle: Circle) -> Circle:
        raise TrajectoryError("no")

    with pytest.raises(TrajectoryError, match=r"pose\.trajectory\.position: no"):
        with_parts_replaced(TASKS, Circle, refuse)
