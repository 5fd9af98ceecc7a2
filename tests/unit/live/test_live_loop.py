"""The live loop's logic: robots in this process, simulated clocks."""

import re
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from live_rigs import PERIOD, Rig, always, law, missing, nan_velocity, start, watched
from loaded_robots import panda
from places import further

import hsp_control as hsp
from hsp_control import (
    FramePosition,
    Gains,
    Hold,
    Limits,
    Rollout,
    TargetPosture,
    simulate,
)
from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError, LiveError
from hsp_control.constraints.limits import PositionRange
from hsp_control.control.changes import Changes
from hsp_control.control.compensation import CompensatedController
from hsp_control.control.estimation import Estimator, RunningEstimator
from hsp_control.control.first_state import StartWarning
from hsp_control.control.measurement import Inertial, LogChannel
from hsp_control.live import (
    Hardware,
    LiveSettings,
    LoopReport,
    Measurement,
    OperatorRequests,
    Phase,
    StopSettings,
    run_loop,
)
from hsp_control.live.live_log import DueRows
from hsp_control.live.loop import LiveRun

AT_REST = 0.02
"""Bound on speeds during the hold: twice the speed at which damping ends [rad/s]."""


def assert_held(rig: Rig, report: LoopReport) -> None:
    """The loop itself brought the robot to rest before it ended."""
    assert report.phase is Phase.HOLDING
    assert not report.silent
    assert report.speed < AT_REST
    # Efforts sent until the loop's end: `close` adds the robot's own stop afterwards.
    assert rig.robot.reason == "the loop has ended"
    assert np.abs(rig.robot.v).max() < AT_REST


# --- without faults ------------------------------------------------------------------


def test_it_is_the_simulation_then_stops(tmp_path: Path) -> None:
    """Without delays the loop equals the sampled loop of simulate bit for bit."""
    rig, log = Rig(), tmp_path / "run.journal"
    report = run_loop(law(), rig, duration=0.4, log=log, log_period=0.01)
    assert isinstance(rig, Hardware)
    assert (report.ended, report.reason) == ("completed", "the duration is over")
    assert_held(rig, report)
    run = Rollout.load(log)
    reference = simulate(
        law(),
        start(),
        duration=0.4,
        control_period=PERIOD,
        log_period=0.01,
        integrator=hsp.integrators.SemiImplicitEuler(PERIOD),
    )
    count = len(reference) - 1  # the last one is the safe stop's first
    assert run["live.phase"][count] == Phase.DAMPING
    np.testing.assert_array_equal(run["live.phase"][:count], Phase.RUNNING)
    for name in ("t", "q", "v", "tau", "task.tip.error", "field.g", "null_space_norm"):
        np.testing.assert_allclose(
            run[name][:count], reference[name][:count], rtol=1e-12, atol=1e-12
        )
    assert run.status == "completed"
    assert run.meta["live"]["phase"] == "holding"
    assert (np.diff(run.t) > 0.0).all()
    assert run["live.phase"][-1] == Phase.HOLDING


def test_a_first_effort_that_jumps_is_warned_of_before_it_is_sent() -> None:
    rig, sent = Rig(), []

    def show(*_: Any, **__: Any) -> None:
        sent.append(len(rig.sent))

    with warnings.catch_warnings():
        warnings.simplefilter("always", StartWarning)
        warnings.showwarning = show
        run_loop(law(gains=Gains(natural_frequency=20.0)), rig, duration=0.01)
    assert sent[0] == 0


def test_a_stream_that_falls_silent_stops_the_robot_safely() -> None:
    target = hsp.StreamPose(stop_after=0.05)
    hand = hsp.FramePose("panda_tcp", target)
    rig = Rig()
    report = run_loop(hsp.Controller(panda(), [hand]), rig, duration=1.0)
    assert report.ended == "fault"
    assert report.reason.startswith("StreamError: no message for 0.051 s; stop_after")
    assert (report.phase, report.silent) == (Phase.HOLDING, False)


