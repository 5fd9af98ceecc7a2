"""A loop against the clock, and what a start costs: cold, cached, read-only."""

import gc
import json
import os
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.cli import main
from hsp_control.common.exceptions import SimulationError
from hsp_control.live.latency import (
    ControlLoop,
    Latency,
    Quantiles,
    measure,
    measure_latency,
    no_garbage_collection,
    periodic,
    real_time_priority,
)
from hsp_control.live.latency.periodic import StepTimes, run_periodic
from hsp_control.visualization.plots import latency_figure

pytestmark = pytest.mark.process

MOVING = "paper/4_moving_obstacle"
compiles = pytest.mark.skipif(
    bool(numba.config.DISABLE_JIT), reason="nothing is compiled"
)


@pytest.fixture
def loop() -> ControlLoop:
    experiment = hsp.load_experiment(MOVING)
    return ControlLoop(experiment.controller, experiment.q0, experiment.v0, 0.001)


class Clock:
    """A clock that only moves when somebody sleeps or works."""

    def __init__(self, oversleep: int, work: list[int]) -> None:
        self.now = 1_000
        self.oversleep = oversleep
        self.work = iter(work)

    def read(self) -> int:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += round(seconds * 1e9) + self.oversleep

    def step(self) -> None:
        self.now += next(self.work)

    def idle(self) -> None:
        pass


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock(7, [100, 100, 2_500, 100, 100, 100])
    monkeypatch.setattr(periodic, "perf_counter_ns", clock.read)
    monkeypatch.setattr(periodic, "sleep", clock.sleep)
    return clock


# --------------------------------------------------------------------------- the clock


def test_beginnings_are_fixed_and_a_late_step_is_made_up_for(clock: Clock) -> None:
    record = StepTimes(1_000, 6)
    run_periodic(clock.step, clock.idle, record, 6)
    assert record.steps == 6
    assert record.step.tolist() == [100, 100, 2_500, 100, 100, 100]
    # The third step ends 1507 after its period: the next begin at once, late by what
    # is left of that, until there is time to sleep again.
    assert record.wake.tolist() == [7, 7, 7, 1_507, 607, 7]


def test_turns_go_on_in_the_same_record(clock: Clock) -> None:
    record = StepTimes(1_000, 6)
    run_periodic(clock.step, clock.idle, record, 2)
    assert (record.steps, record.wake[2]) == (2, -1)
    clock.now += 10**9  # the other loop's turn, which delays nobody
    run_periodic(clock.step, clock.idle, record, 2)
    assert record.wake[:4].tolist() == [7, 7, 7, 1_507]


def test_what_counts_as_missed(clock: Clock) -> None:
    control, empty = StepTimes(1_000, 6), StepTimes(1_000, 6)
    run_periodic(clock.step, clock.idle, control, 6)
    clock.oversleep = 1_001
    run_periodic(clock.idle, clock.idle, empty, 4)
    found = Latency(control, empty, np.array([1e-7]), 0)
    # Too late: the long step itself, and the one after it that began too late.
    assert found.missed == 2
    assert found.response[2] == pytest.approx(2_507e-9)
    assert found.empty_missed == 2  # every other is caught up with
    assert found.period == pytest.approx(1e-6)


def test_quantiles_are_times_that_were_measured() -> None:
    times = np.random.default_rng(0).permutation(np.arange(1.0, 10_001.0))
    assert Quantiles.of(times) == (5001.0, 9901.0, 9991.0, 10_000.0)
    assert Quantiles.of(np.array([3.0])) == (3.0, 3.0, 3.0, 3.0)


# ------------------------------------------------------------------------ the process


def test_the_collector_is_away_and_comes_back() -> None:
    assert gc.isenabled()
    with no_garbage_collection():
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 1000
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
    with pytest.raises(ZeroDivisionError), no_garbage_collection():
        _ = 1 / 0
    assert gc.isenabled()
    gc.disable()
    try:
        with no_garbage_collection():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


