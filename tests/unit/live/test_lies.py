"""With any sensor fault, the loop and its safe stop accelerate no joint."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from zlib import crc32

import numpy as np
import pinocchio as pin
import pytest
from lies import LIES, THE_SIGN, Lie, Sensors, begun, is_seen_at_rest
from live_rigs import PERIOD, Rig, start, watched
from loaded_robots import load, panda
from places import THOROUGH, covering, further

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.live import (
    InProcessRobot,
    LiveSettings,
    LoopReport,
    Measurement,
    SimulatedRobot,
    StopSettings,
    run_loop,
)
from hsp_control.live.reaction_check import ReactionCheck
from hsp_control.live.response_check import ResponseCheck
from hsp_control.live.robot_clock import RobotClock
from hsp_control.live.still_sensors import StillSensors
from hsp_control.live.trusted_motion import TrustedMotion
from hsp_control.live.velocity_check import VelocityCheck
from hsp_control.robot.integrators import SemiImplicitEuler
from hsp_control.simulation.plants import IntegratedPlant, RigidBodyPlant

STOP = StopSettings(hold=0.02, longest_damping=0.3)
SETTINGS = LiveSettings(effort_rate=1000.0, stop=STOP)
# The robot's own stop is late: the loop's stop must suffice.
PATIENT = replace(SETTINGS, velocity_margin=99.0)
AT_REST, IN_MOTION, WATCHED = 30, 150, 150
"""The reads at which a fault begins, and the number of periods checked after it."""
ALL = list(range(7))
NONE = np.zeros(7, dtype=bool)
FASTER = 1.5
"""Tolerated factor on the speed at the fault: earlier efforts still act."""


class Liar(Rig):
    """A robot with false readings of some joints, and its true speeds."""

    def __init__(
        self,
        lie: Lie | None,
        joints: list[int],
        begin: int,
        period: float = PERIOD,
        arm: str = "panda",
    ) -> None:
        super().__init__(watched(PATIENT, period, load(arm)))
        about = np.zeros(load(arm).nv, dtype=bool)
        about[joints] = True
        self.lie = lie
        self.sensors = Sensors(about, begin, np.random.default_rng(0), period)
        self.speeds: list[Array] = []
        self.stopped = 0  # the number of the last read before the safe stop

    def running(self) -> None:
        self.stopped = self.reads

    def read(self, timeout: float) -> Measurement | None:
        found = super().read(timeout)
        assert found is not None
        self.speeds.append(np.abs(found.v))
        return found if self.lie is None else self.sensors(found, self.lie)


def moving(arm: str = "panda") -> hsp.Controller:
    """One circle per second, 12 cm wide, with a swinging elbow: up to 0.9 rad/s.

    Other arms have a shorter reach: 10 cm wide, and an xArm7 moves at 2 rad/s.
    """
    robot, radius = load(arm), 0.12 if arm == "panda" else 0.10
    hand, q = robot.hand.frame, robot.home().copy()
    tip = robot.state(0.0, q, np.zeros(robot.nv)).position(hand)
    center = tip + np.array([0.0, 0.0, radius])
    path = hsp.Circle(radius, 1.0, center, normal=[1.0, 0.0, 0.0])
    task = hsp.FramePosition(hand, path, gains=hsp.Gains(natural_frequency=10.0))
    q[0] += 0.5
    return hsp.Controller(robot, [task], hsp.TargetPosture(q), null_space_gain=10.0)


def resting(arm: str = "panda") -> hsp.Controller:
    robot = load(arm)
    hand, q = robot.hand.frame, robot.home()
    tip = robot.state(0.0, q, np.zeros(robot.nv)).position(hand)
    task = hsp.FramePosition(hand, tip, gains=hsp.Gains(natural_frequency=10.0))
    return hsp.Controller(robot, [task], hsp.TargetPosture(q), null_space_gain=10.0)


def run(
    begin: int,
    lie: Lie | None,
    joints: list[int],
    period: float = PERIOD,
    arm: str = "panda",
) -> tuple[Liar, LoopReport]:
    robot = Liar(lie, joints, begin, period, arm)
    law = resting(arm) if begin == AT_REST else moving(arm)
    return robot, run_loop(
        law,
        robot,
        duration=(begin + WATCHED) * period,
        settings=SETTINGS,
        on_period=lambda t: robot.running(),
    )


def check_braked(robot: Liar, report: LoopReport, *, before: int = 1) -> None:
    """Check that no joint was accelerated after a fault, and that all have stopped.

    ``before``: number of states from that whose speeds count to that of the fault. In
    long periods wrong efforts have acted until the fault is found at all.
    """
    speeds = np.array(robot.speeds)
    at_fault, after = speeds[robot.stopped - before], speeds[robot.stopped :]
    assert (after <= np.maximum(FASTER * at_fault, 0.3)).all(), report.reason
    assert np.abs(robot.robot.v).max() < 0.05  # it has come to rest
    assert robot.robot.phase is robot.robot.phase.HOLDING


@cache
def honest_speeds(begin: int) -> Array:
    robot, report = run(begin, None, [])
    assert report.ended == "completed"
    return np.array(robot.speeds)


ALIKE = {
    *("velocity: -3", "velocity: +2", "velocity: a third more", "velocity: rpm"),
    *("velocity: the next joint's", "velocity: every third", "position: -0.015"),
    *("velocity: turns", "velocity: at its limit", "velocity: delayed by 50 ms"),
    *("velocity: drifting slowly", "position: drifting slowly", "effort: -8"),
    *("position: a tenth more", "effort: at its limit", "time: half as fast"),
}
"""Faults similar to another one in kind and size."""
USUAL = [kind for kind in LIES if THOROUGH or kind not in ALIKE]
SEEN_AT_REST = [kind for kind in USUAL if is_seen_at_rest(LIES[kind])]


@pytest.mark.parametrize(
    ("kind", "begin"),
    [(kind, IN_MOTION) for kind in USUAL[:: 1 if THOROUGH else 2]]
    + [(kind, AT_REST) for kind in SEEN_AT_REST[:: 1 if THOROUGH else 4]],
)
def test_no_lie_accelerates_a_joint(kind: str, begin: int) -> None:
    """Faults of one joint (a different one per kind) and of all joints.

    Unless thorough, every second of the usual kinds, alternately of one and of all
    joints, and every fourth at rest.
    """
    one = crc32(kind.encode()) % 7
    both = [one], ALL
    turn = (USUAL.index(kind) // 2 + (begin == AT_REST)) % 2
    usual = honest_speeds(begin)[begin - 1 : begin + WATCHED].max(axis=0)
    for joints in both if THOROUGH else (both[turn],):
        robot, report = run(begin, LIES[kind], joints)
        speeds = np.array(robot.speeds)
        before = speeds[begin - 1 : robot.stopped]
        assert (before <= np.maximum(1.5 * usual, 0.35)).all(), report.reason
        check_braked(robot, report)


BEYOND = {
    ("iiwa14", 0.01, "both: stands"),
    ("iiwa14", 0.01, "both: mirrored"),
    ("xarm7", 0.002, "both: mirrored"),
    ("xarm7", 0.002, "both: stuck, with +1"),
    ("xarm7", 0.01, "both: contrary"),
    ("ur5", 0.001, "both: contrary"),
}
"""Lies that exceed the bound, about both signals of a joint: see docs/live.md."""


@pytest.mark.parametrize(
    ("arm", "period", "kind", "joints"),
    [
        ("xarm7", 0.001, "velocity: a filter of 1 Hz", ALL),
        ("xarm7", 0.001, "position: stuck", ALL),
        ("xarm7", 0.002, "both: stuck, with +1", [1]),
        ("xarm7", 0.002, "both: mirrored", ALL),
        ("xarm7", 0.005, "both: stuck, with +1", [1]),
        ("xarm7", 0.005, "both: mirrored", ALL),
        ("xarm7", 0.01, "both: other joints'", ALL),
        ("iiwa14", 0.005, "velocity: stuck", ALL),
        ("iiwa14", 0.01, "position: stuck", [1]),
        ("ur5", 0.001, "both: contrary", ALL[:6]),
        ("ur5", 0.01, "velocity: drifting slowly", ALL[:6]),
        *further(
            *(
                (arm, period, kind, joints)
                for arm, joint in (("xarm7", 2), ("ur5", 3), ("iiwa14", 1))
                for period in (0.001, 0.002, 0.005, 0.01)
                for kind in LIES
                for joints in ([joint], ALL[: load(arm).nv])
                if (arm, period, kind) not in BEYOND
            )
        ),
    ],
)
def test_no_lie_accelerates_a_joint_of_another_arm(
    arm: str, period: float, kind: str, joints: list[int]
) -> None:
    """Light joints that move at 2 rad/s, where both sources of one are in doubt."""
    robot, report = run(IN_MOTION, LIES[kind], joints, period, arm)
    check_braked(robot, report, before=0)


def test_a_drift_that_the_loop_follows_is_found_in_the_stop() -> None:
    """The load that a drifting velocity shows must not make it look right."""
    kind = LIES["velocity: drifting slowly"]
    robot, report = run(AT_REST, kind, ALL, 0.001, "xarm7")
    assert "contradicts its positions" in report.reason
    check_braked(robot, report, before=0)


@pytest.mark.parametrize(
    "kind", ["+0.5", "the sign", "degrees", *further("+3", "-2", "stuck at 1")]
)
def test_a_wrong_velocity_is_named_and_braked_with_the_slope(kind: str) -> None:
    """The loop holds the robot to the end, since positions are still right."""
    robot, report = run(IN_MOTION, LIES[f"velocity: {kind}"], [3])
    assert report.ended == "fault"
    assert "panda_joint4" in report.reason
    assert not report.silent
    assert report.at_rest
    assert robot.robot.reason == "the loop has ended"


@pytest.mark.parametrize("kind", ["drifting", "mirrored", *further("stuck")])
def test_a_wrong_position_is_braked_with_the_velocity(kind: str) -> None:
    signal = "both" if kind == "mirrored" else "position"
    _, report = run(IN_MOTION, LIES[f"{signal}: {kind}"], [3])
    assert report.ended == "fault"
    assert "panda_joint4" in report.reason
    assert not report.silent
    assert report.speed < 0.15


def test_a_dead_sensor_leaves_it_to_the_robot() -> None:
    _, report = run(IN_MOTION, LIES["both: stands"], [3])
    assert "panda_joint4 does not move from one state to the next" in report.reason
    assert report.silent


@pytest.mark.parametrize("kind", ["stands", "frozen"])
@pytest.mark.parametrize("joint", [0, 3, *further(2)])
def test_a_sensor_that_is_dead_from_the_start_is_found(kind: str, joint: int) -> None:
    """Friction could hold the joint, but the others' dynamics reveal its motion (12
    rad/s)."""
    robot = Liar(LIES[f"both: {kind}"], [joint], 2)
    report = run_loop(
        moving(),
        robot,
        duration=0.3,
        settings=SETTINGS,
        on_period=lambda t: robot.running(),
    )
    assert report.ended == "fault"
    assert f"panda_joint{joint + 1} stays the same to the last bit" in report.reason
    assert "the other joints show that it moves" in report.reason
    assert report.silent
    assert len(robot.sent) - robot.stopped <= 20  # then the robot's own stop brakes
    assert np.abs(robot.speeds).max() < 2.7


@pytest.mark.parametrize("kind", ["both: stuck, with +1", "both: stands"])
def test_the_replacement_of_a_false_signal_may_fail_too(kind: str) -> None:
    """The arm accelerates; the positions that replace the wrong velocity are frozen."""
    robot = Liar(LIES[kind], [1, 3], 30)
    report = run_loop(
        moving(),
        robot,
        duration=0.2,
        settings=SETTINGS,
        on_period=lambda t: robot.running(),
    )
    assert report.ended == "fault"
    assert report.silent
    # The last effort ramps down at its rate; 0.94 rad/s if positions are trusted.
    assert np.array(robot.speeds)[robot.stopped :].max() < 0.6


def test_a_lie_of_both_from_the_start_is_no_motion() -> None:
    """Velocity and slope disagree from the first state: the robot is at rest."""
    for joints in ([1], ALL):
        robot = Liar(LIES["both: contrary"], joints, 2)
        report = run_loop(moving(), robot, duration=0.3, settings=SETTINGS)
        assert report.ended == "fault"
        assert np.abs(robot.speeds).max() < 0.3


@pytest.mark.parametrize(
    ("joints", "begin"),
    covering([[1], [5], [4, 6], ALL, *further([3], [0, 1, 5])], [2, IN_MOTION]),
)
def test_a_joint_with_the_wrong_sign_is_left_to_the_robot(
    joints: list[int], begin: int
) -> None:
    """Position and velocity agree; feedback and then the stop would drive the joint."""
    robot = Liar(THE_SIGN, joints, begin)
    duration = (begin + 600) * PERIOD
    report = run_loop(
        moving(),
        robot,
        duration=duration,
        settings=SETTINGS,
        on_period=lambda t: robot.running(),
    )
    assert report.ended == "fault"
    assert report.silent
    speeds = np.array(robot.speeds)
    at_fault = speeds[robot.stopped - 1]
    after = speeds[robot.stopped :]
    assert (after <= np.maximum(FASTER * at_fault, 0.3)).all(), report.reason
    assert robot.robot.phase is robot.robot.phase.HOLDING
    assert np.abs(robot.robot.v).max() < 0.5  # 0.3 s of damping may be too short


@pytest.mark.parametrize("begin", [120, *further(60, 180)])
def test_a_fault_while_the_arm_accelerates_does_not_throw_its_wrist(begin: int) -> None:
    """Efforts are rate-limited: heavy joints lag and drag the light ones along."""
    robot, report = run(begin, LIES["effort: none"], [4])
    assert report.ended == "fault"
    speeds = np.array(robot.speeds)
    at_fault, after = speeds[robot.stopped - 1], speeds[robot.stopped :]
    assert (after <= np.maximum(FASTER * at_fault, 0.3)).all()


@pytest.mark.parametrize("kind", ["+60", "the sign", *further("-8", "another joint's")])
def test_no_wrong_effort_makes_the_next_one_jump(kind: str) -> None:
    robot, report = run(IN_MOTION, LIES[f"effort: {kind}"], ALL)
    assert report.ended == "fault"
    assert "the robot reports an effort of" in report.reason
    steps = np.abs(np.diff(robot.sent, axis=0))
    assert steps.max() <= 1000.0 * PERIOD * (1.0 + 1e-9)


# --- no false alarm ------------------------------------------------------------------


class Noisy(Rig):
    """Velocities with noise, delay and a filter; lost states."""

    def __init__(
        self,
        noise: float,
        delay: float,
        frequency: float,
        lost: float,
        encoder: float,
        seed: int,
        period: float = PERIOD,
        arm: hsp.Robot | None = None,
    ) -> None:
        super().__init__(watched(PATIENT, period, arm))
        self.noise, self.lost, self.encoder = noise, lost, encoder
        self.delayed = [0.0 * self.robot.v] * (round(delay / period) + 1)
        self.part = 1.0 - np.exp(-2.0 * np.pi * frequency * period)
        self.filtered = self.delayed[0]
        self.rng = np.random.default_rng(seed)

    def read(self, timeout: float) -> Measurement | None:
        found = super().read(timeout)
        assert found is not None
        v = found.v + self.rng.normal(0.0, self.noise, found.v.size)
        self.filtered = self.filtered + self.part * (v - self.filtered)
        self.delayed = [*self.delayed[1:], self.filtered]
        q = found.q
        if self.encoder:
            q = np.round(q / self.encoder) * self.encoder
        if found.t > 0.0 and self.rng.random() < self.lost:
            return None
        return found._replace(q=q, v=self.delayed[0])


@pytest.mark.parametrize(
    ("noise", "delay", "frequency"),
    [
        (0.05, 0.005, 20.0),
        *further((0.0, 0.0, np.inf), (0.05, 0.0, np.inf), (0.0, 0.005, 20.0)),
    ],
)
@pytest.mark.parametrize("encoder", [1.5e-3, *further(0.0)])
def test_imperfections_of_real_sensors_are_no_fault(
    noise: float, delay: float, frequency: float, encoder: float
) -> None:
    if encoder and not np.isfinite(frequency):
        encoder = 1e-4  # a coarse encoder comes with a filter
    robot = Noisy(noise, delay, frequency, 0.1, encoder, seed=3)
    settings = replace(SETTINGS, velocity_margin=1.0)
    report = run_loop(moving(), robot, duration=0.8, settings=settings)
    assert report.ended == "completed", report.reason


def of_other_masses(arm: str, share: float) -> hsp.Robot:
    """Return an arm with the model's masses times a factor."""
    model = load(arm).model.copy()
    for inertia in list(model.inertias)[1:]:  # not on a slice, which is a copy
        inertia.mass *= share
        inertia.inertia = inertia.inertia * share
    return hsp.Robot.from_pinocchio(model)


