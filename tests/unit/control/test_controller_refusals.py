"""Check what the controller refuses, and that NaN never comes out of it."""

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
    hold_orientation,
    panda,
    states,
    track,
)
from numpy.typing import NDArray

import hsp_control as hsp
from hsp_control.common.exceptions import (
    ContactError,
    ControllerError,
    FieldError,
    FrameNotFoundError,
    GainError,
    ImmutableError,
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
from hsp_control.tasks import TaskSample
from hsp_control.tasks.task import Feedback
from hsp_control.trajectories import CallableTrajectory, Trajectory, TrajectorySample

Array = NDArray[np.float64]


# --- what it refuses -----------------------------------------------------------------


def indefinite_gain() -> Array:
    """Return K_N = [[1, 1.5], [0, 1]] ⊕ I: it decays for W = I but not in W1."""
    K_N = np.eye(7)
    K_N[0, 1] = 1.5
    return K_N


W1 = np.array([100.0, 1, 1, 1, 1, 1, 1])


@pytest.mark.parametrize(
    ("tasks", "options", "error", "message"),
    [
        (list, {}, ControllerError, "^tasks: a controller needs at least one task$"),
        (
            lambda: [track(axes="xyz"), track(name=TCP)],
            {},
            ControllerError,
            "^tasks: two tasks are called 'panda_tcp'; give them distinct names$",
        ),
        (
            lambda: [hsp.FramePosition("panda_hnad", name="hand")],
            {},
            FrameNotFoundError,
            r"^tasks.hand.frame: no frame 'panda_hnad'; did you mean 'panda_hand'\?",
        ),
        (
            lambda: [track()],
            {"field": lambda: hsp.Rest() + hsp.TargetPosture([0.0, 1.0])},
            ShapeError,
            r"^null_space.fields.1.target: a posture has shape \(2,\); needs 7 num",
        ),
        (
            lambda: [track(), hold_orientation(), track(name="again")],
            {},
            ControllerError,
            r"^tasks: the tasks have 9 rows \(panda_tcp: 3, panda_tcp_orientation: 3, "
            r"again: 3\); panda has only 7 degrees of freedom$",
        ),
        (
            lambda: [track(name="one"), *[track(name=n, priority=4) for n in "abc"]],
            {},
            ControllerError,
            r"^tasks: the tasks of priority 4 have 9 rows \(a: 3, b: 3, c: 3\); panda",
        ),
        (
            lambda: [track(), [track(name="again")]],
            {},
            ControllerError,
            "^tasks contains lists; write the level as priority=1, 2, ... of each task",
        ),
        (lambda: [TCP], {}, ControllerError, "contains 'panda_tcp', which is not a Ta"),
        *(
            (lambda: [track()], {what: wrong}, ControllerError, message)
            for what, wrong, message in (
                (
                    "field",
                    [hsp.Rest()],
                    r"^field is \[Rest\(\)\], which is not a NullSp",
                ),
                ("metric", "identity", "^metric is 'identity', which is not a Metric"),
                ("limits", {"effort": 1}, "^limits is .*, which is not a Limits"),
                ("contacts", ["sole"], "^contacts contains 'sole', which is not a Con"),
            )
        ),
        (
            lambda: [track()],
            {"limits": lambda: hsp.Limits(effort=[1.0, 2.0])},
            LimitError,
            "^limits.effort: has 2 numbers; needs one number or 7$",
        ),
        (
            lambda: [track()],
            {"field": lambda: hsp.ObstacleClearance(["ball"])},
            SceneError,
            r"^null_space.fields.0.obstacles.0: no obstacle 'ball' \(the scene has",
        ),
        (lambda: [track()], {"start": [0.0, 1.0]}, ShapeError, r"panda needs \(7,\)"),
        (lambda: [track()], {"base": "flying"}, ContactError, "^base: panda has no fr"),
        (
            lambda: [track()],
            {"null_space_gain": 0.0},
            GainError,
            "null_space_gain is 0.0; must be greater than 0",
        ),
        (
            lambda: [track()],
            {"null_space_gain": -1.0},
            GainError,
            "null_space_gain is -1.0; must be greater than 0",
        ),
        (
            lambda: [track()],
            {"null_space_gain": [1.0, 1, 1, 1, 1, 1, -1]},
            GainError,
            r"null_space_gain is \[1.0, .*, -1.0\]; must be greater than 0",
        ),
        (
            lambda: [track()],
            {"null_space_gain": "fast"},
            GainError,
            "^null_space.gain: null_space_gain is 'fast'; needs numbers",
        ),
        (
            lambda: [track()],
            {"null_space_gain": np.nan},
            GainError,
            "null_space_gain is nan; needs finite numbers",
        ),
        (
            lambda: [track()],
            {"null_space_gain": [1.0, 2.0]},
            GainError,
            r"null_space_gain has shape \(2,\); needs a number, 7 numbers or a 7 × 7",
        ),
        (
            lambda: [track()],
            {"null_space_gain": np.ones((7, 7, 7))},
            GainError,
            r"null_space_gain has shape \(7, 7, 7\)",
        ),
        (
            lambda: [track()],
            {
                "null_space_gain": indefinite_gain(),
                "metric": lambda: ConstantMetric(W1),
            },
            GainError,
            "the smallest eigenvalue of W K_N is -",
        ),
        (
            lambda: [track()],
            {"metric": lambda: ConstantMetric(np.eye(3))},
            MetricError,
            r"^null_space.metric.matrix: the metric has shape \(3, 3\); the robot",
        ),
        *(
            (
                lambda: [track()],
                {"singularity_threshold": value},
                ControllerError,
                f"singularity_threshold is {value}; must be positive",
            )
            for value in (0.0, -0.1, np.nan, np.inf)
        ),
    ],
)
def test_refuses(
    tasks: Callable[[], list[hsp.Task]],
    options: dict[str, Any],
    error: type[Exception],
    message: str,
) -> None:
    made = {
        name: option() if callable(option) else option
        for name, option in options.items()
    }
    with pytest.raises(error, match=message) as caught:
        hsp.Controller(panda(), tasks(), **made)
    assert isinstance(caught.value, hsp.HspControlError)
    not_there = error is FrameNotFoundError
    assert isinstance(caught.value, LookupError if not_there else ValueError)


def test_a_gain_is_judged_in_its_metric() -> None:
    """The gain that is refused in one metric passes in another, and conversely."""
    hsp.Controller(panda(), [track()], null_space_gain=indefinite_gain())
    # W K_N symmetric positive definite, K_N + K_Nᵀ indefinite.
    K_hat = np.eye(7)
    K_hat[0, 1] = K_hat[1, 0] = 0.9
    K_N = np.linalg.solve(np.diag(W1), K_hat)
    assert np.linalg.eigvalsh(K_N + K_N.T)[0] < 0.0
    hsp.Controller(panda(), [track()], null_space_gain=K_N, metric=ConstantMetric(W1))
    with pytest.raises(GainError):
        hsp.Controller(panda(), [track()], null_space_gain=K_N)


def test_as_many_rows_as_freedoms_are_allowed() -> None:
    (posture,) = hsp.Controller(panda(), [hsp.JointPosture(gains=GAINS)]).tasks
    assert posture.rows == 7


@pytest.mark.parametrize(
    ("name", "instead"),
    [
        ("tasks", r"use at\(t\).add\(task\) and at\(t\).remove\(name\)"),
        ("levels", r"use at\(t\).add\(task\) and at\(t\).remove\(name\)"),
        ("field", r"use at\(t\).field\(...\)"),
        ("null_space_gain", r"use at\(t\).null_space_gain\(...\)"),
        ("contacts", r"use at\(t\).contact\(name, bears=...\)"),
        ("limits", r"use at\(t\).limits\(...\)"),
        ("changes", r"use at\(t\)"),
        ("state", "call compute"),
        ("scene", r"use at\(t\).obstacle\(name, center\)"),
        *((name, "build another one") for name in ("robot", "metric", "base")),
    ],
)
def test_what_it_is_made_of_cannot_be_assigned(name: str, instead: str) -> None:
    controller = hsp.Controller(panda(), [track()])
    with pytest.raises(ImmutableError, match=f"^Controller.{name} cannot.*{instead}"):
        setattr(controller, name, getattr(controller, name))


def test_the_gain_in_force_is_a_copy() -> None:
    controller = hsp.Controller(panda(), [track()], null_space_gain=3.0)
    controller.null_space_gain[:] = 7.0
    np.testing.assert_array_equal(controller.null_space_gain, 3.0 * np.eye(7))


# --- NaN never comes out -------------------------------------------------------------


class Broken(Trajectory):
    """A user's trajectory that goes wrong after half a second."""

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
    """A user's metric that is not a number after half a second."""

    form: ClassVar[int] = VARYING

    def evaluate(self, state: hsp.RobotState, out: MetricSample) -> MetricSample:
        out.W_dot[0, 0] = np.nan if state.t > 0.5 else 0.0
        return out


class BrokenTask(hsp.FramePosition):
    """A user's task whose arrays go wrong after half a second."""

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
    """Return a function of a time or a state that goes wrong after half a second."""
    return lambda x: wrong if getattr(x, "t", x) > 0.5 else right


def position(function: Callable[[float], Any]) -> hsp.FramePosition:
    still = late(np.zeros(3), np.zeros(3))
    trajectory = CallableTrajectory(function, 3, velocity=still, acceleration=still)
    return hsp.FramePosition(TCP, trajectory, gains=GAINS)


Parts = dict[str, Any]
NAN = np.full(7, np.nan)
FAILURES: dict[str, tuple[Callable[[], Parts], type[Exception], str]] = {
    **{
        f"{value} in a trajectory's {where}": (
            lambda value=value, where=where: {
                "tasks": [
                    hsp.FramePosition(
                        TCP, Broken(value, where), gains=GAINS, name="mine"
                    )
                ]
            },
            NonFiniteError,
            r"task 'mine' is not finite at t = 0\.75 s; does its trajectory return NaN",
        )
        for value in (np.nan, np.inf)
        for where in ("position", "velocity", "acceleration")
    },
    **{
        f"{value} in a task's {where}": (
            lambda value=value, where=where: {"tasks": [broken_task(where, value)]},
            NonFiniteError,
            r"task 'mine' is not finite at t = 0\.75 s",
        )
        for value in (np.nan, -np.inf)
        for where in ("jacobian", "jacobian_dot", "acceleration")
    },
    "NaN from a trajectory's function": (
        lambda: {"tasks": [position(late([0.0, np.nan, 0.0], CENTER))]},
        TrajectoryError,
        r"function\(0\.75\) must be finite",
    ),
    "too few numbers from a trajectory's function": (
        lambda: {"tasks": [position(late([0.0, 0.0], CENTER))]},
        TrajectoryError,
        r"function\(0\.75\) must have shape \(3\)",
    ),
    **{
        f"{value} in a field's {where}": (
            lambda value=value, where=where: {
                "field": BrokenField(where=where, broken=value, name="mine")
            },
            NonFiniteError,
            r"field 'mine' is not finite at t = 0\.75 s",
        )
        for value in (np.nan, np.inf)
        for where in ("g", "g_dot")
    },
    "NaN from a field's function": (
        lambda: {"field": FunctionField(late(NAN, np.zeros(7)), name="mine")},
        FieldError,
        r"field 'mine' returned g = array\(.*nan.* at t = 0\.75 s; needs 7 finite",
    ),
    "infinity from a field's rate": (
        lambda: {
            "field": FunctionField(
                late(np.zeros(7), np.zeros(7)),
                rate_function=late(np.full(7, np.inf), np.zeros(7)),
                name="mine",
            )
        },
        FieldError,
        r"field 'mine' returned g' = array\(.*inf.* at t = 0\.75 s",
    ),
    "a field of another size": (
        lambda: {"field": FunctionField(late(np.zeros(6), np.zeros(7)))},
        FieldError,
        "needs 7 finite numbers",
    ),
    "NaN from a cost": (
        lambda: {"field": hsp.FunctionCost(late(np.nan, 1.0), name="mine")},
        FieldError,
        r"cost 'mine' returned nan at t = 0\.7",
    ),
    "NaN from a cost's gradient": (
        lambda: {
            "field": hsp.FunctionCost(
                late(1.0, 1.0),
                gradient_function=late(NAN, np.zeros(7)),
                rate_function=late(np.zeros(7), np.zeros(7)),
                name="mine",
            )
        },
        FieldError,
        r"'mine'.*t = 0\.75 s",
    ),
    "NaN in a metric": (
        lambda: {"metric": BrokenMetric()},
        NonFiniteError,
        r"the effort is not finite at t = 0\.75 s, q = \[.*\], v = \[.*\]",
    ),
}


@pytest.mark.parametrize("what", FAILURES)
# Without the compiler (NUMBA_DISABLE_JIT=1) NumPy warns of inf - inf on the way.
@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
def test_nan_of_a_user_is_an_error_and_never_an_effort(what: str) -> None:
    make, error, message = FAILURES[what]
    parts = {"tasks": [track()], "field": None, "metric": None} | make()
    controller = hsp.Controller(panda(), **parts)
    _, q, v = states(1)[0]
    before = contents(controller.compute(panda().state(0.25, q, v)))
    with pytest.raises(error, match=message) as caught:
        controller.compute(panda().state(0.75, q, v))
    assert type(caught.value) is error
    assert isinstance(caught.value, hsp.HspControlError)
    # The failure leaves nothing behind: the controller goes on as if new.
    assert_same(contents(controller.compute(panda().state(0.25, q, v))), before)


def test_user_mistake_in_a_simulation_names_the_time() -> None:
    """The loop stops with the cause and what had been computed."""
    task = hsp.FramePosition(TCP, Broken(np.nan, "position"), gains=GAINS, name="mine")
    controller = hsp.Controller(panda(), [task])
    with pytest.raises(
        hsp.HspControlError, match=r"the simulation stopped: task 'mine' is not finite"
    ) as caught:
        hsp.simulate(controller, panda().home(), duration=1.0, log_period=0.1)
    rollout = caught.value.rollout  # type: ignore[attr-defined]
    assert np.isfinite(rollout.tau).all()
    assert rollout.t[-1] == pytest.approx(0.5)
