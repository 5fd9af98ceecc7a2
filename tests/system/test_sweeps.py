"""Sweeps: the same numbers however they are computed, nothing lost or done twice."""

import json
import math
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest
from scipy import stats

import hsp_control as hsp
from hsp_control.cli import main
from hsp_control.common.exceptions import ConfigError, HspControlError, SweepError
from hsp_control.sweeps import (
    Choices,
    Integers,
    LogUniform,
    Normal,
    Sweep,
    Uniform,
    local_workers,
    sensitivity,
    sweeping,
)
from hsp_control.sweeps.design import points
from hsp_control.sweeps.factor import factors
from hsp_control.sweeps.journal import Journal, journal_of
from hsp_control.sweeps.metrics import Measure
from hsp_control.sweeps.row import Row
from hsp_control.sweeps.spelling import values
from hsp_control.visualization.plots import sweep_figure

MOVING = "paper/4_moving_obstacle"
QUICK = [
    "simulation.duration=0.1",
    "simulation.integrator={type: rk4, step: 0.005}",
]
# Some tenths of a second each, also where kernels are not compiled.
SECONDS = 0.3 if numba.config.DISABLE_JIT else 3
SLOWER = [QUICK[1], f"simulation.duration={SECONDS}"]
OVER = {
    "null_space.gain": "log:1:100:3",
    "start.coordinates.0": "1.0:1.6:2",
    "scene.obstacles.disk.shape.radius": [0.1, 0.3],
}


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
    return hsp.sweep(MOVING, OVER, overrides=QUICK, out=file, workers=2)


# ------------------------------------------------------------------ values and designs


@pytest.mark.parametrize(
    ("text", "levels"),
    [
        ("1,2,5", (1, 2, 5)),
        ("rest,flow", ("rest", "flow")),
        ("[0, 0, 1], [0, 1, 0]", ([0, 0, 1], [0, 1, 0])),
        ("true", (True,)),
        ("'a:b', c", ("a:b", "c")),
        ("{type: hold}", ({"type": "hold"},)),
        ("0:10:3", (0, 5, 10)),
        ("0:1:3", (0.0, 0.5, 1.0)),
        ("-1e-2:0.5:2", (-0.01, 0.5)),
        ("linear:1:9:5", (1, 3, 5, 7, 9)),
        ("log:1:100:3", (1.0, 10.0, 100.0)),
    ],
)
def test_lists_and_ranges_as_they_are_spelled(text: str, levels: tuple) -> None:
    found = values(text).levels()
    assert found is not None
    assert [type(value) for value in found] == [type(value) for value in levels]
    # To rounding: the ends of a range are exact, what is between need not be.
    if isinstance(levels[0], float):
        np.testing.assert_allclose(found, levels, rtol=1e-15)
        assert (found[0], found[-1]) == (levels[0], levels[-1])
    else:
        assert found == levels


@pytest.mark.parametrize(
    ("text", "distribution"),
    [
        ("1:10", Uniform(1, 10)),
        ("uniform:-1:1", Uniform(-1, 1)),
        ("loguniform:0.1:10", LogUniform(0.1, 10)),
        ("normal:0:0.1", Normal(0, 0.1)),
        ("normal:1:0.1:0:2", Normal(1, 0.1, 0, 2)),
        ("integers:0:99", Integers(0, 99)),
    ],
)
def test_distributions_as_they_are_spelled(text: str, distribution: object) -> None:
    assert values(text) == distribution
    assert values(text).levels() is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "needs values"),
        ("5:1:3", "from 5 to 1"),
        ("1:5:1", "at least 2"),
        ("1:5:2.5", "'2.5' is not an integer"),
        ("1:5:1000000", "more than 100000"),
        ("1:x:3", "'x' is not a number"),
        ("1:2:3:4", "has 4 parts"),
        ("nan:1", "must be finite"),
        ("log:0:1:3", "must be positive"),
        ("loguniform:-1:1", "must be positive"),
        ("unifrom:1:2", "did you mean 'uniform'?"),
        ("uniform:1", "takes uniform:LOW:HIGH, not 1 numbers"),
        ("normal:0:0", "deviation must be positive"),
        ("normal:0:1:2:1", "cut off below 2 and above 1"),
        ("normal:0:1:50:60", "has nothing from 50 to 60"),
        ("integers:3:1", "no integers from 3 to 1"),
        ("integers:0:1.5", "'1.5' is not an integer"),
        ("[1, 2", "not a list"),
    ],
)
def test_what_is_no_range_is_refused(text: str, message: str) -> None:
    with pytest.raises(SweepError, match=message.replace("?", r"\?")):
        values(text)


