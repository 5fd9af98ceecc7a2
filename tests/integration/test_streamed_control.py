"""Streams in a controller: exact tracking, repeatable runs, and YAML."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import hsp_control as hsp
from hsp_control.common.errors import AccessError, HspControlError
from hsp_control.simulation.log_writer import LogWriter
from hsp_control.trajectories.streams import inbox

PERIOD = 1e-3
PANDA = hsp.Robot.load("panda")


def hand_pose(robot: hsp.Robot) -> pin.SE3:
    motion = robot.state(0.0, robot.home(), np.zeros(robot.nv)).frame("panda_tcp")
    return pin.SE3(motion.rotation, motion.position)


def moved(pose: pin.SE3, t: float) -> pin.SE3:
    """Return a pose trajectory near ``pose``."""
    away = np.array([0.0, 0.08 * np.sin(2 * t), 0.05 * np.sin(t) ** 2])
    turned = pin.exp3(np.array([0.3, 0.2, 0.0]) * np.sin(1.5 * t))
    return pin.SE3(pose.rotation @ turned, pose.translation + away)


def every(
    period: float, send: Callable[[float], object]
) -> Callable[[LogWriter], None]:
    """Return an ``on_row`` for rows of 10 ms that sends once per period [s]."""
    rows = iter(range(10**9))

    def on_row(recorder: LogWriter) -> None:
        t = 0.01 * next(rows)
        if t / period == pytest.approx(round(t / period)):
            send(t)

    return on_row


def test_tracking_and_the_null_space_are_as_exact_as_without_a_stream() -> None:
    # The law in the integrator's stages, without sampling: only the integrator's error.
    stream = hsp.StreamPose(policy="interpolate", delay=0.15)
    task = hsp.FramePose("panda_tcp", stream)
    controller = hsp.Controller(PANDA, [task], hsp.JointCentering(), null_space_gain=8)
    hand = controller.stream(stream)
    start = hand_pose(PANDA)
    run = hsp.simulate(
        controller,
        PANDA.home(),
        duration=1.5,
        integrator=hsp.integrators.Rk4(1e-3),
        on_row=every(0.05, lambda t: hand.send(moved(start, t), t=t)),
    )
    # RK4 is of third order in steps within which the jerk of the reference jumps.
    assert np.abs(run["task.panda_tcp.error"]).max() < 2e-6
    norms = run["null_space_norm"]
    expected = norms[0] * np.exp(-8.0 * run.t)
    assert np.abs(norms - expected).max() < 1e-5
    # It was moving indeed.
    reference = run["task.panda_tcp.reference"]
    assert np.ptp(reference[:, 1]) > 0.07


def test_a_posture_is_streamed_in_joint_positions() -> None:
    stream = hsp.Stream(delay=0.3)
    task = hsp.JointPosture([0.0] * 7, displacement=stream)
    controller = hsp.Controller(PANDA, [task])
    goal = PANDA.home() + 0.1
    controller.stream("posture").send(goal)
    run = hsp.simulate(controller, PANDA.home(), duration=2.0, control_period=PERIOD)
    assert np.abs(run["task.posture.error"]).max() < 1e-3  # from the start on
    assert np.abs(run.q[-1] - goal).max() < 1e-5


def test_a_target_out_of_reach_is_approached_within_all_limits() -> None:
    stream = hsp.Stream(speed=0.5)
    controller = hsp.Controller(
        PANDA,
        [hsp.FramePosition("panda_tcp", stream)],
        hsp.JointCentering(),
        singularity_threshold=0.1,
    )
    here = hand_pose(PANDA).translation
    hand = controller.stream("panda_tcp")
    hand.send(here + np.array([0.8, 0.0, 0.1]))
    back = every(2.5, lambda t: hand.send(here) if t > 1.0 else None)
    run = hsp.simulate(
        controller, PANDA.home(), duration=5.0, control_period=PERIOD, on_row=back
    )
    assert run["status"].max() <= 2
    assert run["velocity_excess"].max() == 0.0
    assert run["position_excess"].max() == 0.0
    shoulder = np.array([0.0, 0.0, 0.333])
    k = int(2.4 / 0.01)
    stretched = np.linalg.norm(run["task.panda_tcp.actual"][k] - shoulder)
    assert stretched > 0.92  # of about 0.95
    assert np.abs(np.diff(run.tau[k - 20 : k], axis=0)).max() < 0.5  # and rests there
    assert np.linalg.norm(run["task.panda_tcp.error"][-1]) < 1e-3


def test_a_clutch_that_closes_elsewhere_makes_no_jump() -> None:
    stream, start = hsp.StreamPose(delay=0.05), hand_pose(PANDA)
    controller = hsp.Controller(PANDA, [hsp.FramePose("panda_tcp", stream)])

    times = iter(PERIOD * np.arange(2401))

    def lead(_: LogWriter) -> None:
        t = next(times)
        if not 0.8 < t < 1.6:  # released; then the operator's hand is elsewhere
            away = pin.SE3(np.eye(3), np.array([0.0, 0.3 * (t > 1.0), 0.0]))
            controller.stream("panda_tcp").send(away * moved(start, t), t=t)

    run = hsp.simulate(
        controller,
        PANDA.home(),
        duration=2.4,
        control_period=PERIOD,
        log_period=PERIOD,
        on_row=lead,
    )
    steps = np.abs(np.diff(run.tau, axis=0))[100:].max()
    assert steps < 1.5  # [N·m]
    assert np.abs(run["task.panda_tcp.error"]).max() < 2e-3
    assert np.ptp(run["task.panda_tcp.actual"][:, 1]) > 0.2


def test_a_preview_does_not_affect_the_run() -> None:
    stream = hsp.StreamPose()
    controller = hsp.Controller(PANDA, [hsp.FramePose("panda_tcp", stream)])
    hand = controller.stream("panda_tcp")
    hand.send(moved(hand_pose(PANDA), 0.5))
    preview, v = controller.preview(), np.zeros(7)
    for t in np.arange(0.0, 3.0, 0.01):
        preview.compute(t, PANDA.home(), v)
    run = hsp.simulate(controller, PANDA.home(), duration=1.0, control_period=PERIOD)
    there = moved(hand_pose(PANDA), 0.5).translation
    assert run["task.panda_tcp.reference"][-1, :3] == pytest.approx(there)
    assert len(hand.record) == 1


@pytest.mark.parametrize("command", ["target", "velocity", "send", "chunk"])
def test_a_command_to_a_preview_is_the_preview_s_alone(command: str) -> None:
    """It goes on with the original's messages until then, and the original with its."""
    q, v, there = PANDA.home(), np.zeros(7), moved(hand_pose(PANDA), 0.2)

    def begun() -> hsp.Controller:
        made = hsp.Controller(PANDA, [hsp.FramePose("panda_tcp", hsp.StreamPose())])
        made.compute(0.0, q, v)
        made.stream("panda_tcp").send(there)
        made.compute(PERIOD, q, v)
        return made

    def moves(made: hsp.Controller, first: int) -> list[bytes]:
        steps = range(first, first + 100)
        return [made.compute(PERIOD * k, q, v).tau.tobytes() for k in steps]

    controller, alone = begun(), begun()
    preview = controller.preview()
    preview.compute(0.0, q, v)
    aside = moved(there, -0.3)
    match command:
        case "target":
            preview.set_target("panda_tcp", aside)
        case "velocity":
            preview.set_velocity("panda_tcp", [0.1, 0, 0, 0, 0, 0])
        case "send":
            preview.stream("panda_tcp").send(aside)
        case "chunk":
            values = [pin.SE3ToXYZQUAT(aside)]
            preview.stream("panda_tcp").send_chunk(values, [0.1])
    assert moves(controller, 2) == moves(alone, 2)
    taken = preview.stream("panda_tcp").counts()["taken"]
    moves(preview, 2)
    assert preview.stream("panda_tcp").counts()["taken"] > taken
    assert len(controller.stream("panda_tcp").record) == 1


