"""With any fault of a robot's driver the loop stops safely, reports, and does not
raise."""

import itertools
import os
import signal
from asyncio import CancelledError
from collections import namedtuple
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst
from live_rigs import (
    PERIOD,
    Array,
    Rig,
    Trick,
    always,
    law,
    missing,
    nan_velocity,
    start,
    watched,
)
from loaded_robots import panda
from odd_errors import OddError
from places import THOROUGH, covering, further

import hsp_control as hsp
from hsp_control import Rollout
from hsp_control.common.errors import HardwareError, HspControlError
from hsp_control.constraints.limits import own_limits
from hsp_control.control.compensation import CompensatedController
from hsp_control.live import (
    LiveSettings,
    LoopReport,
    Measurement,
    OperatorRequests,
    Phase,
    StopSettings,
    run_loop,
)
from hsp_control.live.frozen_state import FrozenState
from hsp_control.live.loop import LiveRun
from hsp_control.live.measurement_monitor import MeasurementMonitor
from hsp_control.robot import RobotState
from hsp_control.trajectories.trajectory import TrajectorySample

RATE, EFFORT = 1000.0, 80.0
QUICK = StopSettings(hold=0.02)
SETTINGS = LiveSettings(effort_rate=RATE, effort=EFFORT, stop=QUICK)
BEGIN = 60
"""The read at which the fault occurs, while the arm moves."""


def rig(tricks: dict[int, Trick] | None = None, **settings: Any) -> Rig:
    return Rig(watched(SETTINGS.with_(**settings) if settings else SETTINGS), tricks)


def run(robot: Rig, **options: Any) -> LoopReport:
    return run_loop(law(), robot, **{"duration": 0.15, "settings": SETTINGS} | options)


def assert_safe(robot: Rig, report: LoopReport) -> None:
    """The sent efforts were within limits, and the robot is at rest."""
    sent = np.array(robot.sent)
    assert np.isfinite(sent).all()
    assert np.abs(sent).max() <= EFFORT + 1e-9
    held = panda().inverse_dynamics(start(), np.zeros(7), np.zeros(7))
    steps = np.abs(np.diff(np.vstack([held, sent]), axis=0))
    assert steps.max() <= RATE * PERIOD + 1e-9
    assert report.reason
    assert robot.closed
    assert robot.robot.phase is Phase.HOLDING
    assert np.abs(robot.robot.v).max() < 0.02
    if report.ended != "fault":
        assert report.at_rest
        assert robot.robot.reason == "the loop has ended"


# --- return values of `read` ---------------------------------------------------------


class Hostile:
    """An object whose every use raises."""

    def __array__(self, *_: object, **__: object) -> Array:
        raise RuntimeError("no array")

    def __float__(self) -> float:
        raise RuntimeError("no number")

    def __bool__(self) -> bool:
        raise RuntimeError("no truth")

    def __str__(self) -> str:
        raise RuntimeError("no text")


Other = namedtuple("Other", "sequence t q v")
HUGE = 10**400
ODD_NUMBERS = st.sampled_from(
    [np.nan, np.inf, -np.inf, 1e300, -1e300, 1e18, HUGE, None, "1", 1j, [], Hostile(),
     Decimal(1), np.array([0.1]), np.datetime64("2020-01-01")]
)  # fmt: skip
ODD_ARRAYS = st.one_of(
    st.sampled_from(
        [None, 3.0, "q", [], [[]], [None] * 7, ["a"] * 7, [1j] * 7, [True] * 7,
         Hostile(), [Hostile()] * 7, [HUGE] * 7, [[1.0], [1.0, 2.0]], {"q": 1},
         np.full(7, 1e300), np.full(7, np.nan), np.full(7, np.inf),
         np.full(7, 1e5), np.zeros((7, 1)),
         np.zeros(7, dtype="datetime64[s]"), np.zeros(7, dtype="f4,i4")]
    ),
    npst.arrays(
        st.one_of(npst.floating_dtypes(), npst.complex_number_dtypes(),
                  npst.unicode_string_dtypes()),
        npst.array_shapes(min_dims=0, max_dims=2, max_side=8),
    ),
)  # fmt: skip
ODD_RESULTS = st.one_of(
    st.sampled_from(
        [(), 3, "state", {}, object(), Hostile(), Measurement, np.zeros(14),
         Other(1, 0.0, np.zeros(7), np.zeros(7))]
    ).map(lambda case: lambda m: case),
    st.tuples(st.sampled_from(["q", "v", "applied"]), ODD_ARRAYS).map(
        lambda pair: lambda m: m._replace(**{pair[0]: pair[1]})
    ),
    st.tuples(
        st.sampled_from(["sequence", "t", "age", "halted", "fault"]), ODD_NUMBERS
    ).map(lambda pair: lambda m: m._replace(**{pair[0]: pair[1]})),
)  # fmt: skip