# --- the robot's interface -----------------------------------------------------------


@pytest.mark.slow
def test_tau_less_gravity_is_the_same_motion() -> None:
    plain, compensating = Rig(), None
    run_loop(law(), plain, duration=0.3)
    settings = LiveSettings(compensates_gravity=True)
    compensating = Rig(watched(settings))
    run_loop(law(), compensating, duration=0.3, settings=settings)
    for sent, relieved in zip(plain.sent[:300:50], compensating.sent[:300:50]):  # noqa: B905
        assert np.abs(sent - relieved).max() > 1.0  # gravity is not negligible
    np.testing.assert_allclose(plain.robot.q, compensating.robot.q, atol=1e-9)
    relieved = np.array(compensating.sent)
    # At the end, at rest, such a robot is sent zero efforts.
    assert np.abs(relieved[-1]).max() < 0.05


@pytest.mark.parametrize("compensates", [False, True])
def test_estimators_and_plans_get_the_efforts_of_the_motors(compensates: bool) -> None:
    """Also of a robot that adds g(q) itself, and reports its efforts without it."""
    settings = LiveSettings(compensates_gravity=compensates)
    rig = Rig(watched(settings))
    efforts: list[tuple[Array, Array]] = []

    class Listening(RunningEstimator):
        def update(self, measured: Measurement) -> Measurement:
            if measured.applied is not None:
                efforts.append((measured.applied, rig.robot.tau.copy()))
            return measured

        def log_channels(self, q: Array, v: Array) -> dict[str, LogChannel]:
            return {}

    class Listens(Estimator):
        def begin(
            self, controller: hsp.Controller, inertial: Inertial | None
        ) -> Listening:
            return Listening()

    run_loop(law(), rig, duration=0.05, estimators=[Listens()], settings=settings)
    assert len(efforts) >= 49
    for given, applied in efforts:
        np.testing.assert_allclose(given, applied, rtol=0, atol=1e-9)  # up to 40 N·m


# --- with faults: the safe stop ------------------------------------------------------


def interrupt(found: Measurement) -> Measurement:
    raise KeyboardInterrupt


@pytest.mark.slow
def test_ctrl_c_in_a_read_is_the_operator_s_stop(tmp_path: Path) -> None:
    rig, log = Rig(tricks={150: interrupt}), tmp_path / "run.journal"
    report = run_loop(law(), rig, log=log)
    assert (report.ended, report.status) == ("operator", "interrupted")
    assert_held(rig, report)
    assert Rollout.load(log).status == "interrupted"


def test_a_disk_that_is_full_stops_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from hsp_control.simulation import journal

    real, rows = journal.os.write, []

    def full(file: int, data: bytes) -> int:
        rows.append(data)
        if len(rows) > 20:
            raise OSError(28, "No space left on device")
        return real(file, data)

    monkeypatch.setattr(journal.os, "write", full)
    rig = Rig()
    report = run_loop(law(), rig, duration=5.0, log=tmp_path / "run.journal")
    assert "No space left" in report.reason
    assert_held(rig, report)
    monkeypatch.undo()
    # 20 minus the magic, the heading and its copy
    assert len(Rollout.load(tmp_path / "run.journal")) == 17


# --- changes while it runs -----------------------------------------------------------