@pytest.mark.parametrize(
    ("arm", "period", "share"),
    [
        *(("panda", 0.005, 1.0), ("xarm7", 0.002, 0.8)),
        *further(
            *(
                (arm, period, share)
                for arm in ("panda", "xarm7", "ur5", "iiwa14")
                for period in (0.001, 0.002, 0.005, 0.01)
                for share in (1.0, 0.8, 1.2)
            )
        ),
    ],
)
def test_a_velocity_that_lags_from_the_first_state_on_is_no_lie(
    arm: str, period: float, share: float
) -> None:
    """At first the robot is at rest: a joint reaches 0.5 rad/s before it reports any.

    With a filter of 20 Hz and a delay of 5 ms; with encoder or noise, and wrong masses.
    """
    for noise, encoder in ((0.05, 1.5e-3), (0.0, 0.0)):
        wrong = of_other_masses(arm, share)
        robot = Noisy(noise, 0.005, 20.0, 0.1, encoder, 3, period, wrong)
        settings = replace(SETTINGS, velocity_margin=1.0)
        report = run_loop(moving(arm), robot, duration=0.8, settings=settings)
        # An arm of other masses may still move a little after so short a stop.
        assert report.reason.startswith("the duration is over"), report.reason


@pytest.mark.parametrize(
    ("kind", "joints", "period"),
    [
        *(("position: stuck", [1], 0.01), ("position: stuck", ALL, 0.01)),
        *(("both: frozen", [3], 0.01), ("both: frozen", [3], 0.005)),
        *(("both: mirrored", ALL, 0.01), ("both: stands", ALL, 0.005)),
        *(("both: other joints'", ALL, 0.01), ("both: +1 and +0.1", ALL, 0.01)),
        ("velocity: another joint's", ALL, 0.01),
    ],
)
def test_no_lie_accelerates_a_joint_in_long_periods(
    kind: str, joints: list[int], period: float
) -> None:
    """In a long period an effort acts longer, and a fault is trusted longer."""
    for begin in (IN_MOTION, AT_REST)[: 1 + is_seen_at_rest(LIES[kind])]:
        robot, report = run(begin, LIES[kind], joints, period)
        assert report.ended == "fault"
        check_braked(robot, report)


