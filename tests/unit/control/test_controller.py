"""The controller: what it refuses, what it returns, and that it remembers nothing."""

from collections.abc import Callable
from functools import cache
from typing import Any, ClassVar

import numpy as np
import oracles
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from hsp_control import (
    Circle,
    ConstantMetric,
    Controller,
    ControlOutput,
    Dop853,
    FrameOrientation,
    FramePosition,
    FunctionCost,
    FunctionField,
    Gains,
    Hold,
    HspControlError,
    IdentityMetric,
    JointPosture,
    MassMatrixMetric,
    Metric,
    NullSpaceField,
    Rest,
    Robot,
    RobotState,
    TargetPosture,
    Task,
    Trajectory,
    Uncontrolled,
    simulate,
)
from hsp_control.common.exceptions import (
    ControllerError,
    FieldError,
    GainError,
    MetricError,
    NonFiniteError,
    TrajectoryError,
)
from hsp_control.null_space.fields import FieldSample
from hsp_control.null_space.metrics import MetricSample
from hsp_control.null_space.metrics.metric import CONSTANT, VARYING
from hsp_control.tasks import TaskSample
from hsp_control.trajectories import (
    CallableTrajectory,
    HoldOrientation,
    TrajectorySample,
)

Array = NDArray[np.float64]
GAINS = Gains.from_frequency(20.0)
TCP = "panda_tcp"
CENTER = np.array([0.35, 0.1, 0.5])
# Below every singular value of the random states: the law is exact there.
EXACT = 1e-4

METRICS: dict[str, Callable[[int], Metric]] = {
    "identity": lambda nv: IdentityMetric(),
    "coordinates": lambda nv: ConstantMetric.from_coordinates(
        np.tril(np.ones((nv, nv)))
    ),
    "mass_matrix": lambda nv: MassMatrixMetric(),
}
metrics = pytest.mark.parametrize("kind", METRICS)


@cache
def panda() -> Robot:
    return Robot.load("panda")


def circle() -> Circle:
    return Circle(CENTER, 0.1, 2.0, normal=[0.0, 1.0, 1.0])


def track(robot: Robot | None = None, **options: Any) -> FramePosition:
    return FramePosition(robot or panda(), TCP, circle(), GAINS, **options)


def hold_orientation(robot: Robot | None = None) -> FrameOrientation:
    return FrameOrientation(robot or panda(), TCP, HoldOrientation(np.eye(3)), GAINS)


def states(count: int, seed: int = 0) -> list[tuple[float, Array, Array]]:
    rng = np.random.default_rng(seed)
    return [
        (
            float(rng.uniform()),
            panda().random_configuration(rng),
            rng.standard_normal(7),
        )
        for _ in range(count)
    ]


def copied(out: ControlOutput) -> dict[str, Any]:
    """Return copies: the arrays are the controller's own."""
    return {
        "tau": out.tau.copy(),
        "acceleration": out.acceleration.copy(),
        "null_space_error": out.null_space_error.copy(),
        "damped": out.damped,
        **{f"task.{k}": v.copy() for k, v in out.task._asdict().items()},
        **{f"field.{k}": v.copy() for k, v in out.field._asdict().items()},
    }


def assert_same(first: dict[str, Any], second: dict[str, Any]) -> None:
    """To the last bit."""
    assert first.keys() == second.keys()
    for name, value in first.items():
        np.testing.assert_array_equal(value, second[name], err_msg=name)


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
        (list, {}, ControllerError, "a controller needs at least one task"),
        (
            lambda: [track(axes="xyz"), track(name=TCP)],
            {},
            ControllerError,
            "two tasks are called 'panda_tcp'; give them names",
        ),
        (
            lambda: [track(Robot.load("panda"))],
            {},
            ControllerError,
            r"task 'panda_tcp' was built for another robot object \(panda\)",
        ),
        (
            lambda: [track()],
            {"field": lambda: Rest(Robot.load("panda"))},
            ControllerError,
            r"field 'rest' was built for another robot object \(panda\); build it with",
        ),
        (
            lambda: [track(), hold_orientation(), track(name="again")],
            {},
            ControllerError,
            r"the tasks have 9 rows \(panda_tcp: 3, panda_tcp_orientation: 3, again: 3"
            r"\); panda has only 7 freedoms",
        ),
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
            "null_space_gain is 'fast'; needs numbers, a list or a matrix",
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
            "the least eigenvalue of W K_N is -",
        ),
        (
            lambda: [track()],
            {"metric": lambda: ConstantMetric(np.eye(3))},
            MetricError,
            r"metric has shape \(3, 3\); the robot needs \(7, 7\)",
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
    tasks: Callable[[], list[Task]],
    options: dict[str, Any],
    error: type[Exception],
    message: str,
) -> None:
    made = {
        name: option() if callable(option) else option
        for name, option in options.items()
    }
    with pytest.raises(error, match=message) as caught:
        Controller(panda(), tasks(), **made)
    assert isinstance(caught.value, HspControlError)
    assert isinstance(caught.value, ValueError)