def test_the_reference_of_a_task_changes_to_a_stream_while_it_runs() -> None:
    circle = hsp.Circle(radius=0.05, angular_rate=2.0)
    controller = hsp.Controller(PANDA, [hsp.FramePosition("panda_tcp", circle)])
    stream = hsp.Stream()
    changed = every(
        0.3, lambda t: t == pytest.approx(0.3)
        and controller.at(0.3).ramp(0.4).reference("panda_tcp", stream)
    )  # fmt: skip
    run = hsp.simulate(
        controller, PANDA.home(), duration=1.5, control_period=PERIOD, on_row=changed
    )
    error = np.linalg.norm(run["task.panda_tcp.error"], axis=1)
    wanted = (1.0 + 10.0 * run.t) * np.exp(-10.0 * run.t) * 0.05  # throughout
    assert np.abs(error - wanted).max() < 5e-3
    assert np.abs(run.v[-1]).max() < 1e-3


# -- YAML -----------------------------------------------------------------------------


def config(trajectory: dict[str, Any]) -> dict[str, Any]:
    return {
        "robot": {"name": "panda"},
        "tasks": {"hand": {"type": "frame_pose", "trajectory": trajectory}},
        "null_space": {"gain": 8, "fields": [{"type": "joint_centering"}]},
        "simulation": {
            "duration": 0.6,
            "control_period": PERIOD,
            "integrator": {"type": "semi_implicit_euler", "step": PERIOD},
        },
    }


