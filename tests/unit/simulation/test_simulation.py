"""Simulation: orders of convergence, invariants, what is refused, what is kept."""

import io
import json
import os
import signal
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from hsp_control import (
    Controller,
    Dop853,
    FramePose,
    FramePosition,
    FunctionField,
    Gains,
    HspControlError,
    IntegratedPlant,
    JointPosture,
    MassMatrixMetric,
    Obstacle,
    Plant,
    PointDistance,
    RigidBodyPlant,
    Rk4,
    Robot,
    RobotState,
    Rollout,
    Scene,
    SemiImplicitEuler,
    TargetPosture,
    simulate,
)
from hsp_control.common.exceptions import (
    ConfigurationError,
    LogError,
    NonFiniteError,
    ShapeError,
    SimulationError,
)
from hsp_control.control.log_channel import LogChannel
from hsp_control.geometry.shapes import Sphere
from hsp_control.robot import integrators
from hsp_control.trajectories import Circle, ComposedPose, Hold, Lissajous, Spin

pytestmark = pytest.mark.filterwarnings("error")
Array = NDArray[np.float64]

EXACT = Dop853(rtol=1e-12, atol=1e-12)
ROBOTS: dict[str, tuple[str, str | None]] = {
    "planar3r": ("planar3r", None),
    "panda": ("panda", None),
    "rolling ur5": ("ur5", "planar"),
    "floating talos_arm": ("talos_arm", "free_flyer"),
}


@cache
def load(name: str, gravity: bool = True) -> Robot:
    """Return a robot, or skip if example-robot-data is asked for and not there."""
    source, root = ROBOTS[name]
    if source not in {"planar3r", "panda"}:
        pytest.importorskip("example_robot_data")
    pull = None if gravity else (0.0, 0.0, 0.0)
    return Robot.load(source, root=root, gravity=pull)  # type: ignore[arg-type]


def falling(robot: Robot) -> Callable[[float, Array, Array], Array]:
    """Return the dynamics without a controller, tau = 0."""
    nothing = np.zeros(robot.nv)
    return lambda t, q, v: robot.forward_dynamics(q, v, nothing)


def start(robot: Robot, seed: int, speed: float = 0.5) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    q = robot.integrate(robot.home(), 0.3 * rng.normal(size=robot.nv))
    return q, speed * rng.normal(size=robot.nv)


def distance(robot: Robot, a: tuple[Array, Array], b: tuple[Array, Array]) -> float:
    """Return how far two states are from each other, on the manifold."""
    apart = [robot.difference(a[0], b[0]), a[1] - b[1]]
    return float(np.abs(apart).max())


def order(steps: Array, errors: list[float]) -> float:
    """Return the slope of log error over log step."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


# --- integrators ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "expected", "longest"),
    [(Rk4, 4.0, 0.02), (SemiImplicitEuler, 1.0, 0.002)],
)
@pytest.mark.parametrize("name", ROBOTS)
def test_order_of_an_integrator(
    name: str, method: Any, expected: float, longest: float
) -> None:
    """A robot that falls freely, root and all, for 0.2 s: slope by regression."""
    robot = load(name)
    q0, v0 = start(robot, 1, speed=1.0)
    dynamics = falling(robot)
    exact = Dop853(1e-13, 1e-13).advance(robot, dynamics, 0.0, 0.2, q0, v0)
    steps = longest / np.array([1.0, 2.0, 4.0, 8.0])
    errors = [
        distance(robot, method(h).advance(robot, dynamics, 0.0, 0.2, q0, v0), exact)
        for h in steps
    ]
    assert errors[-1] < errors[0]
    assert order(steps, errors) == pytest.approx(expected, abs=0.2)


@pytest.mark.parametrize("name", ROBOTS)
def test_dop853_keeps_its_tolerance(name: str) -> None:
    """In one call for the whole second, and a tenth of the tolerance is a tenth off."""
    robot = load(name)
    q0, v0 = start(robot, 2, speed=1.0)
    dynamics = falling(robot)
    exact = Rk4(0.5e-3).advance(robot, dynamics, 0.0, 0.5, q0, v0)
    size = 1.0 + np.abs(exact[1]).max()
    errors = []
    for tolerance in (1e-5, 1e-7, 1e-9):
        found = Dop853(tolerance, tolerance).advance(robot, dynamics, 0.0, 0.5, q0, v0)
        errors.append(distance(robot, found, exact))
        assert errors[-1] < 20.0 * tolerance * size
    assert errors[0] > errors[1] > errors[2]


@pytest.mark.parametrize(
    ("integrator", "drift"),
    [(Dop853(1e-12, 1e-12), 1e-9), (Rk4(1e-3), 1e-7), (SemiImplicitEuler(1e-3), 0.05)],
)
@pytest.mark.parametrize("name", ROBOTS)
def test_energy_is_kept_without_effort(
    name: str, integrator: Any, drift: float
) -> None:
    """Kinetic and potential energy by plain Pinocchio, over 0.5 s of free fall."""
    robot = load(name)
    model, data = robot.model, robot.model.createData()

    def energy(q: Array, v: Array) -> float:
        return float(
            pin.computeKineticEnergy(model, data, q, v)
            + pin.computePotentialEnergy(model, data, q)
        )

    q, v = start(robot, 3)
    before = energy(q, v)
    exchanged = pin.computePotentialEnergy(model, data, q)
    for k in range(5):
        t = 0.1 * k
        q, v = integrator.advance(robot, falling(robot), t, t + 0.1, q, v)
        assert energy(q, v) == pytest.approx(before, abs=drift * max(1.0, abs(before)))
    if robot.model.gravity.linear[2] and name != "planar3r":
        exchanged -= pin.computePotentialEnergy(model, data, q)
        assert abs(exchanged) > 0.1  # it did fall


def test_momentum_of_a_tumbling_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """No gravity: linear and angular momentum stay, though the chart is laid anew.

    Two seconds at 4 rad/s are 8 rad; a chart about the start is singular at 2 pi.
    """
    robot = load("floating talos_arm", gravity=False)
    model, data = robot.model, robot.model.createData()
    laid = []

    class Counted(integrators.Chart):
        def __init__(self, robot: Robot, base: Array) -> None:
            laid.append(1)
            super().__init__(robot, base)

    monkeypatch.setattr(integrators, "Chart", Counted)
    q, v = start(robot, 4)
    v[3:6] = [2.5, -2.0, 2.4]

    def momentum(q: Array, v: Array) -> Array:
        h = pin.computeCentroidalMomentum(model, data, q, v).vector
        return np.asarray(h)

    before = momentum(q, v)
    q, v = EXACT.advance(robot, falling(robot), 0.0, 2.0, q, v)
    assert len(laid) > 5
    np.testing.assert_allclose(momentum(q, v), before, rtol=0, atol=1e-9)
    assert robot.check_configuration(q) is not None


def test_whole_turns_need_new_charts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rolling robot turns 10 rad; in one chart it would be stuck at 2 pi.

    The chart of a rigid motion (δ ↦ base ⊕ δ) is singular where the turn is whole.
    """
    robot = load("rolling ur5", gravity=False)
    q0, v0 = start(robot, 4, speed=0.2)
    v0[:3] = [0.5, -0.3, 5.0]
    dynamics = falling(robot)
    exact = Rk4(1e-3).advance(robot, dynamics, 0.0, 2.0, q0, v0)
    found = EXACT.advance(robot, dynamics, 0.0, 2.0, q0, v0)
    assert distance(robot, found, exact) < 1e-8

    class StuckError(Exception):
        pass

    evaluations: list[float] = []

    def counted(t: float, q: Array, v: Array) -> Array:
        evaluations.append(t)
        if len(evaluations) > 4000:  # four times what it takes with new charts
            raise StuckError
        return dynamics(t, q, v)

    EXACT.advance(robot, counted, 0.0, 2.0, q0, v0)
    evaluations.clear()
    monkeypatch.setattr(integrators, "CHART_RADIUS", np.inf)
    with pytest.raises(StuckError):
        EXACT.advance(robot, counted, 0.0, 2.0, q0, v0)
    assert evaluations[-1] == pytest.approx(2.0 * np.pi / 5.0, abs=1e-2)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_chart_is_the_manifold(name: str) -> None:
    """y' of the chart is the motion's: d/dt (base ⊕ δ) moves with v."""
    robot = load(name)
    base, _ = start(robot, 5)
    rng = np.random.default_rng(6)
    chart = integrators.Chart(robot, base)
    y, a = 0.8 * rng.normal(size=2 * robot.nv), rng.normal(size=robot.nv)
    rate = chart.rate(y, a)
    np.testing.assert_array_equal(rate[robot.nv :], a)
    h = 1e-4
    ahead, behind = (chart.point(y + s * h * rate)[0] for s in (1.0, -1.0))
    v = robot.difference(behind, ahead) / (2.0 * h)
    np.testing.assert_allclose(v, y[robot.nv :], rtol=0, atol=1e-7)


