"""Plants that differ from the model: imperfections alone, and all in the loop."""

import pickle
from collections.abc import Callable, Sequence
from copy import copy, deepcopy
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from loaded_robots import load
from wording import wording

from hsp_control import Controller, FramePosition, Gains, Robot, Rollout, simulate
from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.robot.description.sources import find_robot
from hsp_control.robot.friction import Friction, JointFriction
from hsp_control.robot.integrators import Dop853, Rk4
from hsp_control.simulation.plants import (
    ContactPlant,
    ImperfectPlant,
    IntegratedPlant,
    Push,
    RigidBodyPlant,
    RigidContact,
    SampledPlant,
    StickingPlant,
)
from hsp_control.simulation.plants.drives import (
    Drive,
    Driving,
    DroppedPeriods,
    EffortDelay,
    EffortLag,
    EffortNoise,
    Jitter,
    RunningLag,
    Saturation,
)
from hsp_control.simulation.plants.imperfect_plant import seeded_generator
from hsp_control.simulation.plants.model_changes import (
    Inertias,
    ModelChange,
    Payload,
    changed,
)
from hsp_control.simulation.plants.sensors import (
    DifferencedVelocity,
    Encoder,
    PositionNoise,
    Sensor,
    VelocityNoise,
)
from hsp_control.trajectories import Circle

ROBOTS = ["planar3r", "panda", "go2"]
"""Continuous joints, revolute ones, and a floating root."""


def some_state(robot: Robot, seed: int = 0) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    return robot.random_configuration(rng), rng.normal(size=robot.nv)


def mass_matrix(robot: Robot, q: Array) -> Array:
    M = robot.state(0.0, q, np.zeros(robot.nv)).mass_matrix.copy()
    return np.triu(M) + np.triu(M, 1).T


def gravity(robot: Robot, q: Array) -> Array:
    return robot.state(0.0, q, np.zeros(robot.nv)).nonlinear_effects.copy()


# --- model changes -------------------------------------------------------------------


@pytest.mark.parametrize("name", [*ROBOTS, "icub_reduced"])  # with moments of -5e-20
def test_random_inertias_are_possible_ones_within_their_bounds(name: str) -> None:
    robot = load(name)
    change = Inertias(random_mass=0.2, random_inertia=0.5, random_com=0.01)
    other = changed(robot, [change], seed=3)
    again = changed(robot, [change], seed=3)
    ratios = []
    for k in range(1, robot.model.njoints):
        before, after = robot.model.inertias[k], other.model.inertias[k]
        if before.mass == 0.0:
            continue
        assert after == again.model.inertias[k]
        ratios.append(after.mass / before.mass)
        assert np.abs(after.lever - before.lever).max() <= 0.01
        least, middle, greatest = np.linalg.eigvalsh(after.inertia)
        assert least >= -1e-15
        # As physically consistent as before: some URDFs are not by more than this.
        low, mid, high = np.linalg.eigvalsh(before.inertia)
        if low + mid >= high:
            assert least + middle >= greatest - 1e-12
    assert np.ptp(ratios) > 0.05
    assert 0.8 <= min(ratios) <= max(ratios) <= 1.2
    third = changed(robot, [Inertias(random_mass=0.2)], seed=4)
    for before, after in zip(robot.model.inertias, third.model.inertias, strict=True):
        if before.mass > 0.0:  # only the mass: another density
            density = after.mass / before.mass
            np.testing.assert_allclose(
                after.inertia, density * before.inertia, rtol=1e-9, atol=1e-15
            )
    assert third.model.inertias[2] != other.model.inertias[2]