def test_quantiles_are_those_of_the_distribution() -> None:
    fractions = np.linspace(0.0, 1.0, 101)[:-1]
    oracles = [
        (Uniform(-1, 3), stats.uniform(-1, 4)),
        (LogUniform(0.1, 50), stats.loguniform(0.1, 50)),
        (Normal(2, 0.5), stats.norm(2, 0.5)),
        (Normal(2, 0.5, 1.8, 4), stats.truncnorm(-0.4, 4, 2, 0.5)),
    ]
    for distribution, oracle in oracles:
        ours = [distribution.quantile(float(u)) for u in fractions[1:]]
        np.testing.assert_allclose(ours, oracle.ppf(fractions[1:]), rtol=1e-10)
        assert math.isfinite(distribution.quantile(0.0))
    drawn = [Integers(3, 7).quantile(float(u)) for u in fractions]
    assert np.unique(drawn, return_counts=True)[1].tolist() == [20] * 5
    assert (min(drawn), max(drawn)) == (3, 7)


def test_a_grid_has_every_combination_in_order() -> None:
    found = points(factors({"a": "1:3:3", "b": ["x", "y"]}), "grid", None, 0)
    assert found == [(1, "x"), (1, "y"), (2, "x"), (2, "y"), (3, "x"), (3, "y")]


def test_a_latin_hypercube_meets_every_stratum_of_every_factor_once() -> None:
    over = factors({"a": "0:1", "b": "0:10", "c": "loguniform:1:2.718281828459045"})
    found = np.array(points(over, "latin_hypercube", 40, 3))
    found[:, 1] /= 10.0
    found[:, 2] = np.log(found[:, 2])
    for column in found.T:
        assert sorted((column * 40).astype(int)) == list(range(40))


@pytest.mark.parametrize("design", ["random", "latin_hypercube", "sobol"])
def test_a_seed_is_a_design(design: Any) -> None:
    over = factors({"a": "0:1", "b": "normal:0:1"})
    assert points(over, design, 20, 5) == points(over, design, 20, 5)
    assert points(over, design, 20, 5) != points(over, design, 20, 6)
    assert len(points(over, design, 20, 5)) == 20


# ----------------------------------------------------------------------- what is in it


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


def test_metres_and_radians_are_not_added() -> None:
    short = ["simulation.duration=0.02", "simulation.log_period=0.01"]
    found = hsp.sweep(
        "panda_obstacle", {"null_space.gain": [5]}, overrides=short, workers=1
    )
    units = {name: told["unit"] for name, told in found.meta["metrics"].items()}
    assert units["tracking.hand.position.rms"] == "m"
    assert units["tracking.hand.orientation.rms"] == "rad"


def test_anything_in_the_configuration_can_vary() -> None:
    over = {
        "start.velocity": ["rest", "flow"],
        "tasks.tip.trajectory.center": [[1.0, 1.0], [1.1, 1.0]],
        "null_space.metric.type": "identity,coordinates",
    }
    found = hsp.sweep(MOVING, over, overrides=QUICK, workers=1)
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
    found = hsp.sweep(MOVING, over, overrides=held, workers=1)
    assert found["status"].tolist() == ["completed", "refused", "diverged"]
    assert "--over null_space.gain: null_space.gain" in found["message"][1]
    assert "the motion diverged" in found["message"][2]
    assert np.isnan(found["tracking.tip.rms"][1])
    assert 0.0 <= found["simulated_time"][2] < 0.1
    assert found.complete


def test_the_configuration_given_is_not_changed() -> None:
    data = hsp.load_experiment(MOVING, *QUICK).scenario.model_dump(mode="json")
    before = json.dumps(data)
    hsp.sweep(data, {"null_space.gain": [3.0, 4.0]}, workers=1)
    assert json.dumps(data) == before


