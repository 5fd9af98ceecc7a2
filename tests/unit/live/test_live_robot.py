"""The robot's side: what it accepts, how it stops, and which effort it reports."""

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from live_rigs import PERIOD, Array, Rig, gravity, law, start, watched
from loaded_robots import panda
from places import THOROUGH, covering
from wording import wording

from hsp_control import Gains, Robot
from hsp_control.control.compensation import (
    CompensatedController,
    Compensation,
    MomentumObserver,
)
from hsp_control.live import LiveSettings, Measurement, Phase, SimulatedRobot, run_loop
from hsp_control.live.effort_limiter import EffortLimiter
from hsp_control.robot.integrators import SemiImplicitEuler
from hsp_control.simulation.plants import IntegratedPlant, RigidBodyPlant

RATE = 500.0
RATED = LiveSettings(effort_rate=RATE)


def fed(robot: SimulatedRobot, efforts: Iterable[Array]) -> Array:
    """Return the motors' efforts in all periods up to the end of the robot's own
    stop."""
    taus = []
    for effort in efforts:
        robot.advance([effort])
        taus.append(robot.tau.copy())
    while not robot.done:
        robot.advance([])
        taus.append(robot.tau.copy())
        assert len(taus) < 5000
    return np.array(taus)


# --- checks --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("joint", "effort", "reason"),
    [
        (1, 87.1, "panda_joint2 was sent 87.1 ... 87.0001"),
        (6, -1e300, "panda_joint7 was sent -1e+300 ... 12"),
        (3, np.nan, "an effort is not finite"),
        (0, 0.6, "... panda_joint1 jumped by 0.6 ... 0.5"),
    ],
)
def test_efforts_beyond_its_limits_stop_it(
    joint: int, effort: float, reason: str
) -> None:
    robot = watched(RATED)
    held = gravity(start())
    wrong = held.copy()
    wrong[joint] = effort
    taus = fed(robot, [held, held, wrong, held])
    with pytest.raises(AssertionError, match=wording(reason)):
        raise AssertionError(robot.reason)
    assert robot.phase is Phase.HOLDING
    assert np.isfinite(taus).all()
    assert np.abs(robot.v).max() < 0.01


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_robot_that_adds_gravity_accepts_every_effort_of_its_motors(
    sign: float,
) -> None:
    """It is sent tau - g(q), which may be larger than the limit of tau."""
    robot, g = watched(LiveSettings(compensates_gravity=True)), gravity(start())
    i = int(np.abs(g).argmax())
    assert abs(g[i]) > 10.0
    limit = LiveSettings().effort_limits(panda())[i]
    effort = np.zeros(7)
    effort[i] = sign * limit - g[i]
    robot.advance([effort])
    assert robot.phase is Phase.RUNNING, robot.reason
    assert robot.tau[i] == pytest.approx(sign * limit, rel=1e-12)
    beyond = np.zeros(7)
    beyond[i] = -np.sign(g[i]) * (limit + abs(g[i]) + 0.1)
    robot.advance([beyond])
    assert f"{panda().dof_names[i]} was sent" in robot.reason


@settings(max_examples=60)
@given(
    efforts=st.lists(
        st.one_of(
            st.lists(st.floats(width=64), min_size=7, max_size=7),
            st.lists(st.sampled_from([1e300, -1e308, np.nan, 0.0]), max_size=8),
        ),
        min_size=1,
        max_size=5,
    )
)
def test_no_number_ends_it(efforts: list[list[float]]) -> None:
    robot = watched()
    robot.advance([gravity(start())])
    for effort in efforts:
        robot.advance([np.array(effort)])
        for number in (robot.q, robot.v, robot.tau):
            assert np.isfinite(number).all()
    assert np.abs(robot.tau).max() <= 87.0 * (1.0 + 1e-6)


