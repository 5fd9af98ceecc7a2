"""Sweeps give the same bits in any order, and after lost or repeated runs."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from distributed import Client
from places import further
from sweep_runs import MOVING, OVER, QUICK, SCHEDULER, WORKER, open_port

import hsp_control as hsp
from hsp_control.common.errors import ConfigError, HspControlError, SweepError
from hsp_control.companions.sweeps import Sweep, cluster, row_files, sweep_runs
from hsp_control.companions.sweeps.one_run import Row, computed
from hsp_control.companions.sweeps.row_files import RowFiles, read_rows

# A tenth of a second each, or more.
SECONDS = 1.5
SLOWER = [QUICK[1], f"simulation.duration={SECONDS}"]
GAINS = {"null_space.gain": "1:20:8"}
RUNS = 8


def same(one: Sweep, other: Sweep) -> None:
    """Assert that two sweeps have the same bits, except for the runs' durations."""
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
def whole(scheduler: str) -> Sweep:
    return hsp.sweeps.sweep(MOVING, GAINS, overrides=SLOWER, scheduler=scheduler)


# --- contents ------------------------------------------------------------------------


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.smoke
def test_a_row_equals_a_single_run(swept: Sweep) -> None:
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


@pytest.mark.process
@pytest.mark.slow
def test_the_file_is_parquet_that_describes_itself(file: Path, swept: Sweep) -> None:
    (written,) = file.iterdir()
    table = pq.read_table(file)
    assert table.num_rows == 12
    assert table["null_space.gain"].to_pylist() == swept["null_space.gain"].tolist()
    meta = json.loads(table.schema.metadata[b"hsp_control"])
    assert meta["metrics"]["tracking.tip.rms"]["unit"] == "m"
    assert meta["identity"]["seed"] == 0
    same(Sweep.load(file), swept)
    same(Sweep.load(written), swept)


@pytest.mark.process
@pytest.mark.slow
def test_anything_in_the_configuration_can_vary(scheduler: str) -> None:
    over = {
        "start.velocity": ["rest", "flow"],
        "tasks.tip.trajectory.center": [[1.0, 1.0], [1.1, 1.0]],
        "null_space.metric.type": "identity,coordinates",
    }
    found = hsp.sweeps.sweep(MOVING, over, overrides=QUICK, scheduler=scheduler)
    assert found.complete
    assert found.completed.all()
    assert set(found["start.velocity"]) == {"rest", "flow"}
    assert set(found["tasks.tip.trajectory.center"]) == {"[1.0, 1.0]", "[1.1, 1.0]"}
    last = found.configuration(7)
    assert last["tasks"]["tip"]["trajectory"]["center"] == [1.1, 1.0]
    assert last["start"]["velocity"] == "flow"


@pytest.mark.process
@pytest.mark.slow
def test_failures_are_rows_with_their_reason(scheduler: str) -> None:
    over = {"null_space.gain": [10.0, -1.0, 900.0]}
    held = [*QUICK, "simulation.control_period=0.01", "simulation.check_rate=false"]
    found = hsp.sweeps.sweep(MOVING, over, overrides=held, scheduler=scheduler)
    assert found["status"].tolist() == ["completed", "refused", "diverged"]
    assert "--over null_space.gain: null_space.gain" in found["message"][1]
    assert "the motion diverged" in found["message"][2]
    assert np.isnan(found["tracking.tip.rms"][1])
    assert 0.0 <= found["simulated_time"][2] < 0.1
    assert found.complete


# --- the same bits, nothing twice ----------------------------------------------------


@pytest.mark.process
@pytest.mark.slow
def test_neither_workers_nor_a_cluster_change_a_bit(
    swept: Sweep, scheduler: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sweep_runs, "AT_ONCE", 5)  # of twelve
    same(hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK, scheduler=scheduler), swept)
    with Client(scheduler, set_as_default=False) as client:
        same(hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK, scheduler=client), swept)
        assert client.status == "running"  # its owner closes it


def sweep_command(out: Path) -> list[str]:
    settings = [word for setting in SLOWER for word in ("--set", setting)]
    over = ["--over", f"null_space.gain={GAINS['null_space.gain']}"]
    command = [sys.executable, "-c", EACH_ROW_AT_ONCE, "sweep", MOVING]
    return [*command, *settings, *over, "--out", str(out), "--workers", "1"]