def test_steps_are_equal_and_none_is_longer() -> None:
    """An interval of 10 ms by steps of 3 ms: four of 2.5 ms, and it ends at its end."""
    robot = load("planar3r")
    q, v = start(robot, 7)
    for method, stages in ((SemiImplicitEuler, 1), (Rk4, 4)):
        times: list[float] = []

        def dynamics(t: float, q: Array, v: Array, times: list[float] = times) -> Array:
            times.append(t)
            return np.zeros(3)

        method(0.003).advance(robot, dynamics, 1.0, 1.01, q, v)
        starts = [1.0, 1.0025, 1.005, 1.0075]
        np.testing.assert_allclose(times[::stages], starts, rtol=0, atol=1e-14)
        assert len(times) == 4 * stages
    assert integrators.number_of_steps(0.3, 0.1) == 3  # 0.3/0.1 is 2.9999999999999996
    assert integrators.number_of_steps(0.1, 0.3) == 1


def test_trials_that_stray_are_shortened() -> None:
    """A trial step of 2 s overflows in its stages, before it could be judged."""
    options: Any = {"duration": 2.0, "integrator": EXACT}
    exact = simulate(planar_controller(), planar_start(), **options)
    for log_period in (0.1, 2.0):
        run = simulate(
            planar_controller(), planar_start(), log_period=log_period, **options
        )
        np.testing.assert_allclose(run.v[-1], exact.v[-1], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "failure",
    [SimulationError, ZeroDivisionError, OverflowError, np.linalg.LinAlgError],
)
def test_trials_that_fail_are_shortened(failure: type[Exception]) -> None:
    """Where the dynamics cannot be computed, a shorter step need not go."""
    robot = load("planar3r")

    def swing(t: float, q: Array, v: Array) -> Array:
        if np.abs(v).max() > 1.1:
            raise failure("too far")
        return -np.sin(t) * np.ones(3)

    q, v = EXACT.advance(robot, swing, 0.0, 3.0, robot.neutral(), np.ones(3))
    np.testing.assert_allclose(v, np.cos(3.0), rtol=0, atol=1e-10)
    expected = robot.integrate(robot.neutral(), np.sin(3.0) * np.ones(3))
    np.testing.assert_allclose(q, expected, rtol=0, atol=1e-10)


def test_dynamics_that_fail_for_good_say_why() -> None:
    robot = load("planar3r")

    def fails_with(failure: Exception) -> Callable[[float, Array, Array], Array]:
        def dynamics(t: float, q: Array, v: Array) -> Array:
            if t > 0.4:
                raise failure
            return np.zeros(3)

        return dynamics

    def run(failure: Exception) -> None:
        q, v = robot.neutral(), np.ones(3)
        EXACT.advance(robot, fails_with(failure), 0.0, 1.0, q, v)

    with pytest.raises(LogError, match=r"^mine$"):
        run(LogError("mine"))
    message = r"^the integrator gave up at t = 0.4 s: by nothing$"
    with pytest.raises(SimulationError, match=message):
        run(ZeroDivisionError("by nothing"))
    with pytest.raises(KeyError, match=r"yours"):  # no business of the integrator's
        run(KeyError("yours"))


def test_dop853_gives_up_at_a_pole() -> None:
    """v' = v² reaches infinity at t = 1: no step is small enough."""
    robot = load("planar3r")
    message = r"^the integrator gave up at t = (1|0\.99\d*) s: .*step size"
    with pytest.raises(SimulationError, match=message):
        EXACT.advance(
            robot, lambda t, q, v: v * v, 0.0, 2.0, robot.neutral(), np.ones(3)
        )