def test_a_motion_that_cannot_be_computed_ends_under_its_brakes() -> None:
    """Without limits in the URDF a huge effort is accepted, and q overflows."""
    endless = Robot.load("planar3r")
    assert np.isinf(LiveSettings().effort_limits(endless)).all()
    plant = IntegratedPlant(RigidBodyPlant(endless), SemiImplicitEuler(PERIOD))
    robot = SimulatedRobot(plant, endless.home(), np.zeros(3), PERIOD)
    for _ in range(50):
        robot.advance([np.array([1e6, -1e6, 1e6])])
    while not robot.done:
        robot.advance([])
    assert "motion cannot be computed" in robot.reason
    assert np.isfinite(robot.q).all()
    assert np.abs(robot.v).max() < 0.1


# --- the effort in force -------------------------------------------------------------


class Lossy(Rig):
    """A robot that misses some efforts, and its efforts in force.

    Attributes:
        in_force: The effort in force in each period.
    """

    def __init__(self, settings: LiveSettings, reports: bool, every: int) -> None:
        super().__init__(watched(settings))
        self.reports, self.every = reports, every
        self.in_force: list[Array] = []

    def read(self, timeout: float) -> Measurement | None:
        found = super().read(timeout)
        assert found is not None
        if found.applied is not None and not found.halted:
            self.in_force.append(found.applied)
        return found if self.reports else found._replace(applied=None)

    def write(self, effort: Array) -> None:
        if len(self.sent) % self.every < self.every - 5:
            super().write(effort)
        else:  # five consecutive losses
            self.sent.append(np.array(effort))


@pytest.mark.parametrize(
    ("compensates", "reports"), covering([False, True], [True, False])
)
def test_lost_efforts_do_not_add_up_if_the_robot_reports_its_effort(
    reports: bool, compensates: bool
) -> None:
    """An effort that always changes at its rate limit, over a lossy line.

    If the loop knows only the sent efforts, after five losses it sends six steps at
    once.
    """
    settings = LiveSettings(
        effort_rate=RATE, compensates_gravity=compensates, velocity_margin=9.0
    )

    class Sawtooth(CompensatedController):
        def effort(self, t: float, q: Array, v: Array, period: float) -> Array:
            super().effort(t, q, v, period)
            side = 1.0 if int(t / 0.02) % 2 else -1.0
            return gravity(q) + side * np.array([8.0, 8.0, 8.0, 8.0, 0.1, 0.1, 0.1])

    robot = Lossy(settings, reports, every=11)
    report = run_loop(Sawtooth(law()), robot, duration=0.2, settings=settings)
    steps = np.abs(np.diff(robot.in_force, axis=0))
    assert steps.max() <= RATE * PERIOD * (1.0 + 1e-6)  # others are refused
    if reports:
        assert report.ended == "completed", report.reason
        assert steps.max() == pytest.approx(RATE * PERIOD)
        assert robot.robot.reason == "the loop has ended"
    else:
        assert report.ended == "fault"
        assert "in a period; 0.5 are allowed, a rate of 500" in robot.robot.reason


@pytest.mark.slow
@settings(max_examples=40 if THOROUGH else 4)
@given(seed=st.integers(0, 2**32 - 1), loss=st.sampled_from([0.1, 0.3]))
def test_a_robot_never_rejects_an_effort_over_a_bad_line(
    seed: int, loss: float
) -> None:
    """States and efforts are lost at random, during the run and the stop."""
    rng = np.random.default_rng(seed)
    chosen = LiveSettings(effort_rate=100.0, velocity_margin=9.0)

    class Bad(Lossy):
        lost = 0  # consecutive states

        def read(self, timeout: float) -> Measurement | None:
            found = super().read(timeout)
            lost = self.reads > 2 and self.lost < 5 and rng.random() < loss
            self.lost = self.lost + 1 if lost else 0
            return None if lost else found

        def write(self, effort: Array) -> None:
            if rng.random() < loss:
                self.sent.append(np.array(effort))
            else:
                Rig.write(self, effort)

    robot = Bad(chosen, reports=True, every=1)
    quick = law(gains=Gains(natural_frequency=10.0))
    report = run_loop(quick, robot, duration=0.1, settings=chosen)
    assert report.ended == "completed", report.reason
    assert robot.robot.reason == "the loop has ended"
    assert np.abs(np.diff(robot.in_force, axis=0)).max() <= 0.1 * (1.0 + 1e-6)


