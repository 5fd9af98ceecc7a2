"""Check that sweeps give the same bits however computed, lost or done twice."""

import json
import os
import signal
import subprocess
import sys
import time
from asyncio import CancelledError
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest
from sweep_runs import MOVING, OVER, QUICK

import hsp_control as hsp
from hsp_control.cli import main
from hsp_control.common.exceptions import (
    ConfigError,
    HspControlError,
    LogError,
    SweepError,
)
from hsp_control.companions.sweeps import Choices, Sweep, local_workers, run_task
from hsp_control.companions.sweeps.journal import SweepJournal, journal_of
from hsp_control.companions.sweeps.parquet import read_parquet
from hsp_control.simulation.journal import JournalReader, JournalWriter

pytestmark = [pytest.mark.process, pytest.mark.slow]

# Some tenths of a second each, also where kernels are not compiled.
SECONDS = 3
SLOWER = [QUICK[1], f"simulation.duration={SECONDS}"]


def same(one: Sweep, other: Sweep) -> None:
    """Assert that two sweeps have the same bits, but for how long runs took."""
    assert list(one.columns) == list(other.columns)
    assert one.meta == other.meta
    for name, column in one.columns.items():
        if name == "wall_time":
            continue
        assert column.dtype == other[name].dtype, name
        if column.dtype == object:
            assert column.tolist() == other[name].tolist()
        else:
            assert column.tobytes() == other[name].tobytes(), name


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("sweeps") / "moving.parquet"


@pytest.fixture(scope="module")
def swept(file: Path) -> Sweep:
    return hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK, out=file, workers=2)


@pytest.fixture(scope="module")
def whole() -> Sweep:
    return hsp.sweeps.sweep(MOVING, {"null_space.gain": "1:20:20"}, overrides=SLOWER)


# --- what is in it -------------------------------------------------------------------


@pytest.mark.smoke
def test_a_row_is_what_a_single_run_gives(swept: Sweep) -> None:
    row = 7
    keys = {name: swept[name][row] for name in swept.parameters}
    settings = [f"{key}={float(value)!r}" for key, value in keys.items()]
    rollout = hsp.load_experiment(MOVING, *QUICK, *settings).run()
    error = np.linalg.norm(rollout["task.tip.error"], axis=1)
    distance = rollout["distance.point_distance"]
    expected = {
        "tracking.tip.rms": np.sqrt(np.mean(error**2)),
        "tracking.tip.max": error.max(),
        "tracking.tip.end": error[-1],
        "null_space_error.max": rollout["null_space_norm"].max(),
        "manipulability.min": rollout["manipulability"].min(),
        "distance.point_distance.min": distance.min(),
        "effort.max": np.abs(rollout.tau).max(),
        "speed.max": np.abs(rollout.v).max(),
        "simulated_time": rollout.t[-1],
    }
    assert {name: swept[name][row] for name in expected} == expected
    again = hsp.load_experiment(swept.configuration(row)).run()
    np.testing.assert_array_equal(again.q, rollout.q)


def test_the_file_is_parquet_that_describes_itself(file: Path, swept: Sweep) -> None:
    table = pq.read_table(file)
    assert table.num_rows == 12
    assert table["null_space.gain"].to_pylist() == swept["null_space.gain"].tolist()
    meta = json.loads(table.schema.metadata[b"hsp_control"])
    assert meta["metrics"]["tracking.tip.rms"]["unit"] == "m"
    assert meta["identity"]["seed"] == 0
    assert not journal_of(file).exists()
    same(Sweep.load(file), swept)


def test_anything_in_the_configuration_can_vary() -> None:
    over = {
        "start.velocity": ["rest", "flow"],
        "tasks.tip.trajectory.center": [[1.0, 1.0], [1.1, 1.0]],
        "null_space.metric.type": "identity,coordinates",
    }
    found = hsp.sweeps.sweep(MOVING, over, overrides=QUICK, workers=1)
    assert found.complete
    assert found.completed.all()
    assert set(found["start.velocity"]) == {"rest", "flow"}
    assert set(found["tasks.tip.trajectory.center"]) == {"[1.0, 1.0]", "[1.1, 1.0]"}
    last = found.configuration(7)
    assert last["tasks"]["tip"]["trajectory"]["center"] == [1.1, 1.0]
    assert last["start"]["velocity"] == "flow"