@pytest.mark.parametrize("value", [0.0, -0.001, np.nan, np.inf])
def test_integrators_refuse_steps_that_are_none(value: float) -> None:
    for build, name in (
        (lambda: Rk4(value), "step"),
        (lambda: SemiImplicitEuler(value), "step"),
        (lambda: Dop853(rtol=value), "rtol"),
        (lambda: Dop853(atol=value), "atol"),
    ):
        message = rf"^integrator: {name} is {value}; must be positive$"
        with pytest.raises(SimulationError, match=message):
            build()


# --- the closed loop -----------------------------------------------------------------


@cache
def planar_controller(gain: float = 10.0) -> Controller:
    robot = load("planar3r", gravity=False)
    circle = Circle([1.0, 1.0], 0.9, 3.0)
    task = FramePosition(robot, "tip", circle, Gains.from_frequency(10.0), axes="xy")
    ball = Obstacle(
        "ball", Sphere(0.1), Lissajous([-1, 1.7, 0], [0, 0.7, 0], [1, 3, 1])
    )
    field = TargetPosture(robot, planar_start()) + PointDistance(robot, ["link3"], ball)
    return Controller(robot, [task], field, null_space_gain=gain)


def planar_start() -> Array:
    robot = load("planar3r", gravity=False)
    return robot.integrate(robot.neutral(), np.array([-0.4, 0.9, 0.8]))


@cache
def panda_controller() -> Controller:
    robot = load("panda")
    x = robot.state(0.0, robot.home(), np.zeros(7)).position("panda_tcp").copy()
    task = FramePosition(
        robot,
        "panda_tcp",
        Lissajous(x, [0.1, 0.1, 0.05], [3.0, 4.0, 5.0]),
        Gains.from_frequency(10.0),
    )
    return Controller(robot, [task], TargetPosture(robot, robot.home() + 0.2))


@pytest.fixture(scope="module")
def planar_run() -> Rollout:
    """Return 0.5 s of the planar arm, logged every 10 ms."""
    return simulate(planar_controller(), planar_start(), duration=0.5, integrator=EXACT)


@pytest.mark.parametrize("which", ["planar3r", "panda"])
def test_sampled_control_converges_in_first_order(which: str) -> None:
    """Held efforts deviate from the continuous law in proportion to the period.

    Slopes by regression over 8, 4, 2 and 1 ms; 1.01 to 1.04 are found.
    """
    controller = planar_controller() if which == "planar3r" else panda_controller()
    robot = controller.robot
    q0 = planar_start() if which == "planar3r" else robot.home()
    options: Any = {"duration": 0.32, "log_period": 0.08}
    exact = simulate(controller, q0, integrator=EXACT, **options)
    periods = np.array([8e-3, 4e-3, 2e-3, 1e-3])
    deviations = []
    for period in periods:
        run = simulate(
            controller, q0, control_period=period, integrator=Rk4(4e-3), **options
        )
        deviations.append(
            [
                np.abs(run["joint_positions"] - exact["joint_positions"]).max(),
                np.abs(run.v - exact.v).max(),
                np.abs(run["null_space_error"] - exact["null_space_error"]).max(),
            ]
        )
    for column in np.array(deviations).T:
        assert order(periods, list(column)) == pytest.approx(1.0, abs=0.1)


