"""The log of a loop, period by period, compared with robot and loop."""

from pathlib import Path

import numpy as np
import pytest
from live_rigs import PERIOD, Rig, Trick, always, law, missing, watched

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.compensation import CompensatedController
from hsp_control.live import LiveSettings, LoopReport, Measurement, Phase, run_loop
from hsp_control.live.live_log import DueRows

RESPONSE, LATE = 0.0003, 0.0017
"""Duration of sending an effort, and of every tenth one [s]."""
LOST = (40, 41, 42, 70)
"""The reads at which nothing arrives."""
UNSEEN = 80
"""The read before which a state was lost."""


class Told(Rig):
    """A robot that reports the age of its states, and applies efforts late."""

    def __init__(self) -> None:
        super().__init__(watched())
        self.now = 0.0
        self.skipped = 0
        self.told: dict[float, Measurement] = {}
        self.answers: dict[float, tuple[Array, float]] = {}
        self._answered: Measurement | None = None

    def read(self, timeout: float) -> Measurement | None:
        found = super().read(timeout)
        assert found is not None
        self.now += PERIOD
        self._answered = None
        if self.reads in LOST:
            self.skipped += 1
            return None
        number = found.sequence + (self.reads >= UNSEEN)
        found = found._replace(sequence=number, age=1e-5 * (self.reads % 7))
        self.told[found.t] = found
        self._answered = found
        return found

    def write(self, effort: Array) -> None:
        super().write(effort)
        spent = LATE if self.reads % 10 == 0 else RESPONSE
        self.now += spent
        if self._answered is not None:
            self.answers[self._answered.t] = np.array(effort), spent


@pytest.fixture(scope="module")
def logged(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Told, LoopReport, hsp.Rollout]:
    robot = Told()
    report = run_loop(
        law(),
        robot,
        duration=0.1,
        log=tmp_path_factory.mktemp("live") / "run.journal",
        log_period=PERIOD,
        clock=lambda: robot.now,
    )
    assert report.ended == "completed", report.reason
    assert report.log is not None
    return robot, report, hsp.Rollout.load(report.log)


def test_each_row_has_the_received_state_and_the_sent_effort(
    logged: tuple[Told, LoopReport, hsp.Rollout],
) -> None:
    robot, _, run = logged
    rows = 0
    for k in range(1, len(run)):  # in the first the robot's clock had not started
        told = robot.told.get(float(run.t[k]))
        if told is None:
            continue
        sent, spent = robot.answers[told.t]
        assert run["live.measured"][k] == 1.0
        assert run["live.age"][k] == told.age
        assert run["live.response"][k] == pytest.approx(spent)
        assert told.applied is not None
        np.testing.assert_array_equal(run["live.applied"][k], told.applied)
        np.testing.assert_array_equal(run["live.sent"][k], sent)
        np.testing.assert_array_equal(run.q[k], told.q)
        rows += 1
    assert rows > 200
    assert set(run["live.phase"]) == {Phase.RUNNING, Phase.DAMPING, Phase.HOLDING}


def test_its_end_has_the_numbers_of_the_report(
    logged: tuple[Told, LoopReport, hsp.Rollout],
) -> None:
    robot, report, run = logged
    reported = run.meta["live"]
    late = sum(spent == LATE for _, spent in robot.answers.values())
    assert reported["missed"] == report.deadlines.missed == late
    assert reported["silent_periods"] == robot.skipped == len(LOST)
    assert reported["unseen"] == report.deadlines.skipped_states == len(LOST) + 1
    assert reported["periods"] == report.deadlines.periods
    assert reported["response"][-1] == pytest.approx(LATE)


def test_no_time_has_two_rows() -> None:
    """Neither at its end, nor where a phase begins: times of a log increase."""
    due = DueRows(0.01)
    assert due.is_due(0.0, Phase.RUNNING)
    due.written(0.0, Phase.RUNNING)
    assert not due.is_due(0.0, Phase.DAMPING)
    assert not due.is_due(0.0, Phase.RUNNING, last=True)
    assert not due.is_due(0.005, Phase.RUNNING)
    assert due.is_due(0.005, Phase.RUNNING, last=True)
    assert due.is_due(0.005, Phase.DAMPING)


