"""The sweep command: mistakes, output, and figures."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sweep_runs import MOVING, OVER, QUICK

import hsp_control as hsp
from hsp_control.cli import main
from hsp_control.common.errors import SweepError
from hsp_control.companions.sweeps import Sweep
from hsp_control.companions.sweeps.sensitivities import influences
from hsp_control.companions.sweeps.sweep_command import _spread


@pytest.mark.parametrize(("arguments", "message"), [
    ([], "nothing is varied; give --over"),
    (["--over", "null_space.gian=1,2"], "did you mean 'gain'?"),
    (["--over", "null_space.gain.x=1,2"], "which has no keys"),
    (["--over", "null_space.gain=2:1:3"], "--over null_space.gain: the interval"),
    (["--over", "null_space.gain=unifrom:1:2"], "did you mean 'uniform'?"),
    (["--over", "null_space.gain"], "needs the form key=values"),
    (["--over", "null_space.gain=-3,-2"], "null_space.gain"),
    (["--over", "null_space.gain=1:2"], "a grid needs a list"),
    (["--over", "null_space.gain=1,2", "--over", "null_space.gain=3"], "twice"),
    (["--over", "null_space.gain=1:2", "--design", "latin"], "'latin_hypercube'?"),
    (["--over", "null_space.gain=1:2", "--design", "random"], "needs --samples"),
    (["--over", "null_space.gain=1:2", "--samples", "0"], "0 samples"),
    (["--over", "null_space.gain=1:2", "--samples", "9", "--seed", "-1"], "seed is"),
    (["--over", "null_space.gain=1,2", "--workers", "0"], "0 workers"),
    (["--over", "null_space.gain=1,2", "--workers", "2", "--scheduler", "tcp://x:1"],
     "give one of the two"),
    (["--over", "null_space.gain=1,2", "--import", "no.py"], "no.py: no such file"),
])  # fmt: skip
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
    assert "/proc/nowhere/x.parquet: cannot be written" in capsys.readouterr().err


@pytest.mark.process
def test_the_command_prints_and_draws_its_findings(
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


@pytest.mark.process
def test_reasons_that_differ_in_numbers_alone_are_reported_once(
    tmp_path: Path, scheduler: str, capsys: pytest.CaptureFixture[str]
) -> None:
    # Not refused for their rate: the motion diverges.
    settings = [*QUICK, "simulation.control_period=0.01", "simulation.check_rate=false"]
    options = [word for setting in settings for word in ("--set", setting)]
    over = ["--over", "null_space.gain=10,900,1100,-1,-2.5"]
    out = ["--out", str(tmp_path / "failing.parquet"), "--scheduler", scheduler]
    assert main(["sweep", MOVING, *options, *over, *out]) == 2
    printed, error = capsys.readouterr()
    assert error.endswith("hsp: 4 of 5 runs did not complete\n")
    assert "5 of 5 runs: 2 diverged, 2 refused, 1 completed" in printed
    assert printed.count("  2 x refused: --over null_space.gain: ") == 1
    assert printed.count("  2 x diverged: the motion diverged before t = ") == 1
    assert "other reasons" not in printed
    assert "No sensitivities: 1 runs were completed" in printed


@pytest.mark.parametrize("package", ["pyarrow.parquet", "distributed"])
def test_missing_packages_are_reported_first(
    package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    message = rf"^a sweep needs {package}: pip install 'hsp_control\[sweeps\]'$"
    with pytest.raises(SweepError, match=message):
        hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK)


def test_a_mistake_in_the_file_is_reported_with_its_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("robot:\n  name: pand\ntasks:\n  a: {type: joint_posture}\n")
    assert main(["sweep", str(file), "--over", "null_space.gain=1,2"]) == 2
    assert f"hsp: {file}:2: robot.name: " in capsys.readouterr().err
    with pytest.raises(SweepError, match=r"x.csv: the name .* must end with .parquet"):
        hsp.sweeps.sweep(MOVING, OVER, overrides=QUICK, out=tmp_path / "x.csv")


def test_a_stream_from_another_process_cannot_be_swept() -> None:
    received = "tasks.tip.trajectory={type: stream, source: 'udp://127.0.0.1:5005'}"
    with pytest.raises(SweepError, match=r"listens to udp:.*, which only one"):
        hsp.sweeps.sweep(MOVING, OVER, overrides=[*QUICK, received])


def test_the_worst_run_has_the_least_distance_or_the_largest_effort() -> None:
    """Of the completed ones, by its number."""
    columns: dict[str, Any] = {
        "run": np.array([3, 5, 6, 8]),
        "status": np.array([*3 * ["completed"], "diverged"], dtype=object),
        "distance.ball.min": np.array([0.3, 0.1, 0.2, 0.0]),
        "effort.max": np.array([7.0, 1.0, 9.0, 99.0]),
    }
    names = list(columns)[2:]
    about = {"unit": "m", "meaning": "a number"}
    meta = {"parameters": {}, "metrics": dict.fromkeys(names, about)}
    swept = Sweep(columns, meta)
    *_, worst = _spread(swept, influences(swept, names)).columns
    assert list(worst.cells) == ["5", "6"]