class Spy(RigidBodyPlant):
    """A plant that writes down what it is asked."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self.calls: list[tuple[float, Array]] = []

    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        self.calls.append((t, tau.copy()))
        return super().acceleration(t, q, v, tau)


def test_sampled_control_holds_the_effort() -> None:
    """One effort a period, from beginning to end; the first is the logged one."""
    plant = Spy(planar_controller().robot)
    run = simulate(
        planar_controller(),
        planar_start(),
        duration=0.04,
        log_period=0.01,
        control_period=0.0025,
        integrator=Rk4(0.001),
        plant=plant,
    )
    times = np.array([t for t, _ in plant.calls])
    efforts = np.array([tau for _, tau in plant.calls])
    changes = 1 + np.flatnonzero(np.abs(np.diff(efforts, axis=0)).max(axis=1) > 0.0)
    np.testing.assert_allclose(
        times[[0, *changes]], 0.0025 * np.arange(16), rtol=0, atol=1e-12
    )
    assert len(plant.calls) == 16 * 3 * 4  # 3 steps of 0.83 ms, 4 stages
    np.testing.assert_array_equal(efforts[[0, *changes]][::4], run.tau[:4])


def test_continuous_control_is_evaluated_in_every_stage() -> None:
    plant = Spy(planar_controller().robot)
    simulate(
        planar_controller(),
        planar_start(),
        duration=0.02,
        integrator=Rk4(0.01),
        plant=plant,
    )
    efforts = np.array([tau for _, tau in plant.calls])
    assert len(efforts) == 8
    assert len(np.unique(efforts, axis=0)) == 8


def test_the_plant_may_be_another_robot() -> None:
    """A task error that dies on the model itself remains on an arm under gravity."""
    pytest.importorskip("example_robot_data")
    model, real = Robot.load("ur5"), Robot.load("ur5", gravity=(0.0, 0.0, -9.0))
    q0 = model.random_configuration(np.random.default_rng(1))
    x = model.state(0.0, q0, np.zeros(6)).position("tool0").copy()
    circle = Lissajous(x, [0.02, 0.02, 0.02], [1.0, 1.0, 1.0])
    task = FramePosition(model, "tool0", circle, Gains.from_frequency(10.0))
    controller = Controller(model, [task])
    runs = [
        simulate(controller, q0, duration=1.0, log_period=0.1, plant=plant)
        for plant in (None, RigidBodyPlant(real))
    ]
    ends = [np.abs(run["task.tool0.error"][-1]).max() for run in runs]
    assert ends[0] < 1e-3
    assert ends[1] > 3e-3


LEFT = np.array([1.0, -0.5, 1.0])


def test_a_floating_robot_follows_the_law() -> None:
    """Order 4 on the manifold with a pose task, and the error's own exponential.

    The hand is led through 2.4 rad in 0.6 s, at a root that turns with it.
    """
    robot = load("floating talos_arm", gravity=False)
    frame = "gripper_left_base_link"
    q0, v0 = start(robot, 8, speed=0.3)
    here = robot.state(0.0, q0, v0).frame(frame)
    axis = np.array([1.0, -2.0, 2.0]) / 3.0
    path = ComposedPose(
        Lissajous(here.position + 0.1 * LEFT, [0.2, 0.1, 0.2], [3.0, 4.0, 5.0]),
        Spin(pin.exp3(np.array([0.5, 0.8, -0.3])) @ here.rotation, axis, 4.0),
    )
    task = FramePose(robot, frame, path, Gains.from_frequency(6.0))
    controller = Controller(
        robot,
        [task],
        TargetPosture(robot, robot.home()),
        null_space_gain=6.0,
        base="driven" if robot.unactuated else None,
    )
    options: Any = {"duration": 0.6, "log_period": 0.1}
    exact = simulate(controller, q0, v0, integrator=EXACT, **options)
    e, e_dot = exact[f"task.{task.name}.error"], exact[f"task.{task.name}.error_rate"]
    t = exact.t[:, None]
    expected = (e[0] + (e_dot[0] + 6.0 * e[0]) * t) * np.exp(-6.0 * t)
    assert np.linalg.norm(e[0, 3:]) > 0.9
    np.testing.assert_allclose(e, expected, rtol=0, atol=1e-9)
    assert (
        np.linalg.norm(robot.difference(q0, exact.q[-1])[3:6]) > 0.5
    )  # the root turned
    norm = exact["null_space_norm"]
    np.testing.assert_allclose(norm, norm[0] * np.exp(-6.0 * exact.t), rtol=1e-8)

    steps = np.array([0.02, 0.01, 0.005])
    errors = []
    for step in steps:
        run = simulate(controller, q0, v0, integrator=Rk4(step), **options)
        errors.append(
            distance(robot, (run.q[-1], run.v[-1]), (exact.q[-1], exact.v[-1]))
        )
    assert order(steps, errors) == pytest.approx(4.0, abs=0.3)


def test_dop853_is_the_default(planar_run: Rollout) -> None:
    run = simulate(planar_controller(), planar_start(), duration=0.1)
    same = simulate(
        planar_controller(), planar_start(), duration=0.1, integrator=Dop853(1e-9, 1e-9)
    )
    np.testing.assert_array_equal(run.q, same.q)
    np.testing.assert_allclose(run.v, planar_run.v[:11], rtol=0, atol=1e-7)


def test_a_run_can_be_repeated(planar_run: Rollout) -> None:
    """Bit for bit, with other things computed between; nothing is shared."""
    planar_controller().compute(
        planar_controller().robot.state(3.0, planar_start(), np.ones(3))
    )
    again = simulate(
        planar_controller(), planar_start(), duration=0.5, integrator=EXACT
    )
    assert list(again.columns) == list(planar_run.columns)
    for name, column in planar_run.columns.items():
        np.testing.assert_array_equal(column, again[name], err_msg=name)
        assert not np.shares_memory(column, again[name])


def test_time_starts_when_it_is_told() -> None:
    """Half of a run, and the other half from where it ended, are the whole."""
    controller, q0 = planar_controller(), planar_start()
    options: Any = {"duration": 0.2, "integrator": Rk4(0.005)}
    first = simulate(controller, q0, start_time=1.0, **options)
    second = simulate(controller, first.q[-1], first.v[-1], start_time=1.2, **options)
    whole = simulate(controller, q0, start_time=1.0, **{**options, "duration": 0.4})
    np.testing.assert_allclose(first.t, 1.0 + 0.01 * np.arange(21), rtol=0, atol=1e-14)
    np.testing.assert_allclose(second.v[-1], whole.v[-1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(second.tau[0], first.tau[-1], rtol=0, atol=1e-10)
    late = simulate(controller, q0, start_time=0.0, **options)
    assert np.abs(late.tau[0] - first.tau[0]).max() > 0.1


def test_the_start_is_not_changed() -> None:
    q0, v0 = planar_start(), np.zeros(3)
    before = q0.copy()
    simulate(planar_controller(), q0, v0, duration=0.02)
    np.testing.assert_array_equal(q0, before)
    np.testing.assert_array_equal(v0, 0.0)


def test_progress(planar_run: Rollout) -> None:
    fractions: list[float] = []
    simulate(
        planar_controller(), planar_start(), duration=0.1, on_progress=fractions.append
    )
    np.testing.assert_allclose(fractions, np.linspace(0.0, 1.0, 11), atol=1e-15)


# --- what is refused -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"duration": 0.0}, r"^duration is 0.0 s; must be positive$"),
        ({"duration": -1.0}, r"^duration is -1.0 s; must be positive$"),
        ({"duration": np.nan}, r"^duration is nan s; must be positive$"),
        ({"duration": np.inf}, r"^duration is inf s; must be positive$"),
        ({"duration": 0.1, "log_period": 0.0}, r"^log_period is 0.0 s; must be pos"),
        (
            {"duration": 0.105},
            r"^duration = 0.105 s is not a whole multiple of log_period = 0.01 s$",
        ),
        (
            {"duration": 0.005},
            r"^duration = 0.005 s is not a whole multiple of log_period = 0.01 s$",
        ),
        (
            {"duration": 0.1, "control_period": 0.003},
            r"^log_period = 0.01 s is not a whole multiple of control_period = 0.003",
        ),
        (
            {"duration": 0.1, "control_period": 0.02},
            r"^log_period = 0.01 s is not a whole multiple of control_period = 0.02 s$",
        ),
        (
            {"duration": 1e300, "log_period": 1e-300},
            r"^duration = 1e\+300 s is inf times log_period = 1e-300 s; at most ",
        ),
        (
            {"duration": 0.1, "control_period": -0.001},
            r"^control_period is -0.001 s; mu",
        ),
        (
            {"duration": 0.1, "control_period": 0.0},
            r"^control_period is 0.0 s; must be",
        ),
    ],
)
def test_times_that_do_not_fit(options: dict[str, float], message: str) -> None:
    with pytest.raises(SimulationError, match=message) as caught:
        simulate(planar_controller(), planar_start(), **options)  # type: ignore
    assert caught.value.rollout is None


def test_times_that_fit_but_for_rounding() -> None:
    """0.3/0.1 is 2.9999999999999996, 0.07/0.01 is 7.000000000000001."""
    run = simulate(planar_controller(), planar_start(), duration=0.3, log_period=0.1)
    assert len(run) == 4
    run = simulate(
        planar_controller(), planar_start(), duration=0.07, control_period=0.01 / 3
    )
    assert len(run) == 8


@pytest.mark.parametrize(
    ("q0", "v0", "kind", "message"),
    [
        ([0.0] * 3, None, ShapeError, r"^configuration q has shape \(3,\); planar3r "),
        (
            [0.0] * 6,
            None,
            ConfigurationError,
            r"^q\[0:2\] = .* of norm 0; needs norm 1",
        ),
        ([np.nan] * 6, None, NonFiniteError, r"^configuration q\[0\] is nan"),
        (None, [0.0] * 6, ShapeError, r"^velocity v0 has shape \(6,\); planar3r needs"),
        (None, [0.0, np.inf, 0.0], NonFiniteError, r"^velocity v0\[1\] is inf"),
        (None, "fast", ShapeError, r"^velocity v0 is not an array of 3 numbers$"),
    ],
)
def test_starts_that_are_none(q0: Any, v0: Any, kind: Any, message: str) -> None:
    with pytest.raises(kind, match=message):
        simulate(
            planar_controller(), planar_start() if q0 is None else q0, v0, duration=0.1
        )


# --- what is kept --------------------------------------------------------------------


def simulate_until_interrupted(*arguments: Any, **options: Any) -> Rollout:
    """Simulate; a Ctrl-C that gets through fails the test, not the session."""
    try:
        return simulate(*arguments, **options)
    except KeyboardInterrupt:
        pytest.fail("the Ctrl-C got through")


@pytest.mark.parametrize("row", [0, 1, 17, 50])
def test_ctrl_c_keeps_what_was_computed(row: int, planar_run: Rollout) -> None:
    """Interrupted at row k: k + 1 rows, the same as the whole run's."""

    def interrupt(fraction: float) -> None:
        if round(fraction * 50) == row:
            raise KeyboardInterrupt

    run = simulate_until_interrupted(
        planar_controller(),
        planar_start(),
        duration=0.5,
        integrator=EXACT,
        on_progress=interrupt,
    )
    assert run.status == "interrupted"
    assert run.meta["message"] == "stopped by the user"
    assert len(run) == row + 1
    for name, column in run.columns.items():
        np.testing.assert_array_equal(column, planar_run[name][: row + 1], err_msg=name)