@pytest.mark.parametrize(("name", "frame"), [("panda", "panda_tcp"), ("go2", "base")])
def test_a_payload_is_felt_where_it_is(name: str, frame: str) -> None:
    """M grows by m JᵀJ and gravity's effort by -Jᵀ m g, J of the ball's centre."""
    robot = load(name)
    q, _ = some_state(robot)
    center, mass = np.array([0.02, -0.01, 0.1]), 2.0
    other = changed(robot, [Payload(frame, mass, tuple(center))])
    state = robot.state(0.0, q, np.zeros(robot.nv))
    at = state.frame(frame)
    arm = at.rotation @ center
    J = at.jacobian[:3] - pin.skew(arm) @ at.jacobian[3:]
    np.testing.assert_allclose(
        mass_matrix(other, q), mass_matrix(robot, q) + mass * J.T @ J, atol=1e-10
    )
    np.testing.assert_allclose(
        gravity(other, q),
        gravity(robot, q) - J.T @ (mass * robot.model.gravity.linear),
        atol=1e-10,
    )
    ball = changed(robot, [Payload(frame, mass, tuple(center), radius=0.1)])
    turn = at.jacobian[3:]
    np.testing.assert_allclose(
        mass_matrix(ball, q),
        mass_matrix(other, q) + 0.4 * mass * 0.1**2 * turn.T @ turn,
        atol=1e-10,
    )


# --- friction ------------------------------------------------------------------------


def cart(mass: float = 2.0) -> Robot:
    """Return a mass on a horizontal rail."""
    model = pin.Model()
    joint = model.addJoint(0, pin.JointModelPX(), pin.SE3.Identity(), "rail")
    body = pin.Inertia(mass, np.zeros(3), 0.1 * np.eye(3))
    model.appendBodyToJoint(joint, body, pin.SE3.Identity())
    return Robot(model, find_robot("planar3r"))


def moved(plant: SampledPlant, v: float, duration: float, tau: float) -> Array:
    plant.reset(0.0, np.zeros(1), np.array([v]))
    return np.concatenate(plant.advance(0.0, duration, np.array([tau])))


def test_a_cart_slides_stops_and_sticks() -> None:
    """2 kg at 1 m/s against 4 N: it stops after 0.5 s and 0.25 m, and stays there."""
    robot = cart()
    plant = StickingPlant(robot, JointFriction.of(robot, coulomb=4.0), step=1e-3)
    np.testing.assert_allclose(moved(plant, 1.0, 0.25, 0.0), [0.1875, 0.5], rtol=1e-12)
    x, v = moved(plant, 1.0, 2.0, 0.0)
    assert x == pytest.approx(0.25, abs=1e-9)
    assert v == 0.0
    for push in (-3.999, 3.999):
        assert moved(plant, 0.0, 1.0, push).tolist() == [0.0, 0.0]
    np.testing.assert_allclose(moved(plant, 0.0, 1.0, 5.0), [0.25, 0.5], rtol=1e-9)
    np.testing.assert_allclose(moved(plant, 0.0, 1.0, -5.0), [-0.25, -0.5], rtol=1e-9)


@pytest.mark.parametrize("name", ROBOTS)
def test_without_friction_it_is_the_ideal_plant_to_second_order(name: str) -> None:
    robot = load(name)
    q, v = some_state(robot)
    tau = np.zeros(robot.nv)
    exact = Dop853(1e-13, 1e-13).advance(
        robot, lambda t, q, v: robot.forward_dynamics(q, v, tau), 0.0, 0.1, q, v
    )
    errors = []
    for step in (1e-3, 5e-4, 2.5e-4):
        plant = StickingPlant(robot, JointFriction.of(robot), step)
        plant.reset(0.0, q, v)
        end = plant.advance(0.0, 0.1, tau)
        apart = [robot.difference(exact[0], end[0]), exact[1] - end[1]]
        errors.append(float(np.abs(apart).max()))
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    np.testing.assert_allclose(orders, 2.0, atol=0.15)


