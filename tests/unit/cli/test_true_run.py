"""The robot's log has the tasks that the loop followed, of the robot's own states."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, NoReturn

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control import RobotState, Rollout
from hsp_control.cli import live, robot_process
from hsp_control.cli.live_experiment import FINAL_HOLD, simulated_robot
from hsp_control.cli.robot_process import RobotProcess
from hsp_control.cli.true_run import with_tasks
from hsp_control.common.errors import LiveError
from hsp_control.companions.viewer import ComparedRun, robot_of
from hsp_control.companions.viewer.packing import ArrayTable
from hsp_control.companions.viewer.page_plots import pack_panels
from hsp_control.live import InProcessRobot, Phase, SimulatedRobot
from hsp_control.live.live_log import live_channels
from hsp_control.live.report import Deadlines
from hsp_control.live.udp import ServerReport
from hsp_control.simulation.limit_excess import POSITION, VELOCITY, LimitExcess
from hsp_control.simulation.log_writer import LogWriter

CONFIG: dict[str, Any] = {
    "robot": {"name": "panda"},
    "tasks": {
        "tip": {"type": "frame_position", "trajectory": {"type": "stream"}},
        "elbow": {"type": "frame_position", "frame": "panda_link4", "axes": "z",
                  "priority": 2},
    },
    "simulation": {"duration": 0.3, "control_period": 0.001,
                   "integrator": {"type": "semi_implicit_euler", "step": 0.001}},
}  # fmt: skip


def states_only(run: Rollout, experiment: hsp.Experiment) -> Rollout:
    """Return a log of the same states as a robot writes it: without a controller."""
    nothing = hsp.Controller(experiment.robot, (), limits=None, scene=experiment.scene)
    excess, limits = LimitExcess(experiment.robot), experiment.controller.limits
    writer = LogWriter(nothing, experiment.scene, len(run))
    state = RobotState(experiment.robot)
    for t, q, v, tau in zip(run.t, run.q, run.v, run.tau, strict=True):
        excess.record(limits, q, v)
        channels = live_channels(phase=float(Phase.RUNNING)) | excess.collect(limits)
        writer.record(state.update(t, q, v), None, tau, channels, parts=False)
    return writer.rollout("completed", "", config=run.config)


def test_the_tasks_are_those_of_the_loop(tmp_path: Path) -> None:
    experiment = hsp.load_experiment(CONFIG)
    controller = experiment.controller
    handle = controller.stream("tip")
    state = RobotState(experiment.robot).update(0.0, experiment.q0, experiment.v0)
    x, y, z = state.position("panda_hand")

    def steer(t: float) -> None:
        """Send messages, and change the other task while the loop runs."""
        handle.send([x, y + 0.1 * t, z])
        if abs(t - 0.1) < 1e-9:
            controller.at(0.12).ramp(0.05).gains(
                "elbow", hsp.Gains(natural_frequency=4.0)
            )

    report = hsp.run_loop(
        controller,
        InProcessRobot(simulated_robot(experiment)),
        duration=0.3,
        on_period=steer,
        log=tmp_path / "loop.journal",
        meta={"config": experiment.config},
    )
    assert report.ended == "completed", report.reason
    loop = Rollout.load(tmp_path / "loop.journal")
    truth = states_only(loop, hsp.load_experiment(CONFIG))
    assert not truth.meta["tasks"]
    path = loop.save(tmp_path / "loop.npz")
    run = with_tasks(truth, loop, hsp.load_experiment(path))
    running = loop["live.phase"] == Phase.RUNNING
    assert running.sum() == 30
    moved = np.ptp(loop["task.tip.reference"][running], axis=0)
    assert moved[1] > 0.01
    for name in loop.columns:
        if name.startswith(("task.", "field.", "null_space", "acceleration")):
            scale = 1.0 + np.nanmax(np.abs(loop[name]))
            np.testing.assert_allclose(
                run[name][running], loop[name][running], atol=1e-9 * scale, err_msg=name
            )
    np.testing.assert_array_equal(run["live.phase"], loop["live.phase"])
    assert "the safe stop is the last" in str(run)


@pytest.mark.parametrize("limits", ["none", {"velocity": 3.0}])
def test_excesses_are_those_over_the_limits_of_the_time(
    limits: Any,
) -> None:
    """Without limits there are none; the robot knows nothing of changed ones."""
    changes = [{"type": "limits", "limits": {"velocity": 0.001}, "at": 0.1, "ramp": 0}]
    circle = {"type": "circle", "origin": "start", "radius": 0.05, "angular_rate": 1.5}
    circle |= {"center": [0.0, 0.0, 0.05], "normal": [1, 0, 0]}
    task = {"type": "frame_position", "trajectory": circle, "blend": 0.1}
    data = CONFIG | {
        "tasks": {"tip": task},
        "limits": limits,
        "changes": changes if limits != "none" else [],
    }
    experiment = hsp.load_experiment(data)
    run = hsp.load_experiment(data).run()
    columns = {**run.columns, "live.phase": np.ones(len(run))}
    loop = Rollout(columns, run.meta)
    truth = states_only(run, experiment)
    made = with_tasks(truth, loop, experiment)
    for name in (POSITION, VELOCITY):
        assert (name in made) == (name in run)
    if VELOCITY in run:
        assert truth[VELOCITY].max() == 0.0
        assert made[VELOCITY][run.t > 0.15].max() > 0.0


def test_what_a_plan_made_is_said_to_be_missing() -> None:
    walk = hsp.load_experiment("walking/talos_walk")
    empty = Rollout({"t": np.zeros(0)}, {})
    with pytest.raises(LiveError, match="the plan"):
        with_tasks(empty, empty, walk)


@pytest.mark.filterwarnings("error")
def test_a_log_of_states_is_summed_up_drawn_and_exported(tmp_path: Path) -> None:
    experiment = hsp.load_experiment(CONFIG)
    log = states_only(experiment.run(), experiment)
    log.meta["config"] = experiment.config
    assert "not in this log, which has states only" in str(log)
    assert "nan" not in str(log)
    figure = hsp.plots.diagnostics_figure(log)
    titles = "".join(axes.get_title(loc="left") for axes in figure.axes)
    assert "Efforts" in titles
    assert "Null-space" not in titles
    packed = pack_panels([ComparedRun("", robot_of(log), log)], ArrayTable())
    shown = [each["title"] for each in packed["panels"]]
    assert shown == ["Joint positions", "Efforts τ"]
    hsp.viewer.export_html(log, tmp_path / "page.html")


@pytest.mark.parametrize(
    "raised", [ValueError("no"), KeyboardInterrupt(), SystemExit()]
)
def test_the_robot_s_log_is_kept_whatever_is_raised_while_it_is_completed(
    raised: BaseException,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """By the user's own field, or by Ctrl-C in a long evaluation."""

    def fail(*_: object) -> NoReturn:
        raise raised

    experiment = hsp.load_experiment(CONFIG, "simulation.duration=0.05")
    loop = experiment.run().save(tmp_path / "loop.npz")
    run = experiment.run(log=tmp_path / "robot.journal")
    monkeypatch.setattr(live, "with_tasks", fail)
    assert live._convert(tmp_path / "robot.journal", followed=loop)
    kept = hsp.Rollout.load(tmp_path / "robot.npz")
    np.testing.assert_array_equal(kept.q, run.q)
    assert not (tmp_path / "robot.journal").exists()
    assert f"has its states only: {type(raised).__name__}" in capsys.readouterr().out


