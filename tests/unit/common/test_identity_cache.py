"""A cache by identity: equal is not enough, and a copy begins anew."""

import dataclasses
from typing import Any

import numpy as np

import hsp_control as hsp
from hsp_control.common.identity_cache import IdentityCache


class Maker:
    """Counts what it makes."""

    def __init__(self) -> None:
        self.made: list[tuple[Any, ...]] = []
        self.cache = IdentityCache(self.make)

    def make(self, *keys: Any) -> int:
        self.made.append(keys)
        return len(self.made)


def test_it_is_made_anew_for_another_object_of_any_place() -> None:
    maker, keys = Maker(), [np.zeros(1) for _ in range(5)]
    assert maker.cache.get(*keys) == 1
    assert maker.cache.get(*keys) == 1
    for place in range(5):
        others = list(keys)
        others[place] = np.zeros(1)  # equal, and another
        count = len(maker.made)
        assert maker.cache.get(*others) == count + 1
        assert all(a is b for a, b in zip(maker.made[-1], others, strict=True))
        maker.cache.get(*keys)
    assert maker.cache.get(keys[0]) == len(maker.made)  # fewer keys are other keys
    assert maker.made[-1] == (keys[0],)


def test_a_changed_copy_of_a_part_computes_for_itself() -> None:
    """At the same state: a task whose gains are replaced."""
    robot = hsp.Robot.load("planar3r")
    q = robot.integrate(robot.home(), np.array([0.3, 0.2, 0.1]))
    state = robot.state(0.0, q, np.ones(3))
    gains, path = hsp.Gains(25.0, 10.0), hsp.Hold([1.0, 1.0])
    task = hsp.FramePosition("tip", path, gains=gains, axes="xy")
    first = task.evaluate(state)
    other = dataclasses.replace(task, gains=hsp.Gains(100.0, 10.0))
    theirs, mine = other.evaluate(state), task.evaluate(state)
    np.testing.assert_array_equal(mine.acceleration, first.acceleration)
    extra = 75.0 * mine.error
    np.testing.assert_allclose(theirs.acceleration, mine.acceleration + extra)