def test_failures_are_rows_with_their_reason() -> None:
    over = {"null_space.gain": [10.0, -1.0, 900.0]}
    held = [*QUICK, "simulation.control_period=0.01", "simulation.check_rate=false"]
    found = hsp.sweeps.sweep(MOVING, over, overrides=held, workers=1)
    assert found["status"].tolist() == ["completed", "refused", "diverged"]
    assert "--over null_space.gain: null_space.gain" in found["message"][1]
    assert "the motion diverged" in found["message"][2]
    assert np.isnan(found["tracking.tip.rms"][1])
    assert 0.0 <= found["simulated_time"][2] < 0.1
    assert found.complete


# --- the same bits, nothing twice ----------------------------------------------------


def test_the_number_of_workers_changes_no_bit(swept: Sweep) -> None:
    same(hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK, workers=1), swept)


def sweep_command(out: Path, *more: str) -> list[str]:
    settings = [word for setting in SLOWER for word in ("--set", setting)]
    over = ["--over", "null_space.gain=1:20:20"]
    command = [sys.executable, "-m", "hsp_control", "sweep", MOVING]
    return [*command, *settings, *over, "--out", str(out), *more]


def started(out: Path, rows: int) -> "subprocess.Popen[bytes]":
    """Start a sweep and return when it has some rows, and some are left."""
    process = subprocess.Popen(
        sweep_command(out, "--workers", "1"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    journal = journal_of(out)
    until(lambda: journal.is_file() and journal.read_bytes().count(b'"row"') >= rows)
    assert process.poll() is None
    return process


def until(condition: Callable[[], bool], patience: float = 120.0) -> None:
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def finish(out: Path) -> Sweep:
    over = {"null_space.gain": "1:20:20"}
    return hsp.sweeps.sweep(MOVING, over, overrides=SLOWER, out=out, workers=1)


def test_a_killed_sweep_goes_on_where_it_was(
    tmp_path: Path, whole: Sweep, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "killed.parquet"
    process = started(out, 3)
    workers = psutil.Process(process.pid).children()
    process.kill()
    process.communicate()
    # Workers do not outlive it, though one was in the middle of a run.
    psutil.wait_procs(workers, timeout=10)
    assert not [worker for worker in workers if worker.is_running()]
    assert main(["plot", str(out)]) == 2
    assert "the same command resumes it" in capsys.readouterr().err
    journal = journal_of(out)
    read = JournalReader(journal)
    read.read()
    rows = [note["row"] for note in read.notes if "row" in note]
    with journal.open("ab") as file:  # killed in the middle of a write
        file.write(b'N\x90\x00\x00\x00....{"row": {"run": 19, "status": "compl')
    resumed = finish(out)
    same(resumed, whole)
    assert len(rows) >= 3
    assert all(resumed["wall_time"][row["run"]] == row["wall_time"] for row in rows)
    assert not journal.exists()


def test_ctrl_c_leaves_a_readable_file_and_the_same_command_ends_it(
    tmp_path: Path, whole: Sweep
) -> None:
    out = tmp_path / "stopped.parquet"
    process = started(out, 2)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 130, errors.decode()
    assert b"stopped by the user" in errors
    assert b"Traceback" not in errors
    part = Sweep.load(out)
    assert 2 <= len(part) < 20
    assert not part.complete
    resumed = finish(out)
    same(resumed, whole)
    kept = part["run"]
    assert resumed["wall_time"][kept].tobytes() == part["wall_time"].tobytes()


def test_a_run_that_kills_its_workers_is_a_row_and_tried_again_another_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Sweep
) -> None:
    ask = local_workers._ask

    def deadly(process: Any, task: str) -> str | None:
        if json.loads(task)["changes"][0]["value"] == 2:
            process.kill()
            process.wait()
        return ask(process, task)

    out = tmp_path / "crash.parquet"
    over = {"null_space.gain": [1, 2]}
    monkeypatch.setattr(local_workers, "_ask", deadly)
    found = hsp.sweeps.sweep(MOVING, over, overrides=QUICK, out=out, workers=1)
    assert found["status"].tolist() == ["completed", "crashed"]
    assert "SIGKILL" in found["message"][1]
    monkeypatch.undo()
    found = hsp.sweeps.sweep(MOVING, over, overrides=QUICK, out=out, workers=1)
    assert found["status"].tolist() == ["completed", "completed"]


def test_a_run_that_takes_too_long_is_a_row_and_tried_again_another_time(
    tmp_path: Path,
) -> None:
    endless = [  # a quarter of an hour
        "simulation.integrator={type: rk4, step: 0.0005}",
        "simulation.log_period=1",
        "simulation.duration=10000",
    ]
    out = tmp_path / "long.parquet"
    done: list[int] = []

    def note(runs: int, total: int, failures: int) -> None:
        done.append(runs)

    for _ in range(2):
        found = hsp.sweeps.sweep(
            MOVING, {"null_space.gain": [1, 2]}, overrides=endless, out=out,
            workers=1, time_limit=1.0, on_progress=note,
        )  # fmt: skip
        assert found["status"].tolist() == ["timed out", "timed out"]
        assert found["message"].tolist() == 2 * ["took longer than 1 s"]
    assert done == [0, 1, 2, 0, 1, 2]


@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan])
def test_a_time_limit_is_positive(limit: float) -> None:
    with pytest.raises(SweepError, match=r"time_limit is .* must be positive"):
        hsp.sweeps.sweep(MOVING, {"null_space.gain": [1, 2]}, time_limit=limit)