@pytest.mark.slow
@settings(max_examples=100 if THOROUGH else 5)
@given(odd=ODD_RESULTS, count=st.sampled_from([1, 30, 20_000]))
def test_any_result_of_read(odd: Trick, count: int) -> None:
    robot = rig(always(odd, BEGIN, count))
    report = run(robot)
    assert_safe(robot, report)
    # Valid values, such as halted=1.0, are no fault.
    assert report.ended in {"fault", "completed"}
    if count == 20_000 and report.ended == "fault":
        assert report.t < 0.15 + 0.3


def replaced(**values: Any) -> Trick:
    return lambda m: m._replace(**values)


def shifted(**shifts: float) -> Trick:
    return lambda m: m._replace(**{k: getattr(m, k) + s for k, s in shifts.items()})


def far(found: Measurement) -> Measurement:
    q = found.q.copy()
    q[3] = 0.1  # a Panda's fourth joint ends at -0.07
    return found._replace(q=q)


def fast(found: Measurement) -> Measurement:
    v = found.v.copy()
    v[1] = 2.5  # its limit is 2.175
    return found._replace(v=v)


class Frozen:
    """Repeats the first state as if it were new."""

    def __init__(self) -> None:
        self.seen: Measurement | None = None

    def __call__(self, found: Measurement) -> Measurement:
        self.seen = self.seen or found
        return found._replace(q=self.seen.q, v=self.seen.v)


FAULTS: dict[str, tuple[Any, int, str]] = {
    "a speed that is NaN": (nan_velocity, 1, r"not finite: v\[2\] is nan"),
    "an infinite position": (replaced(q=np.full(7, np.inf)), 1, r"q\[0\] is inf"),
    "five joints": (lambda m: m._replace(q=m.q[:5]), 1, r"q has shape \(5,\)"),
    "a time that is NaN": (replaced(t=np.nan), 1, "the state's time is nan"),
    "no state": (missing, 21, "no new state for 21 periods"),
    "always the same state": (replaced(sequence=59), 21, "no new state for 21 periods"),
    "an old state": (replaced(age=0.03), 1, "0.03 s old; 0.02 s are allowed"),
    "a gap": (shifted(sequence=30), 20_000, "30 states in a row were not received"),
    "beyond a joint's limit": (far, 1, "panda_joint4 is at 0.1, outside"),
    "too fast": (fast, 1, "panda_joint2 moves at 2.5, outside"),
    "a robot that stopped": (replaced(halted=True), 1, "has stopped by itself"),
    "an age that is NaN": (replaced(age=np.nan), 1, "age is nan"),
    "an age of the future": (replaced(age=-0.5), 1, "-0.5 s old"),
    "a sequence that is no number": (replaced(sequence=1.5), 1, "sequence is of type"),
    "a time without resolution": (replaced(t=1e15), 1, "too large for periods"),
    "a clock that jumps": (shifted(t=1.0), 20_000, "clock jumps by 1.001 s"),
    "a clock that goes back": (shifted(t=-0.01), 20_000, "clock jumps by -0.009 s"),
    "a clock that stands": (replaced(t=0.058), 20_000, "clock stands still for 21"),
    "a joint that jumps": (shifted(q=0.1), 20_000, "panda_joint1 jumps by 0.1"),
    "a huge position": (replaced(q=np.full(7, 1e300)), 1, r"absurd: q\[0\] is 1e\+300"),
    "a huge speed": (replaced(v=np.full(7, -1e200)), 1, r"absurd: v\[0\] is -1e\+200"),
    "an applied effort": (replaced(applied=np.full(7, np.nan)), 1, "not finite"),
    "fault of the hardware": (replaced(fault="two senders"), 1, "two senders"),
    "a reason that is none": (replaced(fault=None), 1, "fault is of type NoneType"),
    "another type": (lambda m: tuple(m), 1, "type tuple; needs a Measurement"),
    "complex numbers": (replaced(q=np.zeros(7, complex)), 1, "holds complex128"),
    "a frozen state": (Frozen, 20_000, "its sensor is dead"),
}  # fmt: skip