def test_how_the_robot_ended_stays_in_its_log() -> None:
    experiment = hsp.load_experiment(CONFIG)
    run = hsp.load_experiment(CONFIG).run()
    loop = Rollout({**run.columns, "live.phase": np.ones(len(run))}, run.meta)
    truth = states_only(run, experiment)
    truth.meta |= {"status": "stopped", "message": "its loop fell silent"}
    made = with_tasks(truth, loop, experiment)
    assert (made.status, made.meta["message"]) == ("stopped", "its loop fell silent")


def test_the_later_phase_of_both_processes_is_logged() -> None:
    """The robot may stop by itself, and holds on when the loop has ended."""
    experiment = hsp.load_experiment(CONFIG)
    run = hsp.load_experiment(CONFIG).run()
    rows = np.arange(len(run))
    loop = np.select([rows < 10, rows < 20], [Phase.RUNNING, Phase.DAMPING], 3.0)
    own = np.select([rows < 5, rows < 8], [Phase.RUNNING, Phase.HOLDING], 1.0)
    truth = states_only(run, experiment)
    truth.columns["live.phase"][:] = own
    both = Rollout({**run.columns, "live.phase": loop}, run.meta)
    made = with_tasks(truth, both, experiment)["live.phase"]
    np.testing.assert_array_equal(made, np.maximum(loop, own))