# ------------------------------------------------------- the same bits, nothing twice


def test_the_number_of_workers_changes_no_bit(swept: Sweep) -> None:
    same(hsp.sweep(MOVING, OVER, overrides=QUICK, workers=1), swept)


def test_what_is_done_is_not_done_again(file: Path, swept: Sweep) -> None:
    before = file.read_bytes()
    again = hsp.sweep(MOVING, OVER, overrides=QUICK, out=file)
    same(again, swept)
    assert again["wall_time"].tobytes() == swept["wall_time"].tobytes()
    assert file.read_bytes() == before


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
    return hsp.sweep(MOVING, over, overrides=SLOWER, out=out, workers=1)


@pytest.fixture(scope="module")
def whole() -> Sweep:
    return hsp.sweep(MOVING, {"null_space.gain": "1:20:20"}, overrides=SLOWER)


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
    assert "The same command resumes it" in capsys.readouterr().err
    journal = journal_of(out)
    lines = journal.read_text().splitlines()
    rows = [json.loads(line)["row"] for line in lines if '"row"' in line]
    with journal.open("a") as file:  # killed in the middle of a write
        file.write('{"row": {"run": 19, "status": "compl')
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
    assert process.returncode == 2, errors.decode()
    assert b"stopped by the user" in errors
    assert b"Traceback" not in errors
    part = Sweep.load(out)
    assert 2 <= len(part) < 20
    assert not part.complete
    resumed = finish(out)
    same(resumed, whole)
    kept = part["run"]
    assert resumed["wall_time"][kept].tobytes() == part["wall_time"].tobytes()


def test_half_a_line_is_cut_off_before_another_is_written(tmp_path: Path) -> None:
    path = tmp_path / "x.parquet.journal"
    rows = [Row(k, "completed", "", {"e": 0.1 * k}, 0.5) for k in range(3)]
    journal = Journal(path)
    journal.begin({"seed": 1})
    journal.add(rows[0], {"e": Measure(0.0, "m", "error")})
    journal.close()
    for row, half in zip(
        rows[1:], ('{"row": {"run"', '{"described": {"é'), strict=True
    ):
        with path.open("a", encoding="utf-8") as file:
            file.write(half)
        journal = Journal(path)
        assert journal.rows == rows[: row.run]
        journal.add(row, {})
        journal.close()
    journal = Journal(path)
    assert journal.rows == rows
    assert journal.identity == {"seed": 1}
    assert journal.described == {"e": Measure(0.0, "m", "error")}
    journal.remove()
    path.write_text('{"swe')  # killed in the first line
    journal = Journal(path)
    assert (journal.rows, journal.identity) == ([], None)
    journal.remove()


def test_killed_between_the_file_and_the_journal(file: Path, tmp_path: Path) -> None:
    """Rows in both count once."""
    out = tmp_path / "both.parquet"
    whole = hsp.sweep(MOVING, OVER, overrides=QUICK, workers=1)
    journal = Journal(journal_of(out))
    journal.begin(whole.meta["identity"])
    for row in whole.rows():
        journal.add(row, {})
    journal.close()
    whole.save(out)
    again = hsp.sweep(MOVING, OVER, overrides=QUICK, out=out)
    same(again, whole)
    assert again["wall_time"].tobytes() == whole["wall_time"].tobytes()


def test_a_worker_that_dies_costs_nothing(whole: Sweep) -> None:
    killed = []

    def kill_one(done: int, total: int, failures: int) -> None:
        if done == 2 and not killed:
            workers = psutil.Process().children()
            killed.extend(workers)
            workers[0].kill()

    over = {"null_space.gain": "1:20:20"}
    found = hsp.sweep(MOVING, over, overrides=SLOWER, workers=1, on_progress=kill_one)
    assert killed
    same(found, whole)


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
    found = hsp.sweep(MOVING, over, overrides=QUICK, out=out, workers=1)
    assert found["status"].tolist() == ["completed", "crashed"]
    assert "SIGKILL" in found["message"][1]
    monkeypatch.undo()
    found = hsp.sweep(MOVING, over, overrides=QUICK, out=out, workers=1)
    assert found["status"].tolist() == ["completed", "completed"]