@pytest.mark.parametrize("period", [0.001, 0.005, 0.01])
@pytest.mark.parametrize(("speed", "wrong"), [(0.06, True), (0.2, True), (0.04, False)])
def test_no_encoder_stands_still_at_a_reported_speed(
    period: float, speed: float, *, wrong: bool
) -> None:
    """It would move 2 mrad, which an encoder resolves; a velocity bias is tolerated."""
    check, v = VelocityCheck(panda(), SETTINGS, period), np.full(7, speed)
    for k in range(round(0.1 / period)):
        way = 1e-4 * (-1) ** k  # steps of the encoder
        check.update(np.full(7, way), np.zeros(7), period)
    lasts = 3 + round(2e-3 / speed / period)
    found = [
        k
        for k in range(2 * lasts)
        if check.update(0.0 * v, v, period) or any(check.contradicted)
    ]
    assert bool(found) == wrong
    assert not wrong or found[0] <= lasts


PERIODS = [0.001, *further(0.002, 0.005, 0.01)]


@pytest.mark.parametrize("period", PERIODS)
def test_noise_of_hours_is_no_lie(period: float) -> None:
    """The check alone, without a robot: two joints of each kind of motion."""
    robot, rng = panda(), np.random.default_rng(1)
    motion = TrustedMotion(robot, LiveSettings(), period)
    q0, none = start(), np.zeros(7, dtype=bool)
    size = np.array([0.0, 0.1, 0.2, 0.2, 0.3, 0.4, 0.5])
    rate = np.array([1.0, 1.0, 5.0, 8.0, 6.0, 4.0, 5.0])
    filtered, last = np.zeros(7), 0.0
    part = 1.0 - np.exp(-2.0 * np.pi * 20.0 * period)
    delay = 0.005
    for k in range(8000 if THOROUGH else 2500):
        t = k * period
        q = q0 + size * np.sin(rate * t) / rate
        v = size * np.cos(rate * max(t - delay, 0.0)) + rng.normal(0.0, 0.05, 7)
        filtered = filtered + part * (v - filtered) if k else v
        shown = v if k % 2 and period > 0.005 else filtered
        if rng.random() < 0.1:
            continue
        held = robot.inverse_dynamics(q, shown, np.zeros(7))
        motion.applied(q, shown, held, np.zeros(7))
        motion.update(Measurement(k, t, q, shown), t - last, none)
        last = t
        assert motion.fault is None
    assert motion.complete