def test_a_worker_that_cannot_start_is_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(local_workers, "_MAIN", "raise SystemExit(3)")
    with pytest.raises(
        SweepError, match="cannot start: the worker exited with status 3"
    ):
        hsp.sweeps.sweep(MOVING, {"null_space.gain": [1, 2]}, overrides=QUICK)


# --- files of others -----------------------------------------------------------------


def test_another_sweep_is_not_overwritten(file: Path, swept: Sweep) -> None:
    before = file.read_bytes()
    with pytest.raises(SweepError, match=r"configuration.simulation.duration is 0.1"):
        hsp.sweeps.sweep(MOVING, OVER, overrides=["simulation.duration=0.2"], out=file)
    other = {**OVER, "null_space.gain": [1.0, 2.0]}
    with pytest.raises(SweepError, match="contains another sweep: its factors"):
        hsp.sweeps.sweep(MOVING, other, overrides=QUICK, out=file)
    assert file.read_bytes() == before
    assert not journal_of(file).exists()


def test_a_urdf_that_changed_is_another_sweep(tmp_path: Path) -> None:
    source = hsp.Robot.load("planar3r").source
    urdf = tmp_path / "arm.urdf"
    text = source.urdf.read_text()
    urdf.write_text(text)
    config = {
        "robot": {"name": str(urdf)},
        "start": {"joints": [0.3, 0.4, 0.5]},
        "tasks": {"tip": {"type": "frame_position", "axes": "xy", "frame": "tip",
                          "trajectory": {"type": "hold"}, "gains": {"kp": 9, "kv": 6}}},
        "simulation": {"duration": 0.02, "log_period": 0.01},
    }  # fmt: skip
    out, over = tmp_path / "arm.parquet", {"null_space.gain": [1.0, 2.0]}
    hsp.sweeps.sweep(config, over, out=out, workers=1)
    urdf.write_text(text.replace('mass value="1', 'mass value="2'))
    assert urdf.read_text() != text
    with pytest.raises(SweepError, match="the model of its robot is different"):
        hsp.sweeps.sweep(config, over, out=out, workers=1)
    hsp.sweeps.sweep(config, over, out=out, workers=1, fresh=True)