ALIKE = {
    *("an infinite position", "a time that is NaN", "an age that is NaN"),
    *("an age of the future", "a clock that goes back", "a huge speed"),
    *("always the same state", "complex numbers", "a time without resolution"),
}
"""Faults similar to another one, which the same check detects."""


@pytest.mark.parametrize("kind", [k for k in FAULTS if THOROUGH or k not in ALIKE])
def test_each_fault_of_a_measurement_is_named(kind: str, tmp_path: Path) -> None:
    trick, count, reason = FAULTS[kind]
    robot, log = rig(always(trick() if trick is Frozen else trick, BEGIN, count)), None
    log = tmp_path / "run.journal"
    report = run(robot, log=log)
    assert report.ended == "fault"
    with pytest.raises(AssertionError, match=reason):
        raise AssertionError(report.reason)
    assert_safe(robot, report)
    if count < 20_000:  # the loop holds the robot, since states arrive again
        assert (report.phase, report.silent) == (Phase.HOLDING, False)
    logged = Rollout.load(log)
    assert (logged.status, logged.meta["message"]) == ("stopped", report.reason)
    longest = 0.02 if count != 21 else 0.03  # without a state there is no row
    assert (np.diff(logged.t) < longest).all()  # also if the robot's clock jumps


@pytest.mark.parametrize("end", ["lower", "upper"])
def test_positions_may_be_beyond_a_limit_by_their_margin(end: str) -> None:
    monitor = MeasurementMonitor(panda(), None, SETTINGS, PERIOD)
    outwards = -1.0 if end == "lower" else 1.0
    limit, v = getattr(own_limits(panda()), end)[1], np.zeros(7)
    for share, fits in ((-2.0, True), (-0.5, True), (0.9, True), (1.1, False)):
        q = start().copy()
        q[1] = limit + outwards * share * SETTINGS.position_margin
        found = monitor.violation(Measurement(1, 0.0, q, v))
        assert (found is None) == fits, share


def test_speeds_may_be_beyond_a_limit_by_a_tenth_of_it() -> None:
    monitor = MeasurementMonitor(panda(), None, LiveSettings(), PERIOD)
    limit = own_limits(panda()).velocity
    for joint in range(7):
        for factor, fits in ((1.0, True), (1.099, True), (1.101, False)):
            for sign in (1.0, -1.0):
                v = sign * factor * limit * np.eye(7)[joint]
                found = monitor.violation(Measurement(1, 0.0, start(), v))
                assert (found is None) == fits, (joint, factor)