EACH_ROW_AT_ONCE = """
from hsp_control.cli import main
from hsp_control.companions.sweeps import row_files
row_files.SECONDS = 0.0
raise SystemExit(main())
"""


def started(out: Path, rows: int) -> "subprocess.Popen[bytes]":
    """Start a sweep and return when it has written some, but not all rows."""
    process = subprocess.Popen(
        sweep_command(out), stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    until(lambda: len(list(out.glob("rows-*.parquet"))) >= rows)
    assert process.poll() is None
    return process


def until(condition: Callable[[], bool], patience: float = 120.0) -> None:
    deadline = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def finish(out: Path, kept: Sweep, whole: Sweep, scheduler: str) -> None:
    """The same command computes only the missing runs."""
    assert 2 <= len(kept) < RUNS
    assert not kept.complete
    ended = hsp.sweeps.sweep(
        MOVING, GAINS, overrides=SLOWER, out=out, scheduler=scheduler
    )
    same(ended, whole)
    again = ended["wall_time"][kept["run"]]
    assert again.tobytes() == kept["wall_time"].tobytes()


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.parametrize("rows", further(3))
def test_a_killed_sweep_goes_on_where_it_was(
    rows: int, tmp_path: Path, whole: Sweep, scheduler: str
) -> None:
    out = tmp_path / "killed.parquet"
    process = started(out, rows)
    workers = psutil.Process(process.pid).children(recursive=True)
    assert len(workers) >= 2  # the nanny and its worker
    process.kill()
    process.communicate()
    # They do not outlive it, though one was busy with a run.
    _, alive = psutil.wait_procs(workers, timeout=100)
    assert not alive
    kept = Sweep.load(out)
    (out / ".rows-000099.parquet.part").write_bytes(b"PAR1")  # killed while writing
    finish(out, kept, whole, scheduler)


@pytest.mark.process
@pytest.mark.slow
def test_ctrl_c_keeps_the_rows_and_the_same_command_ends_it(
    tmp_path: Path, whole: Sweep, scheduler: str
) -> None:
    out = tmp_path / "stopped.parquet"
    process = started(out, 2)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=200)
    assert process.returncode == 130, errors.decode()
    assert b"stopped by the user" in errors
    assert b"Traceback" not in errors
    assert len(list(out.iterdir())) == 1  # few files replace many
    finish(out, Sweep.load(out), whole, scheduler)


@pytest.mark.process
@pytest.mark.slow
def test_a_dead_scheduler_keeps_the_rows_and_the_same_command_ends_it(
    tmp_path: Path, whole: Sweep, scheduler: str
) -> None:
    out = tmp_path / "dead.parquet"
    with open_port() as port:
        address = f"tcp://127.0.0.1:{port}"
    dying, worker = (
        subprocess.Popen(
            [sys.executable, "-P", "-m", *command], stderr=subprocess.DEVNULL
        )
        for command in ([*SCHEDULER, "--port", str(port)], [*WORKER, address])
    )

    def kill(done: int, total: int, failures: int) -> None:
        if done == 2:
            dying.kill()

    with pytest.raises(SweepError, match="the scheduler does not answer any more"):
        hsp.sweeps.sweep(
            MOVING, GAINS, overrides=SLOWER, out=out, scheduler=address,
            on_progress=kill,
        )  # fmt: skip
    worker.kill()
    dying.wait()
    worker.wait()
    finish(out, Sweep.load(out), whole, scheduler)


def running(word: str, parent: psutil.Process) -> list[psutil.Process]:
    """Return the running child processes with a word in their command."""
    found = []
    for child in parent.children():
        with suppress(psutil.NoSuchProcess):  # zombies are excluded
            if word in " ".join(child.cmdline()):
                found.append(child)
    return found


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.parametrize("after", further((2, 6)))
def test_a_killed_worker_is_replaced(after: tuple[int, int], whole: Sweep) -> None:
    killed: list[int] = []

    def kill(done: int, total: int, failures: int) -> None:
        """Kill the worker after the first rows."""
        if done in after:
            (nanny,) = running("--nworkers", psutil.Process())
            each = running("spawn_main", nanny)
            each[-1].kill()
            killed.append(done)

    found = hsp.sweeps.sweep(
        MOVING, GAINS, overrides=SLOWER, workers=1, on_progress=kill
    )
    assert killed == [*after]
    same(found, whole)