@pytest.mark.slow
def test_field_gains_and_tasks_change_without_a_jump(tmp_path: Path) -> None:
    controller, requests, rig = law(), OperatorRequests(), Rig()
    q = start()
    q[0] -= 0.5
    new = TargetPosture(q, name="other")
    gains = Gains(natural_frequency=5.0)
    elbow = FramePosition(
        "panda_link4", Hold([0.6]), gains=gains, name="elbow", axes="z"
    )
    stiffer = Gains(natural_frequency=15.0)

    def at(t: float) -> Changes:
        return controller.at(t).ramp(0.2)

    changes = {
        0.1: lambda: at(0.12).field(new),
        0.2: lambda: at(0.22).gains("tip", stiffer),
        0.3: lambda: at(0.32).add(elbow),
        0.6: lambda: at(0.62).remove("elbow"),
    }
    for_now = sorted(changes.items())

    def on_period(t: float) -> None:
        while for_now and t >= for_now[0][0]:
            requests.call(for_now.pop(0)[1])

    log = tmp_path / "run.journal"
    report = run_loop(
        controller, rig, duration=1.0, requests=requests, on_period=on_period, log=log,
        log_period=PERIOD,
    )  # fmt: skip
    assert report.ended == "completed", report.reason
    assert_held(rig, report)
    assert controller.field.name == "other"  # complete, and the previous one forgotten
    assert [task.name for task in controller.tasks] == ["tip"]
    run = Rollout.load(log)
    ran = run["live.phase"] == Phase.RUNNING
    steps = np.abs(np.diff(run.tau[ran], axis=0)).max(axis=1)
    # As large as without a change: the motion's own, as in the first 0.1 s.
    assert steps.max() < 5.0 * steps[10:100].max()
    assert np.isfinite(run["task.elbow.error"][(run.t > 0.4) & (run.t < 0.6), 0]).all()
    assert np.isnan(run["task.elbow.error"][run.t > 0.83]).all()
    assert np.isnan(run["field.other.g"][run.t < 0.09]).all()
    assert list(run.meta["tasks"]) == ["tip", "elbow"]  # a removed one is drawn, too


def test_requested_changes_are_made_in_their_order() -> None:
    """Also one that is requested by a change, and none twice."""
    requests, made = OperatorRequests(), list[int]()
    for k in range(3):
        requests.call(lambda k=k: made.append(k))
    requests.call(lambda: requests.call(lambda: made.append(3)))
    requests.run_pending()
    requests.run_pending()
    assert made == [0, 1, 2, 3]


def test_a_task_of_another_form_is_logged_by_another_name() -> None:
    controller = law()
    elbow = FramePosition("panda_link4", Hold([0.6]), name="elbow", axes="z")
    other = FramePosition("panda_link4", name="elbow", axes="xy")
    controller.at(0.01).ramp(0.01).add(elbow)
    controller.at(0.03).ramp(0.01).remove("elbow")
    controller.at(0.05).ramp(0.01).add(other)
    run = simulate(controller, start(), duration=0.08, control_period=PERIOD)
    assert [about["axes"] for about in run.meta["tasks"].values()] == ["xyz", "z", "xy"]
    for name, rows in (("elbow", [2, 3]), ("elbow_2", [6, 7, 8])):
        error = run[f"task.{name}.error"]
        measured = run[f"task.{name}.reference"] - run[f"task.{name}.actual"]
        np.testing.assert_allclose(error[rows], measured[rows], atol=1e-15)
        assert np.isnan(np.delete(error, rows, axis=0)).all()


# --- refusals -----------------------------------------------------------------------


def test_a_floating_base_that_nothing_holds_is_refused() -> None:
    robot = hsp.Robot.load("panda", root="free_flyer")
    task = hsp.JointPosture(robot.neutral(), gains=Gains(natural_frequency=5.0))
    controller = hsp.Controller(robot, [task], base="driven")
    rig = Rig()
    with pytest.raises(
        LiveError, match="panda has a floating base and no contacts: a live loop"
    ):
        run_loop(controller, rig)
    assert rig.closed


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"duration": 0.0}, "duration is 0.0 s; must be positive"),
        ({"log_period": 1e-4}, "log_period is 0.0001 s; must be a period, 0.001 s"),
        ({"settings": LiveSettings(stop=StopSettings(damping=600.0))},
         "damping is 600; at a period of 0.001 s it may be 500 at most"),
        ({"settings": LiveSettings(effort_rate=[1.0, 2.0])},
         "effort_rate: has 2 numbers; needs one number or 7"),
        ({"settings": LiveSettings(effort=[1.0, 2.0, 3.0])},
         "effort: has 3 numbers; needs one number or 7"),
    ],
)  # fmt: skip
def test_settings_that_are_none(options: dict[str, Any], message: str) -> None:
    with pytest.raises(LiveError, match=message):
        run_loop(law(), Rig(), **options)


