"""Inputs that the controller refuses; its output is never NaN."""

from collections.abc import Callable
from dataclasses import KW_ONLY
from typing import Any, ClassVar

import numpy as np
import pytest
from controller_cases import (
    CENTER,
    GAINS,
    TCP,
    assert_same,
    circle,
    contents,
    states,
    track,
)
from loaded_robots import panda
from wording import wording

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import (
    ContactError,
    ControllerError,
    FieldError,
    FrameNotFoundError,
    GainError,
    LimitError,
    MetricError,
    NonFiniteError,
    SceneError,
    ShapeError,
    TrajectoryError,
)
from hsp_control.law import VARYING
from hsp_control.null_space.fields import FieldSample, FunctionField
from hsp_control.null_space.metrics import ConstantMetric, Metric, MetricSample
from hsp_control.tasks import Task, TaskSample
from hsp_control.tasks.feedback import Feedback
from hsp_control.trajectories import CallableTrajectory, Trajectory, TrajectorySample

Parts = dict[str, Any]


# --- refusals ------------------------------------------------------------------------


def indefinite_gain() -> Array:
    """Return K_N = [[1, 1.5], [0, 1]] ⊕ I: e_N decays for W = I but not in W1."""
    K_N = np.eye(7)
    K_N[0, 1] = 1.5
    return K_N


W1 = np.array([100.0, 1, 1, 1, 1, 1, 1])


def named(*names: str, **options: Any) -> Callable[[], list[Task]]:
    return lambda: [track(name=name, **options) for name in names]


SHORT = hsp.metrics.ConstantMetric(np.eye(3))
TOGETHER = {"null_space_gain": indefinite_gain(), "metric": ConstantMetric(W1)}


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (
            {"tasks": named(TCP, TCP)},
            ControllerError,
            "tasks: two tasks ... 'panda_tcp'",
        ),
        (
            {"tasks": lambda: [hsp.FramePosition("panda_hnad", name="hand")]},
            FrameNotFoundError,
            "tasks.hand.frame: no ... 'panda_hnad' ... 'panda_hand'",
        ),
        (
            {"field": hsp.Rest() + hsp.TargetPosture([0.0, 1.0])},
            ShapeError,
            "field.1.target: ... (2,) ... 7 numbers",
        ),
        (
            {"tasks": named("one", "two", "three")},
            ControllerError,
            "tasks: ... 9 rows (one: 3, two: 3, three: 3) ... 7",
        ),
        (
            {"tasks": lambda: [track(), *named(*"abc", priority=4)()]},
            ControllerError,
            "tasks: ... priority 4 ... 9 rows (a: 3, b: 3, c: 3)",
        ),
        (
            {"tasks": lambda: [track(), [track(name="again")]]},
            ControllerError,
            "tasks contains lists ... priority=1",
        ),
        ({"tasks": lambda: [TCP]}, ControllerError, "... contains 'panda_tcp', a str"),
        (
            {"field": [hsp.Rest()]},
            ControllerError,
            "field is [Rest()], a list",
        ),
        ({"metric": "identity"}, ControllerError, "... hsp.metrics.IdentityMetric"),
        ({"limits": {"effort": 1}}, ControllerError, "limits is ... a Limits(effort"),
        ({"contacts": ["sole"]}, ControllerError, "contacts contains 'sole', a str"),
        ({"tasks": track}, ControllerError, "... needs several ... [task]"),
        (
            {"tasks": lambda: {"hand": track()}},
            ControllerError,
            "tasks is ... a list, with name='hand'",
        ),
        ({"limits": "none"}, ControllerError, "... in Python it is None"),
        ({"field": hsp.Rest}, ControllerError, "... Rest, a class ... an instance"),
        (
            {"limits": hsp.Limits(effort=[1.0, 2.0])},
            LimitError,
            "limits.effort: ... 2 numbers ... 7",
        ),
        (
            {"field": hsp.ObstacleClearance(["ball"])},
            SceneError,
            "field.0.obstacles.0: no obstacle 'ball'",
        ),
        ({"start": [0.0, 1.0]}, ShapeError, "... panda needs (7,)"),
        ({"base": "flying"}, ContactError, "base: panda has no free-flyer"),
        ({"null_space_gain": 0.0}, GainError, "... is 0 ... greater than 0"),
        (
            {"null_space_gain": [1.0, 1, 1, 1, 1, 1, -1]},
            GainError,
            "... null_space_gain[6] is -1 ... greater than 0",
        ),
        (
            {"null_space_gain": "fast"},
            GainError,
            "null_space_gain ... 'fast' ... numbers",
        ),
        ({"null_space_gain": np.nan}, GainError, "... is nan ... finite"),
        (
            {"null_space_gain": [1.0, 2.0]},
            GainError,
            "... null_space_gain ... (2,) ... 7 × 7",
        ),
        (TOGETHER, GainError, "... eigenvalue of W K_N is -"),
        ({"metric": SHORT}, MetricError, "metric.matrix: ... (3, 3)"),
        ({"singularity_threshold": 0.0}, ControllerError, "... is 0.0 ... positive"),
        ({"singularity_threshold": np.nan}, ControllerError, "... is nan ... positive"),
    ],
)
def test_refuses(options: Parts, error: type[Exception], message: str) -> None:
    make = options.get("tasks", lambda: [track()])
    with pytest.raises(error, match=wording(message)) as caught:
        hsp.Controller(panda(), **(options | {"tasks": make()}))
    assert isinstance(caught.value, hsp.HspControlError)
    not_there = error is FrameNotFoundError
    assert isinstance(caught.value, LookupError if not_there else ValueError)


