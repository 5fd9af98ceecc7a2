"""The checks of one joint's sensors on given states: their thresholds."""

import numpy as np
import pytest
from live_rigs import PERIOD, gravity, start
from loaded_robots import panda

from hsp_control import Robot
from hsp_control.common.arrays import Array, Flags
from hsp_control.live import LiveSettings, Measurement
from hsp_control.live.expected_motion import ExpectedMotion
from hsp_control.live.reaction_check import ReactionCheck
from hsp_control.live.still_sensors import StillSensors
from hsp_control.live.trusted_motion import TrustedMotion
from hsp_control.live.velocity_check import VelocityCheck

SETTINGS = LiveSettings()


def stopped(joints: list[int], speed: float) -> Flags:
    """Return the sensors that are reported dead after joints stop in one period."""
    check = VelocityCheck(panda(), SETTINGS, PERIOD)
    v = np.zeros(7)
    v[joints] = speed
    for k in range(150):
        now = v if k < 50 else np.zeros(7)
        check.update(now * PERIOD, now, PERIOD)
    return check.dead


def test_friction_stops_one_slow_joint_in_a_period_and_not_several() -> None:
    """At 50 rad/s² in two periods: 0.1 rad/s; less if several joints stop."""
    assert not stopped([0], 0.06).any()
    assert not stopped([0, 1], 0.04).any()
    assert stopped([0, 1], 0.06).tolist() == [True, True] + 5 * [False]
    assert stopped([0], 0.11).tolist() == [True] + 6 * [False]


@pytest.mark.parametrize(("missing", "doubtful"), [(2, True), (4, False)])
def test_a_slope_across_a_gap_is_not_compared_with_the_velocity_after_it(
    missing: int, doubtful: bool
) -> None:
    """The joint accelerated meanwhile: its slope is half of its velocity."""
    check, found = VelocityCheck(panda(), SETTINGS, PERIOD), False
    v = np.ones(7)
    for k in range(300):
        passed = (missing if k == 100 else 1) * PERIOD
        speed, slope = (0.0, 0.0) if k < 100 else (1.0, 0.5 if k == 100 else 1.0)
        check.update(slope * v * passed, speed * v, passed)
        found |= bool(check.doubtful.any())
        assert not check.contradicted.any(), k
    assert found == doubtful


def felt(share: float) -> bool:
    """Return whether another joint's motion shows that a frozen one moves."""
    inertia = np.array([[1.0, 0.5], [0.5, 1.0]])
    free: Array = np.linalg.solve(inertia, [1.0, 0.0])  # an effort at the first joint
    check = ReactionCheck(SETTINGS.velocity_error)
    for k in range(300):
        check.expect(np.array([True, False]), inertia, free)
        check.update(share * k * PERIOD * free, PERIOD)
    return check.felt


def test_motion_beyond_the_reaction_has_another_cause() -> None:
    assert [felt(share) for share in (0.3, 1.0, 2.0)] == [False, True, False]


@pytest.mark.parametrize("period", [0.001, 0.002, 0.01])
def test_a_joint_that_accelerates_within_a_period_is_no_contradiction(
    period: float,
) -> None:
    """Up to 100 rad/s²: its slope in 10 ms is 0.5 rad/s behind the velocity."""
    check, w = VelocityCheck(panda(), SETTINGS, period), 50.0
    t = period * np.arange(round(0.5 / period))
    way, v = 2.0 / w * np.diff(1.0 - np.cos(w * t)), 2.0 * np.sin(w * t)
    for k in range(1, len(t)):
        a = 2.0 * w * np.cos(w * (t[k] - 0.5 * period))
        check.update(np.full(7, way[k - 1]), np.full(7, v[k]), period, np.full(7, a))
        assert not (check.doubtful | check.contradicted).any(), k
    for _ in range(3):  # still a fault
        check.update(np.zeros(7), np.full(7, 2.8), period, np.full(7, 100.0))
    assert check.contradicted.all()


class Motion:
    """Trusted signals of a Panda at rest whose joints report a motion."""

    def __init__(self, period: float) -> None:
        self.trusted = TrustedMotion(panda(), SETTINGS, period)
        self.period, self.count, self.q = period, 0, start()

    def update(
        self, moves: float, says: float, *, first: float = 0.0, effort: float = 0.0
    ) -> str | None:
        """Return the fault after a period.

        Args:
            moves: Slope of the last joint's positions [rad/s].
            says: Its velocity [rad/s].
            first: Velocity of the first joint, whose positions are constant [rad/s].
            effort: Of the last joint from now on, besides gravity [N·m].
        """
        self.count += 1
        self.q, v = self.q.copy(), np.zeros(7)
        self.q[6] += moves * self.period
        v[[0, 6]] = first, says
        passed = self.period if self.count > 1 else 0.0
        reported = Measurement(self.count, self.count * self.period, self.q, v)
        self.trusted.update(reported, passed, np.zeros(7, dtype=bool))
        tau = gravity(self.q)
        tau[6] += effort
        self.trusted.applied(self.q, np.zeros(7), tau, load=np.zeros(7))
        return self.trusted.fault