def test_a_step_obeys_coulombs_law_in_every_joint() -> None:
    """The residual of M Δv - h(tau - N) is h c sign(v), at most that where v = 0."""
    robot = load("panda")
    coulomb = np.array([5.0, 5.0, 3.0, 3.0, 1.0, 1.0, 0.5])
    plant = StickingPlant(robot, JointFriction.of(robot, coulomb), step=1e-4)
    rng = np.random.default_rng(1)
    stuck = 0
    for _ in range(20):
        q = robot.random_configuration(rng)
        v = np.where(rng.random(7) < 0.5, 0.0, 0.5 * rng.normal(size=7))
        N = robot.state(0.0, q, v).nonlinear_effects.copy()
        tau = N + rng.normal(size=7) * coulomb
        plant.reset(0.0, q, v)
        _, after = plant.advance(0.0, 1e-4, tau)
        force = (tau - N) - mass_matrix(robot, q) @ (after - v) / 1e-4
        slips = after != 0.0
        np.testing.assert_allclose(
            force[slips], (coulomb * np.sign(after))[slips], atol=0.05
        )
        assert (np.abs(force[~slips]) <= coulomb[~slips] + 0.05).all()
        stuck += int((~slips).sum())
    assert 20 < stuck < 120


# --- sensors -------------------------------------------------------------------------


def shown(
    sensor: Sensor, robot: Robot, states: Sequence[tuple[Array, Array]], seed: int = 0
) -> list[tuple[Array, Array]]:
    random = seeded_generator(seed, type(sensor).__name__)
    sense = sensor.begin(robot, *states[0], random)
    return [sense(0.01 * k, *state) for k, state in enumerate(states)]


@pytest.mark.parametrize("name", ROBOTS)
def test_a_differenced_velocity_is_that_of_two_positions(name: str) -> None:
    """Passed through: the first velocity, one at an equal time, and a root's."""
    robot = load(name)
    (q, v), reported = some_state(robot), np.ones(robot.nv)
    sense = DifferencedVelocity().begin(robot, q, v, np.random.default_rng(0))
    np.testing.assert_array_equal(sense(1.0, q, reported)[1], reported)
    np.testing.assert_array_equal(sense(1.0, q, reported)[1], reported)
    later = robot.integrate(q, 0.01 * v)
    expected = np.where(robot.is_single_dof(), v, reported)
    np.testing.assert_allclose(sense(1.01, later, reported)[1], expected, atol=1e-9)
    assert (expected == reported).sum() == (6 if name == "go2" else 0)


@pytest.mark.parametrize("name", ROBOTS)
def test_an_encoder_counts(name: str) -> None:
    """Multiples of a count within half a count; a root is measured exactly."""
    robot = load(name)
    states = [some_state(robot, seed) for seed in range(20)]
    count = 2.0 * np.pi / 2**10
    for (q, v), (q_shown, v_shown) in zip(
        states, shown(Encoder(count), robot, states), strict=True
    ):
        robot.check_configuration(q_shown)
        off = robot.difference(q, q_shown)
        assert np.abs(off).max() <= 0.5 * count + 1e-12
        joints = robot.joint_positions(q_shown)[6 if name == "go2" else 0 :]
        np.testing.assert_allclose(joints / count, np.round(joints / count), atol=1e-9)
        np.testing.assert_array_equal(v_shown, v)
        if name == "go2":
            assert np.abs(off[:6]).max() < 1e-12