def test_a_clock_that_runs_faster_than_ours_is_named() -> None:
    """Also if the number of states agrees with the velocity; a delay is no fault."""
    rng = np.random.default_rng(0)
    for rate, real_time in ((1.0, True), (1.2, True), (1.2, False)):
        clock = RobotClock(0.0, PERIOD, 20, 1000, real_time=real_time)
        faults = []
        for k in range(6000):
            ours = k * PERIOD / rate + rng.exponential(0.003)
            found = clock.fault(Measurement(k, k * PERIOD, start(), start()), ours)
            faults += [found] if found else []
        if rate > 1.0 and real_time:
            assert "clock runs faster than this computer's" in faults[0]
        else:
            assert not faults


@pytest.mark.parametrize("rate", [0.5, 0.7, 1.5, 2.0])
def test_a_clock_that_does_not_fit_its_states_is_named(rate: float) -> None:
    clock = RobotClock(0.0, PERIOD, 20, 1000)
    found = None
    for k in range(200):
        t = k * PERIOD + (rate - 1.0) * max(k - 50, 0) * PERIOD
        found = found or clock.fault(Measurement(k, t, start(), start()), 0.0)
    assert found is not None
    assert "does not fit the number of its states" in found


def test_lost_states_that_have_no_number_are_no_wrong_clock() -> None:
    clock, rng = RobotClock(0.0, PERIOD, 20, 1000), np.random.default_rng(0)
    states = np.flatnonzero(rng.random(5000) > 0.1)
    for number, k in enumerate(states.tolist()):
        new = Measurement(number, k * PERIOD, start(), start())
        assert clock.fault(new, 0.0) is None