@pytest.mark.parametrize("control_period", [None, 0.005])
def test_ctrl_c_in_the_middle_of_a_row(
    control_period: float | None, tmp_path: Path
) -> None:
    """A signal comes at any moment: here inside the controller. Whole rows are kept."""
    robot = load("planar3r", gravity=False)

    def pressed(state: RobotState) -> Array:
        if state.t > 0.083:
            signal.raise_signal(signal.SIGINT)
        return np.zeros(3)

    field = FunctionField(robot, pressed, rate=lambda state: np.zeros(3))
    controller = Controller(robot, planar_controller().tasks, field)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        run = simulate_until_interrupted(
            controller, planar_start(), duration=0.5, control_period=control_period
        )
    finally:
        signal.signal(signal.SIGINT, before)
    assert run.status == "interrupted"
    assert len(run) == 9
    assert len({len(column) for column in run.columns.values()}) == 1
    assert Rollout.load(run.save(tmp_path / "run.npz")).status == "interrupted"


def test_ctrl_c_before_the_first_row() -> None:
    robot = load("planar3r", gravity=False)
    built = []

    def pressed(state: RobotState) -> Array:
        if built:
            raise KeyboardInterrupt
        return np.zeros(3)

    field = FunctionField(robot, pressed)
    controller = Controller(robot, planar_controller().tasks, field)
    built.append(True)
    run = simulate_until_interrupted(controller, planar_start(), duration=0.5)
    assert run.status == "interrupted"
    assert len(run) == 0
    assert repr(run) == "Rollout(0 rows, empty, interrupted)"