@pytest.mark.parametrize("states", [1, 3])
def test_a_jump_is_farther_than_the_greatest_speed_over_the_gap(states: int) -> None:
    """Also with a stopped clock: the states' sequence numbers decide."""
    monitor = MeasurementMonitor(panda(), None, SETTINGS, PERIOD)
    monitor.last = Measurement(4, 0.5, start(), np.zeros(7))
    speed = own_limits(panda()).velocity[3] * (1.0 + SETTINGS.velocity_margin)
    for factor, fits in ((0.99, True), (1.01, False)):
        way = factor * speed * states * PERIOD + SETTINGS.position_margin
        q = start() + way * np.eye(7)[3]
        judged = np.ones(7, dtype=bool)
        new = Measurement(4 + states, 0.5, q, np.zeros(7))
        found, why = monitor.jumps(new, judged)
        assert found.tolist() == [False] * 3 + [not fits] + [False] * 3, factor
        assert (why is None) == fits


@pytest.mark.parametrize("friction", [1.0, 0.1])
def test_a_robot_that_its_friction_can_hold_is_not_frozen(friction: float) -> None:
    """Identical states with zero velocity: brakes may hold every joint; gear friction
    cannot hold against the law's growing efforts."""
    still = always(replaced(q=start(), v=np.zeros(7)), 1)
    patient = LiveSettings(stop=QUICK, velocity_margin=99.0, friction=friction)
    report = run(Rig(watched(patient), still), duration=0.1, settings=patient)
    if friction == 1.0:
        assert report.ended == "completed", report.reason
    else:
        assert "stays the same to the last bit: its effort is" in report.reason
        assert "its sensor is dead, or it is blocked" in report.reason


def test_a_state_that_stays_is_frozen_where_the_efforts_would_move_it() -> None:
    """Under the efforts that act: holding efforts leave the arm in place."""
    v = np.full(7, 1e-6)  # with 0 in all joints, brakes may hold it
    hold = panda().inverse_dynamics(start(), v, np.zeros(7))
    for effort, frozen in ((hold, False), (hold + 5.0 * np.eye(7)[1], True)):
        state = FrozenState(panda(), PERIOD, 20)
        found = [
            state.fault(Measurement(k, k * PERIOD, start(), v), effort)
            for k in range(60)
        ]
        assert any(found) == frozen
        assert not any(found[:21])


def test_buffers_that_the_driver_reuses_are_copied() -> None:
    """A driver that returns the same arrays every time and overwrites them."""
    buffers = np.zeros(7), np.zeros(7)

    class Reusing(Rig):
        def read(self, timeout: float) -> Measurement | None:
            found = super().read(timeout)
            assert found is not None
            buffers[0][:], buffers[1][:] = found.q, found.v
            return found._replace(q=buffers[0], v=buffers[1])

    plain, reusing = rig(), Reusing(watched(SETTINGS))
    assert run(plain).ended == run(reusing).ended == "completed"
    np.testing.assert_array_equal(plain.sent, reusing.sent)


# --- exceptions ----------------------------------------------------------------------


class Odd(Exception):
    def __str__(self) -> str:
        raise ValueError("not even a message")


NO_EXCEPTIONS: list[BaseException] = [
    CancelledError(), GeneratorExit(), OddError("panicked"), BaseException(),
    BaseExceptionGroup("two", [CancelledError(), GeneratorExit()]),
]  # fmt: skip
ASKED: list[BaseException] = [KeyboardInterrupt(), SystemExit(3)]
ERRORS = st.sampled_from(
    [ValueError("bad"), RuntimeError("reflex"), HardwareError("gone"), OSError(5, "io"),
     KeyError("q"), MemoryError(), RecursionError(), StopIteration(), AssertionError(),
     np.linalg.LinAlgError("singular"), FloatingPointError("overflow"), TimeoutError(),
     UnicodeDecodeError("utf-8", b"", 0, 1, "odd"), HspControlError("odd"), Odd(),
     ExceptionGroup("two", [ValueError(), OSError()]), *NO_EXCEPTIONS]
)  # fmt: skip