def test_a_source_that_is_trusted_again_is_expected_where_it_is() -> None:
    """Meanwhile the model expected the joint elsewhere, as its load is not known."""
    motion = Motion(PERIOD)
    for _ in range(100):
        motion.update(0.0, 0.0)
    for _ in range(60):  # both sources leave the expectation, by as much
        motion.update(1.0, -1.0, effort=-0.1)
    trusted = motion.trusted
    assert not trusted.trusted_positions[6]
    assert trusted._expected.v[2, 6] < -0.5  # the effort acts in the model alone
    for _ in range(30):  # a clear case: velocities are wrong
        motion.update(1.0, -1.0, first=3.0)
    assert trusted.trusted_positions.all()


def test_a_joint_is_expected_by_the_source_that_is_still_trusted() -> None:
    """As before the last step, which the wrong source may have made; or as neither."""
    expected = ExpectedMotion(panda(), 0.3, PERIOD, panda().dynamics())
    expected.begin(np.zeros(7))
    trusted = np.ones((2, 7), dtype=bool)
    for _ in range(2):  # measured velocities and slopes differ
        expected.follow(
            np.stack([np.full(7, 0.2), np.full(7, -0.2)]), trusted, PERIOD, braked=False
        )
    by_v, by_q, mean = expected.before.copy()
    assert (by_v > 0.0).all()
    assert (by_q < 0.0).all()
    kept = expected.v[2, 3:].copy()
    trusted[:, :3] = [[True, False, False], [False, True, False]]
    expected.leave(~trusted.all(axis=0), trusted)
    np.testing.assert_array_equal(expected.v[2, :3], [by_v[0], by_q[1], mean[2]])
    np.testing.assert_array_equal(expected.v[2, 3:], kept)


@pytest.mark.parametrize("period", [0.001, 0.005, 0.01])
def test_noise_of_a_velocity_is_no_motion(period: float) -> None:
    motion, rng = Motion(period), np.random.default_rng(0)
    for noise in rng.normal(0.0, 0.05, 100).tolist():
        assert motion.update(0.0, noise) is None
        if motion.count > 1:
            assert motion.trusted.mean_velocity is not None
            np.testing.assert_array_equal(motion.trusted.mean_velocity, 0.0)
    for _ in range(20):
        motion.update(0.2, 0.2)
    assert motion.trusted.mean_velocity is not None
    np.testing.assert_allclose(motion.trusted.mean_velocity, 0.2 * np.eye(7)[6])


@pytest.mark.parametrize("stops", [False, True])
def test_in_a_stop_a_known_load_may_hold_a_joint(stops: bool) -> None:
    """Before, it may be a dead sensor: the joint should move, but stays to the bit."""
    trusted, q, rest = TrustedMotion(panda(), SETTINGS, PERIOD), start(), np.zeros(7)
    load = np.array([0.0, 25.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    if stops:
        trusted.stop()
    faults = []
    for k in range(1, 200):
        passed = PERIOD if k > 1 else 0.0
        trusted.update(Measurement(k, k * PERIOD, q, rest), passed, rest > 0.0)
        trusted.applied(q, rest, gravity(q) - load, load)
        faults.append(trusted.fault)
    found = [each for each in faults if each is not None]
    assert bool(found) != stops, found
    assert all("panda_joint2 stays the same to the last bit" in each for each in found)


def test_one_noisy_velocity_of_a_braked_joint_is_no_acceleration() -> None:
    motion = Motion(0.002)
    for _ in range(50):
        assert motion.update(0.2, 0.2) is None
    motion.trusted.stop()
    assert motion.update(0.2, 0.7) is None  # beyond the residual of braking, once
    faults = [motion.update(0.6, 0.6) for _ in range(10)]  # the others are at rest
    (found,) = filter(None, faults)
    assert "panda_joint7 is braked, and moves at 0.6 rad/s" in found


def test_after_a_restart_a_quiet_sensor_is_not_one_whose_noise_has_vanished() -> None:
    robot, rng = Robot.load("panda"), np.random.default_rng(1)
    q, rest = robot.home(), np.zeros(7)
    tau = robot.inverse_dynamics(q, rest, rest)
    sensors = StillSensors(robot, LiveSettings(), np.full(7, 87.0), 0.001)
    for restarted in (False, True):
        for k in range(1000):
            noise = 1e-5 * (-1.0) ** k * rng.uniform(0.5, 1.5, 7)
            sensors.update(noise, noise, rest, 0.001)
        if restarted:
            sensors.restart()
        for _ in range(100):
            sensors.update(rest, rest, rest, 0.001)
        sensors.judge(q, rest, tau)
        assert sensors.dead.all() == (not restarted)
        assert sensors.dead.any() == (not restarted)


def test_before_a_restart_no_joint_has_moved() -> None:
    check, v = VelocityCheck(panda(), SETTINGS, PERIOD), np.ones(7)
    for restarted in (False, True):
        for _ in range(100):
            check.update(PERIOD * v, v, PERIOD)
        if restarted:
            check.restart()
        check.update(np.zeros(7), v, PERIOD)  # as if it braked in this period
        assert check.doubtful.all() == restarted
        assert check.doubtful.any() == restarted


def test_a_new_beginning_lacks_no_acceleration() -> None:
    expected = ExpectedMotion(panda(), 0.3, PERIOD, panda().dynamics())
    both, v = np.ones((2, 7), dtype=bool), np.ones(7)
    for braked in (False, True):
        expected.follow(np.stack([v, v]), both, PERIOD, braked=braked)
    expected.begin(v)
    expected.advance(PERIOD)
    np.testing.assert_array_equal(expected.v, np.ones((3, 7)))