def test_a_collision_is_no_lie() -> None:
    """Positions and velocities agree: the joint has stopped."""
    motion = TrustedMotion(panda(), LiveSettings(), PERIOD)
    q, none = start(), np.zeros(7, dtype=bool)
    speed = np.array([1.0, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0])
    rng = np.random.default_rng(0)
    for k in range(300):
        v = speed * (k < 100) - 0.1 * speed * (100 <= k < 130)
        q = q + PERIOD * v + rng.normal(0.0, 1e-6, 7)
        motion.update(Measurement(k, k * PERIOD, q, v), PERIOD * (k > 0), none)
        assert motion.fault is None, k
    assert motion.complete


def test_friction_that_the_model_misses_is_no_dead_sensor() -> None:
    """A joint reverses and sticks for 50 ms under a growing effort."""
    motion, none = TrustedMotion(panda(), LiveSettings(), PERIOD), np.zeros(7, bool)
    q, at = start(), np.zeros(7)
    at[3] = 1.0
    for k in range(400):
        t = k * PERIOD
        speed = 0.4 * np.cos(10.0 * t)
        sticks = abs(speed) < 0.04
        v = at * (0.0 if sticks else speed)
        q = q + PERIOD * v
        held = panda().inverse_dynamics(q, v, -4.0 * np.sin(10.0 * t) * at)
        pushed = held + 10.0 * np.sign(-np.sin(10.0 * t)) * at
        motion.applied(q, v, pushed, np.zeros(7))
        motion.update(Measurement(k, t, q, v), PERIOD * (k > 0), none)
        assert motion.fault is None, k
    assert motion.complete


def test_a_gap_without_states_contradicts_nothing() -> None:
    """On a busy computer, 90 ms without a state while the joint accelerates."""
    check = VelocityCheck(panda(), SETTINGS, PERIOD)
    one = np.ones(7)
    for _ in range(40):
        check.update(0.1 * PERIOD * one, 0.1 * one, PERIOD)
    gap = 45 * PERIOD
    check.update(0.5 * (0.1 + 1.3) * gap * one, 1.3 * one, gap)
    assert not (check.contradicted | check.doubtful).any()
    for _ in range(40):  # later states are checked again
        check.update(1.3 * PERIOD * one, 1.3 * one, PERIOD)
        assert not check.contradicted.any()
    for _ in range(3):
        check.update(1.3 * PERIOD * one, -1.3 * one, PERIOD)
    assert check.contradicted.all()


def reaction(moves: float, *, beside: float = 0.0) -> bool:
    """Return whether the other joints reveal a frozen elbow that moves or rests.

    Shoulder and forearm are pushed, too, as by unmodelled friction.
    """
    robot, zero = panda(), np.zeros(7)
    check, silent = ReactionCheck(0.3), np.eye(7, dtype=bool)[3]
    rng, v = np.random.default_rng(0), np.zeros(7)
    inertia = robot.state(0.0, start(), zero).mass_matrix
    others, felt = ~silent, False
    for k in range(300):
        push = 6.0 * np.sin(12.0 * k * PERIOD) * np.eye(7)[3]
        force = push + np.eye(7)[1] * 2.0
        free = np.linalg.solve(inertia, force)
        check.expect(silent, inertia, free)
        among = inertia[np.ix_(others, others)]
        true = force[others] + beside * np.array([3.0, -3.0, 2.0, 0.5, 0.3, 0.1])
        at_rest = np.linalg.solve(among, true)
        all_move = at_rest + free[others] - np.linalg.solve(among, force[others])
        v[others] += PERIOD * (at_rest + moves * (all_move - at_rest))
        check.update(v + rng.normal(0.0, 0.005, 7), PERIOD)
        felt |= check.felt
    return felt