@pytest.mark.parametrize("interrupted", ASKED, ids=repr)
def test_a_stop_that_is_cut_short_is_not_completed(interrupted: BaseException) -> None:
    """The duration is over, and Ctrl-C comes while the safe stop brakes."""

    def ask(found: Measurement) -> Measurement:
        raise interrupted

    robot = Rig(watched(SETTINGS), {25: ask})
    report = run_loop(law(), robot, duration=20 * PERIOD, settings=SETTINGS)
    assert report.silent
    assert not report.at_rest
    assert report.ended == "operator"
    assert report.reason.startswith("the duration is over; the safe stop was cut short")


class Failing(Rig):
    """A robot whose methods raise: from their nth call on, some times or always."""

    def __init__(
        self, method: str, error: BaseException, first: int, times: int
    ) -> None:
        super().__init__(watched(SETTINGS))
        self.method, self.error = method, error
        self.calls, self.first, self.times = 0, first, times

    def fail(self, method: str) -> None:
        if method == self.method:
            self.calls += 1
            if 0 <= self.calls - self.first < self.times:
                raise self.error

    def read(self, timeout: float) -> Measurement | None:
        self.fail("read")
        return super().read(timeout)

    def write(self, effort: Array) -> None:
        self.fail("write")
        super().write(effort)

    def close(self) -> None:
        super().close()
        self.fail("close")


@pytest.mark.slow
@settings(max_examples=100 if THOROUGH else 6)
@given(
    method=st.sampled_from(["read", "write", "close", "on_period", "change"]),
    error=ERRORS,
    times=st.sampled_from([1, 3, 20_000]),
)
def test_any_exception(method: str, error: BaseException, times: int) -> None:
    first = 1 if method in {"close", "on_period", "change"} else BEGIN
    robot, requests = Failing(method, error, first, times), OperatorRequests()

    def fail(*_: object) -> None:
        raise error

    if method == "change":
        requests.call(fail)
    on_period = fail if method == "on_period" else None
    report = run(robot, requests=requests, on_period=on_period)
    assert report.ended == "fault"
    assert report.error is error
    assert report.silent is (method == "read")
    assert_safe(robot, report)


@pytest.mark.parametrize(
    "error",
    [NO_EXCEPTIONS[2], *further(*NO_EXCEPTIONS[:2], *NO_EXCEPTIONS[3:])],
    ids=repr,
)
@pytest.mark.parametrize("where", ["read", "write", "close", "on_period", "change"])
def test_a_base_exception_is_a_fault(where: str, error: BaseException) -> None:
    test_any_exception.hypothesis.inner_test(where, error, 1)  # type: ignore[attr-defined]


class Speechless(Exception):
    """Its message raises."""

    def __init__(self, raised: BaseException) -> None:
        self.raised = raised

    def __str__(self) -> str:
        raise self.raised


@pytest.mark.parametrize("raised", [SystemExit(0), KeyboardInterrupt()], ids=repr)
@pytest.mark.parametrize("where", ["read", "write", "close", "on_period"])
def test_an_error_whose_message_raises_is_a_fault(
    where: str, raised: BaseException
) -> None:
    test_a_base_exception_is_a_fault(where, Speechless(raised))


@pytest.mark.parametrize(
    ("error", "once"),
    covering(
        [
            KeyboardInterrupt(),
            NO_EXCEPTIONS[0],
            *further(*NO_EXCEPTIONS[1:], SystemExit(3)),
        ],
        [True, False],
    ),
    ids=repr,
)
def test_an_exception_of_a_field_ends_in_the_safe_stop(
    error: BaseException, once: bool, tmp_path: Path
) -> None:
    """The files are closed: the next run in this process writes the same log."""
    armed, count = False, 0

    def swing(state: RobotState) -> Array:
        nonlocal count
        count += armed
        if armed and count >= 30 and (count == 30 or not once):
            raise error
        return start() - state.q

    field = hsp.fields.FunctionField(swing, rate_function=lambda state: -state.v)
    log = tmp_path / "run.journal"

    def arm(_t: float) -> None:
        nonlocal armed
        armed = True

    robot = rig()
    report = run_loop(
        law(field), robot, duration=0.3, settings=SETTINGS, log=log, on_period=arm
    )
    assert_safe(robot, report)
    interrupted = isinstance(error, KeyboardInterrupt | SystemExit)
    assert report.ended == ("operator" if interrupted else "fault")
    assert not report.silent
    assert Rollout.load(log).meta["message"] == report.reason
    armed = False
    again = run_loop(law(field), rig(), duration=0.1, settings=SETTINGS, log=log)
    assert again.ended == "completed"