def test_a_robot_that_is_silent_or_unfit_is_not_started() -> None:
    clock = iter(np.arange(0.0, 1e4, 0.1))
    rig = Rig(tricks=always(missing, 1))
    with pytest.raises(HardwareError, match="no state of the robot arrived in 10 s"):
        run_loop(law(), rig, clock=lambda: float(next(clock)))
    assert rig.closed
    assert not rig.sent
    rig = Rig(tricks=always(nan_velocity, 1))
    with pytest.raises(HardwareError, match=r"cannot be started: .*not finite"):
        run_loop(law(), rig)
    assert not rig.sent
    assert rig.closed


@pytest.mark.parametrize("at_first", [None, *further(Limits())])
def test_the_monitor_follows_limits_that_change(at_first: Limits | None) -> None:
    q = start()
    wide = PositionRange(q - 0.2, q + 0.2)
    narrow = PositionRange(q - 0.05, q + 0.05)

    class Beyond(CompensatedController):
        def __init__(self, source: hsp.Controller) -> None:
            super().__init__(source)
            self.unaware = law()

        def effort(self, t: float, q: Array, v: Array, period: float) -> Array:
            super().effort(t, q, v, period)
            return self.unaware.compute(t, q, v).tau

    source = Beyond(law(limits=at_first))
    source.controller.at(0.05).ramp(0.05).limits(Limits(position=wide))
    source.controller.at(0.2).ramp(0.05).limits(Limits(position=narrow))
    report = run_loop(source, Rig(), duration=5.0)
    assert report.ended == "fault"
    assert re.search("panda_joint. is at .*, outside", report.reason)
    # Only the narrow range is left so early; tolerance widens ranges by 0.02.
    reference = run_loop(Beyond(law(limits=Limits(position=wide))), Rig(), duration=5.0)
    assert 0.2 < report.t < reference.t


@pytest.mark.parametrize("error", [-1e-9, 0.0, 1e-9])
def test_a_row_is_due_at_each_tenth_state_also_where_times_are_rounded(
    error: float,
) -> None:
    due, rows = DueRows(0.01), []
    for k in range(500):
        t = 0.001 * k + error
        if due.is_due(t, 1):
            due.written(t, 1)
            rows.append(k)
    assert rows == [*range(0, 500, 10)]


def test_schedules_of_feet_use_the_controller_s_time() -> None:
    """A run's time may differ from the robot's clock."""
    requested: list[float] = []
    measured = Measurement(1, 0.2, start(), np.zeros(7))
    run: Any = SimpleNamespace(
        reader=SimpleNamespace(
            measurement=measured, state=panda().state(7.2, start(), np.zeros(7))
        ),
        detector=SimpleNamespace(check=lambda state: None),
        safe_stop=SimpleNamespace(
            feet=SimpleNamespace(update=lambda each: requested.append(each.t))
        ),
    )
    LiveRun.feel_ground(run)
    assert requested == [7.2]


def test_the_first_reason_to_stop_is_kept() -> None:
    """Those after it are its consequences."""
    requests = OperatorRequests()
    requests.stop("the door is open")
    requests.stop("the page has ended", fault=True)
    assert (requests.reason, requests.fault) == ("the door is open", False)


def test_the_first_interval_begins_after_the_preparation() -> None:
    rig = Rig()
    report = run_loop(
        law(), rig, duration=0.01, clock=lambda: (rig.reads > 0) + PERIOD * rig.reads
    )
    assert report.deadlines.interval is not None
    assert report.deadlines.interval.worst == pytest.approx(PERIOD)