def test_the_others_feel_a_joint_that_moves() -> None:
    assert reaction(1.0)
    assert reaction(0.8)  # friction brakes it
    assert not reaction(0.0)
    assert not reaction(0.2)
    assert not reaction(0.0, beside=1.0)  # their own friction is not the cause
    assert not reaction(0.0, beside=-1.0)


def test_a_coarse_encoder_with_a_velocity_between_its_steps_is_not_dead() -> None:
    """A decelerating joint: steps of 1.5 mrad, velocity from the last 20 ms."""
    check, step = VelocityCheck(panda(), SETTINGS, PERIOD), 1.5e-3
    q, seen = 0.0, [0.0]
    for k in range(400):
        q += PERIOD * max(0.15 - 0.5 * k * PERIOD, 0.0)
        seen.append(np.floor(q / step) * step)
        v = (seen[-1] - seen[max(len(seen) - 21, 0)]) / (20 * PERIOD)
        way = (seen[-1] - seen[-2]) * np.ones(7)
        check.update(way, v * np.ones(7), PERIOD)
        assert not check.dead.any(), k


@pytest.mark.parametrize(("joints", "dead"), [(1, False), (2, True), (7, True)])
def test_no_friction_stops_several_joints_in_one_period(
    joints: int, dead: bool
) -> None:
    """At 5 ms and 0.3 rad/s; a single joint may have stopped."""
    check = VelocityCheck(panda(), SETTINGS, 0.005)
    v = 0.3 * (np.arange(7) < joints)
    for k in range(40):
        moving = v * (k < 30)
        noise = 1e-4 * np.sin(1.0 + 7.0 * k) * (np.arange(7) >= joints)
        check.update(0.005 * moving + noise, moving + noise, 0.005)
        if k < 32:
            assert not check.dead.any()
    assert check.dead.sum() == (joints if dead else 0)


def test_motion_that_the_reaction_does_not_explain_is_no_reaction() -> None:
    """Momentum as if the frozen joint moved, and more in another joint."""
    inertia = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]])
    for beside, felt in ((0.0, True), (3.0, False)):
        check, v, found = ReactionCheck(0.3), np.zeros(3), False
        for k in range(300):
            push = 8.0 * np.sin(12.0 * k * PERIOD)
            free = np.linalg.solve(inertia, [push, 0.0, 0.0])
            check.expect(np.array([True, False, False]), inertia, free)
            v[1:] += PERIOD * (free[1:] + beside * np.array([0.0, free[1]]))
            check.update(v, PERIOD)
            found |= check.felt
        assert found == felt


def test_a_velocity_that_is_trusted_alone_may_stand_too() -> None:
    """Positions that are no longer trusted may have any values."""
    check, none, all_ = VelocityCheck(panda(), SETTINGS, PERIOD), NONE, ~NONE
    check.trust(none, all_)
    for k in range(60):
        v = (0.5 + 0.001 * min(k, 30)) * np.ones(7)
        check.update(0.001 * np.sin(3.0 * k) * np.ones(7), v, PERIOD)
        assert not check.dead.any() or k > 30
    assert check.dead.all()


def oscillation(
    check: ResponseCheck, sign: float, *, missed: float = 0.0, seconds: float = 1.0
) -> bool:
    """Return whether a joint that follows its effort with a given sign is reported."""
    rng, found = np.random.default_rng(0), False
    for k in range(round(seconds / PERIOD)):
        t = k * PERIOD
        pushed = 8.0 * np.cos(8.0 * t)
        v = np.array([sign * np.sin(8.0 * t) + missed * t + rng.normal(0.0, 0.02)])
        check.update(np.array([pushed]), v, PERIOD)
        found |= bool(check.contrary.any())
    return found


def test_a_joint_goes_the_other_way_than_it_is_driven() -> None:
    """With a 20 % error; not if the joint follows, or a heavy rotor hardly moves."""
    one = np.ones(1, dtype=bool)
    for sign, contrary in ((-1.0, True), (-0.8, True), (-1.2, True), (1.0, False)):
        assert oscillation(ResponseCheck(0.3, one), sign) == contrary, sign
    for sign in (0.0, 0.05, 0.3, 2.0):
        assert not oscillation(ResponseCheck(0.3, one), sign), sign
    assert not oscillation(ResponseCheck(0.3, ~one), -1.0)


@pytest.mark.parametrize(
    ("frequency", "damping"), covering([3.0, 10.0, 30.0], [0.4, 1.0])
)
def test_a_push_that_the_law_resists_is_no_wrong_sign(
    frequency: float, damping: float
) -> None:
    """The joint yields to the push against its effort, for a while."""
    for push in (3.0, 30.0, -100.0):
        check = ResponseCheck(0.3, np.ones(1, dtype=bool))
        x = v = 0.0
        for k in range(1500):
            effort = -(frequency**2) * x - 2.0 * damping * frequency * v
            for _ in range(4):
                own = -(frequency**2) * x - 2.0 * damping * frequency * v
                v += PERIOD / 4 * (own + push * (k < 700))
                x += PERIOD / 4 * v
            check.update(np.array([effort]), np.array([v]), PERIOD)
            assert not check.contrary.any(), (push, k)