def test_a_worker_that_cannot_start_is_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(local_workers, "_MAIN", "raise SystemExit(3)")
    with pytest.raises(
        SweepError, match="does not start: the worker left with status 3"
    ):
        hsp.sweep(MOVING, {"null_space.gain": [1, 2]}, overrides=QUICK)


# ---------------------------------------------------------------------- files of others


def test_another_sweep_is_not_overwritten(file: Path, swept: Sweep) -> None:
    before = file.read_bytes()
    with pytest.raises(SweepError, match=r"configuration.simulation.duration is 0.1"):
        hsp.sweep(MOVING, OVER, overrides=["simulation.duration=0.2"], out=file)
    other = {**OVER, "null_space.gain": [1.0, 2.0]}
    with pytest.raises(SweepError, match="holds another sweep: its factors"):
        hsp.sweep(MOVING, other, overrides=QUICK, out=file)
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
    hsp.sweep(config, over, out=out, workers=1)
    urdf.write_text(text.replace('mass value="1', 'mass value="2'))
    assert urdf.read_text() != text
    with pytest.raises(SweepError, match="robot's model is another one"):
        hsp.sweep(config, over, out=out, workers=1)
    hsp.sweep(config, over, out=out, workers=1, fresh=True)


def test_one_process_at_a_time(tmp_path: Path) -> None:
    out = tmp_path / "one.parquet"
    journal = Journal(journal_of(out))
    try:
        with pytest.raises(SweepError, match="another process is writing this sweep"):
            hsp.sweep(MOVING, OVER, overrides=QUICK, out=out)
    finally:
        journal.remove()


@pytest.mark.parametrize("content", [b"nonsense", b"PAR1", b""])
def test_files_that_are_no_sweep_are_refused(tmp_path: Path, content: bytes) -> None:
    out = tmp_path / "x.parquet"
    out.write_bytes(content)
    with pytest.raises(SweepError, match="not a whole Parquet file"):
        hsp.sweep(MOVING, OVER, overrides=QUICK, out=out)
    assert out.read_bytes() == content
    assert not journal_of(out).exists()
    journal_of(out).write_bytes(b"mine\n")
    with pytest.raises(SweepError, match="not the journal of a sweep"):
        hsp.sweep(MOVING, OVER, overrides=QUICK, out=out)
    assert journal_of(out).read_bytes() == b"mine\n"


def test_another_program_s_parquet_is_refused(tmp_path: Path) -> None:
    import pyarrow as pa

    pq.write_table(pa.table({"a": [1]}), tmp_path / "a.parquet")
    with pytest.raises(SweepError, match="not of a sweep"):
        Sweep.load(tmp_path / "a.parquet")
    with pytest.raises(SweepError, match=r"no such file; did you mean 'a.parquet'\?"):
        Sweep.load(tmp_path / "b.parquet")