def test_a_gain_is_judged_in_its_metric() -> None:
    """The gain that is refused in one metric passes in another, and conversely."""
    Controller(panda(), [track()], null_space_gain=indefinite_gain())
    # W K_N symmetric positive definite, K_N + K_Nᵀ indefinite.
    K_hat = np.eye(7)
    K_hat[0, 1] = K_hat[1, 0] = 0.9
    K_N = np.linalg.solve(np.diag(W1), K_hat)
    assert np.linalg.eigvalsh(K_N + K_N.T)[0] < 0.0
    Controller(panda(), [track()], null_space_gain=K_N, metric=ConstantMetric(W1))
    with pytest.raises(GainError):
        Controller(panda(), [track()], null_space_gain=K_N)


def test_as_many_rows_as_freedoms_are_allowed() -> None:
    posture = JointPosture(panda(), panda().home(), GAINS)
    assert posture.rows == 7
    Controller(panda(), [posture])


# --- what it returns -----------------------------------------------------------------


@metrics
def test_effort_is_m_a_plus_n(kind: str) -> None:
    """Equation (7), with M and N by plain Pinocchio."""
    field = TargetPosture(panda(), panda().home())
    controller = Controller(panda(), [track()], field, metric=METRICS[kind](7))
    model, data = panda().model, panda().model.createData()
    for t, q, v in states(5):
        out = controller.compute(panda().state(t, q, v))
        M = pin.crba(model, data, q).copy()
        N = pin.rnea(model, data, q, v, np.zeros(7)).copy()
        expected = M @ out.acceleration + N
        scale = np.abs(expected).max()
        np.testing.assert_allclose(out.tau, expected, rtol=0, atol=1e-13 * scale)
        # The plant answers with that acceleration; cond(M) is below 1e4.
        a = panda().forward_dynamics(q, v, out.tau)
        size = np.abs(out.acceleration).max()
        np.testing.assert_allclose(a, out.acceleration, rtol=0, atol=1e-11 * size)


def test_tasks_are_stacked_in_order() -> None:
    tasks = [hold_orientation(), track(axes="xyz", name="origin")]
    controller = Controller(panda(), tasks, singularity_threshold=EXACT)
    t, q, v = states(1)[0]
    state = panda().state(t, q, v)
    out = controller.compute(state)
    assert controller.task_rows == {
        "panda_tcp_orientation": slice(0, 3),
        "origin": slice(3, 6),
    }
    for task in tasks:
        where = controller.task_rows[task.name]
        for stacked, own in zip(out.task, task.evaluate(state), strict=True):
            np.testing.assert_array_equal(stacked[where], own)
    residual = out.task.jacobian @ out.acceleration + out.task.jacobian_dot @ v
    scale = np.abs(out.task.acceleration).max()
    np.testing.assert_allclose(
        residual, out.task.acceleration, rtol=0, atol=1e-12 * scale
    )


def test_order_of_tasks_does_not_matter() -> None:
    """One level: the same law whichever comes first."""
    field = TargetPosture(panda(), panda().home())
    first = Controller(panda(), [track(), hold_orientation()], field)
    second = Controller(panda(), [hold_orientation(), track()], field)
    for t, q, v in states(5):
        state = panda().state(t, q, v)
        a, b = first.compute(state), second.compute(state)
        # Six rows near singularities: condition numbers up to 1e3.
        scale = 1e-11 * np.abs(a.acceleration).max()
        np.testing.assert_allclose(a.acceleration, b.acceleration, rtol=0, atol=scale)
        np.testing.assert_allclose(
            a.null_space_error, b.null_space_error, rtol=0, atol=1e-11
        )