# --- no NaN in the output ------------------------------------------------------------


class Broken(Trajectory):
    """A user's trajectory that becomes invalid after half a second."""

    value: float
    where: str

    @property
    def dimension(self) -> int:
        return 3

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        out = circle().sample(t, out)
        if t > 0.5:
            getattr(out, self.where)[1] = self.value
        return out


class BrokenField(hsp.NullSpaceField):
    """A user's field written straight into the sample, unchecked."""

    where: str
    broken: float

    def evaluate(
        self, state: hsp.RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        for array in out:
            array[:] = 0.0
        if state.t > 0.5:
            getattr(out, self.where)[2] = self.broken
        return out

    def value(self, state: hsp.RobotState) -> float:
        return 0.0


class BrokenMetric(Metric):
    """A user's metric that is NaN after half a second."""

    form: ClassVar[int] = VARYING

    def evaluate(self, state: hsp.RobotState, out: MetricSample) -> MetricSample:
        out.W_dot[0, 0] = np.nan if state.t > 0.5 else 0.0
        return out


class BrokenTask(hsp.FramePosition):
    """A user's task whose arrays become invalid after half a second."""

    _: KW_ONLY
    where: str
    broken: float

    def evaluate(
        self,
        state: hsp.RobotState,
        out: TaskSample | None = None,
        feedback: Feedback | None = None,
    ) -> TaskSample:
        out = super().evaluate(state, out, feedback)
        if state.t > 0.5:
            getattr(out, self.where)[..., 1] = self.broken
        return out


def broken_task(where: str, value: float) -> BrokenTask:
    return BrokenTask(
        TCP, circle(), gains=GAINS, name="mine", where=where, broken=value
    )


def late(wrong: Any, right: Any) -> Callable[..., Any]:
    """Return a function of time or state that becomes invalid after half a second."""
    return lambda x: wrong if getattr(x, "t", x) > 0.5 else right


def position(trajectory: Trajectory, name: str) -> hsp.FramePosition:
    return hsp.FramePosition(TCP, trajectory, gains=GAINS, name=name)


def called(function: Callable[[float], Any]) -> hsp.FramePosition:
    still = late(np.zeros(3), np.zeros(3))
    path = CallableTrajectory(function, 3, velocity=still, acceleration=still)
    return position(path, "called")


NAN = np.full(7, np.nan)
ZERO = np.zeros(7)


def mine(function: Any, **options: Any) -> Parts:
    return {"field": FunctionField(function, name="mine", **options)}


FAILURES: list[tuple[Parts, type[Exception], str]] = [
    *(
        (
            {"tasks": [position(Broken(value, where), "mine")]},
            NonFiniteError,
            "... task 'mine' is not finite at t = 0.75 s ... trajectory",
        )
        for value, where in (
            *((np.nan, "position"), (np.inf, "velocity"), (np.nan, "acceleration")),
        )
    ),
    *(
        (
            {"tasks": [broken_task(where, value)]},
            NonFiniteError,
            "task 'mine' is not finite at t = 0.75 s",
        )
        for value, where in (
            *(
                (np.nan, "jacobian"),
                (-np.inf, "jacobian_dot"),
                (np.nan, "acceleration"),
            ),
        )
    ),
    (
        {"tasks": [called(late([0.0, np.nan, 0.0], CENTER))]},
        TrajectoryError,
        "... function(0.75) ... finite",
    ),
    (
        {"tasks": [called(late([0.0, 0.0], CENTER))]},
        TrajectoryError,
        "... function(0.75) ... (3)",
    ),
    *(
        (
            {"field": BrokenField(where=where, broken=value, name="mine")},
            NonFiniteError,
            "field 'mine' is not finite at t = 0.75 s",
        )
        for value, where in ((np.nan, "g"), (np.inf, "g_dot"))
    ),
    (
        mine(late(NAN, ZERO)),
        FieldError,
        "... field 'mine' ... g = ... nan ... t = 0.75 s",
    ),
    (
        mine(late(ZERO, ZERO), rate_function=late(np.full(7, np.inf), ZERO)),
        FieldError,
        "... field 'mine' ... g' = ... inf ... t = 0.75 s",
    ),
    (mine(late(np.zeros(6), ZERO)), FieldError, "... 7 finite numbers"),
    (
        {"field": hsp.FunctionCost(late(np.nan, 1.0), name="mine")},
        FieldError,
        "... cost 'mine' ... nan at t = 0.7",
    ),
    (
        {
            "field": hsp.FunctionCost(
                late(1.0, 1.0),
                gradient_function=late(NAN, ZERO),
                rate_function=late(ZERO, ZERO),
                name="mine",
            )
        },
        FieldError,
        "... 'mine' ... t = 0.75 s",
    ),
    (
        {"metric": BrokenMetric()},
        NonFiniteError,
        "... effort is not finite at t = 0.75 s",
    ),
]


@pytest.mark.parametrize(("own", "error", "message"), FAILURES)
@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
def test_nan_of_a_user_is_an_error_and_never_an_effort(
    own: Parts, error: type[Exception], message: str
) -> None:
    parts = {"tasks": [track()], "field": None, "metric": None} | own
    controller = hsp.Controller(panda(), **parts)
    _, q, v = states(1)[0]
    before = contents(controller.compute(panda().state(0.25, q, v)))
    with pytest.raises(error, match=wording(message)) as caught:
        controller.compute(panda().state(0.75, q, v))
    assert type(caught.value) is error
    # The failure leaves no trace: the controller continues as if new.
    assert_same(contents(controller.compute(panda().state(0.25, q, v))), before)