# --------------------------------------------------------------------- the command line


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "a sweep varies something"),
        (["--over", "null_space.gian=1,2"], "did you mean 'gain'?"),
        (["--over", "null_space.gain.x=1,2"], "which has no keys"),
        (["--over", "null_space.gain=2:1:3"], "--over null_space.gain: the interval"),
        (["--over", "null_space.gain=unifrom:1:2"], "did you mean 'uniform'?"),
        (["--over", "null_space.gain"], "needs the form key=values"),
        (["--over", "null_space.gain=-3,-2"], "null_space.gain"),
        (["--over", "null_space.gain=1:2"], "a grid needs a list"),
        (["--over", "null_space.gain=1,2", "--over", "null_space.gain=3"], "twice"),
        (["--over", "null_space.gain=1:2", "--design", "latin"], "'latin_hypercube'?"),
        (["--over", "null_space.gain=1:2", "--design", "random"], "number of --samp"),
        (["--over", "null_space.gain=1:2", "--samples", "0"], "0 samples"),
        (
            ["--over", "null_space.gain=1:2", "--samples", "9", "--seed", "-1"],
            "seed is",
        ),
        (["--over", "null_space.gain=1,2", "--workers", "0"], "0 workers"),
    ],
)
def test_each_mistake_gets_one_message_and_status_2(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "x.parquet"
    assert main(["sweep", MOVING, *arguments, "--out", str(out)]) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert captured.err.startswith("hsp: ")
    assert not list(tmp_path.iterdir())


def test_an_unknown_configuration_or_place_is_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    over = ["--over", "null_space.gain=1,2"]
    assert main(["sweep", "paper/4_moving", *over]) == 2
    assert "did you mean 'paper/4_moving_obstacle'?" in capsys.readouterr().err
    assert main(["sweep", MOVING, *over, "--out", "/proc/nowhere/x.parquet"]) == 2
    assert "/proc/nowhere/x.parquet.journal: cannot" in capsys.readouterr().err


def test_the_command_tells_and_draws_what_it_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "found.parquet"
    settings = [word for setting in QUICK for word in ("--set", setting)]
    over = ["--over", "null_space.gain=loguniform:1:100"]
    over += ["--over", "start.coordinates.0=normal:1.3:0.1"]
    design = ["--samples", "16", "--seed", "4", "--out", str(out), "--plot"]
    assert main(["sweep", MOVING, *settings, *over, *design]) == 0
    printed = capsys.readouterr().out
    assert "16 of 16 runs: 16 completed" in printed
    assert "start.coordinates.0" in printed
    assert (tmp_path / "found-sensitivity.png").stat().st_size > 20_000
    assert main(["plot", str(out), "--format", "svg"]) == 0
    assert (tmp_path / "found-sensitivity.svg").is_file()


def test_reasons_that_differ_in_numbers_alone_are_told_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Not refused for their rate: the motion shall tell.
    settings = [*QUICK, "simulation.control_period=0.01", "simulation.check_rate=false"]
    options = [word for setting in settings for word in ("--set", setting)]
    over = ["--over", "null_space.gain=10,900,1100,-1,-2.5"]
    out = ["--out", str(tmp_path / "failing.parquet"), "--workers", "1"]
    assert main(["sweep", MOVING, *options, *over, *out]) == 0
    printed = capsys.readouterr().out
    assert "5 of 5 runs: 2 diverged, 2 refused, 1 completed" in printed
    assert printed.count("  2 x refused: --over null_space.gain: ") == 1
    assert printed.count("  2 x diverged: the motion diverged before t = ") == 1
    assert "other reasons" not in printed
    assert "No sensitivities: 1 runs were completed" in printed


def test_importing_the_package_imports_no_extra() -> None:
    heavy = ["pyarrow", "distributed", "matplotlib", "scipy.stats", "meshcat"]
    code = f"import sys, hsp_control; print([m for m in {heavy} if m in sys.modules])"
    ran = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert ran.stdout.strip() == "[]"


def test_without_pyarrow_the_message_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    with pytest.raises(SweepError, match=r"pip install 'hsp_control\[sweeps\]'"):
        hsp.sweep(MOVING, OVER, overrides=QUICK, out=tmp_path / "x.parquet")
    assert len(hsp.sweep(MOVING, {"null_space.gain": [3]}, overrides=QUICK)) == 1


def test_a_mistake_in_the_file_is_told_with_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("robot:\n  name: pand\ntasks:\n  a: {type: joint_posture}\n")
    assert main(["sweep", str(file), "--over", "null_space.gain=1,2"]) == 2
    assert f"hsp: {file}:2: robot.name: " in capsys.readouterr().err
    with pytest.raises(SweepError, match=r"x.csv: the name .* ends in .parquet"):
        hsp.sweep(MOVING, OVER, overrides=QUICK, out=tmp_path / "x.csv")


def test_a_robot_beside_its_configuration_is_found_from_anywhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(hsp.Robot.load("planar3r").source.urdf, tmp_path / "arm.urdf")
    (tmp_path / "mine.yaml").write_text(
        "robot: {name: arm.urdf}\n"
        "start: {joints: [0.3, 0.4, 0.5]}\n"
        "tasks: {tip: {type: frame_position, axes: xy, frame: tip,"
        " trajectory: {type: hold}, gains: {kp: 9, kv: 6}}}\n"
        "simulation: {duration: 0.02}\n"
    )
    found = hsp.sweep(tmp_path / "mine.yaml", {"null_space.gain": [1]}, workers=1)
    assert found.completed.all()


def test_a_worker_with_other_versions_is_an_error_that_loses_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Mixed(local_workers.LocalWorkers):
        def map(self, tasks: Any) -> Iterator[tuple[int, str]]:
            for run, text in super().map(tasks):
                result = json.loads(text)
                if run == 1:
                    result["versions"]["pin"] = "3.0"
                yield run, json.dumps(result)

    monkeypatch.setattr(sweeping, "LocalWorkers", Mixed)
    out, over = tmp_path / "mixed.parquet", {"null_space.gain": [1.0, 2.0, 3.0]}
    with pytest.raises(SweepError, match=r"a worker has pin 3.0, here is"):
        hsp.sweep(MOVING, over, overrides=QUICK, out=out, workers=1)
    assert Sweep.load(out)["run"].tolist() == [0]


# ------------------------------------------------------------------------- sensitivity


def invented(runs: int = 200) -> Sweep:
    """A sweep whose dependences are known."""
    rng = np.random.default_rng(0)
    up, bowl, none = rng.uniform(-1, 1, (3, runs))
    kind = np.array(["a", "b"], dtype=object)[rng.integers(0, 2, runs)]
    status = np.array(["completed"] * runs, dtype=object)
    status[:5] = "diverged"
    columns = {
        "run": np.arange(runs),
        "status": status,
        "message": np.array([""] * runs, dtype=object),
        "wall_time": np.ones(runs),
        "up": up, "bowl": bowl, "none": none, "kind": kind,
        "tracking.x.rms": np.exp(3.0 * up),
        "manipulability.min": -np.exp(3.0 * up),
        "distance.y.min": bowl**2,
        "effort.max": np.where(kind == "a", 5.0, 1.0) + 0.1 * none,
    }  # fmt: skip
    columns["tracking.x.rms"][0] = 1e9  # it diverged: it must not count
    metrics = ["tracking.x.rms", "manipulability.min", "distance.y.min", "effort.max"]
    meta = {
        "format": "hsp_control sweep 1",
        "name": "invented",
        "runs": runs,
        "parameters": {
            name: {"keys": [name], "json": False}
            for name in ("up", "bowl", "none", "kind")
        },
        "metrics": {name: {"unit": "m", "meaning": name} for name in metrics},
        "identity": {
            "configuration": {"title": "Costs 5$ to 10$"},
            "factors": [], "design": "random", "seed": 0,
            "versions": {"hsp_control": "0"},
        },
    }  # fmt: skip
    return Sweep(columns, meta)


def test_sensitivities_are_those_that_were_put_in() -> None:
    found = sensitivity(invented())
    assert found.outcomes == (
        "tracking.x.rms", "manipulability.min", "distance.y.min", "effort.max",
    )  # fmt: skip
    assert found.runs == 195
    up, bowl, none, kind = (found.correlation[k] for k in range(4))
    assert up[:2] == pytest.approx([1.0, -1.0])  # any monotone form, exactly
    assert abs(bowl[2]) < 3 * found.noise  # an optimum in the middle correlates little
    assert np.isnan(kind).all()  # texts have no order
    assert abs(none[0]) < 2 * found.noise
    share = found.share
    assert share[0, 0] > 0.97
    assert share[1, 2] > 0.9  # ... but explains nearly all
    assert share[3, 3] == pytest.approx(0.75, abs=0.05)  # two halves of the ranks
    assert max(share[2, :3]) < 0.1  # one in twenty is called an influence
    assert share[2, 3] > 0.2  # within each half, it orders the ranks
    # Ranks: what the oracle of correlations gives.
    oracle = stats.spearmanr(invented()["bowl"][5:], invented()["distance.y.min"][5:])
    assert bowl[2] == pytest.approx(oracle.statistic, abs=1e-12)


def test_what_cannot_be_told_is_not_told() -> None:
    with pytest.raises(SweepError, match="5 runs were completed"):
        sensitivity(invented(10))
    with pytest.raises(SweepError, match=r"did you mean 'effort.max'\?"):
        sensitivity(invented(), ["effort.mx"])
    unknown = invented()
    unknown["effort.max"][5:] = np.nan
    assert "effort.max" not in sensitivity(unknown).outcomes
    with pytest.raises(SweepError, match="no completed run has the metric"):
        sensitivity(unknown, ["effort.max"])
    with pytest.raises(SweepError, match="has no run 200"):
        invented().configuration(200)
    with pytest.raises(SweepError, match="has no column 'upp'; did you mean 'up'"):
        invented()["upp"]


def test_every_pair_has_its_panel_and_failures_are_shown() -> None:
    figure = sweep_figure(invented())
    figure.canvas.draw()
    axes = figure.axes
    assert len(axes) == 16
    corner = axes[0]
    assert "+1.00" in corner.get_title(loc="left")
    points, line, failed = corner.lines
    assert len(points.get_xdata()) == 195
    assert len(failed.get_xdata()) == 5
    assert np.all(np.diff(line.get_ydata()) > 0.0)
    assert corner.get_yscale() == "log"
    assert [label.get_text() for label in axes[15].get_xticklabels()] == ["a", "b"]
    tints = [np.array(each.get_facecolor()) for each in axes]
    assert tints[0][2] > tints[0][0]  # grows: blue
    assert tints[4][0] > tints[4][2]  # falls: orange
    assert axes[2].get_title(loc="left") == "no influence seen"


# --------------------------------------------------------------------------------- Dask


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and two workers, processes of their own, on the loopback alone."""
    pytest.importorskip("distributed")
    file = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m", "distributed.cli"]
    host = ["--host", "127.0.0.1", "--no-dashboard"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    environment |= {"DASK_DISTRIBUTED__WORKER__DAEMON": "False"}
    quiet: dict[str, Any] = {
        "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL,
        "env": environment, "cwd": tmp_path,
    }  # fmt: skip
    processes = []

    def start(module: str, *arguments: str) -> None:
        command = [*dask[:2], f"{dask[2]}.{module}", *host, *arguments]
        processes.append(subprocess.Popen(command, **quiet))

    start("dask_scheduler", "--port", "0", "--scheduler-file", str(file))
    try:
        until(lambda: file.is_file() and bool(file.read_text()))
        address = json.loads(file.read_text())["address"]
        for _ in range(2):
            start("dask_worker", address, "--nthreads", "1", "--no-nanny")
        yield address, processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_a_dask_cluster_gives_the_same_bits_though_a_worker_dies(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path, whole: Sweep
) -> None:
    import distributed

    address, workers = cluster
    with distributed.Client(address, set_as_default=False) as client:
        client.wait_for_workers(2, timeout=60)
    seen = []

    def kill_one(done: int, total: int, failures: int) -> None:
        seen.append(done)
        if done == 5:
            workers[0].kill()

    out = tmp_path / "dask.parquet"
    found = hsp.sweep(
        MOVING,
        {"null_space.gain": "1:20:20"},
        overrides=SLOWER,
        out=out,
        scheduler=address,
        on_progress=kill_one,
    )
    assert workers[0].wait() == -signal.SIGKILL
    assert seen == list(range(21))  # every run came once
    same(found, whole)
    same(Sweep.load(out), whole)


def test_no_scheduler_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    from hsp_control.sweeps import dask_workers

    monkeypatch.setattr(dask_workers, "PATIENCE", 0.5)
    with pytest.raises(SweepError, match="no Dask scheduler answers at"):
        hsp.sweep(MOVING, OVER, overrides=QUICK, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(SweepError, match="leave --workers out"):
        hsp.sweep(MOVING, OVER, overrides=QUICK, scheduler="tcp://x:1", workers=2)
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(SweepError, match=r"pip install 'hsp_control\[dask\]'"):
        hsp.sweep(MOVING, OVER, overrides=QUICK, scheduler="tcp://127.0.0.1:9")


def test_a_bad_key_is_found_before_any_worker_is_asked() -> None:
    with pytest.raises(ConfigError, match=r"null_space.gian"):
        hsp.sweep(MOVING, {"null_space.gian": [1]}, scheduler="tcp://127.0.0.1:9")
    with pytest.raises(HspControlError, match="--set x"):
        hsp.sweep(MOVING, OVER, overrides=["x"])
    assert Choices((1,)).levels() == (1,)