def write(folder: Path, trajectory: dict[str, Any]) -> Path:
    file = folder / "streamed.yaml"
    file.write_text(json.dumps(config(trajectory)))  # JSON is YAML
    return file


def goals(folder: Path, robot: hsp.Robot) -> Path:
    start, file = hand_pose(robot), folder / "goals.jsonl"
    lines = []
    for k in range(8):
        value = pin.SE3ToXYZQUAT(moved(start, 0.05 * k)).tolist()
        lines.append(json.dumps({"at": 0.02 + 0.05 * k, "t": 0.05 * k, "value": value}))
    file.write_text("\n".join(lines))
    return file


def test_a_recorded_file_is_followed_and_its_log_repeats_the_run(
    tmp_path: Path,
) -> None:
    goals(tmp_path, PANDA)
    trajectory = {"type": "stream", "source": "goals.jsonl", "policy": "interpolate"}
    experiment = hsp.load_experiment(write(tmp_path, trajectory))
    run = experiment.run()
    assert run["stream.hand.taken"][-1] == 8
    assert run["stream.hand.rejected"].max() == 0
    assert np.nanmax(np.abs(run["task.hand.error"])) < 1e-3
    log = run.save(tmp_path / "run.npz")
    (tmp_path / "goals.jsonl").unlink()  # the log has the received messages
    again = hsp.load_experiment(log).run()
    assert np.array_equal(run.q, again.q)
    yaml = tmp_path / "again.yaml"
    yaml.write_text(experiment.to_yaml())
    assert np.array_equal(hsp.load_experiment(yaml).run().q, run.q)


@pytest.mark.parametrize(("trajectory", "message"), [
    ({"source": "udp://:5005"}, r"yaml:1: tasks.hand.trajectory: source is .*HOST"),
    ({"source": "none.jsonl"}, r"tasks.hand.trajectory.*none.jsonl: the recording"),
    ({"policy": "newest"}, r"yaml:1: tasks.hand.trajectory.policy"),
    ({"messages": [{"at": 0.0}]}, r"message 0 of the recording: a message needs a"),
    ({"angular_speed": 9.0}, r"tasks.hand.*angular_acceleration is 20; with"),
])  # fmt: skip
def test_mistakes_name_their_place(
    tmp_path: Path, trajectory: dict[str, Any], message: str
) -> None:
    with pytest.raises(HspControlError, match=message):
        hsp.load_experiment(write(tmp_path, {"type": "stream", **trajectory}))