@pytest.mark.parametrize("config", [MOVING, "iiwa_null_space"])
def test_steps_leave_nothing_to_collect(config: str) -> None:
    experiment = hsp.load_experiment(config)
    loop = ControlLoop(experiment.controller, experiment.q0, experiment.v0, 0.001)
    for _ in range(2):  # what a first step binds, and reads from the cache, stays
        loop.control()
        loop.move()
    with no_garbage_collection():
        tracked = len(gc.get_objects())
        for _ in range(50):
            loop.control()
            loop.move()
        assert len(gc.get_objects()) < tracked + 25  # not one in two steps
        assert gc.collect() == 0


def test_priority_is_set_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda *call: calls.append((call[1], call[2]))
    )
    before = os.sched_getscheduler(0)
    with real_time_priority(40):
        assert [policy for policy, _ in calls] == [os.SCHED_FIFO]
        assert calls[0][1].sched_priority == 40
    assert calls[1][0] == before


def test_the_dry_run_is_not_real_time(
    loop: ControlLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    events: list[str] = []
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda _, policy, __: events.append(f"set {policy}")
    )
    dry_run = measure_latency.dry_run
    monkeypatch.setattr(
        measure_latency, "dry_run", lambda *a: events.append("dry run") or dry_run(*a)
    )
    measure(loop, 0.002, priority=40)
    real, ordinary = f"set {os.SCHED_FIFO}", f"set {os.sched_getscheduler(0)}"
    assert events == [real, ordinary, "dry run", real, ordinary]


def test_priority_that_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SimulationError, match="must be from 1 to 99"):
        real_time_priority(0).__enter__()

    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with pytest.raises(SimulationError, match="not permitted; needs root, CAP_SYS"):
        real_time_priority(40).__enter__()


# --------------------------------------------------------------------------- the loop


def test_the_loop_moves_as_the_simulation_does(loop: ControlLoop) -> None:
    experiment = hsp.load_experiment(MOVING)
    rollout = hsp.simulate(
        experiment.controller,
        experiment.q0,
        experiment.v0,
        duration=0.05,
        control_period=0.001,
        log_period=0.001,
        integrator=hsp.integrators.SemiImplicitEuler(0.001),
    )
    for row in range(50):
        np.testing.assert_allclose(loop.q, rollout.q[row], rtol=0, atol=1e-14)
        loop.control()
        np.testing.assert_allclose(loop.tau, rollout.tau[row], rtol=1e-12)
        loop.move()
    loop.restart()
    np.testing.assert_array_equal(loop.q, rollout.q[0])
    assert loop.t == 0.0


@pytest.mark.slow
def test_a_loop_with_a_plan_moves_as_the_simulation_does() -> None:
    """The step that is timed is that of a run: estimator, plan, and their contacts."""
    pytest.importorskip("mujoco")
    pytest.importorskip("example_robot_data")
    brief = (
        "estimators.base=true",
        "simulation.duration=0.4",
        "simulation.log_period=0.001",
    )
    run = hsp.load_experiment("whole_body/solo12_trot", *brief).run()
    made = hsp.load_experiment("whole_body/solo12_trot", *brief)
    given = made.controller, made.q0, made.v0, 0.001, made.plant
    trot = ControlLoop(*given, made.scenario.plan, made.scenario.estimators)
    for _ in range(2):  # a restart begins a run anew
        for row in range(400):
            np.testing.assert_allclose(trot.q, run.q[row], rtol=0, atol=1e-9)
            trot.control()
            np.testing.assert_allclose(trot.tau, run.tau[row], rtol=0, atol=1e-7)
            trot.move()
        trot.restart()
    assert 2.0 in run["plan.phase"], "no foot swung"