DEADLY = """
import os
import shutil
import hsp_control as hsp

class Deadly(hsp.Cost, type="deadly"):
    \"\"\"Ends its process at some strength.\"\"\"
    strength: float
    \"\"\"At two [-].\"\"\"
    def value(self, state):
        if self.strength == 2.0 and os.environ.get("HSP_TEST_DEADLY"):
            os._exit(9)
        return self.strength * float(state.q @ state.q)
"""


@pytest.mark.process
@pytest.mark.slow
def test_a_run_that_kills_three_workers_is_a_row_and_tried_again_another_time(
    tmp_path: Path,
    scheduler: str,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
) -> None:
    members = hsp.NullSpaceField.family.members
    request.addfinalizer(lambda: members.pop("deadly", None))
    script, out = tmp_path / "deadly.py", tmp_path / "crash.parquet"
    script.write_text(DEADLY)
    more = [*QUICK, "null_space.fields=[{type: deadly, strength: 1}]"]
    over = {"null_space.fields.0.strength": [1.0, 2.0, 3.0]}
    options: Any = {"overrides": more, "out": out, "imports": [script]}
    monkeypatch.setattr(cluster, "_VARIABLES", {"HSP_TEST_DEADLY": "1"})
    found = hsp.sweeps.sweep(MOVING, over, workers=1, **options)
    assert found["status"].tolist() == ["completed", "crashed", "completed"]
    assert found["message"][1].startswith("3 workers died")
    found = hsp.sweeps.sweep(MOVING, over, scheduler=scheduler, **options)
    assert found["status"].tolist() == 3 * ["completed"]


# --- transfer to workers -------------------------------------------------------------

SCRIPT = """
import hsp_control as hsp
import beside

class Sway(hsp.Cost, type="sway"):
    \"\"\"A cost of the user.\"\"\"
    size: float = 1.0
    \"\"\"Size [-].\"\"\"
    def value(self, state):
        return beside.TWICE * self.size * float(state.q @ state.q)

found = hsp.sweeps.sweep(
    {configuration!r}, {{"null_space.fields.0.size": [1.0, 2.0]}},
    overrides={more!r} + ["null_space.fields=[{{type: sway}}]"], workers=1,
)
print(found["status"].tolist(), found["message"].tolist())
"""


@pytest.mark.process
@pytest.mark.slow
def test_a_script_needs_no_guard_and_its_types_travel(tmp_path: Path) -> None:
    script = tmp_path / "mine.py"
    script.write_text(SCRIPT.format(configuration=MOVING, more=QUICK))
    (tmp_path / "beside.py").write_text("TWICE = 2.0\n")
    reported = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False
    )
    assert reported.stdout == "['completed', 'completed'] ['', '']\n", reported.stderr


@pytest.mark.process
@pytest.mark.slow
def test_files_travel_where_no_worker_has_them(tmp_path: Path, scheduler: str) -> None:
    """The configuration's files are in a folder that is removed before the runs."""
    folder = tmp_path / "mine"
    folder.mkdir()
    urdf = hsp.Robot.load("planar3r").source.urdf.read_text()
    (folder / "arm.urdf").write_text(urdf)
    (folder / "block.obj").write_text(TETRAHEDRON)
    (folder / "arm.yaml").write_text(ARM)
    over = {"null_space.gain": [1.0, 2.0]}
    run = hsp.load_experiment(folder / "arm.yaml", "null_space.gain=2").run()
    nearest = run["distance.point_distance"].min()

    def gone(_: object) -> None:
        for each in folder.iterdir():
            each.unlink()

    there = hsp.sweeps.sweep(
        folder / "arm.yaml", over, scheduler=scheduler, on_start=gone
    )
    assert there.completed.all(), there["message"]
    assert there["distance.point_distance.min"][1] == nearest


TETRAHEDRON = """v 0 0 0
v 0.2 0 0
v 0 0.2 0
v 0 0 0.2
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""
ARM = """
robot: {name: arm.urdf}
start: {joints: [0.3, 0.4, 0.5]}
tasks:
  tip: {type: frame_position, axes: xy, frame: tip, trajectory: {type: hold},
        gains: {kp: 9, kv: 6}}
scene:
  obstacles:
    block:
      center: {type: hold, point: [2, 2, 0]}
      shape: {type: mesh, file: block.obj}
null_space:
  fields:
    - {type: point_distance, frames: [tip], obstacle: block}