@pytest.mark.parametrize("name", ROBOTS)
def test_noise_has_its_size_and_its_seed(name: str) -> None:
    robot = load(name)
    states = [some_state(robot)] * 2000
    q, v = states[0]
    positions = shown(PositionNoise(0.01), robot, states, seed=1)
    velocities = shown(VelocityNoise(0.02), robot, states, seed=1)
    off = np.array([robot.difference(q, q_shown) for q_shown, _ in positions])
    rate = np.array([v_shown - v for _, v_shown in velocities])
    joints = slice(6 if name == "go2" else 0, None)
    np.testing.assert_allclose(off[:, joints].std(axis=0), 0.01, rtol=0.1)
    np.testing.assert_allclose(rate[:, joints].std(axis=0), 0.02, rtol=0.1)
    assert np.abs(off[:, joints].mean(axis=0)).max() < 0.001
    alike = np.corrcoef(off[:, -1], rate[:, -1])[0, 1]
    assert abs(alike) < 0.1  # the same seed, but independent numbers per kind
    again = shown(PositionNoise(0.01), robot, states, seed=1)
    other = shown(PositionNoise(0.01), robot, states, seed=2)
    np.testing.assert_array_equal(again[-1][0], positions[-1][0])
    assert (other[-1][0] != positions[-1][0]).any()
    if name == "go2":
        assert np.abs(off[:, :6]).max() < 1e-12
        own = shown(PositionNoise(np.full(18, 0.01)), robot, states[:1])
        assert np.abs(robot.difference(q, own[0][0])[:6]).min() > 1e-6


# --- drives --------------------------------------------------------------------------


def begun(drive: Drive, seed: int = 0) -> Driving:
    return drive.begin(load("panda"), seeded_generator(seed, type(drive).__name__))


def driven(drive: Drive, efforts: Sequence[Array], seed: int = 0) -> list[Array]:
    act = begun(drive, seed)
    return [act(effort)[0] for effort in efforts]


EFFORTS = [np.full(7, float(k)) for k in range(1, 9)]


def test_a_saturated_drive() -> None:
    effort = np.array([100.0, -100.0, 5.0, 0.0, -13.0, 12.1, 11.9])
    own = load("panda").model.upperEffortLimit
    np.testing.assert_array_equal(own[[0, 6]], [87.0, 12.0])
    np.testing.assert_array_equal(
        driven(Saturation(), [effort])[0], [87.0, -87.0, 5.0, 0.0, -12.0, 12.0, 11.9]
    )
    half = np.array([50.0] + [0.0] * 6)
    np.testing.assert_array_equal(
        driven(Saturation(half), [effort])[0], [50.0, *effort[1:]]
    )


@pytest.mark.parametrize("periods", [0, 1, 3])
def test_a_late_drive(periods: int) -> None:
    found = [effort[0] for effort in driven(EffortDelay(periods), EFFORTS)]
    assert found == [1.0] * periods + [float(k) for k in range(1, 9 - periods)]


@pytest.mark.parametrize("time_constant", [2e-4, 1e-3, 0.02])
def test_a_lag_acts_by_its_mean_over_the_period(time_constant: float) -> None:
    """τ f' = effort - f, integrated over the period in small steps."""
    drive = EffortLag(time_constant).begin(
        Robot.load("panda"), np.random.default_rng(0)
    )
    assert isinstance(drive, RunningLag)
    drive.period = 1e-3
    n = 20_000
    times = (np.arange(n) + 0.5) * drive.period / n
    has = np.array([1.0, -2.0])
    np.testing.assert_allclose(drive(has)[0], has, rtol=1e-12)
    for effort in (np.array([3.0, 0.0]), np.array([-1.0, 5.0])):
        f = effort + np.exp(-times / time_constant)[:, None] * (has - effort)
        np.testing.assert_allclose(drive(effort)[0], f.mean(axis=0), rtol=1e-7)
        has = effort + np.exp(-drive.period / time_constant) * (has - effort)


def test_a_drive_that_loses_efforts() -> None:
    """Every effort is the commanded or the previous one; the first is applied."""
    efforts = [np.full(7, float(k)) for k in range(2000)]
    found = [effort[0] for effort in driven(DroppedPeriods(0.3), efforts, seed=2)]
    lost = 0
    for k, effort in enumerate(found):
        assert effort in (k, found[k - 1] if k else 0.0)
        lost += effort != k
    assert 0.25 < lost / 2000 < 0.35