def test_a_measured_loop_did_the_same_steps_twice(
    loop: ControlLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measure_latency, "TURN", 0.02)
    done: list[float] = []
    found = measure(loop, 0.05, on_progress=done.append)
    assert len(found.step) == len(found.empty) == len(found.back_to_back) == 50
    assert done == [0.4, 0.8, 1.0]
    assert (found.step > 0.0).all()
    assert (found.wake >= 0.0).all()
    assert loop.t == pytest.approx(0.05)
    assert found.compilations == 0
    assert gc.isenabled()
    figure = latency_figure(found, "a loop")
    often, when = figure.axes
    np.testing.assert_allclose(
        often.lines[0].get_xdata(), np.sort(found.step)[::-1] * 1e6
    )
    assert len(when.lines[0].get_xdata()) == 50


@compiles
def test_what_is_compiled_on_the_clock_is_noticed(loop: ControlLoop) -> None:
    controls = 0
    control = loop.control

    def compiling() -> None:
        nonlocal controls
        controls += 1
        if controls == 15:  # the dry run has ten
            numba.njit(lambda x: x + 1)(2)
        control()

    loop.control = compiling  # type: ignore[method-assign]
    assert measure(loop, 0.01).compilations == 1


def test_ctrl_c_keeps_what_was_measured(
    loop: ControlLoop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measure_latency, "TURN", 0.01)

    def interrupt(done: float) -> None:
        raise KeyboardInterrupt

    found = measure(loop, 1.0, on_progress=interrupt)
    assert len(found.step) == len(found.empty) == 10
    assert gc.isenabled()


# ------------------------------------------------------------------- the command line


def test_bench_tells_and_draws(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "latency.svg"
    quick = ["--seconds", "0.1", "--rate", "500", "--plot", str(picture)]
    assert main(["bench", "--latency", MOVING, *quick]) == 0
    printed = capsys.readouterr().out
    assert f"{MOVING} at 500 Hz: 50 periods" in printed
    assert "Missed periods: " in printed
    (row,) = [line for line in printed.splitlines() if line.startswith("step: state")]
    numbers = [float(word) for word in row.split()[-4:]]
    assert 0.0 < numbers[0] <= numbers[1] <= numbers[2] <= numbers[3]
    assert picture.is_file()


def test_bench_tells_a_program_seconds(capsys: pytest.CaptureFixture[str]) -> None:
    quick = ["--seconds", "0.1", "--rate", "500", "--json"]
    assert main(["bench", "--latency", MOVING, *quick]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["periods"] == 50
    for name in ("step", "back_to_back", "wake", "empty", "response"):
        times = [told[name][part] for part in ("median", "p99", "p999", "worst")]
        assert times == sorted(times)
        assert 0.0 < times[0] < 1.0


@pytest.mark.slow
def test_bench_names_what_the_step_consists_of(
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("example_robot_data")
    quick = ["--seconds", "0.05", "--set", "estimators.base=true"]
    assert main(["bench", "--latency", "whole_body/solo12_trot", *quick]) == 0
    printed = capsys.readouterr().out
    (row,) = [line for line in printed.splitlines() if line.startswith("step: ")]
    assert row.startswith("step: estimators, plan, state and law ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--rate", "0"], "--rate 0; must be"),
        (["--seconds", "-1"], "-1 s; must be positive"),
        (["--priority", "100"], "must be from 1 to 99"),
        (["paper/4_moving"], "did you mean 'paper/4_moving_obstacle'?"),
        (["--set", "null_space.gian=3"], "did you mean 'gain'?"),
    ],
)
def test_each_mistake_gets_one_message_and_status_2(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    config = [] if arguments[0].startswith("paper") else [MOVING]
    assert main(["bench", "--latency", *config, *arguments]) == 2
    error = capsys.readouterr().err
    assert error.startswith("hsp: ")
    assert message in error


def test_run_tells_its_speed_and_its_memory(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    short = ["--set", "simulation.duration=0.1", "--out", str(tmp_path)]
    assert main(["run", MOVING, *short]) == 0
    printed = capsys.readouterr().out
    assert "times real time (0.1 s in " in printed
    with np.load(tmp_path / "4_moving_obstacle.npz") as log:
        size = sum(log[name][0].nbytes for name in log.files if name != "meta")
    assert f"log            {size} bytes per row" in printed


# -------------------------------------------------------------------------- the cache