simulation: {duration: 0.02, log_period: 0.01}
"""


def test_a_computer_that_is_not_fit_ends_the_sweep() -> None:
    def unfit(_: object) -> None:
        raise SweepError("a worker has numpy 1 instead of 2")

    with pytest.raises(SweepError, match="a worker has numpy 1"):
        computed(unfit, 0, (), None)


# --- faults that end no sweep --------------------------------------------------------


@pytest.mark.process
@pytest.mark.slow
def test_a_run_with_a_timeout_is_a_row_and_tried_again_later(
    tmp_path: Path, scheduler: str
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
            scheduler=scheduler, time_limit=0.3, on_progress=note,
        )  # fmt: skip
        assert found["status"].tolist() == ["timed out", "timed out"]
        assert found["message"].tolist() == 2 * ["lasted longer than 0.3 s"]
    assert done == [0, 1, 2, 0, 1, 2]


@pytest.mark.parametrize("limit", [0.0, -1.0, np.nan])
def test_a_time_limit_is_positive(limit: float) -> None:
    with pytest.raises(SweepError, match=r"time_limit is .* must be positive"):
        hsp.sweeps.sweep(MOVING, {"null_space.gain": [1, 2]}, time_limit=limit)


def test_a_received_row_is_kept_after_its_worker_dies() -> None:
    """The next run may kill its worker before the result is read."""
    row = Row(2, "completed", "")
    assert sweep_runs._row(SimpleNamespace(status="cancelled"), row) is row
    with pytest.raises(SweepError, match="the scheduler does not answer"):
        sweep_runs._row(SimpleNamespace(status="cancelled"), None)


def test_a_base_exception_is_a_row() -> None:
    for error in (GeneratorExit("x"), SystemExit(3)):

        def fail(_: object, error: BaseException = error) -> None:
            raise error

        row = computed(fail, 0, (), None)
        assert row.status == "failed"
        assert row.message.startswith(type(error).__name__)


@pytest.mark.process
@pytest.mark.slow
def test_workers_that_cannot_start_are_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cluster, "_WORKERS", "raise SystemExit(3)")
    with pytest.raises(SweepError, match="no worker can be started: exit status 3"):
        hsp.sweeps.sweep(MOVING, {"null_space.gain": [1, 2]}, overrides=QUICK)


@pytest.mark.process
@pytest.mark.slow
def test_a_scheduler_that_does_not_answer_is_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    with open_port() as port:
        address = f"tcp://127.0.0.1:{port}"
    with pytest.raises(SweepError, match=f"no scheduler answers at {address}"):
        hsp.sweeps.sweep(
            MOVING, {"null_space.gain": [1, 2]}, overrides=QUICK, scheduler=address
        )


# --- untrusted files -----------------------------------------------------------------


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.smoke
def test_another_sweep_is_not_overwritten(file: Path, swept: Sweep) -> None:
    before = [each.read_bytes() for each in file.iterdir()]
    with pytest.raises(SweepError, match=r"configuration.simulation.duration is 0.1"):
        hsp.sweeps.sweep(MOVING, OVER, overrides=["simulation.duration=0.2"], out=file)
    other = {**OVER, "null_space.gain": [1.0, 2.0]}
    with pytest.raises(SweepError, match="contains another sweep: its factors"):
        hsp.sweeps.sweep(MOVING, other, overrides=QUICK, out=file)
    assert [each.read_bytes() for each in file.iterdir()] == before


@pytest.mark.process
@pytest.mark.slow
def test_a_urdf_that_changed_is_another_sweep(tmp_path: Path, scheduler: str) -> None:
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
    hsp.sweeps.sweep(config, over, out=out, scheduler=scheduler)
    urdf.write_text(text.replace('mass value="1', 'mass value="2'))
    assert urdf.read_text() != text
    with pytest.raises(SweepError, match="the model of its robot is different"):
        hsp.sweeps.sweep(config, over, out=out, scheduler=scheduler)
    fresh = hsp.sweeps.sweep(config, over, out=out, scheduler=scheduler, fresh=True)
    assert fresh.completed.all()


@pytest.mark.process
@pytest.mark.slow
@pytest.mark.smoke
def test_one_process_at_a_time(file: Path, swept: Sweep, tmp_path: Path) -> None:
    _, meta = read_rows(file)
    plan: Any = type("Plan", (), {"__len__": lambda _: 0})()
    plan.base, plan.factors, plan.points = plan, (), ()
    plan.name = ""
    out = tmp_path / "one.parquet"
    held = RowFiles(plan, meta["identity"], out, fresh=False)
    with pytest.raises(SweepError, match="another sweep writes it already"):
        hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK, out=out)
    held.close()
    assert not out.exists()  # it had no rows


def test_rows_are_written_while_no_other_one_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that lasts long, or a worker that is stopped, keeps them in memory."""
    plan: Any = type("Plan", (), {"__len__": lambda _: 2})()
    plan.base, plan.factors, plan.points, plan.name = plan, (), (), ""
    now = 0.0
    monkeypatch.setattr(row_files, "monotonic", lambda: now)
    out = tmp_path / "sweep.parquet"
    files = RowFiles(plan, {}, out, fresh=False)
    files.add(Row(0, "completed", "", {}, 0.1))
    files.write_if_due()
    assert not list(out.glob("*.parquet"))
    now = row_files.SECONDS + 0.1
    files.write_if_due()
    rows, _ = read_rows(out)
    assert rows["run"].to_pylist() == [0]
    files.close()