def test_one_process_at_a_time(tmp_path: Path) -> None:
    out = tmp_path / "one.parquet"
    journal = SweepJournal(journal_of(out), fresh=False)
    try:
        with pytest.raises(LogError, match="this program writes it already"):
            hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK, out=out)
    finally:
        journal.remove()


@pytest.mark.parametrize("content", [b"nonsense", b"PAR1", b""])
def test_files_that_are_no_sweep_are_refused(tmp_path: Path, content: bytes) -> None:
    out = tmp_path / "x.parquet"
    out.write_bytes(content)
    with pytest.raises(SweepError, match="not a complete Parquet file"):
        hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK, out=out)
    assert out.read_bytes() == content
    assert not journal_of(out).exists()
    journal_of(out).write_bytes(b"mine\n")
    JournalWriter(tmp_path / "run").write_heading({"t": ()}, {"format": "hsp"})
    for there, error, message in (
        (b"mine\n", LogError, "is no journal"),
        ((tmp_path / "run").read_bytes(), SweepError, "the journal of a run"),
    ):
        journal_of(out).write_bytes(there)
        for fresh in (False, True):
            with pytest.raises(error, match=message):
                hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK, out=out, fresh=fresh)
        assert journal_of(out).read_bytes() == there


def test_another_program_s_parquet_is_refused(tmp_path: Path) -> None:
    import pyarrow as pa

    pq.write_table(pa.table({"a": [1]}), tmp_path / "a.parquet")
    with pytest.raises(SweepError, match="but not a sweep"):
        Sweep.load(tmp_path / "a.parquet")
    with pytest.raises(SweepError, match=r"no such file; did you mean 'a.parquet'\?"):
        Sweep.load(tmp_path / "b.parquet")


def test_a_bad_key_is_found_before_any_worker_is_asked() -> None:
    with pytest.raises(ConfigError, match=r"null_space.gian"):
        hsp.sweeps.sweep(MOVING, {"null_space.gian": [1]})
    with pytest.raises(HspControlError, match="'x': needs the form key=value"):
        hsp.sweeps.sweep(MOVING, OVER, overrides=["x"])
    assert Choices((1,)).levels() == (1,)


@pytest.mark.parametrize(
    "error", [ValueError("mine"), CancelledError(), GeneratorExit()], ids=repr
)
def test_whatever_raises_in_the_parent_leaves_the_journal_free(
    error: BaseException, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the main thread, or in one that serves a worker: nothing waits for ever."""
    out = tmp_path / "x.parquet"

    def fail(*_: object) -> None:
        raise error

    def raises(**options: Any) -> None:
        with pytest.raises(type(error)):
            hsp.sweeps.sweep(
                MOVING, OVER, out=out, workers=1, overrides=QUICK, **options
            )

    raises(on_progress=fail)
    with monkeypatch.context() as patch:
        patch.setattr(local_workers, "_ask", fail)
        raises()
    with monkeypatch.context() as patch:
        patch.setattr(Sweep, "save", fail)
        patch.setattr("hsp_control.companions.sweeps.sweep_runs._run_pending", fail)
        raises()
    writer = JournalWriter(journal_of(out))
    writer.close()


def test_what_is_no_exception_is_a_row() -> None:
    for error in (CancelledError("x"), GeneratorExit(), SystemExit(3)):
        with pytest.MonkeyPatch.context() as patch:

            def fail(*_: object, error: BaseException = error) -> None:
                raise error

            patch.setattr(run_task, "_run", fail)
            row, _ = run_task.read_result(0, run_task.run_task("{}"))
        assert row.status == "failed"
        assert row.message.startswith(type(error).__name__)


@pytest.mark.parametrize("kind", ["fifo", "device"])
def test_what_never_ends_is_no_table(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    if kind == "fifo":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero")
    with pytest.raises(SweepError, match="a device or a pipe"):
        read_parquet(path)
