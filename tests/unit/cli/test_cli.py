"""The command line as a user types it: output, exit status, one message per error."""

import _thread
import json
import os
import re
import signal
import threading
import time
from collections.abc import Callable
from importlib import metadata
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from places import ON_MUJOCO
from robot_texts import link, robot_xml
from wording import wording

import hsp_control as hsp
from hsp_control import NullSpaceField, Rollout, __version__, load_experiment
from hsp_control.cli import doctor, main, options, robot_table, stopwatch
from hsp_control.cli.check import _where_exact, advice_of_run, start_advice
from hsp_control.cli.interrupts import DeferredInterrupt

MOVING = "paper/4_moving_obstacle"
SHORT = ["--set", "simulation.duration=0.1"]
LOG = "4_moving_obstacle-simulation.duration=0.1.npz"


def test_run_leaves_a_log_that_numpy_alone_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", MOVING, "--out", str(tmp_path), *SHORT]) == 0
    log = tmp_path / LOG
    assert f"Log: {log}" in capsys.readouterr().out
    with np.load(log, allow_pickle=False) as columns:
        assert {"t", "q", "v", "tau"} <= set(columns.files)
        assert columns["t"].shape == (11,)
        meta = json.loads(str(columns["meta"]))
    assert meta["config"]["simulation"]["duration"] == 0.1
    assert meta["columns"]["tau"]["unit"] == "N·m"


def test_run_reports_its_result_as_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The columns are named as in a sweep; the output agrees with the log."""
    arguments = ["run", MOVING, "--out", str(tmp_path), "--json", *SHORT]
    assert main(arguments) == 0
    report = json.loads(capsys.readouterr().out)
    rollout = Rollout.load(report["log"])
    assert (report["status"], report["rows"]) == ("completed", 11)
    assert report["effort.max"] == np.abs(rollout.tau).max()
    assert report["null_space_error.end"] == rollout["null_space_norm"][-1]
    error = np.linalg.norm(rollout["task.tip.error"], axis=1)
    assert report["tracking.tip.max"] == pytest.approx(error.max(), rel=1e-12)


def test_an_exit_of_a_users_code_is_a_failure(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    request: pytest.FixtureRequest,
) -> None:
    members = NullSpaceField.family.members
    request.addfinalizer(lambda: members.pop("leaves", None))
    own = tmp_path / "leaves.py"
    own.write_text(
        "import sys, hsp_control as hsp\n"
        "class Leaves(hsp.Cost, type='leaves'):\n"
        "    def value(self, state):\n"
        "        return sys.exit(0) if state.t > 0.05 else 0.0 * state.q[0]\n"
    )
    fields = "null_space.fields=[{type: leaves}]"
    arguments = ["--import", str(own), "--out", str(tmp_path), "--set", fields]
    assert main(["run", MOVING, *arguments, *SHORT]) == 2
    assert "SystemExit(0)" in capsys.readouterr().err


def test_check_describes_a_configuration_as_json(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["check", MOVING, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["robot"] == {"name": "planar3r", "nq": 6, "nv": 3}
    assert (report["tasks"]["tip"]["type"], report["tasks"]["tip"]["rows"]) == (
        "FramePosition",
        2,
    )
    assert report["null_space"]["degrees_of_freedom"] == 1
    assert len(report["singular_values"]) == 2
    assert report["advice"] == []
    assert report["limits"] == "none"


def test_a_log_is_not_replaced_by_its_repetition(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The configuration may be a robot's default one; other overrides are in the
    name."""
    run = ["run", "--out", str(tmp_path), "--json"]
    assert main([*run, MOVING, *SHORT]) == 0
    log = tmp_path / LOG
    before = log.read_bytes()
    capsys.readouterr()
    shown = ["--set", "title=Once more", "--set", "view.speed=2"]
    assert main([*run, str(log), *shown]) == 0
    report = json.loads(capsys.readouterr().out)
    again = tmp_path / "4_moving_obstacle-simulation.duration=0.1-again.npz"
    assert report["log"] == str(again)
    setting = f"description={'x' * 200}", f"tasks.tip.gains={{kp: 100, kv: {20:0130d}}}"
    long = [word for each in setting for word in ("--set", each)]
    assert main([*run, str(log), *long]) == 0
    name = Path(json.loads(capsys.readouterr().out)["log"]).name
    assert re.fullmatch(
        r"4_.*0\.1-tasks\.tip\.gains=.kp:_100-kv:_0+-[0-9a-f]{8}\.npz", name
    )
    assert log.read_bytes() == before
    elsewhere = tmp_path / "elsewhere"
    assert main([*run[:2], str(elsewhere), *run[3:], str(log)]) == 0
    assert [file.name for file in elsewhere.iterdir()] == [log.name]


