"""Every assignment and argument has an effect, or is refused."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.mixture import AccelerationModifier
from hsp_control.declaration import Part

BALL = hsp.Obstacle("ball", hsp.Sphere(0.1), hsp.Hold([0.6, 0.4, 0.6]))


def panda(**options: Any) -> hsp.Controller:
    robot = hsp.Robot.load("panda")
    hand = hsp.FramePose("panda_tcp", hsp.Circle(0.1, 2.0), name="hand")
    field = hsp.JointCentering() + 0.5 * hsp.ObstacleClearance()
    return hsp.Controller(robot, [hand], field, scene=[BALL], **options)


def public(thing: object) -> list[str]:
    """Return the public attributes of an object that are no methods."""
    return [
        name
        for name in dir(thing)
        if not name.startswith("_") and not callable(getattr(thing, name, None))
    ]


def everything(controller: hsp.Controller) -> list[object]:
    """Return the controller and all objects it exposes, parts of parts included."""
    controller.compute(0.0, controller.robot.home(), np.zeros(controller.robot.nv))
    return [controller, *parts([getattr(controller, n) for n in public(controller)])]


def parts(waiting: list[Any]) -> list[object]:
    """Return the parts among some objects, and the parts of parts."""
    found: list[object] = []
    while waiting:
        each = waiting.pop()
        if isinstance(each, tuple):
            waiting += each
        elif isinstance(each, Mapping):
            waiting += each.values()
        elif isinstance(each, Part):
            found.append(each)
            waiting += list(each.all_fields().values())
        elif type(each).__name__ == "RobotLimits":
            found.append(each)
            waiting += [getattr(each, name) for name in public(each)]
    return found


def test_no_attribute_can_be_assigned() -> None:
    """On the controller and all its parts; new attributes are covered, too."""
    all_parts = everything(panda(limits=hsp.Limits()))
    assert {
        *("Controller", "FramePose", "Circle", "Gains", "JointCentering"),
        *("Obstacle", "Sphere", "RobotLimits", "FieldSum"),
    } < {type(part).__name__ for part in all_parts}
    for part in all_parts:
        names = public(part)
        assert names
        for name in [*names, "a_new_one"]:
            with pytest.raises(AttributeError, match=r"assign"):
                setattr(part, name, 1.0)


@pytest.mark.parametrize(
    ("t", "q", "v", "message"),
    [
        (0.0, np.zeros(6), np.zeros(7), "6"),
        (0.0, np.full(7, np.nan), np.zeros(7), "nan"),
        (0.0, np.zeros(7, dtype=complex), np.zeros(7), "complex"),
        (0.0, ["a"] * 7, np.zeros(7), "'a'"),
        (0.0, None, np.zeros(7), "needs t, q and v"),
        (None, np.zeros(7), np.zeros(7), "time t is None"),
    ],
)
def test_an_invalid_state_gives_one_exact_error(
    t: Any, q: Any, v: Any, message: str
) -> None:
    with pytest.raises(hsp.HspControlError, match=message):
        panda().compute(t, q, v)


@pytest.mark.parametrize(
    ("tau", "period", "message"),
    [
        (np.full(7, np.nan), 0.001, r"effort tau\[0\] is nan"),
        (np.zeros(6), 0.001, "effort tau"),
        (np.zeros(7), np.nan, "period is nan"),
        (np.zeros(7), 0.0, "period is 0.0 s; must be positive"),
    ],
)
def test_an_applied_effort_is_checked(tau: Array, period: float, message: str) -> None:
    controller = panda(limits=hsp.Limits(effort_rate=1000.0))
    with pytest.raises(hsp.HspControlError, match=message):
        controller.applied(tau, period)
    output = controller.compute(0.0, controller.robot.home(), np.zeros(7))
    assert np.isfinite(output.tau).all()


@pytest.mark.parametrize(
    "modifier",
    [
        lambda state, stack, a: (a, np.full(7, np.nan)),
        lambda state, stack, a: (a + 1e308, None),  # finite; M a overflows
    ],
)
@pytest.mark.parametrize("limits", [None, hsp.Limits()])
def test_an_effort_that_is_not_finite_is_never_delivered(
    modifier: AccelerationModifier, limits: hsp.Limits | None
) -> None:
    controller = panda(limits=limits)
    q, v = controller.robot.home(), np.zeros(7)
    with pytest.raises(hsp.errors.NonFiniteError):
        controller.compute(0.0, q, v, modifier=modifier)


def test_a_foreign_state_gives_the_same_effort() -> None:
    controller = panda()
    state = controller.robot.state(0.3, controller.robot.home(), np.full(7, 0.1))
    np.testing.assert_array_equal(
        controller.compute(state).tau, controller.compute(0.3, state.q, state.v).tau
    )
    other = hsp.Robot.load("panda").state(0.0, state.q, state.v)
    with pytest.raises(hsp.errors.ControllerError, match="another robot object"):
        controller.compute(other)