@pytest.mark.parametrize(
    ("error", "where"),
    [
        *((KeyboardInterrupt(), "task"), (SystemExit(3), "obstacle")),
        *further(*itertools.product(NO_EXCEPTIONS, ["task", "obstacle"])),
    ],
    ids=repr,
)
def test_an_exception_that_a_part_keeps_raising_ends_in_the_safe_stop(
    error: BaseException, where: str, tmp_path: Path
) -> None:
    """Rows of the log evaluate parts in the stop, too: that is no second Ctrl-C."""

    def height(state: RobotState) -> float:
        if where == "task" and state.t > 0.05:
            raise error
        return float(state.position("panda_tcp")[2])

    class Center(hsp.trajectories.Trajectory):
        dimension = 3

        def sample(
            self, t: float, out: TrajectorySample | None = None
        ) -> TrajectorySample:
            if where == "obstacle" and t > 0.05:
                raise error
            return hsp.Hold([0.6, 0.5, 0.5]).sample(t, out)

    log, robot = tmp_path / "run.journal", rig()
    ball = hsp.Obstacle("ball", hsp.shapes.Sphere(0.05), Center())
    field = hsp.JointCentering() + hsp.ObstacleClearance(["ball"])
    task = hsp.FunctionTask(height)
    made = hsp.Controller(panda(), [task], field, scene=[ball])
    report = run_loop(made, robot, duration=0.3, settings=SETTINGS, log=log)
    assert_safe(robot, report)
    assert not report.silent
    assert Rollout.load(log).meta["message"] == report.reason