def test_defaults_are_rest_the_identity_and_ten() -> None:
    plain = Controller(panda(), [track()])
    said = Controller(
        panda(), [track()], Rest(panda()), metric=IdentityMetric(), null_space_gain=10.0
    )
    state = panda().state(*states(1)[0])
    assert_same(copied(plain.compute(state)), copied(said.compute(state)))
    np.testing.assert_array_equal(plain.null_space_gain, 10.0 * np.eye(7))


def test_gain_as_number_list_and_matrix() -> None:
    state = panda().state(*states(1)[0])
    outputs = [
        copied(Controller(panda(), [track()], null_space_gain=gain).compute(state))
        for gain in (6.0, 7 * [6.0], 6.0 * np.eye(7))
    ]
    assert_same(outputs[0], outputs[1])
    assert_same(outputs[0], outputs[2])


@metrics
def test_uncontrolled_leaves_self_motion_alone(kind: str) -> None:
    """φ_N = 0, the paper's first simulation: a = J#(a_x - J'v) and no more."""
    metric = METRICS[kind](7)
    controller = Controller(
        panda(),
        [track()],
        Uncontrolled(panda()),
        metric=metric,
        singularity_threshold=EXACT,
    )
    for t, q, v in states(5):
        state = panda().state(t, q, v)
        out = controller.compute(state)
        sample, W = out.task, metric.evaluate(state, MetricSample.allocate(7)).W
        J_sharp = oracles.pseudo_inverse(sample.jacobian, W)
        expected = J_sharp @ (sample.acceleration - sample.jacobian_dot @ v)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(
            out.acceleration, expected, rtol=0, atol=1e-11 * scale
        )
        # e_N is reported all the same, for g = 0: the self-motion that nobody holds.
        e_N = -(v - J_sharp @ sample.jacobian @ v)
        np.testing.assert_allclose(out.null_space_error, e_N, rtol=0, atol=1e-11)
        assert np.abs(e_N).max() > 0.1


@metrics
def test_diagnosis(kind: str) -> None:
    metric = METRICS[kind](7)
    field = TargetPosture(panda(), panda().home(), weights=2.0)
    controller = Controller(
        panda(), [track(), hold_orientation()], field, metric=metric
    )
    for t, q, v in states(3, seed=1):
        state = panda().state(t, q, v)
        out = copied(controller.compute(state))
        diagnosis = controller.diagnose(state)
        W = metric.evaluate(state, MetricSample.allocate(7)).W
        J, e_N = out["task.jacobian"], out["null_space_error"]
        whitened = J @ np.linalg.inv(np.linalg.cholesky(W)).T
        expected = np.linalg.svd(whitened)[1]
        np.testing.assert_allclose(
            diagnosis.singular_values, expected, rtol=0, atol=1e-13 * expected[0]
        )
        np.testing.assert_allclose(
            diagnosis.manipulability,
            np.linalg.det(J @ np.linalg.solve(W, J.T)),
            rtol=1e-9,
        )
        np.testing.assert_allclose(
            diagnosis.null_space_norm, np.sqrt(e_N @ W @ e_N), rtol=1e-13
        )
        assert diagnosis.field_value == field.value(state)
        # To look changes nothing.
        again = controller.diagnose(state)
        np.testing.assert_array_equal(again.singular_values, diagnosis.singular_values)
        assert_same(copied(controller.compute(state)), out)


# --- no memory -----------------------------------------------------------------------


@metrics
def test_same_state_same_effort(kind: str) -> None:
    """Whatever was computed before: elsewhere, near a singularity, or an error."""
    tasks = [track(), hold_orientation()]
    field = TargetPosture(panda(), panda().home())
    controller = Controller(panda(), tasks, field, metric=METRICS[kind](7))
    fresh = Controller(panda(), tasks, field, metric=METRICS[kind](7))
    somewhere, *others = states(6, seed=2)
    state = panda().state(*somewhere)
    expected = copied(controller.compute(state))
    assert_same(copied(controller.compute(state)), expected)
    for t, q, v in others:
        controller.compute(panda().state(t, q, v))
        controller.diagnose(panda().state(t, q, v))
    upright = panda().state(0.0, np.zeros(7), np.ones(7))
    assert controller.compute(upright).damped
    controller.flow(0.7, others[0][1])
    assert_same(copied(controller.compute(state)), expected)
    # Another controller of the same tasks and field does not disturb, nor a new state.
    assert_same(copied(fresh.compute(panda().state(*somewhere))), expected)
    assert_same(copied(controller.compute(state)), expected)