@pytest.mark.parametrize("later", [[1], []], ids=["more rows", "no more rows"])
def test_a_folder_that_is_deleted_meanwhile_is_written_again(
    later: list[int], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    plan: Any = type("Plan", (), {"__len__": lambda _: 2})()
    plan.base, plan.factors, plan.points, plan.name = plan, (), (), ""
    out = tmp_path / "out" / "sweep.parquet"
    files = RowFiles(plan, {}, out, fresh=False)
    files.add(Row(0, "completed", "", {}, 0.1))
    files.write()
    shutil.rmtree(tmp_path / "out")
    for run in later:
        files.add(Row(run, "completed", "", {}, 0.1))
    files.write()
    with pytest.raises(SweepError, match="another sweep writes it already"):
        RowFiles(plan, {}, out, fresh=False)
    files.close()
    rows, _ = read_rows(out)
    assert rows["run"].to_pylist() == [0, *later]
    assert "was deleted meanwhile" in caplog.text
    assert [each.suffix for each in out.iterdir()] == [".parquet"]


@pytest.mark.parametrize("content", [b"nonsense", b"PAR1", b""])
def test_files_that_are_no_sweep_are_refused(tmp_path: Path, content: bytes) -> None:
    out = tmp_path / "x.parquet"
    out.write_bytes(content)
    with pytest.raises(SweepError, match="a file, and sweeps are folders"):
        hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK, out=out)
    assert out.read_bytes() == content
    out.unlink()
    out.mkdir()
    there = out / "rows-000001.parquet"
    there.write_bytes(content)
    for fresh in (False, True):
        with pytest.raises(SweepError, match="not a complete Parquet file"):
            hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK, out=out, fresh=fresh)
    assert [each.read_bytes() for each in out.iterdir()] == [content]


def test_another_program_s_parquet_is_refused(tmp_path: Path) -> None:
    pq.write_table(pa.table({"a": [1]}), tmp_path / "a.parquet")
    with pytest.raises(SweepError, match="but not a sweep"):
        Sweep.load(tmp_path / "a.parquet")
    with pytest.raises(SweepError, match=r"no such file; did you mean 'a.parquet'\?"):
        Sweep.load(tmp_path / "b.parquet")


def test_a_bad_key_is_found_before_any_worker_starts() -> None:
    with pytest.raises(ConfigError, match=r"null_space.gian"):
        hsp.sweeps.sweep(MOVING, {"null_space.gian": [1]})
    with pytest.raises(HspControlError, match="'x': needs the form key=value"):
        hsp.sweeps.sweep(MOVING, OVER, overrides=["x"])


@pytest.mark.process
@pytest.mark.slow
def test_any_exception_in_the_parent_leaves_the_folder_free(
    tmp_path: Path, scheduler: str
) -> None:
    out = tmp_path / "x.parquet"

    def fail(*_: object) -> None:
        raise GeneratorExit

    options: Any = {"overrides": QUICK, "out": out, "scheduler": scheduler}
    with pytest.raises(GeneratorExit):
        hsp.sweeps.sweep(MOVING, OVER, on_progress=fail, **options)
    with pytest.raises(GeneratorExit):
        hsp.sweeps.sweep(MOVING, OVER, on_start=fail, **options)
    assert hsp.sweeps.sweep(MOVING, OVER, **options).complete


@pytest.mark.parametrize("kind", ["fifo", "device"])
def test_endless_input_is_no_table(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.parquet"
    if kind == "fifo":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero")
    with pytest.raises(SweepError, match="a device or a pipe"):
        read_rows(path)