class Spy(SampledPlant):
    """A plant that records the efforts that act."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self.calls: list[tuple[float, float, float]] = []

    def reset(self, t: float, q: Array, v: Array) -> None:
        self.calls.clear()

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        self.calls.append((t, end, float(tau[0])))
        return self.robot.neutral(), np.zeros(self.robot.nv)


def timeline(*drives: Drive, seed: int = 0) -> list[tuple[float, float, float]]:
    """Return (from, to, effort) while a plant moves for 8 periods of 1 s."""
    spy = Spy(load("panda"))
    plant = ImperfectPlant(spy, drives=drives, seed=seed)
    plant.reset(0.0, spy.robot.neutral(), np.zeros(7))
    for k, effort in enumerate(EFFORTS):
        plant.advance(float(k), k + 1.0, effort)
    return spy.calls


def test_an_effort_later_than_its_period_begins_the_next() -> None:
    assert timeline(Jitter(1e9)) == [
        (0.0, 1.0, 1.0),
        *((float(k), k + 1.0, float(k)) for k in range(1, 8)),
    ]


def test_delays_of_all_drives_add_up() -> None:
    """Also of those before drives without any: the same jitter, clipped efforts."""
    jitter = timeline(Jitter(0.5))
    assert len(jitter) == 15  # the first effort acts at once
    found = timeline(Jitter(0.5), EffortNoise(0.0), Saturation(4.0))
    assert found == [(a, b, min(effort, 4.0)) for a, b, effort in jitter]


def test_contacts_are_felt_under_the_effort_that_acted() -> None:
    """A late effort does not press yet: as the plant's own wrenches."""
    robot, h = load("panda"), 1e-3
    engine = ContactPlant(robot, [RigidContact("panda_tcp", kind="point")])
    plant = ImperfectPlant(IntegratedPlant(engine, Rk4(h)), drives=[EffortDelay(1)])
    q, rest = robot.home(), np.zeros(7)
    first = robot.inverse_dynamics(q, rest, rest)
    second = first + 10.0
    plant.reset(0.0, q, rest)
    for k, tau in enumerate((first, second)):
        plant.advance(k * h, (k + 1) * h, tau)
    given = 2 * h, q, rest
    early, late = (
        engine.contact_wrenches(*given, tau)["panda_tcp"] for tau in (first, second)
    )
    felt = plant.contact_wrenches(*given, second)["panda_tcp"]
    np.testing.assert_array_equal(felt, early)
    assert np.abs(late - early).max() > 10.0


# --- pushes --------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["ideal", "sticking", "mujoco"])
def test_a_push_gives_its_impulse_to_any_plant(kind: str) -> None:
    """3 N for 0.5 s on 2 kg: 0.75 m/s, and along the rail alone."""
    robot = cart()
    robot.model.addFrame(
        pin.Frame("body", 1, 0, pin.SE3.Identity(), pin.FrameType.BODY)
    )
    robot = changed(robot, [])
    push = Push("body", (3.0, 7.0, 0.0), (0.0, 0.0, 1.0), start=0.2, duration=0.5)
    plant: SampledPlant
    if kind == "ideal":
        plant = IntegratedPlant(RigidBodyPlant(robot, [push]), Rk4(1e-3))
    elif kind == "sticking":
        plant = StickingPlant(robot, JointFriction.of(robot), pushes=[push])
    else:
        engine = pytest.importorskip("hsp_control.companions.mujoco.plant")

        plant = engine.MujocoPlant(robot, engine.Mujoco(pushes=[push]))
    # RK4's stages may misplace an edge by a third of a step.
    exact = 1e-9 if kind != "ideal" else 1e-3
    assert moved(plant, 0.0, 1.0, 0.0)[1] == pytest.approx(0.75, rel=exact)