def test_an_arm_that_sinks_against_its_effort_has_no_wrong_sign() -> None:
    """Masses wrong by ±20 %: a wrist sinks at 2 rad/s²."""
    model, rng = panda().model.copy(), np.random.default_rng(500)
    for i in range(1, model.njoints):
        share, own = rng.choice([0.8, 1.2]), model.inertias[i]
        model.inertias[i] = pin.Inertia(
            own.mass * share, own.lever, own.inertia * share
        )
    true = hsp.Robot.from_pinocchio(model, end_effector=panda().end_effector)
    plant = IntegratedPlant(RigidBodyPlant(true), hsp.integrators.Rk4(PERIOD))
    robot = SimulatedRobot(plant, panda().home(), np.zeros(7), PERIOD)
    path = hsp.Circle(0.05, 2.0)
    task = hsp.FramePosition("panda_tcp", path, blend=0.2)
    law = hsp.Controller(panda(), [task], hsp.JointCentering(), null_space_gain=8.0)
    report = run_loop(law, InProcessRobot(robot), duration=0.2, clock=lambda: robot.t)
    assert report.reason.startswith("the duration is over"), report.reason


def still_sensors(
    q: Callable[[int], float], v: Callable[[int], float], states: int
) -> StillSensors:
    """Return the fault reported for the first joint, at rest under gravity."""
    robot, zero = panda(), np.zeros(7)
    limits = SETTINGS.effort_limits(robot)
    sensors = StillSensors(robot, SETTINGS, limits, PERIOD)
    tau = robot.inverse_dynamics(start(), zero, zero)
    one = np.eye(7)[0]
    for k in range(1, states):
        way, speed = (q(k) - q(k - 1)) * one, v(k) * one
        sensors.update(way, speed, 0.1 * speed, PERIOD)
        sensors.judge(start(), speed, tau)
    return sensors


def test_a_sensor_that_loses_its_noise_at_rest_is_dead() -> None:
    rng = np.random.default_rng(0)
    noise = rng.normal(0.0, 1e-5, 2000), rng.normal(0.0, 0.05, 2000)
    q, zeros = (noise[0].tolist(), noise[1].tolist()), 2000 * [0.0]
    alive = still_sensors(lambda k: q[0][k], lambda k: q[1][k], 1900)
    assert not alive.dead.any()
    for positions in (True, False):  # noise in either suffices
        shown = [q[0], zeros] if positions else [zeros, q[1]]
        at, speed = (values[:1500] + 400 * [values[1500]] for values in shown)
        dead = still_sensors(at.__getitem__, speed.__getitem__, 1600)
        assert dead.dead.tolist() == [True] + 6 * [False]
        assert "its sensor's noise has vanished" in dead.why(0)


def test_an_encoder_on_the_edge_of_a_step_is_not_dead_beside_it() -> None:
    """The position toggles between two values until slow creep ends it."""
    rng = np.random.default_rng(0)
    steps = (1e-4 * rng.integers(0, 2, 2000)).tolist()
    found = still_sensors(lambda k: steps[min(k, 1500)], lambda k: 0.0 * k, 1900)
    assert not found.dead.any()


def test_noise_in_motion_is_not_used_at_rest() -> None:
    """A driver with a velocity dead band: the joint has stopped indeed."""
    rng = np.random.default_rng(0)
    v = (1.0 + rng.normal(0.0, 0.05, 2000)).tolist()
    found = still_sensors(
        lambda k: 0.001 * min(k, 1500), lambda k: v[k] if k < 1500 else 0.0, 1600
    )
    assert not found.dead.any()


@pytest.mark.parametrize("share", [1.2, *further(0.8)])
def test_wrong_masses_are_no_lie(share: float) -> None:
    """With noise, delay, filter and lost states."""
    heavy = of_other_masses("panda", share)
    robot = Noisy(0.05, 0.005, 20.0, 0.1, 0.0, seed=3, arm=heavy)
    settings = replace(SETTINGS, velocity_margin=1.0)
    report = run_loop(moving(), robot, duration=1.0, settings=settings)
    # it does not sink during the stop
    assert report.ended == "completed", report.reason
    assert report.at_rest


def test_an_unknown_load_is_no_lie() -> None:
    """An unmodelled kilogram at the hand of a moving arm."""
    model = panda().model.copy()
    hand = model.frames[model.getFrameId("panda_tcp")]
    load = pin.Inertia(1.0, np.zeros(3), 1e-3 * np.eye(3))
    model.appendBodyToJoint(hand.parentJoint, load, hand.placement)
    loaded = hsp.Robot.from_pinocchio(model)
    plant = IntegratedPlant(RigidBodyPlant(loaded), SemiImplicitEuler(PERIOD))
    robot = Rig(SimulatedRobot(plant, start(), np.zeros(7), PERIOD, settings=PATIENT))
    report = run_loop(moving(), robot, duration=1.5, settings=SETTINGS)
    # it does not sink during the stop
    assert report.ended == "completed", report.reason
    assert report.at_rest