def test_a_log_without_all_messages_is_not_repeated(
    tmp_path: Path,
) -> None:
    goals(tmp_path, PANDA)
    trajectory = {"type": "stream", "source": "goals.jsonl"}
    run = hsp.load_experiment(write(tmp_path, trajectory)).run()
    run.meta["streams"]["hand"][0] = run.meta["streams"]["hand"][0][:3]
    log = run.save(tmp_path / "run.npz")
    with pytest.raises(
        hsp.errors.ConfigError, match="used 8 messages, and the log contains 3 of"
    ):
        hsp.load_experiment(log)


@pytest.mark.parametrize(("task", "value"), [
    ({"type": "frame_position", "frame": "panda_tcp"}, [0.3, 0.1, 0.5]),
    ({"type": "frame_orientation", "frame": "panda_tcp"}, [1.0, 0.0, 0.0, 0.0]),
    ({"type": "frame_pose", "frame": "panda_tcp"}, [0.3, 0.1, 0.5, 1, 0, 0, 0]),
])  # fmt: skip
def test_any_task_changes_to_a_stream_in_yaml(
    task: dict[str, Any], value: list[float], tmp_path: Path
) -> None:
    stream = {"type": "stream", "messages": [{"at": 0.3, "value": value}]}
    change = {"type": "reference", "task": "hand", "at": 0.2, "trajectory": stream}
    data = config({"type": "stream"}) | {"tasks": {"hand": task}, "changes": [change]}
    run = hsp.load_experiment(data).run()
    assert run["stream.hand.taken"][-1] == 1
    again = hsp.load_experiment(run.save(tmp_path / "run.npz")).run()
    assert np.array_equal(run.q, again.q)


def test_a_log_records_all_that_streams_take(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without a log nothing would be recorded here, also of a later stream."""
    monkeypatch.setattr(inbox, "BRIEF", 0)
    stream = {"type": "stream", "messages": [{"at": 0.1, "value": [0.3, 0, 0.5]}]}
    data = config({"type": "stream"})
    data["tasks"]["hand"] = {"type": "frame_position", "trajectory": stream}
    experiment = hsp.load_experiment(data)
    controller = experiment.controller
    later, rows = hsp.Stream(delay=0.05), iter(range(100))

    def lead(_: LogWriter) -> None:
        k = next(rows)
        if k == 30:
            controller.at(0.3).reference("hand", later)
        elif k > 30:
            controller.stream(later).send([0.4, 0.1, 0.5])

    run = hsp.simulate(
        controller, PANDA.home(), duration=0.6, control_period=PERIOD, on_row=lead
    )
    assert len(run.meta["streams"]["hand"][0]) == 1
    assert "streams_lost" not in run.meta
    assert run.meta["changes"][0]["trajectory"]["messages"]


def test_a_stream_moves_no_obstacle() -> None:
    with pytest.raises(hsp.errors.SceneError, match="a stream cannot move an obstacle"):
        hsp.Obstacle("ball", hsp.Sphere(0.1), hsp.Stream([0.0, 0.0, 1.0]))


def test_strict_reading_listens_to_this_computer_and_reads_beside_the_file(
    tmp_path: Path,
) -> None:
    outside = goals(tmp_path, PANDA)
    folder = tmp_path / "inside"
    folder.mkdir()
    for source, message in (
        ("udp://0.0.0.0:5005", "listens to other computers; strict reading allows"),
        ("ros2://goal?domain=1", "listens to other computers; strict reading allows"),
        (str(outside), "outside the folders that strict reading allows"),
    ):
        file = write(folder, {"type": "stream", "source": source})
        with pytest.raises(AccessError, match=message):
            hsp.load_experiment(file, strict=True)