def test_injected_faults_are_those_of_the_packets_sender() -> None:
    """States are the robot's packets, efforts are ours."""
    kinds = ("sent", "accepted", "lost", "stale", "duplicated", "corrupted", "foreign")
    counts, theirs = dict.fromkeys(kinds, 0), dict.fromkeys(kinds, 0)
    robot = {"link": theirs, "injected": {"lost": 2, "late": 3}}
    table = live._packets(counts, {"lost": 5, "late": 7}, robot)
    rows = {
        row[0]: row[3:5] for row in zip(*(c.cells for c in table.columns), strict=True)
    }
    assert rows["  injected, states"] == ("2", "3")
    assert rows["  injected, efforts"] == ("5", "7")


def test_times_of_a_loop_are_printed_in_microseconds() -> None:
    deadlines = Deadlines(0.001)
    deadlines.add(interval=0.0012, response=0.00025)
    report: Any = SimpleNamespace(deadlines=deadlines)
    table = live._times(report, SimpleNamespace(name="mine"))  # type: ignore[arg-type]
    heading, *numbers = table.columns
    assert str(heading.header) == "mine at 1000 Hz, times in µs"
    assert [list(each.cells) for each in numbers] == 4 * [["250", "1200"]]


def test_a_rehearsal_leaves_no_effort_in_the_drives() -> None:
    drives = {"drives": {"delay": {"periods": 2}}}
    experiment = hsp.load_experiment(
        CONFIG | {"plant": {"type": "rigid_body"} | drives}
    )
    robot, tau = simulated_robot(experiment), np.arange(7.0)
    robot_process._warm_up(robot, experiment)
    logged = robot.plant.log_channels(0.0, robot.q, robot.v, tau)
    np.testing.assert_array_equal(logged["applied.tau"].value, tau)  # none before


def test_a_simulated_robot_is_held_for_half_a_second_after_its_stop() -> None:
    """Its log goes on after the loop's, which holds it for a shorter time."""
    experiment = hsp.load_experiment(CONFIG | {"live": {"stop": {"hold": 0.05}}})
    robot, held = simulated_robot(experiment), 0
    robot.advance(
        [experiment.robot.inverse_dynamics(experiment.q0, np.zeros(7), np.zeros(7))]
    )
    robot.halt("over")
    while not robot.done:
        robot.advance([])
        held += robot.phase == Phase.HOLDING
    assert held * robot.period == pytest.approx(FINAL_HOLD, abs=1.5 * robot.period)


@pytest.mark.parametrize(("limits", "accepted"), [("none", False), (100.0, True)])
def test_a_simulated_robot_accepts_what_its_controller_s_limits_permit(
    limits: Any, accepted: bool
) -> None:
    """The URDF permits 87 N·m at the first joint, and 12 N·m at the last."""
    given = limits if limits == "none" else {"effort": limits}
    experiment = hsp.load_experiment(CONFIG | {"limits": given})
    robot = simulated_robot(experiment)
    effort = experiment.robot.inverse_dynamics(experiment.q0, np.zeros(7), np.zeros(7))
    effort[0] = 95.0
    robot.advance([effort])
    assert (robot.phase == Phase.RUNNING) is accepted, robot.reason


def test_a_closed_robot_process_leaves_no_socket() -> None:
    robot = RobotProcess(hsp.load_experiment(CONFIG))
    robot.close()
    assert robot.hardware.link._socket.fileno() == -1


def test_a_robot_reports_the_speed_of_its_fastest_joint(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def serve(robot: SimulatedRobot, *_: object, **__: object) -> ServerReport:
        robot.v[:2] = 1.0, -2.0
        return ServerReport()

    monkeypatch.setattr(robot_process, "serve", serve)
    ours = RobotProcess(hsp.load_experiment(CONFIG))
    report = robot_process._run(ours._settings, lambda: None)
    ours.close()
    assert report["speed"] == 2.0


@pytest.mark.parametrize(
    ("rests", "silent", "words"),
    [
        (True, False, "held the robot"),
        (False, False, "could not bring the robot to rest"),
        (False, True, "fell silent"),
    ],
)
def test_the_end_of_both_processes_is_printed(
    rests: bool, silent: bool, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    report: Any = SimpleNamespace(
        deadlines=Deadlines(0.001), reason="over", silent=silent, at_rest=rests,
        t=1.25, speed=0.3,
    )  # fmt: skip
    robot = {"reason": "closed", "phase": "holding", "t": 2.5, "speed": 0.04}
    live._print_ends(report, robot)
    _, loop, its = capsys.readouterr().out.splitlines()
    assert loop == f"The loop: over, at t = 1.250 s; {words}, the fastest joint at 0.3"
    assert its.startswith("The robot: closed; holding at t = 2.500 s, the fastest ")
    assert its.endswith(" 0.04")