def test_states_take_turns() -> None:
    """Two robots of one kind, one controller: each state gets its own effort."""
    field = TargetPosture(panda(), panda().home())
    controller = Controller(panda(), [track()], field, metric=MassMatrixMetric())
    first, second = (panda().state(*where) for where in states(2, seed=3))
    a, b = copied(controller.compute(first)), copied(controller.compute(second))
    for _ in range(3):
        assert_same(copied(controller.compute(first)), a)
        assert_same(copied(controller.compute(second)), b)
    assert np.abs(a["tau"] - b["tau"]).max() > 1.0


# --- near singularities --------------------------------------------------------------


@metrics
def test_singular_posture_gives_a_bounded_effort(kind: str) -> None:
    """The Panda upright cannot move its hand up: damped, bounded and smooth there."""
    tasks = [track(), hold_orientation()]
    field = TargetPosture(panda(), panda().home())
    threshold = 0.05
    controller = Controller(
        panda(),
        tasks,
        field,
        metric=METRICS[kind](7),
        singularity_threshold=threshold,
    )
    v = 0.1 * np.ones(7)
    direction = np.random.default_rng(4).standard_normal(7)
    outputs = [
        copied(controller.compute(panda().state(0.0, h * direction, v)))
        for h in (0.0, 1e-9, 1e-6)
    ]
    for out in outputs:
        assert out["damped"]
        assert np.isfinite(out["tau"]).all()
    sample = outputs[0]
    wanted = sample["task.acceleration"] - sample["task.jacobian_dot"] @ v
    state = panda().state(0.0, np.zeros(7), v)
    metric = METRICS[kind](7).evaluate(state, MetricSample.allocate(7))
    uncontrolled = Controller(
        panda(),
        tasks,
        Uncontrolled(panda()),
        metric=METRICS[kind](7),
        singularity_threshold=threshold,
    )
    a = uncontrolled.compute(state).acceleration
    bound = 1.09 / threshold * np.linalg.norm(wanted)
    assert np.sqrt(a @ metric.W @ a) <= bound
    # Continuous across the singular posture: a jump would be of a's own size. J# may
    # turn by 2/threshold² = 800 a radian, times the whitening's 30 in the mass matrix.
    size = np.abs(outputs[0]["acceleration"]).max()
    for out, h in zip(outputs[1:], (1e-9, 1e-6), strict=True):
        moved = np.abs(out["acceleration"] - outputs[0]["acceleration"]).max()
        assert moved <= 1e5 * h * size


# --- NaN never comes out -------------------------------------------------------------


class Broken(Trajectory):
    """A user's trajectory that goes wrong after half a second."""

    __slots__ = ("value", "where")

    def __init__(self, value: float, where: str) -> None:
        self.value = value
        self.where = where

    @property
    def dimension(self) -> int:
        return 3

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        out = circle().sample(t, out)
        if t > 0.5:
            getattr(out, self.where)[1] = self.value
        return out


class BrokenField(NullSpaceField):
    """A user's field written straight into the sample, unchecked."""

    def __init__(self, where: str, value: float) -> None:
        super().__init__(panda(), "mine")
        self.where = where
        self.broken = value

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        for array in out:
            array[:] = 0.0
        if state.t > 0.5:
            getattr(out, self.where)[2] = self.broken
        return out

    def value(self, state: RobotState) -> float:
        return 0.0


class BrokenMetric(Metric):
    """A user's metric that is not a number after half a second."""

    form: ClassVar[int] = VARYING

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        out.W_dot[0, 0] = np.nan if state.t > 0.5 else 0.0
        return out


class BrokenTask(FramePosition):
    """A user's task whose arrays go wrong after half a second."""

    where: str
    broken: float

    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        out = super().evaluate(state, out)
        if state.t > 0.5:
            getattr(out, self.where)[..., 1] = self.broken
        return out


def broken_task(where: str, value: float) -> BrokenTask:
    task = BrokenTask(panda(), TCP, circle(), GAINS, name="mine")
    task.where, task.broken = where, value
    return task


def late(wrong: Any, right: Any) -> Callable[..., Any]:
    """Return a function of a time or a state that goes wrong after half a second."""
    return lambda x: wrong if getattr(x, "t", x) > 0.5 else right