@pytest.mark.parametrize(("config", "freedom"), [
    # four feet hold three rows each
    pytest.param(["whole_body/solo12_trunk"], 18 - 12 - 6, marks=ON_MUJOCO),
    ([MOVING, "--set", "start.coordinates=[0, 0, 0]"], 3 - 1),  # stretched
    ([MOVING, "--set", "tasks.tip.schedule={intervals: [[1, null]]}"], 3),
])  # fmt: skip
def test_check_reports_the_freedom_that_contacts_and_tasks_leave(
    config: list[str], freedom: int, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", "--json", *config]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["null_space"]["degrees_of_freedom"] == freedom


def test_the_summary_reports_a_target_out_of_reach(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A planar arm of 3 m, and a target at 4 m."""
    config = tmp_path / "far.yaml"
    config.write_text(
        "robot: {name: planar3r}\n"
        "start: {joints: {joint1: 0.1, joint2: 0.4, joint3: 0.4}}\n"
        "tasks: {tip: {type: frame_position, axes: xy, trajectory: "
        "{type: hold, point: [4, 0]}}}\n"
        "simulation: {duration: 4, control_period: 0.002}\n"
    )
    assert main(["run", str(config), "--out", str(tmp_path)]) == 0
    report = capsys.readouterr().out
    assert re.search(r"\d+ rows: target out of reach, 1\.\d\d m at the end", report)


@pytest.mark.parametrize(("hand", "report"), [
    (
        "{type: frame_position, trajectory: "
        "{type: line, origin: world, start: [0.4, 0, 0.5], end: [1.6, 0, 0.5], "
        "duration: 2}}",
        "... task 'hand': ... out of reach by 0. ... from t = 0. ... most at 2",
    ),
    (
        "{type: frame_pose, trajectory: {type: composed, position: "
        "{type: hold, point: [0.8, 0, 0.3]}, orientation: "
        "{type: hold, rotation: [0, -2, 0]}}}",
        "... task 'hand': ... cannot be reached in its orientation",
    ),
    (
        # 39 turns: equidistant samples would all be near the start, within reach
        "{type: frame_position, trajectory: {type: circle, center: [-1.1, 0, 0.5], "
        "radius: 1.5, angular_rate: 122.52211349000193}}",
        "... task 'hand': ... out of reach",
    ),
    (
        "{type: frame_pose, trajectory: "
        "{type: circle, radius: 0.1, angular_rate: 1}}",
        None,
    ),
])  # fmt: skip
def test_check_reports_targets_out_of_reach_before_the_run(
    hand: str, report: str | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The report has distance and time, or says that only the orientation fails."""
    config = tmp_path / "far.yaml"
    config.write_text(
        f"robot: {{name: panda}}\ntasks: {{hand: {hand}}}\n"
        "simulation: {duration: 2, control_period: 0.001}\n"
    )
    assert main(["check", str(config)]) == 0
    warned = capsys.readouterr().err
    assert (
        ("reach" not in warned)
        if report is None
        else re.search(wording(report), warned)
    )


def test_check_reports_references_too_fast_for_joints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "fast.yaml"
    config.write_text(
        "robot: {name: panda}\ntasks: {hand: {type: frame_pose, trajectory: "
        "{type: along, speed: 4, path: {type: circle, radius: 0.1, angular_rate: 1}}"
        "}}\n"
        "simulation: {duration: 2, control_period: 0.001}\n"
    )
    assert main(["check", str(config)]) == 0
    report = r"task 'hand': its reference moves at 4 m/s at t = .* 'panda_joint\d'"
    assert re.search(report, capsys.readouterr().err)


@pytest.mark.parametrize(("config", "tasks", "report"), [
    (  # three links of 1 m each
        MOVING,
        "{tip: {type: frame_position, axes: x, trajectory: "
        "{type: line, origin: world, start: [1], end: [5], duration: 2}}}",
        r"reach by 2 m, from t = 1\.0\d s, most at 2 s",
    ),
    (
        MOVING,
        "{tip: {type: frame_position, axes: yx, trajectory: "
        "{type: hold, point: [0, 4]}}}",
        "reach by 1 m, at the start",
    ),
    pytest.param(  # the feet stay in place
        "whole_body/talos_circle",
        "{hand: {type: frame_position, frame: gripper_right_base_link, trajectory: "
        "{type: hold, point: [4, 0, 1]}}}",
        r"reach by 2(\.\d)? m, at the start",
        marks=ON_MUJOCO,
    ),
    pytest.param(
        "whole_body/talos_circle",
        "{hand: {type: frame_position, frame: gripper_right_base_link, trajectory: "
        "{type: hold, origin: start, point: [0.2, 0, 0]}}}",
        None,
        marks=ON_MUJOCO,
    ),
])  # fmt: skip
def test_check_reports_targets_along_some_axes_and_of_hands_on_legs(
    config: str, tasks: str, report: str | None, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--set", f"tasks={tasks}", "--set", "simulation.duration=2"]
    assert main(["check", config, *options]) == 0
    warned = capsys.readouterr().err
    assert ("reach" not in warned) if report is None else re.search(report, warned)


def test_check_looks_to_the_end_of_a_run_that_begins_late(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The target leaves the reach of 3 m at 1 s, when the run begins."""
    tip = (
        "tasks.tip={type: frame_position, axes: x, trajectory: {type: line, "
        "origin: world, start: [1], end: [5], duration: 2}}"
    )
    late = ["--set", "simulation.start_time=1", "--set", "simulation.duration=1"]
    assert main(["check", MOVING, "--set", tip, *late]) == 0
    assert "reach by 2 m, from t = 1" in (warned := capsys.readouterr().err)
    assert "most at 2 s" in warned


def test_check_warns_of_motors_that_cannot_hold_the_robot(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """At the start of this run gravity requires 23 N·m at joint 2."""
    assert main(["check", "panda_obstacle"]) == 0
    assert "none binds at the start" in capsys.readouterr().out
    weak = ["--set", "limits={effort: {joints: {panda_joint2: 20}}}"]
    assert main(["check", "panda_obstacle", *weak]) == 0
    text = capsys.readouterr().out
    assert "bind at the start: the law is not exact there" in text
    (line,) = [line for line in text.splitlines() if "cannot hold" in line]
    report = "At the start joint 'panda_joint2' ... 23.2 N·m ... 20"
    assert re.search(wording(report), line)
    assert main(["check", "panda_obstacle", *weak, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert (report["limits"], report["advice"]) == ("limited", [line])


@pytest.mark.slow
def test_robots_lists_loadable_robots(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    every = tuple(robot_table.rows())  # loads all of them, once
    monkeypatch.setattr(robot_table, "rows", lambda: iter(every))
    assert main(["robots"]) == 0
    rows = capsys.readouterr().out.splitlines()
    assert max(map(len, rows)) <= 80
    (planar,) = [row for row in rows if row.startswith("planar3r ")]
    assert planar.split() == ["planar3r", "3", "tip", "2", "+", "1", "-"]
    (bravo,) = [k for k, row in enumerate(rows) if row.startswith("bravo7_gripper ")]
    assert "no mass" in rows[bravo + 1]
    assert main(["robots", "--json"]) == 0
    found = {row["name"]: row for row in json.loads(capsys.readouterr().out)}
    assert found["planar3r"]["nv"] == 3
    assert main(["robots", "iiwa14"]) == 0
    assert "iiwa_joint_7" in capsys.readouterr().out


def test_doctor_lists_missing_parts_of_this_machine(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    assert main(["doctor", "--json"]) == 0
    found = {each["topic"]: each for each in json.loads(capsys.readouterr().out)}
    assert found["BLAS threads"]["state"] == "note"
    assert found["extra mujoco"]["state"] == "ok"
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "1")
    monkeypatch.setattr(doctor.metadata, "version", versions_without("pyarrow"))
    assert main(["doctor"]) == 0
    text = capsys.readouterr().out
    assert "not installed: pyarrow" in text
    assert "pip install 'hsp_control[sweeps]'" in text
    assert "not set" not in text


def test_doctor_reports_an_installation_of_another_version(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    version = metadata.version
    for installed, report in (
        (__version__, ("ok", __version__)),
        ("0.0.1", ("note", f"{__version__}, installed as 0.0.1")),
    ):

        def found(name: str, installed: str = installed) -> str:
            return installed if name == "hsp_control" else version(name)

        monkeypatch.setattr(doctor.metadata, "version", found)
        assert main(["doctor", "--json"]) == 0
        checks = {each["topic"]: each for each in json.loads(capsys.readouterr().out)}
        ours = checks["hsp_control"]
        assert (ours["state"], ours["found"]) == report


def versions_without(package: str) -> Callable[[str], str]:
    version = metadata.version

    def found(name: str) -> str:
        if name == package:
            raise metadata.PackageNotFoundError(name)
        return version(name)

    return found


@pytest.mark.parametrize(("typed", "message"), [
    (["rnu"], "there is no command 'rnu'; did you mean 'run'?"),
    (
        ["run", MOVING, "--jsno"],
        "there is no '--jsno' here; did you mean '--json'?",
    ),
    (["check", MOVING, "twice"], "'twice' is one argument too many"),
    (["run", MOVING, "a=1"], "one argument too many; did you mean --set a=1?"),
    # Not parsed as --strict.
    (["run", MOVING, "--st", "a=1"], "no '--st' here; did you mean '--set'?"),
])  # fmt: skip
def test_typing_errors_get_a_suggestion(
    typed: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(typed)
    assert ended.value.code == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(("arguments", "message"), [
    (["run", "paper/4_moving"], "did you mean 'paper/4_moving_obstacle'?"),
    (["run", "nowhere.yaml"], "hsp: nowhere.yaml: no such file"),
    (["check", MOVING, "--set", "tasks.tip.frame=tpi"], "did you mean 'tip'?"),
    (["check", MOVING, "--set", "nonsense"], "--set nonsense"),
    (["robots", "pand"], "did you mean 'panda'?"),
    (["run", MOVING, *SHORT, "--out", "/proc/nowhere"], "hsp: /proc/nowhere"),
])  # fmt: skip
def test_each_mistake_gets_one_message_and_status_2(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.startswith("hsp: ")
    assert "Traceback" not in captured.err


def test_a_library_that_a_slim_system_lacks_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def lacks(library: str, reason: str) -> None:
        def load(_: object) -> int:
            raise ImportError(f"{library}: {reason}")

        monkeypatch.setattr("hsp_control.cli.check.check", load)

    reason = "cannot open shared object file: No such file or directory"
    lacks("libgomp.so.1", reason)
    assert main(["check", MOVING]) == 2
    report = "hsp: libgomp.so.1 ... libgomp1 (Debian ... libgomp"
    assert re.search(wording(report), capsys.readouterr().err)
    lacks("libother.so", reason)
    assert main(["check", MOVING]) == 2
    assert "libother.so is missing on this system" in capsys.readouterr().err
    lacks("no module", "a mistake of ours")
    with pytest.raises(ImportError, match="a mistake of ours"):
        main(["check", MOVING])


@pytest.mark.slow
def test_a_diverging_run_keeps_its_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wild = ["--set", "simulation.control_period=0.01", "--set", "null_space.gain=900"]
    assert main(["run", MOVING, "--out", str(tmp_path), *wild]) == 2
    assert "unstable at this rate: K_N times the period is 9" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
    wild += ["--set", "simulation.check_rate=false"]
    wild += ["--set", "simulation.integrator={type: rk4, step: 0.01}"]
    assert main(["run", MOVING, "--out", str(tmp_path), *wild]) == 2
    assert "diverged" in capsys.readouterr().err
    (log,) = tmp_path.iterdir()
    with np.load(log, allow_pickle=False) as columns:
        assert len(columns["t"]) > 1
        assert json.loads(str(columns["meta"]))["status"] == "diverged"


def test_ctrl_c_keeps_computed_rows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    check, rows = DeferredInterrupt.check, iter(range(1000))

    def pressed_at_the_tenth_row(self: DeferredInterrupt) -> None:
        if next(rows) == 10:
            os.kill(os.getpid(), signal.SIGINT)
        check(self)

    monkeypatch.setattr(DeferredInterrupt, "check", pressed_at_the_tenth_row)
    long = ["--set", "simulation.duration=10000", "--set", "simulation.log_period=0.1"]
    assert main(["run", MOVING, "--out", str(tmp_path), *long]) == 130
    assert "stopped by the user at t = " in capsys.readouterr().err
    log = Rollout.load(next(tmp_path.glob("*.npz")))
    assert log.status == "interrupted"
    assert 9 <= len(log) <= 12


@pytest.mark.slow
def test_ctrl_c_does_not_wait_for_a_row_that_never_comes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def press() -> None:
        while not isinstance(
            getattr(signal.getsignal(signal.SIGINT), "__self__", None),
            DeferredInterrupt,
        ):
            time.sleep(0.01)
        time.sleep(0.3)
        _thread.interrupt_main()

    threading.Thread(target=press, daemon=True).start()
    for_ever = [
        "--set",
        "simulation.duration=1e4",
        "--set",
        "simulation.log_period=1e4",
    ]
    assert main(["run", MOVING, "--out", str(tmp_path), *for_ever]) == 130
    assert "stopped by the user at t = 0 s" in capsys.readouterr().err
    log = Rollout.load(next(tmp_path.glob("*.npz")))
    assert log.status == "interrupted"
    assert len(log) == 1


def test_help_is_printed_without_a_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    assert "COMMAND" in capsys.readouterr().out


def test_the_advice_after_a_run_is_about_its_start() -> None:
    """A stretched arm is singular; where the run ended is another question."""
    stretched = load_experiment(MOVING, "start.coordinates=[0, 0, 0]")
    begins = np.array([[1.0, 0.0], [1.0, 0.5]])
    advice = [
        list(advice_of_run(stretched, Rollout({"singular_values": values}, {})))
        for values in (begins, begins[::-1])
    ]
    assert advice[0][0].startswith("The tasks tip are singular at the start")
    assert advice[1] == []


def test_a_package_whose_command_is_broken_stops_no_other(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = EntryPoint("fly", "no_such_package.command:FLY", "hsp_control.commands")
    monkeypatch.setattr(options, "entry_points", lambda group: {"fly": broken})
    assert main(["schema"]) == 0
    report = "hsp: 'fly' cannot be imported from no_such_package.command:FLY: No module"
    assert report in capsys.readouterr().err


POINTING = hsp.Pointing("tool0", direction=[1.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("task", "better"), [(hsp.FramePose("tool0"), True), (POINTING, False)]
)
def test_a_better_start_is_searched_for_poses(task: hsp.Task, better: bool) -> None:
    straight = hsp.simulation.InitialState(configuration=[0.0] * 6)
    made = hsp.Experiment("ur5", [task], start=straight)
    lines = [*start_advice(made, "hand")]
    assert lines[0].startswith("The tasks hand are singular at the start")
    assert ("A better start (smallest singular value" in "\n".join(lines)) == better
    assert "inf" not in "\n".join(lines)


def test_the_speed_of_a_run_is_its_time_over_the_wall_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """From the first row on."""
    clock = iter([10.0, 10.5, 12.0])
    monkeypatch.setattr(stopwatch, "perf_counter", lambda: next(clock))
    watch = stopwatch.Stopwatch()
    for _ in range(3):
        watch.lap()
    assert watch.table_rows(Rollout({"t": np.array([1.0, 2.0, 9.0])}, {})) == [
        ("speed", "4 times real time (8 s in 2 s, logging included)"),
        ("log", "8 bytes per row, 2.4e-05 MB in memory"),
    ]


def test_check_prints_the_change_of_an_effort_in_a_millisecond(
    capsys: pytest.CaptureFixture[str],
) -> None:
    limits = load_experiment("panda_limits").controller.limits
    assert limits is not None
    (rate,) = set(limits.effort_rate)
    assert main(["check", "panda_limits"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert f"at most {1e-3 * rate:.2g} N·m or N in 1 ms" in text


def test_a_robot_s_limits_are_in_the_columns_of_their_names(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Those of the last joint of a Panda: 2.8973 rad, 2.61 rad/s, 12 N·m."""
    assert main(["robots", "panda"]) == 0
    lines = capsys.readouterr().out.splitlines()
    (heading,) = (line for line in lines if line.startswith("dof "))
    assert heading.split()[1:] == [
        "lower",
        "upper",
        "speed",
        "limit",
        "effort",
        "limit",
    ]
    (last,) = (line for line in lines if line.startswith("panda_joint7 "))
    assert last.split()[1:] == ["-2.897", "2.897", "2.61", "12"]


def test_doctor_marks_what_does_not_work_and_notes_the_rest(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    checks = [
        doctor.Check("good", "ok", "fine"),
        doctor.Check("slow", "note", "late", "hurry"),
        doctor.Check("broken", "bad", "gone"),
    ]
    for name in ("_versions", "_companions", "_real_time", "_extras"):
        monkeypatch.setattr(doctor, name, list)
    monkeypatch.setattr(doctor, "_dynamics", lambda: checks[0])
    monkeypatch.setattr(doctor, "_threads", lambda: checks[1])
    assert main(["doctor"]) == 0
    monkeypatch.setattr(doctor, "_extras", lambda: checks[2:])
    assert main(["doctor"]) == 2
    *_, good, slow, advice, broken = capsys.readouterr().out.splitlines()
    assert [line[:2] for line in (good, slow, advice, broken)] == [
        "  ",
        "- ",
        "  ",
        "! ",
    ]
    assert [good.split(), slow.split(), advice.split(), broken.split()] == [
        ["good", "fine"], ["-", "slow", "late"], ["hurry"], ["!", "broken", "gone"],
    ]  # fmt: skip


@pytest.mark.parametrize(("openblas", "omp", "found"), [
    ("1", None, "1"),
    ("1", "8", "1"),
    (None, "1", "1"),
    ("0", "1", "1"),
    ("8", "1", "OPENBLAS_NUM_THREADS=8, OMP_NUM_THREADS=1"),
    (None, "8", "OMP_NUM_THREADS=8"),
])  # fmt: skip
def test_doctor_reports_the_threads_that_openblas_starts(
    openblas: str | None,
    omp: str | None,
    found: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its own variable comes before that of OpenMP."""
    given = {"OPENBLAS_NUM_THREADS": openblas, "OMP_NUM_THREADS": omp}
    for name, value in given.items():
        monkeypatch.delenv(name, raising=False)
        if value is not None:
            monkeypatch.setenv(name, value)
    check = doctor._threads()
    assert (check.state, check.found) == ("ok" if found == "1" else "note", found)


@pytest.mark.parametrize(
    ("most", "user", "state"),
    [((0, 99), 1000, "note"), ((20, 99), 1000, "ok"), ((0, 0), 0, "ok")],
)
def test_doctor_asks_for_the_priority_that_is_permitted_now(
    most: tuple[int, int], user: int, state: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The soft limit: the hard one is only how far it could be raised."""
    monkeypatch.setattr(doctor.resource, "getrlimit", lambda _: most)
    monkeypatch.setattr(doctor.os, "geteuid", lambda: user)
    monkeypatch.setattr(doctor.platform, "system", lambda: "Linux")
    found = {each.topic: each.state for each in doctor._real_time()}
    assert found["real-time rights"] == state


def test_the_unit_of_the_largest_effort_is_that_of_its_joint(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A lift carries the weight of 4 kg; the plate on it turns about the vertical."""
    limit = '<limit lower="-1" upper="1" effort="90" velocity="1"/>'
    joints = [
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><axis xyz="0 0 1"/>{limit}</joint>'
        for name, kind, parent, child in (
            ("lift", "prismatic", "base", "column"),
            ("turn", "revolute", "column", "plate"),
        )
    ]
    urdf, config = tmp_path / "lift.urdf", tmp_path / "lift.yaml"
    links = [link(name) for name in ("base", "column", "plate")]
    urdf.write_text(robot_xml(*links, *joints))
    config.write_text(f"robot: {{name: {urdf}}}\ntasks: {{q: {{type: joint_posture}}}}")
    assert main(["check", str(config)]) == 0
    (line,) = [
        each.split()
        for each in capsys.readouterr().out.splitlines()
        if each.startswith("largest effort")
    ]
    assert line == ["largest", "effort", "39.2", "N", "at", "the", "start"]


def test_check_prints_in_degrees_where_the_law_is_exact() -> None:
    errors = {"hand position": [0.012, "m"], "hand orientation": [0.6, "rad"]}
    words = _where_exact(
        {"errors": errors, "singular_value": 0.05, "singular_value_at_start": 0.31}
    )
    assert words.startswith("hand position below 0.012 m, hand orientation below 34°; ")
    assert words.endswith(" J is above 0.05 (0.31 at the start)")


def test_the_law_is_exact_from_twice_its_threshold_of_singular_values(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Or from a tenth of the robot's size, here 0.3, where that is more."""
    for threshold, exact in ((0.03, 0.3), (0.4, 0.8)):
        setting = f"null_space.singularity_threshold={threshold}"
        assert main(["check", MOVING, "--json", "--set", setting]) == 0
        found = json.loads(capsys.readouterr().out)["exact"]
        assert found["singular_value"] == pytest.approx(exact)