@pytest.mark.parametrize(
    ("options", "least"),
    [
        # K_N h = 20 and the loop blows up; 2 is the limit (theory.md §8).
        ({"control_period": 0.01}, 2),
        ({"control_period": 0.01, "integrator": SemiImplicitEuler(0.01)}, 2),
        ({"integrator": SemiImplicitEuler(0.01)}, 2),
        ({"integrator": Rk4(0.01)}, 1),
    ],
)
def test_divergence_keeps_the_rollout(
    options: dict[str, Any], least: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(9)
    with pytest.raises(SimulationError, match=r"^the simulation stopped: ") as caught:
        simulate(
            planar_controller(2000.0),
            planar_start(),
            rng.normal(size=3),
            duration=1.0,
            **options,
        )
    run = caught.value.rollout
    assert isinstance(run, Rollout)
    assert run.status == "diverged"
    assert run.meta["message"] in str(caught.value)
    assert least <= len(run) < 101
    assert all(np.isfinite(run[name]).all() for name in ("t", "q", "v", "tau"))
    loaded = Rollout.load(run.save(tmp_path / "run.npz"))
    np.testing.assert_array_equal(loaded.v, run.v)


def test_a_runaway_is_told_with_its_speed() -> None:
    message = (
        r"^the simulation stopped: the motion diverged before t = 0.0\d+ s: a joint "
        r"moves at [\d.e+]+ rad/s \(or m/s\). A singularity, gains too high"
    )
    with pytest.raises(SimulationError, match=message):
        simulate(
            planar_controller(2000.0),
            planar_start(),
            np.ones(3),
            duration=1.0,
            control_period=0.01,
        )


def test_an_error_on_the_way_keeps_the_rollout() -> None:
    """A field that returns NaN at some time is named; the rows before are kept."""
    robot = load("planar3r", gravity=False)
    field = FunctionField(
        robot,
        lambda state: np.full(3, np.nan if state.t > 0.25 else 0.0),
        rate=lambda state: np.zeros(3),
        name="mine",
    )
    controller = Controller(robot, planar_controller().tasks, field)
    with pytest.raises(
        SimulationError, match=r"^the simulation stopped: field 'mine' returned g = "
    ) as caught:
        simulate(controller, planar_start(), duration=0.5, meta={"name": "this"})
    run = caught.value.rollout
    assert isinstance(run, Rollout)
    assert len(run) == 26
    assert run.meta["name"] == "this"
    assert isinstance(caught.value.__cause__, HspControlError)


# --- the log's columns ---------------------------------------------------------------


def test_columns(planar_run: Rollout) -> None:
    """Every column is described, of the length of t, and says what the state says."""
    run, controller = planar_run, planar_controller()
    robot = controller.robot
    assert set(run.meta["columns"]) == set(run.columns)
    for name, column in run.columns.items():
        assert len(column) == len(run.t) == 51
        assert set(run.meta["columns"][name]) == {"unit", "meaning"}
    np.testing.assert_allclose(run.t, 0.01 * np.arange(51), rtol=0, atol=1e-15)
    for i in (0, 13, 50):
        state = robot.state(run.t[i], run.q[i], run.v[i])
        output = controller.compute(state)
        np.testing.assert_array_equal(run.tau[i], output.tau)
        np.testing.assert_array_equal(run["acceleration"][i], output.acceleration)
        np.testing.assert_array_equal(run["field.g"][i], output.field.g)
        np.testing.assert_array_equal(run["task.tip.error"][i], output.task.error)
        np.testing.assert_array_equal(
            run["null_space_error"][i], output.null_space_error
        )
        J = state.frame("tip").jacobian[:2]
        np.testing.assert_allclose(
            run["manipulability"][i], np.linalg.det(J @ J.T), rtol=1e-12
        )
        np.testing.assert_allclose(
            run["singular_values"][i], np.linalg.svd(J)[1], rtol=1e-12
        )
        for point, frame in enumerate(("joint1", "joint2", "joint3", "tip")):
            np.testing.assert_allclose(
                run["skeleton"][i, point], state.position(frame), rtol=0, atol=1e-14
            )
    assert run.meta["robot"]["skeleton_parents"] == [-1, 0, 1, 2]
    assert run.meta["metric"] == "IdentityMetric"
    assert run.meta["null_space_gain"] == (10.0 * np.eye(3)).tolist()


def test_the_norm_is_that_of_the_metric() -> None:
    robot = load("panda")
    controller = Controller(
        robot,
        panda_controller().tasks,
        panda_controller().field,
        metric=MassMatrixMetric(),
    )
    run = simulate(controller, robot.home(), duration=0.02, integrator=Rk4(0.001))
    for i in range(3):
        e_N = run["null_space_error"][i]
        M = robot.state(0.0, run.q[i], run.v[i]).mass_matrix
        expected = np.sqrt(e_N @ M @ e_N)
        np.testing.assert_allclose(run["null_space_norm"][i], expected, rtol=1e-12)


def test_joint_positions_of_continuous_joints_wind_up() -> None:
    """Joints that are led to 17 and -34 rad have gone there, not to some of ±pi."""
    robot = load("planar3r", gravity=False)
    away = Lissajous([0.0, 0.0, 0.0], [20.0, -40.0, 0.1], [0.5, 0.5, 1.0])
    task = JointPosture(
        robot, robot.neutral(), Gains.from_frequency(10.0), displacement=away
    )
    run = simulate(
        Controller(robot, [task]), robot.neutral(), [10.0, -20.0, 0.1], duration=2.0
    )
    expected = np.array([away.sample(t).position for t in run.t])
    assert np.abs(expected[-1]).max() > 30.0
    np.testing.assert_allclose(run["joint_positions"], expected, rtol=0, atol=1e-7)


def test_obstacles_are_logged() -> None:
    center = Lissajous([-1, 1.7, 0], [0, 0.75, 0], [0, 3, 0])
    scene = Scene([Obstacle("disk", Sphere(0.2), center)])
    run = simulate(planar_controller(), planar_start(), duration=0.1, scene=scene)
    expected = np.array([center.sample(t).position for t in run.t])
    np.testing.assert_array_equal(run["obstacle.disk"], expected)
    assert run.meta["obstacles"]["disk"]["radius"] == 0.2
    assert "obstacle.disk" in run.meta["columns"]


# --- the log's file ------------------------------------------------------------------


def strict(text: str) -> Any:
    """Parse JSON as the standard has it, without NaN and Infinity."""

    def refuse(name: str) -> Any:
        raise ValueError(f"{name} is not JSON")

    return json.loads(text, parse_constant=refuse)


def same(a: Rollout, b: Rollout) -> bool:
    return (
        list(a.columns) == list(b.columns)
        and all(np.array_equal(a[name], b[name]) for name in a.columns)
        and a.meta == b.meta
    )


def test_round_trip(planar_run: Rollout, tmp_path: Path) -> None:
    path = planar_run.save(tmp_path / "logs" / "run.npz")  # makes the folder
    assert path == tmp_path / "logs" / "run.npz"
    assert [file.name for file in path.parent.iterdir()] == ["run.npz"]
    loaded = Rollout.load(str(path))
    assert same(loaded, planar_run)
    assert all(loaded[n].dtype == planar_run[n].dtype for n in loaded.columns)
    assert loaded.config is None
    assert repr(loaded) == "Rollout(51 rows, 0 to 0.5 s, completed)"


def test_numpy_alone_reads_it(planar_run: Rollout, tmp_path: Path) -> None:
    """No pickle inside; the names that always exist; the description is strict JSON."""
    path = planar_run.save(tmp_path / "run.npz")
    with np.load(path, allow_pickle=False) as archive:
        columns = {name: archive[name] for name in archive.files}
    assert {"meta", "t", "q", "v", "tau"} <= set(columns)
    assert all(column.dtype != object for column in columns.values())
    meta = strict(str(columns.pop("meta")))
    assert meta["format"] == "hsp_control rollout 1"
    assert meta["status"] == "completed"
    assert {"columns", "robot", "tasks", "versions"} <= set(meta)
    assert set(meta["columns"]) == set(columns)
    assert meta["robot"]["freedoms"] == ["joint1", "joint2", "joint3"]
    for name, column in columns.items():
        np.testing.assert_array_equal(column, planar_run[name], err_msg=name)


def test_meta_is_the_user_s_too(tmp_path: Path) -> None:
    run = simulate(
        planar_controller(),
        planar_start(),
        duration=0.01,
        meta={"config": {"title": "φ_N = 0, “quoted”"}, "note": [1, None, True]},
    )
    loaded = Rollout.load(run.save(tmp_path / "a name with spaces"))
    assert loaded.config == {"title": "φ_N = 0, “quoted”"}
    assert loaded.meta["note"] == [1, None, True]


def test_a_column_that_is_not_there(planar_run: Rollout) -> None:
    assert "task.tip.error" in planar_run
    assert "task.tip.eror" not in planar_run
    message = (
        r"^the log has no column 'task.tip.eror'; did you mean 'task.tip.error'\? "
        r"\(it has t, q, v, tau, "
    )
    with pytest.raises(LogError, match=message):
        planar_run["task.tip.eror"]


@pytest.fixture
def short_log(tmp_path: Path) -> tuple[Rollout, bytes, Path]:
    """Return a log of three rows, the bytes of its file, and a place for others."""
    run = simulate(planar_controller(), planar_start(), duration=0.02)
    data = run.save(tmp_path / "whole.npz").read_bytes()
    return run, data, tmp_path / "other.npz"


def test_a_log_cut_short_is_refused(short_log: tuple[Rollout, bytes, Path]) -> None:
    """At every 50th byte, and at the last few."""
    _, data, path = short_log
    ends = {*range(0, len(data), 50), *range(len(data) - 25, len(data))}
    for end in sorted(ends):
        path.write_bytes(data[:end])
        with pytest.raises(LogError, match=r"other.npz: not a whole .npz log"):
            Rollout.load(path)


def test_a_log_with_a_wrong_byte_is_refused_or_whole(
    short_log: tuple[Rollout, bytes, Path],
) -> None:
    """Some bytes do not matter (dates); no other may change what is read."""
    run, data, path = short_log
    refused = 0
    places = range(3, len(data), 50)
    for place in places:
        broken = bytearray(data)
        broken[place] ^= 0xFF
        path.write_bytes(broken)
        try:
            loaded = Rollout.load(path)
        except LogError:
            refused += 1
        else:
            assert same(loaded, run), place
    assert refused > 0.7 * len(places)


def npz(**arrays: Any) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


def meta(**changes: Any) -> Any:
    return np.array(json.dumps({"format": "hsp_control rollout 1", **changes}))


ROW: Any = {name: np.zeros((2, 1)) for name in ("q", "v", "tau")}
FOREIGN: dict[str, tuple[Callable[[], bytes], str]] = {
    "empty": (lambda: b"", r"not a whole .npz log"),
    "text": (lambda: b"t, q, v\n0, 1, 2\n", r"not a whole .npz log"),
    "png": (lambda: b"\x89PNG\r\n\x1a\n" + bytes(range(256)), r"not a whole .npz log"),
    "zip": (lambda: b"PK\x03\x04" + bytes(100), r"not a whole .npz log"),
    "npy": (lambda: npy(np.zeros(3)), r"not a whole .npz log"),
    "pickle": (
        lambda: npz(meta=meta(), t=np.array([{}], dtype=object)),
        r"not a whole .npz log .*pickle",
    ),
    "no meta": (
        lambda: npz(t=np.zeros(2), **ROW),
        r"not a log of hsp_control: it has no text entry 'meta' \(it has t, q, v, ",
    ),
    "meta of numbers": (
        lambda: npz(meta=np.zeros(3), t=np.zeros(2), **ROW),
        r"not a log of hsp_control: it has no text entry 'meta'",
    ),
    "meta not JSON": (
        lambda: npz(meta=np.array("{"), t=np.zeros(2), **ROW),
        r"its entry 'meta' is not JSON: ",
    ),
    "meta a list": (
        lambda: npz(meta=np.array("[1, 2]"), t=np.zeros(2), **ROW),
        r"its format is \[1, 2\]; this version reads 'hsp_control rollout 1'",
    ),
    "another format": (
        lambda: npz(meta=meta(format="hsp_control rollout 2"), t=np.zeros(2), **ROW),
        r"its format is 'hsp_control rollout 2'; this version reads",
    ),
    "no format": (
        lambda: npz(meta=np.array("{}"), t=np.zeros(2), **ROW),
        r"its format is None; this version reads",
    ),
    "column": (lambda: npz(meta=meta(), **ROW), r"the log lacks the column 't'"),
    "described column": (
        lambda: npz(meta=meta(columns={"e": {}}), t=np.zeros(2), **ROW),
        r"the log lacks the column 'e'",
    ),
    "lengths": (
        lambda: npz(meta=meta(), t=np.zeros(3), **ROW),
        r"the log's columns differ in length",
    ),
    "number for a column": (
        lambda: npz(meta=meta(), t=np.zeros(2), extra=np.array(1.0), **ROW),
        r"the log's columns differ in length",
    ),
}


def npy(array: Array) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    return file.getvalue()


@pytest.mark.parametrize("which", FOREIGN)
def test_foreign_files(which: str, tmp_path: Path) -> None:
    make, message = FOREIGN[which]
    path = tmp_path / "foreign.npz"
    path.write_bytes(make())
    with pytest.raises(LogError, match=rf"foreign.npz: {message}"):
        Rollout.load(path)


def test_no_such_file(short_log: tuple[Rollout, bytes, Path]) -> None:
    _, _, path = short_log
    message = r"whloe.npz: no such file; did you mean 'whole.npz'\?$"
    with pytest.raises(LogError, match=message):
        Rollout.load(path.with_name("whloe.npz"))
    with pytest.raises(LogError, match=r"gone.npz: no such file$"):
        Rollout.load(path.parent / "nowhere" / "gone.npz")
    with pytest.raises(LogError, match=r"not a whole .npz log"):
        Rollout.load(path.parent)  # a folder


def test_places_where_nothing_can_be_written(
    short_log: tuple[Rollout, bytes, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A folder that is a file, a file that is a folder, a full disk."""
    run, data, path = short_log
    path.write_bytes(b"a file")
    with pytest.raises(
        LogError, match=r"run.npz: cannot write the log: (File ex|Not a)"
    ):
        run.save(path / "run.npz")
    with pytest.raises(
        LogError, match=r"run.npz: cannot write the log: (Not a|File ex)"
    ):
        run.save(path / "deeper" / "run.npz")
    folder = path.with_name("folder.npz")
    folder.mkdir()
    with pytest.raises(
        LogError, match=r"folder.npz: cannot write the log: Is a direct"
    ):
        run.save(folder)
    assert sorted(file.name for file in path.parent.iterdir()) == [
        "folder.npz",
        "other.npz",
        "whole.npz",
    ]

    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", full)
    whole = path.with_name("whole.npz")
    with pytest.raises(
        LogError, match=r"whole.npz: cannot write the log: No space left"
    ):
        run.save(whole)
    assert whole.read_bytes() == data  # the old one is still there, and nothing else
    assert not list(path.parent.glob(".*.part"))


@pytest.mark.skipif(os.geteuid() == 0, reason="nothing is locked for root")
def test_a_locked_folder(short_log: tuple[Rollout, bytes, Path]) -> None:
    run, _, path = short_log
    folder = path.with_name("locked")
    folder.mkdir(mode=0o500)
    with pytest.raises(LogError, match=r"cannot write the log: Permission denied$"):
        run.save(folder / "run.npz")


def test_saving_over_a_log_replaces_it(
    planar_run: Rollout, short_log: tuple[Rollout, bytes, Path]
) -> None:
    _, _, path = short_log
    whole = path.with_name("whole.npz")
    planar_run.save(whole)
    assert len(Rollout.load(whole)) == 51


# --- plants that move on by themselves -----------------------------------------------


class Sampled(IntegratedPlant):
    """A sampled plant that writes down its calls, and shows the state one off."""

    def __init__(self, robot: Robot, offset: float) -> None:
        super().__init__(RigidBodyPlant(robot), Rk4(0.001))
        self.offset = offset
        self.calls: list[tuple[Any, ...]] = []

    def reset(self, t: float, q: Array, v: Array) -> None:
        self.calls.append(("reset", t))
        super().reset(t, q, v)

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        self.calls.append(("measure", t))
        return (q, v + self.offset) if self.offset else (q, v)

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        self.calls.append(("advance", t, end, tau.copy()))
        return super().advance(t, end, tau)

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> dict[str, LogChannel]:
        return {"contact.tip.force": LogChannel(np.array([t, v[0], tau[0]]), "N", "so")}

    def describe(self) -> dict[str, Any]:
        return {"type": "Sampled", "offset": self.offset}


def run_sampled(plant: Plant | None) -> Rollout:
    return simulate(
        planar_controller(),
        planar_start(),
        [0.1, 0.2, 0.3],
        duration=0.04,
        control_period=0.005,
        integrator=Rk4(0.001),
        plant=plant,
        start_time=1.0,
    )


def test_a_sampled_plant_is_reset_once_then_measured_and_moved_every_period() -> None:
    plant = Sampled(planar_controller().robot, 0.0)
    run = run_sampled(plant)
    kinds = [call[0] for call in plant.calls]
    assert kinds == ["reset", *["measure", "advance"] * 8, "measure"]
    assert plant.calls[0] == ("reset", 1.0)
    times = [call[1] for call in plant.calls if call[0] == "measure"]
    np.testing.assert_allclose(times, 1.0 + 0.005 * np.arange(9), rtol=0, atol=1e-12)
    for call in (call for call in plant.calls if call[0] == "advance"):
        assert call[2] - call[1] == pytest.approx(0.005, abs=1e-12)
    same = run_sampled(None)
    for name in same.columns:
        np.testing.assert_array_equal(run[name], same[name], err_msg=name)


def test_the_log_has_the_truth_and_the_effort_of_what_was_shown() -> None:
    """Shown v + 1, the controller commands what it would at v + 1; q, v are true."""
    controller = planar_controller()
    plant = Sampled(controller.robot, 1.0)
    run = run_sampled(plant)
    state = RobotState(controller.robot)
    for t, q, v, tau, error_rate in zip(
        run.t, run.q, run.v, run.tau, run["task.tip.error_rate"], strict=True
    ):
        expected = controller.compute(state.update(t, q, v + 1.0)).tau
        np.testing.assert_allclose(tau, expected, rtol=1e-12, atol=1e-12)
        truth = controller.compute(state.update(t, q, v)).task.error_rate
        np.testing.assert_allclose(error_rate, truth, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(
        run["contact.tip.force"], np.c_[run.t, run.v[:, 0], run.tau[:, 0]]
    )
    assert run.meta["columns"]["contact.tip.force"] == {"unit": "N", "meaning": "so"}
    assert run.meta["plant"] == {"type": "Sampled", "offset": 1.0}
    ideal = {"type": "RigidBodyPlant", "pushes": []}
    assert run_sampled(None).meta["plant"] == ideal


def test_a_sampled_plant_needs_a_control_period() -> None:
    plant = Sampled(planar_controller().robot, 0.0)
    with pytest.raises(
        SimulationError, match=r"^Sampled holds the effort .* control_p"
    ):
        simulate(planar_controller(), planar_start(), duration=0.1, plant=plant)


def test_a_plant_with_other_joints_is_refused() -> None:
    plant = RigidBodyPlant(load("panda"))
    message = r"^the plant moves panda with the joints panda_joint1, .* planar3r has "
    with pytest.raises(SimulationError, match=message):
        simulate(planar_controller(), planar_start(), duration=0.1, plant=plant)


def test_a_run_can_be_measured_afterwards(planar_run: Rollout) -> None:
    """`measure` gives what the log has, and what it has not, at every row."""
    run, robot = planar_run, load("planar3r", gravity=False)
    tip = run.measure(robot, lambda state: state.position("tip"))
    np.testing.assert_array_equal(tip, run["skeleton"][:, -1])
    speed = run.measure(robot, lambda state: state.v @ state.v)
    np.testing.assert_array_equal(speed, [v @ v for v in run.v])
    np.testing.assert_array_equal(run.measure(robot, lambda state: state.t), run.t)
    with pytest.raises(ShapeError, match=r"panda needs \(7,\)"):
        run.measure(load("panda"), lambda state: state.t)


@pytest.mark.parametrize(
    ("name", "efforts"),
    [("planar3r", "N·m"), ("rolling ur5", "N or N·m")],
)
def test_efforts_have_the_units_of_their_joints(name: str, efforts: str) -> None:
    """In the joints' order: a root or a rail that comes first pushes, in newtons."""
    robot = load(name)
    q0 = robot.integrate(robot.home(), np.full(robot.nv, 0.3))
    start = robot.state(0.0, q0, np.zeros(robot.nv)).position(robot.end_effector)
    gains = Gains.from_frequency(5.0)
    task = FramePosition(robot, robot.end_effector, Hold(start[:2]), gains, axes="xy")
    run = simulate(Controller(robot, [task]), q0, duration=0.01)
    assert run.meta["columns"]["tau"]["unit"] == efforts