def position(function: Callable[[float], Any]) -> FramePosition:
    still = late(np.zeros(3), np.zeros(3))
    trajectory = CallableTrajectory(function, 3, velocity=still, acceleration=still)
    return FramePosition(panda(), TCP, trajectory, GAINS)


Parts = dict[str, Any]
NAN = np.full(7, np.nan)
FAILURES: dict[str, tuple[Callable[[], Parts], type[Exception], str]] = {
    **{
        f"{value} in a trajectory's {where}": (
            lambda value=value, where=where: {
                "tasks": [
                    FramePosition(
                        panda(), TCP, Broken(value, where), GAINS, name="mine"
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
            lambda value=value, where=where: {"field": BrokenField(where, value)},
            NonFiniteError,
            r"field 'mine' is not finite at t = 0\.75 s",
        )
        for value in (np.nan, np.inf)
        for where in ("g", "g_dot")
    },
    "NaN from a field's function": (
        lambda: {"field": FunctionField(panda(), late(NAN, np.zeros(7)), name="mine")},
        FieldError,
        r"field 'mine' returned g = array\(.*nan.* at t = 0\.75 s; needs 7 finite",
    ),
    "infinity from a field's rate": (
        lambda: {
            "field": FunctionField(
                panda(),
                late(np.zeros(7), np.zeros(7)),
                rate=late(np.full(7, np.inf), np.zeros(7)),
                name="mine",
            )
        },
        FieldError,
        r"field 'mine' returned g' = array\(.*inf.* at t = 0\.75 s",
    ),
    "a field of another size": (
        lambda: {"field": FunctionField(panda(), late(np.zeros(6), np.zeros(7)))},
        FieldError,
        "needs 7 finite numbers",
    ),
    "NaN from a cost": (
        lambda: {"field": FunctionCost(panda(), late(np.nan, 1.0), name="mine")},
        FieldError,
        r"cost 'mine' returned nan at t = 0\.7",
    ),
    "NaN from a cost's gradient": (
        lambda: {
            "field": FunctionCost(
                panda(),
                late(1.0, 1.0),
                gradient=late(NAN, np.zeros(7)),
                gradient_rate=late(np.zeros(7), np.zeros(7)),
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
    controller = Controller(panda(), **parts)
    _, q, v = states(1)[0]
    before = copied(controller.compute(panda().state(0.25, q, v)))
    with pytest.raises(error, match=message) as caught:
        controller.compute(panda().state(0.75, q, v))
    assert type(caught.value) is error
    assert isinstance(caught.value, HspControlError)
    # The failure leaves nothing behind: the controller goes on as if new.
    assert_same(copied(controller.compute(panda().state(0.25, q, v))), before)


def test_user_mistake_in_a_simulation_names_the_time() -> None:
    """The loop stops with the cause and what had been computed."""
    task = FramePosition(panda(), TCP, Broken(np.nan, "position"), GAINS, name="mine")
    controller = Controller(panda(), [task])
    with pytest.raises(
        HspControlError, match=r"the simulation stopped: task 'mine' is not finite"
    ) as caught:
        simulate(controller, panda().home(), duration=1.0, log_period=0.1)
    rollout = caught.value.rollout  # type: ignore[attr-defined]
    assert np.isfinite(rollout.tau).all()
    assert rollout.t[-1] == pytest.approx(0.5)


# --- the flow ------------------------------------------------------------------------


def swaying_posture(state: RobotState) -> Array:
    """A field that moves in time: the joints follow sines about the home posture."""
    away = panda().home() - state.q
    return 2.0 * away + np.sin(state.t + np.arange(7.0))


@metrics
def test_flow_meets_the_task_and_follows_the_field(kind: str) -> None:
    """v = J#x_d' + P g: J v = x_d', and v - g is as small as the metric can tell."""
    metric = METRICS[kind](7)
    field = FunctionField(panda(), swaying_posture)
    tasks = [track(), hold_orientation()]
    controller = Controller(
        panda(), tasks, field, metric=metric, singularity_threshold=EXACT
    )
    for t, q, _ in states(3, seed=5):
        v = controller.flow(t, q)
        state = panda().state(t, q, v)
        J = np.vstack([task.evaluate(state).jacobian for task in tasks])
        rate = np.concatenate([circle().sample(t).velocity, np.zeros(3)])
        np.testing.assert_allclose(J @ v, rate, rtol=0, atol=1e-12)
        W = metric.evaluate(state, MetricSample.allocate(7)).W
        null = np.linalg.svd(J)[2][6:]
        g = swaying_posture(state)
        # P(g - v) = 0: on the flow the null-space error has died.
        np.testing.assert_allclose(null @ W @ (g - v), 0.0, rtol=0, atol=1e-10)
        e_N = controller.compute(state).null_space_error
        np.testing.assert_allclose(e_N, 0.0, rtol=0, atol=1e-11)


@metrics
def test_robot_becomes_the_flow(kind: str) -> None:
    """After the transients the simulated velocity is flow(t, q), in every metric.

    Started off the path and moving: exp(-20 · 2) = 4e-18 is left of both errors.
    """
    controller = Controller(
        panda(),
        [track()],
        FunctionField(panda(), swaying_posture),
        metric=METRICS[kind](7),
        null_space_gain=20.0,
        singularity_threshold=EXACT,
    )
    rollout = simulate(
        controller,
        panda().home(),
        0.2 * np.ones(7),
        duration=2.0,
        log_period=0.25,
        integrator=Dop853(rtol=1e-10, atol=1e-10),
    )
    gaps = [
        np.abs(v - controller.flow(t, q)).max()
        for t, q, v in zip(rollout.t, rollout.q, rollout.v, strict=True)
    ]
    # In between, both errors die like (1 + 20 t) exp(-20 t); at the end it is the
    # integrator's tolerance that is left.
    assert gaps[0] > 0.1
    assert gaps[-1] < 1e-8
    # The flow itself is not at rest: the robot follows something that moves.
    assert np.abs(rollout.v[-1]).max() > 0.1


def test_a_start_on_the_flow_has_no_transient() -> None:
    """v0 = flow(0, q0) from a point of the path: e and e_N are zero from the start."""
    field = FunctionField(panda(), swaying_posture)
    home = panda().home()
    start = panda().state(0.0, home, np.zeros(7)).position(TCP).copy()
    path = Circle(
        start - np.array([0.1, 0.0, 0.0]), 0.1, 2.0, axes=[[1, 0, 0], [0, 0, 1]]
    )
    task = FramePosition(panda(), TCP, path, GAINS)
    controller = Controller(panda(), [task], field, singularity_threshold=EXACT)
    rollout = simulate(
        controller,
        home,
        controller.flow(0.0, home),
        duration=1.0,
        log_period=0.1,
        integrator=Dop853(rtol=1e-10, atol=1e-10),
    )
    for t, q, v in zip(rollout.t, rollout.q, rollout.v, strict=True):
        out = controller.compute(panda().state(t, q, v))
        np.testing.assert_allclose(out.task.error, 0.0, rtol=0, atol=1e-9)
        np.testing.assert_allclose(out.null_space_error, 0.0, rtol=0, atol=1e-8)


def test_hold_still() -> None:
    """A robot at rest at its posture and its point stays there: a = 0, tau = N."""
    home = panda().home()
    point = panda().state(0.0, home, np.zeros(7)).position(TCP).copy()
    task = FramePosition(panda(), TCP, Hold(point), GAINS)
    field = TargetPosture(panda(), home)
    for kind in METRICS:
        controller = Controller(panda(), [task], field, metric=METRICS[kind](7))
        state = panda().state(0.0, home, np.zeros(7))
        out = controller.compute(state)
        np.testing.assert_allclose(out.acceleration, 0.0, rtol=0, atol=1e-12)
        np.testing.assert_allclose(out.tau, state.nonlinear_effects, rtol=0, atol=1e-12)
        np.testing.assert_allclose(controller.flow(0.0, home), 0.0, rtol=0, atol=1e-14)


def test_constant_form_is_asked_for_no_rate() -> None:
    """A metric that declares itself constant is not differentiated."""

    class Growing(Metric):
        form: ClassVar[int] = CONSTANT

        def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
            out.W_dot[:] = np.nan  # nobody may read it
            return out

    controller = Controller(panda(), [track()], metric=Growing())
    plain = Controller(panda(), [track()])
    state = panda().state(*states(1)[0])
    np.testing.assert_allclose(
        controller.compute(state).tau, plain.compute(state).tau, rtol=1e-13, atol=1e-12
    )


def test_refuses_the_state_of_another_robot_object() -> None:
    other = Robot.load("panda")
    state = other.state(0.0, other.home(), np.zeros(7))
    with pytest.raises(ControllerError, match="the state is of another robot object"):
        Controller(panda(), [track()]).compute(state)