@pytest.mark.parametrize(("start", "duration"), [(0.1, 0.2), (0.3, 0.4), (0.2, 0.1)])
def test_a_push_on_mujoco_lasts_as_many_steps_as_it_should(
    start: float, duration: float
) -> None:
    """Also where a step begins at 0.3 s and the push ends at 0.1 s + 0.2 s, later."""
    engine = pytest.importorskip("hsp_control.companions.mujoco.plant")
    robot = cart()
    robot.model.addFrame(
        pin.Frame("body", 1, 0, pin.SE3.Identity(), pin.FrameType.BODY)
    )
    push = Push("body", (3.0, 0.0, 0.0), start=start, duration=duration)
    plant = engine.MujocoPlant(changed(robot, []), engine.Mujoco(pushes=[push]))
    v = moved(plant, 0.0, 1.0, 0.0)[1]
    assert v == pytest.approx(3.0 * duration / 2.0, rel=1e-9)


# --- the whole loop ------------------------------------------------------------------


def panda_controller() -> Controller:
    robot = load("panda")
    start = robot.state(0.0, robot.home(), np.zeros(7)).position("panda_tcp").copy()
    center = start - [0.0, 0.1, 0.0]
    circle = Circle(0.1, 2.0, center, phase=np.pi / 2, normal=(0.0, 0.0, 1.0))
    task = FramePosition("panda_tcp", circle, gains=Gains(natural_frequency=20.0))
    return Controller(robot, [task])


def run(
    sensors: Sequence[Sensor] = (),
    drives: Sequence[Drive] = (),
    changes: Sequence[ModelChange] = (),
    friction: JointFriction | None = None,
    duration: float = 0.5,
    seed: int = 0,
) -> Rollout:
    controller = panda_controller()
    robot = changed(controller.robot, changes) if changes else controller.robot
    plant: SampledPlant = IntegratedPlant(RigidBodyPlant(robot), Rk4(1e-3))
    if friction is not None:
        plant = StickingPlant(robot, friction)
    return simulate(
        controller,
        robot.home(),
        duration=duration,
        control_period=1e-3,
        plant=ImperfectPlant(plant, sensors, drives, seed),
    )


@cache
def ideal() -> Rollout:
    return run()


def test_the_log_has_true_and_measured_states_and_the_acting_effort() -> None:
    rollout, again = (
        run(
            sensors=[Encoder(1e-3), VelocityNoise(0.02)],
            drives=[EffortDelay(1), Jitter(5e-4), EffortNoise(0.1), Saturation(20.0)],
            friction=JointFriction(np.full(7, 0.5), np.full(7, 0.2)),
            seed=5,
        )
        for _ in range(2)
    )
    for name, column in rollout.columns.items():
        np.testing.assert_array_equal(column, again[name], err_msg=name)
    assert np.abs(rollout.q - ideal().q).max() > 1e-3
    off = rollout["measured.q"] - rollout.q
    assert 1e-4 < np.abs(off).max() <= 0.5e-3 + 1e-12
    np.testing.assert_allclose(
        (rollout["measured.v"] - rollout.v).std(), 0.02, rtol=0.2
    )
    assert np.abs(rollout.tau).max() > 20.0
    assert np.abs(rollout["applied.tau"][1:]).max() == 20.0
    described = rollout.meta["plant"]
    assert described["type"] == "StickingPlant"
    assert described["sensors"][1] == {"type": "VelocityNoise", "std": 0.02}
    assert described["drives"][0] == {"type": "EffortDelay", "periods": 1}
    assert described["seed"] == 5