def test_a_phase_begins_with_a_row(tmp_path: Path) -> None:
    """A row at the stop for any row interval: it shows when and where the stop
    began."""
    tricks: dict[int, Trick] = {
        60: lambda found: found._replace(q=found.q + 1.0)  # the fault
    }
    log = tmp_path / "rare.journal"
    run_loop(law(), Rig(tricks=tricks), duration=0.5, log=log, log_period=0.05)
    run = hsp.Rollout.load(log)
    damping = run.t[run["live.phase"] == Phase.DAMPING]
    assert damping[0] == pytest.approx(58 * PERIOD, abs=2.1 * PERIOD)
    assert run["live.measured"][run["live.phase"] == Phase.DAMPING][0] in (0.0, 1.0)


EFFORT = np.array([45.0, 45.0, 45.0, 45.0, 12.0, 12.0, 12.0])


def test_a_stop_without_states_is_logged_as_predicted(tmp_path: Path) -> None:
    robot = Rig(watched(), always(missing, 40))
    settings = LiveSettings(missing=5, prediction_time=0.05)
    report = run_loop(
        law(),
        robot,
        duration=1.0,
        settings=settings,
        log=tmp_path / "blind.journal",
        log_period=PERIOD,
    )
    assert report.ended == "fault"
    run = hsp.Rollout.load(tmp_path / "blind.journal")
    stops = run["live.phase"] > Phase.RUNNING
    assert stops.sum() > 20
    assert (run["live.measured"] == ~stops).all()
    assert np.isnan(run["live.age"][stops]).all()


def test_efforts_follow_limits_that_fall_in_a_run() -> None:
    """Also with a source that commands more than its controller permits."""

    class Strong(CompensatedController):
        def effort(self, t: float, q: Array, v: Array, period: float) -> Array:
            tau = super().effort(t, q, v, period)
            return tau + 70.0 * np.sin(300.0 * t) * np.eye(7)[0]

    robot = Rig(watched(LiveSettings(velocity_margin=9.0)))
    source = Strong(law(limits=hsp.Limits()))
    source.controller.at(0.05).ramp(0.02).limits(hsp.Limits(effort=EFFORT))
    settings = LiveSettings(velocity_margin=9.0)
    run_loop(source, robot, duration=0.15, settings=settings)
    efforts = np.abs(robot.sent)[:, 0]
    assert efforts[:40].max() > 50.0
    assert efforts[90:150].max() == EFFORT[0]


def test_after_an_unsent_effort_the_rate_is_relative_to_the_last_one() -> None:
    class Fails(Rig):
        """Does not report its effort, so that the loop has to know it."""

        def read(self, timeout: float) -> Measurement | None:
            found = super().read(timeout)
            assert found is not None
            return found._replace(applied=None)

        def write(self, effort: Array) -> None:
            if len(self.sent) == 60 and not self.failed:
                self.failed = True
                raise OSError("no route")
            super().write(effort)

        failed = False

    class Rising(CompensatedController):
        def effort(self, t: float, q: Array, v: Array, period: float) -> Array:
            tau = super().effort(t, q, v, period)
            return tau + 9.0 * (t > 0.04) * np.eye(7)[1]

    rate = 300.0
    settings = LiveSettings(effort_rate=rate)
    robot = Fails(watched(settings))
    report = run_loop(Rising(law()), robot, duration=0.3, settings=settings)
    assert robot.failed
    assert "the effort cannot be sent" in report.reason
    steps = np.abs(np.diff(robot.sent, axis=0))
    assert steps[59:62].max() == pytest.approx(rate * PERIOD)
    assert steps.max() <= rate * PERIOD * (1.0 + 1e-9)
    assert "jumped" not in robot.robot.reason