@pytest.mark.parametrize(
    "error",
    [
        OddError("panicked"),
        KeyboardInterrupt(),
        *further(*NO_EXCEPTIONS, OSError(5, "io")),
    ],
)
def test_a_run_that_cannot_begin_leaves_the_log_free(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log, robot = tmp_path / "run.journal", rig()

    def fail(*_: object, **__: object) -> None:
        raise error

    with monkeypatch.context() as patch:
        patch.setattr("hsp_control.live.loop.LoopLog.begin", fail)
        with pytest.raises(type(error)) as raised:
            run(robot, log=log)
    assert raised.value is error  # its traceback keeps all local variables alive
    assert robot.closed
    assert run(rig(), log=log).ended == "completed"


ODD_EFFORTS = [np.zeros(3), np.full(7, np.nan), "tau"]


@pytest.mark.parametrize(
    ("case", "given_"),
    [
        *itertools.product(
            ["applied", "effort", "log_channels"], [RuntimeError("mine"), None]
        ),
        *itertools.product(["effort"], ODD_EFFORTS),
        *further(*itertools.product(["applied", "log_channels"], ODD_EFFORTS)),
    ],
)
def test_any_fault_of_an_effort_source(case: str, given_: Any, tmp_path: Path) -> None:
    class Mine(CompensatedController):
        calls = 0

        def _odd(self, usual: Callable[[], Any]) -> Any:
            self.calls += 1
            if self.calls < 40:
                return usual()
            if isinstance(given_, Exception):
                raise given_
            return given_

        def effort(self, *args: Any) -> Any:
            usual = super().effort
            return self._odd(lambda: usual(*args)) if case == "effort" else usual(*args)

        def applied(self, tau: Array, period: float) -> None:
            super().applied(tau, period)
            if case == "applied":
                self._odd(lambda: None)

        def log_channels(self) -> Any:
            usual = super().log_channels
            return self._odd(usual) if case == "log_channels" else usual()

    robot = rig()
    report = run_loop(
        Mine(law()), robot, duration=0.1, settings=SETTINGS, log=tmp_path / "a.journal",
        log_period=PERIOD,
    )  # fmt: skip
    raised = isinstance(given_, Exception)
    assert report.ended == (
        "completed" if case == "applied" and not raised else "fault"
    )
    assert_safe(robot, report)
    logged = Rollout.load(tmp_path / "a.journal")
    assert logged.meta["message"] == report.reason  # also after a failed row


# --- the operator --------------------------------------------------------------------


@pytest.mark.parametrize(
    "kind", [signal.SIGTERM, *further(signal.SIGINT, signal.SIGHUP)]
)
def test_a_signal_is_the_operator_s_stop(kind: signal.Signals) -> None:
    before, robot = signal.getsignal(kind), rig()

    def send(t: float) -> None:
        if t > 0.05 and not sent:
            sent.append(t)
            os.kill(os.getpid(), kind)

    sent: list[float] = []
    report = run(robot, duration=None, on_period=send)
    assert report.ended == "operator"
    assert report.reason == f"stopped by the operator ({kind.name})"
    assert_safe(robot, report)
    assert signal.getsignal(kind) is before


def test_a_second_signal_leaves_it_to_the_robot() -> None:
    robot = rig()

    class Impatient(CompensatedController):
        def applied(self, tau: Array, period: float) -> None:
            if self.state.t > 0.05:
                os.kill(os.getpid(), signal.SIGTERM)
            super().applied(tau, period)

    report = run_loop(Impatient(law()), robot, settings=SETTINGS)
    assert report.ended == "operator"
    assert report.silent
    assert robot.robot.phase is Phase.HOLDING


class OutOfTime(BaseException):
    """What a signal's handler may raise, at any place in a period."""


@pytest.mark.parametrize("times", [1, 2])
def test_what_a_handler_raises_in_the_middle_of_a_period_ends_in_the_safe_stop(
    times: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A second one, in the stop, leaves it to the robot."""
    robot, raised, period = rig(), list[float](), LiveRun.check_applied_effort

    def raising(run: LiveRun) -> None:
        period(run)
        if run.reader.state.t > 0.05 and len(raised) < times:
            raised.append(run.reader.state.t)
            raise OutOfTime("time limit")

    monkeypatch.setattr(LiveRun, "check_applied_effort", raising)
    report = run_loop(law(), robot, settings=SETTINGS)
    assert (report.ended, report.reason) == ("fault", "OutOfTime: time limit")
    assert isinstance(report.error, OutOfTime)
    assert report.silent is (times == 2)
    if times == 1:
        assert_safe(robot, report)


# --- the report ----------------------------------------------------------------------


@pytest.mark.parametrize("standstill", [0.1, 2.0])
def test_completed_means_at_rest(standstill: float) -> None:
    """The safe stop ends after its longest damping time, at rest or not."""
    weak = {"damping": 0.1, "natural_frequency": 0.1}
    stop = StopSettings(
        longest_damping=0.005, hold=0.001, standstill=standstill, **weak
    )
    chosen = LiveSettings(stop=stop)
    speeds: list[float] = []

    def seen(found: Measurement) -> Measurement:
        speeds.append(float(np.abs(found.v).max()))
        return found

    robot = Rig(watched(chosen), always(seen, 1))
    report = run_loop(law(), robot, duration=0.15, settings=chosen)
    assert report.phase is Phase.HOLDING
    assert 0.15 < report.speed < 1.5
    assert report.speed == pytest.approx(speeds[-1], rel=0.02)
    assert report.at_rest is (standstill > 1.5)
    reported = (report.ended, report.reason)
    if report.at_rest:
        assert reported == ("completed", "the duration is over")
    else:
        moved = f"then the robot still moved at {report.speed:.3g}"
        assert reported == ("fault", f"the duration is over; {moved}")