@pytest.mark.parametrize(
    "copied", [copy, deepcopy, lambda each: pickle.loads(pickle.dumps(each))]
)
def test_a_copy_begins_its_sensors_and_drives_anew(
    copied: Callable[[Any], Any],
) -> None:
    """The copy begins without memory; the original continues as without a copy."""

    def moved(plant: ImperfectPlant, times: range, q: Array, v: Array) -> list[Array]:
        found = []
        for k in times:
            found += plant.measure(k * 1e-3, q, v)
            tau = np.full(7, 5.0 * np.sin(k))
            q, v = plant.advance(k * 1e-3, (k + 1) * 1e-3, tau)
        return [*found, q, v]

    parts = [Encoder(0.01), VelocityNoise(0.02)], [EffortDelay(2), EffortLag(0.005)]
    plants = [ImperfectPlant(ideal_plant("panda"), *parts, seed=1) for _ in range(2)]
    start = plants[0].robot.home(), np.zeros(7)
    for each in plants:
        each.reset(0.0, *start)
        now = moved(each, range(5), *start)[-2:]
    twin = copied(plants[0])
    begun = ImperfectPlant(ideal_plant("panda"), *parts, seed=1)
    begun.reset(0.005, *now)
    found, expected = (moved(each, range(5, 9), *now) for each in (twin, begun))
    np.testing.assert_array_equal(found[0], expected[0])  # a step of the encoder
    np.testing.assert_array_equal(found[1], expected[1])  # the same noise
    np.testing.assert_array_equal(
        moved(plants[0], range(5, 9), *now), moved(plants[1], range(5, 9), *now)
    )


# --- refusals ------------------------------------------------------------------------


def ideal_plant(name: str) -> SampledPlant:
    return IntegratedPlant(RigidBodyPlant(load(name)), Rk4(1e-3))


REFUSED: list[tuple[Callable[[], object], str]] = [
    (lambda: Inertias(mass_factor=0.0),
     "Inertias: mass_factor: 0.0 ... greater than 0"),
    (lambda: Inertias(com_shift=(1.0,)), "Inertias: com_shift: (1.0,) ... 1 ... 3"),
    (lambda: Inertias(random_mass=1.0), "Inertias: random_mass: 1.0 ... less than 1"),
    (lambda: Payload("hand", -2.0), "Payload: mass: -2.0 ... greater than 0"),
    (lambda: EffortDelay(0.5),  # type: ignore[arg-type]
     "EffortDelay: periods: 0.5 ... an int"),
    (lambda: DroppedPeriods(1.0), "DroppedPeriods: probability: 1.0 ... less than 1"),
    (lambda: Push("hand", duration=0.0), "Push: duration: 0.0 ... greater than 0"),
    (lambda: JointFriction.of(load("panda"), [1.0, 2.0]),
     "coulomb: ... (2,) ... one number"),
    (lambda: Friction(viscous=[0.1, np.inf]), "Friction: viscous.1: inf ... finite"),
    (lambda: StickingPlant(load("panda"), JointFriction.of(load("panda")), -1.0),
     "step ... -1.0 ... positive"),
    (lambda: changed(load("panda"), [Payload("panda_link0", 1.0)]),
     "frame: 'panda_link0' is fixed to the world"),
    (lambda: ImperfectPlant(ideal_plant("planar3r"), drives=[Saturation()]),
     "drives.saturation.limit: ... planar3r ... no effort limits"),
    (lambda: ImperfectPlant(ideal_plant("panda"), [PositionNoise([1.0, 2.0])]),
     "sensors.position_noise.std: ... (2,) ... one number"),
    (lambda: Encoder("fine"), "Encoder: resolution: 'fine' ... a number"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "message"), REFUSED)
def test_imperfections_that_are_none(make: Any, message: str) -> None:
    with pytest.raises(SimulationError, match=wording(message)):
        make()


def test_a_reset_forgets_the_effort_that_acted() -> None:
    """The first one of a run acts at once, however late a drive is."""
    spy = Spy(load("panda"))
    plant = ImperfectPlant(spy, drives=[Jitter(1e9)])
    for effort in (1.0, 2.0):
        plant.reset(0.0, spy.robot.neutral(), np.zeros(7))
        plant.advance(0.0, 1.0, np.full(7, effort))
        assert spy.calls == [(0.0, 1.0, effort)]
