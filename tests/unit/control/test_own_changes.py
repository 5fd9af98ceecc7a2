"""User-defined changes: the result of `apply` is checked when one is made."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.declaration.quantities import Number

ROBOT, REST = hsp.Robot.load("planar3r"), np.zeros(3)


class Calm(hsp.changes.Change):
    """K_N is multiplied by a factor."""

    factor: Number

    def apply(self, setup: Any) -> Any:
        gain = setup.gain.then(self.at, self.ramp, self.factor * setup.gain.target)
        return replace(setup, gain=gain)


class Softer(hsp.changes.Change):
    """Gains as the two matrices that `Gains.matrices` returns."""

    def apply(self, setup: Any) -> Any:
        (task,) = setup.tasks
        target = hsp.Gains(natural_frequency=5.0).matrices(task.task.rows)
        return setup.with_task(task, gains=task.gains.then(self.at, self.ramp, target))


class Forgetful(hsp.changes.Change):
    """A `return` is missing."""

    def apply(self, setup: Any) -> Any:
        """Return nothing."""


class OtherMetric(hsp.changes.Change):
    """A change without a ramp."""

    def apply(self, setup: Any) -> Any:
        return replace(setup, metric=hsp.metrics.MassMatrixMetric())


class WrongShape(hsp.changes.Change):
    """Gains of another task."""

    def apply(self, setup: Any) -> Any:
        (task,) = setup.tasks
        gains = task.gains.then(self.at, self.ramp, np.ones((2, 8, 2)))
        return setup.with_task(task, gains=gains)


class Number5(hsp.changes.Change):
    """K_N as a number."""

    def apply(self, setup: Any) -> Any:
        return replace(setup, gain=5.0)


MISTAKES = {
    Forgetful: r"Forgetful\.apply returns NoneType; needs the changed Setup",
    OtherMetric: r"OtherMetric\.apply replaces the metric, which has no ramp",
    Number5: r"Number5\.apply replaces gain by float; needs Evolution",
    WrongShape: r"gains of task 'hand' to an array of shape \(2, 8, 2\); needs \(2, 2",
}


def controller(*changes: hsp.changes.Change) -> hsp.Controller:
    hand = hsp.FramePosition(axes="xy", name="hand")
    return hsp.Controller(ROBOT, [hand], changes=changes)


def test_it_ramps_as_ours_do() -> None:
    made = controller()
    made.compute(0.0, ROBOT.home(), REST)
    made.change(Calm(0.5, at=1.0, ramp=1.0))
    for t, gain in ((0.9, 10.0), (1.5, 7.5), (2.1, 5.0)):
        made.compute(t, ROBOT.home(), REST)
        np.testing.assert_allclose(made.null_space_gain, gain * np.eye(3), atol=1e-9)


def test_gains_may_be_a_pair_of_matrices() -> None:
    made = controller()
    made.compute(0.0, ROBOT.home(), REST)
    made.change(Softer(at=1.0, ramp=1.0))
    for t in (1.5, 2.5):
        made.compute(t, ROBOT.home(), REST)
    np.testing.assert_array_equal(made.feedback("hand").Kp, 25.0 * np.eye(2))


@pytest.mark.parametrize("begun", [False, True])
@pytest.mark.parametrize("kind", MISTAKES)
def test_a_mistake_is_one_error(kind: type[hsp.changes.Change], begun: bool) -> None:
    with pytest.raises(hsp.errors.ControllerError, match=MISTAKES[kind]):
        controller(kind(at=1.0))
    made = controller()
    if begun:
        made.compute(0.0, ROBOT.home(), REST)
    with pytest.raises(hsp.errors.ControllerError, match=MISTAKES[kind]):
        made.change(kind(at=1.0))
    assert made.changes == ()


def test_a_gain_that_lets_the_error_grow_is_refused() -> None:
    with pytest.raises(hsp.errors.GainError, match="null_space_gain"):
        controller().change(Calm(-1.0, at=1.0))


@pytest.mark.parametrize(
    ("factor", "message"), [(np.nan, "contain NaN"), (-1.0, "does not decay")]
)
def test_gains_with_which_no_error_decays_are_refused(
    factor: float, message: str
) -> None:
    class Scaled(hsp.changes.Change):
        def apply(self, setup: Any) -> Any:
            (task,) = setup.tasks
            target = factor * np.asarray(task.gains.target)
            return setup.with_task(
                task, gains=task.gains.then(self.at, self.ramp, target)
            )

    with pytest.raises(
        hsp.errors.GainError, match=f"Scaled.apply, task 'hand': .*{message}"
    ):
        controller(Scaled(at=1.0))


def test_another_kind_is_made_by_change() -> None:
    with pytest.raises(AttributeError, match="did you mean 'gains'"):
        controller().at(1.0).gain("hand", hsp.Gains())  # type: ignore[attr-defined]
    with pytest.raises(AttributeError, match=r"controller\.change\("):
        controller().at(1.0).calm(0.5)  # type: ignore[attr-defined]