@given(seed=st.integers(0, 2**32 - 1), compensates=st.booleans())
def test_the_limiter_keeps_the_rate_from_both(seed: int, compensates: bool) -> None:
    rng = np.random.default_rng(seed)
    most, step = 40.0, RATE * PERIOD
    chosen = LiveSettings(
        effort_rate=RATE, effort=most, compensates_gravity=compensates
    )
    limiter = EffortLimiter(panda(), chosen, PERIOD)
    limiter.reset(start())
    borne = gravity(start()) if compensates else np.zeros(7)
    for _ in range(20):
        before = limiter.sent.copy()
        known = before + rng.choice([0.0, 0.7, 1.5, 30.0, 1e300]) * rng.choice(
            [-step, step], 7
        )
        changed = limiter.robot_has(known)
        assert changed is (not np.array_equal(known, before))
        assert limiter.apply(100.0 * rng.standard_normal(7), start())
        np.testing.assert_allclose(limiter.applied, limiter.sent + borne, atol=1e-12)
        assert (np.abs(limiter.sent + borne) <= most + 1e-9).all()
        true = np.clip(known, -most - borne, most - borne)
        assert (np.abs(limiter.sent - true) <= step + 1e-9).all()
        near = np.abs(true - before) <= 2.0 * step
        assert (np.abs(limiter.sent - before)[near] <= step + 1e-9).all()
    before = limiter.sent.copy()
    assert not limiter.apply(np.full(7, np.nan), start())
    np.testing.assert_array_equal(limiter.sent, before)


def test_nothing_presses_while_brakes_hold_a_robot(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    robot, pressed = watched(), np.arange(6.0)
    felt = {"panda_hand": pressed}
    monkeypatch.setattr(robot.plant, "contact_wrenches", lambda *_: felt)
    np.testing.assert_array_equal(robot.measured().wrenches["panda_hand"], np.zeros(6))
    robot.advance([robot.tau])
    assert robot.measured().wrenches["panda_hand"] is pressed


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_stop_keeps_the_limits_of_motors_that_bear_gravity_themselves(
    sign: float,
) -> None:
    """The sent effort is tau - g: the limits apply to tau."""
    q, limit = start(), 40.0
    chosen = LiveSettings(effort_rate=4e4, effort=limit, compensates_gravity=True)
    limiter = EffortLimiter(panda(), chosen, PERIOD)
    limiter.reset(q)
    inertia = panda().state(0.0, q, np.zeros(7)).mass_matrix
    assert np.abs(limiter.gravity).max() > 20.0
    for _ in range(5):  # rate limits are active in some joints, effort limits in others
        assert limiter.apply(np.full(7, sign * 1e3), q, inertia)
        assert (np.abs(limiter.applied) <= limit + 1e-9).all()
    np.testing.assert_allclose(limiter.applied, sign * limit, atol=1e-6)


def test_a_lost_effort_corrects_the_momentum_observer() -> None:
    """Compensation is computed from the applied effort, not from the sent one."""
    observer = Compensation(momentum_observer=MomentumObserver(200.0, cancel=False))

    class Watching(CompensatedController):
        largest = 0.0

        def effort(self, t: float, q: Array, v: Array, period: float) -> Array:
            tau = super().effort(t, q, v, period)
            reported = self.log_channels()["observer.disturbance"].value
            estimated = float(np.abs(reported).max())
            self.largest = max(self.largest, estimated if t > 0.02 else 0.0)
            tau[:4] += 6.0 if int(t / 0.02) % 2 else -6.0
            return tau

    known, unknown = Watching(law(), observer), Watching(law(), observer)
    for command, reports in ((known, True), (unknown, False)):
        run_loop(command, Lossy(LiveSettings(), reports, every=11), duration=0.1)
    # The plant is the model: sampling is the only disturbance.
    assert known.largest < 0.1 * unknown.largest
