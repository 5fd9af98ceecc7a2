"""Integrators: orders of convergence, invariants, charts, adaptive steps."""

import pickle
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from closed_loops import EXACT, ROBOTS, distance, load, order, start

import hsp_control as hsp
from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import LogError, SimulationError
from hsp_control.engine.plans import planned
from hsp_control.robot import integrators
from hsp_control.robot.integrators import Dop853, Rk4, SemiImplicitEuler
from hsp_control.simulation.plants import RigidBody, RigidBodyPlant
from hsp_control.simulation.simulate import default_integrator


def falling(robot: Robot) -> Callable[[float, Array, Array], Array]:
    """Return the dynamics without a controller, tau = 0."""
    nothing = np.zeros(robot.nv)
    return lambda t, q, v: robot.forward_dynamics(q, v, nothing)


def one_by_one(
    calls: list[Any], interval: Array, longest: float, now: Array, h: Array
) -> None:
    """Divide an interval into equal steps, and make the calls of every step in
    Python."""
    start, end = interval
    steps = integrators.number_of_steps(end - start, longest)
    h[0] = (end - start) / steps
    for k in range(steps):
        now[0] = start + k * h[0]
        for call in calls:
            call(now[0])


@pytest.mark.parametrize(
    ("method", "expected", "longest"),
    [(Rk4, 4.0, 0.02), (SemiImplicitEuler, 1.0, 0.002)],
)
@pytest.mark.parametrize("name", ROBOTS)
def test_order_of_an_integrator(
    name: str, method: Any, expected: float, longest: float
) -> None:
    """A robot with a floating root in free fall for 0.2 s: slope by regression."""
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
    """One call for a whole second; a tenth of the tolerance gives a tenth of the
    error."""
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
    """Without gravity linear and angular momentum are constant across charts.

    Two seconds at 4 rad/s are 8 rad; a chart about the start is singular at 2 pi.
    """
    robot = load("floating talos_arm", gravity=False)
    model, data = robot.model, robot.model.createData()
    laid = []

    class Counted(integrators.TangentChart):
        def __init__(self, robot: Robot, base: Array) -> None:
            laid.append(1)
            super().__init__(robot, base)

    monkeypatch.setattr(integrators, "TangentChart", Counted)
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
        if len(evaluations) > 4000:  # four times the number with new charts
            raise StuckError
        return dynamics(t, q, v)

    EXACT.advance(robot, counted, 0.0, 2.0, q0, v0)
    evaluations.clear()
    monkeypatch.setattr(integrators, "CHART_RADIUS", np.inf)
    with pytest.raises(StuckError):
        EXACT.advance(robot, counted, 0.0, 2.0, q0, v0)
    assert evaluations[-1] == pytest.approx(2.0 * np.pi / 5.0, abs=1e-2)


@pytest.mark.parametrize("method", [Rk4, SemiImplicitEuler])
def test_native_steps_are_those_that_are_made_one_by_one(method: Any) -> None:
    """Bit for bit, over intervals of 10 ms with steps of at most 3 ms."""
    robot = load("panda")
    tau = np.linspace(-3.0, 3.0, 7)

    def begin() -> integrators.Steps:
        return method(0.003).begin(
            robot, lambda q, v: robot.bind_forward_dynamics(q, v, tau)
        )

    native, single = begin(), begin()
    assert native.native
    given = single.interval, 0.003, single.now, single.h
    single.take = partial(one_by_one, planned(single._calls()).steps(), *given)
    ours = theirs = start(robot, 8)
    for k in range(10):
        t, end = 0.01 * k, 0.01 * (k + 1)
        ours, theirs = native(t, end, *ours), single(t, end, *theirs)
        assert ours[0].tobytes() == theirs[0].tobytes()
        assert ours[1].tobytes() == theirs[1].tobytes()
    copy = pickle.loads(pickle.dumps(native.take))
    copy()  # it owns its input
    assert native.h[0] == pytest.approx(0.0025)


@pytest.mark.parametrize(
    "failure",
    [SimulationError, ZeroDivisionError, OverflowError, np.linalg.LinAlgError],
)
def test_trials_that_fail_are_shortened(failure: type[Exception]) -> None:
    """Where the dynamics raise, a shorter step may not be possible, either."""
    robot = load("planar3r")

    def swing(t: float, q: Array, v: Array) -> Array:
        if np.abs(v).max() > 1.1:
            raise failure("too far")
        return -np.sin(t) * np.ones(3)

    q, v = EXACT.advance(robot, swing, 0.0, 3.0, robot.neutral(), np.ones(3))
    np.testing.assert_allclose(v, np.cos(3.0), rtol=0, atol=1e-10)
    expected = robot.integrate(robot.neutral(), np.sin(3.0) * np.ones(3))
    np.testing.assert_allclose(q, expected, rtol=0, atol=1e-10)


def test_dynamics_that_fail_permanently_give_the_reason() -> None:
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
    message = r"^the integrator failed at t = 0.4 s: by nothing$"
    with pytest.raises(SimulationError, match=message):
        run(ZeroDivisionError("by nothing"))
    with pytest.raises(KeyError, match=r"yours"):  # not caused by the integrator
        run(KeyError("yours"))


def test_held_efforts_move_rigid_bodies_by_rk4_by_default() -> None:
    """The difference to a tight DOP853 is below the resolution of any figure."""
    robot = load("panda")
    for plant in (None, RigidBody(), RigidBodyPlant(robot)):
        assert default_integrator(plant, 0.01) == Rk4(1e-3)
        assert default_integrator(plant, None) == Dop853()
    mujoco = pytest.importorskip("hsp_control.companions.mujoco")
    assert default_integrator(mujoco.Mujoco(), 0.001) == Dop853()
    task = hsp.FramePose(trajectory=hsp.Circle(0.1, 3.0), blend=0.5, name="hand")
    parts: Any = robot, [task], hsp.JointCentering()
    how: Any = {"duration": 1.0, "control_period": 0.01}
    own, exact = (
        hsp.simulate(hsp.Controller(*parts), robot.home(), **how, integrator=each)
        for each in (None, Dop853(1e-12, 1e-12))
    )
    for name in ("q", "v", "task.hand.error", "null_space_norm"):
        np.testing.assert_allclose(own[name], exact[name], atol=1e-8)


def test_dop853_gives_up_at_a_pole() -> None:
    """v' = v² reaches infinity at t = 1: no step is small enough."""
    robot = load("planar3r")
    message = r"^the integrator failed at t = (1|0\.99\d*) s: .*step size"
    with pytest.raises(SimulationError, match=message):
        EXACT.advance(
            robot, lambda t, q, v: v * v, 0.0, 2.0, robot.neutral(), np.ones(3)
        )


@pytest.mark.parametrize("value", [0.0, -0.001, np.nan, np.inf])
def test_integrators_refuse_steps_that_are_none(value: float) -> None:
    for build, name in (
        (lambda: Rk4(value), "Rk4: step"),
        (lambda: SemiImplicitEuler(value), "SemiImplicitEuler: step"),
        (lambda: Dop853(rtol=value), "Dop853: rtol"),
        (lambda: Dop853(atol=value), "Dop853: atol"),
    ):
        wrong = "must be greater than 0" if np.isfinite(value) else "not a finite"
        message = rf"^{name}: .*{wrong}"
        with pytest.raises(SimulationError, match=message):
            build()