AGREEING: dict[str, Lie] = {
    name: lambda s, m, change=change: m._replace(
        **dict(zip("qv", change(s), strict=True))
    )
    for name, change in {
        "-1": lambda s: (s.q[-1] - s.since, s.v[-1] - 1.0),
        "+1": lambda s: (s.q[-1] + s.since, s.v[-1] + 1.0),
        "a tenth": lambda s: (begun(s).q + 0.1 * (s.q[-1] - begun(s).q), 0.1 * s.v[-1]),
        "-0.1 times": lambda s: (
            begun(s).q - 0.1 * (s.q[-1] - begun(s).q),
            -0.1 * s.v[-1],
        ),
    }.items()
}
"""Faults with consistent velocity and position; the heavy joints reveal them."""


@pytest.mark.parametrize(
    ("kind", "joints"),
    [
        *(("-1", [1]), ("+1", [0]), ("a tenth", ALL), ("-0.1 times", [3])),
        *further(("-1", ALL), ("+1", [3]), ("a tenth", [0]), ("-0.1 times", ALL)),
        *further(("-1", [0]), ("-1", [3]), ("+1", [1]), ("+1", ALL)),
        *further(("a tenth", [3]), ("-0.1 times", [0])),
    ],
)
def test_a_momentum_that_nothing_changes_is_measured_wrong(
    kind: str, joints: list[int]
) -> None:
    """Neither efforts nor contacts explain it; before, only the stop found some.

    For wrong factors the shoulder is too slow, 0.25 rad/s.
    """
    usual = honest_speeds(IN_MOTION)[IN_MOTION - 1 : IN_MOTION + WATCHED].max(axis=0)
    robot, report = run(IN_MOTION, AGREEING[kind], joints)
    assert report.ended == "fault"
    assert "it has hit something hard, or its sensors are wrong" in report.reason
    assert report.silent
    speeds = np.array(robot.speeds)
    assert (speeds[IN_MOTION:] <= np.maximum(1.5 * usual, 0.6)).all()
    at_fault, after = speeds[robot.stopped - 1], speeds[robot.stopped :]
    assert (after <= np.maximum(FASTER * at_fault, 0.3)).all()


def test_motion_as_small_as_its_noise_has_no_sign() -> None:
    check = ResponseCheck(0.3, np.ones(1, dtype=bool))
    for k in range(1000):
        t = k * PERIOD
        v = np.array([-0.01 * np.sin(8.0 * t)])
        check.update(np.array([0.08 * np.cos(8.0 * t)]), v, PERIOD)
        assert not check.contrary.any()


@pytest.mark.parametrize(("share", "dead"), [(0.15, False), (0.25, True)])
def test_a_joint_may_be_held_by_friction_where_the_masses_are_wrong(
    share: float, dead: bool
) -> None:
    """Besides friction a fifth of gravity may be a model error."""
    robot, zero = panda(), np.zeros(7)
    limits = SETTINGS.effort_limits(robot)
    sensors = StillSensors(robot, SETTINGS, limits, PERIOD)
    gravity = robot.inverse_dynamics(start(), zero, zero)
    friction = SETTINGS.friction * limits[3]
    pushed = (friction + share * abs(gravity[3])) * np.eye(7)[3]
    for _ in range(60):
        sensors.update(zero, zero, zero, PERIOD)
        sensors.judge(start(), zero, gravity + pushed)
    assert bool(sensors.dead[3]) == dead
    assert sensors.dead.sum() == dead


def test_where_no_effort_limit_is_known_friction_may_hold_anything() -> None:
    sensors = StillSensors(panda(), SETTINGS, np.full(7, np.inf), PERIOD)
    for _ in range(60):
        sensors.update(np.zeros(7), np.zeros(7), np.zeros(7), PERIOD)
        sensors.judge(start(), np.zeros(7), np.full(7, 500.0))
    assert not sensors.dead.any()


def test_a_robot_that_stops_by_itself_does_not_throw_its_wrist() -> None:
    """The shoulder pushes with 40 N·m, which ramp down at the rate limit."""
    robot = watched(SETTINGS)
    at_start = panda().inverse_dynamics(start(), np.zeros(7), np.zeros(7))
    for k in range(40):
        robot.advance([at_start + (k + 1) * np.eye(7)[1]])
    speed = np.abs(robot.v)
    robot.halt("enough")
    fastest = np.zeros(7)
    for _ in range(60):
        robot.advance([])
        fastest = np.maximum(fastest, np.abs(robot.v))
    assert (fastest[4:] <= np.maximum(FASTER * speed[4:], 0.3)).all()


class Runaway(Rig):
    """A robot whose last motor exerts 4 N·m from the safe stop on, whatever is sent."""

    def __init__(self) -> None:
        super().__init__()
        self.stopping = False

    def write(self, effort: Array) -> None:
        super().write(np.append(effort[:6], 4.0) if self.stopping else effort)

    def read(self, timeout: float) -> Measurement | None:
        found = super().read(timeout)
        assert found is not None
        return found._replace(applied=None)


def test_a_motor_that_runs_away_in_the_stop_is_left_to_the_robot() -> None:
    """Both sensors agree; a braked joint that accelerates shows that no effort helps.

    It does so within 0.1 s; the robot's own stop then has all its motors.
    """
    robot, requests = Runaway(), hsp.live.OperatorRequests()

    def stop(t: float) -> None:
        if t > 0.1:
            robot.stopping = True
            requests.stop("enough")

    report = run_loop(resting(), robot, requests=requests, on_period=stop)
    assert report.ended == "fault"
    assert report.reason.startswith("enough; then panda_joint7 is braked, and moves at")
    assert "its motor does not follow the efforts" in report.reason
    assert report.silent
    assert report.t < 0.2
