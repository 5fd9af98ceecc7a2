"""The example closes the loop with the simulated robot of ``hsp live``, by UDP."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from frozen_runs import EXAMPLE, compiled

import hsp_control as hsp
from hsp_control.cli.true_run import with_tasks


@pytest.mark.process
def test_a_loop_in_cpp_moves_the_simulated_arm(tmp_path: Path) -> None:
    compiled(EXAMPLE / "live.cpp", tmp_path, "-std=c++20", language="c++")
    command = [sys.executable, str(EXAMPLE / "start.py"), "panda_limits"]
    command += ["--duration", "2", "--lockstep", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert " 0 refused" in done.stdout
    assert "the loop closed the connection" in done.stdout
    states = hsp.Rollout.load(tmp_path / "panda_limits-robot.journal")
    log = with_tasks(states, states, hsp.load_experiment("panda_limits"))
    # The hand has moved, and is on its circle.
    error = np.linalg.norm(log["task.hand.error"], axis=1)
    actual = log["task.hand.actual"]
    assert np.ptp(actual, axis=0).max() > 0.1
    tracking = (log.t > 1.0) & (log.t < 1.9)  # then the robot stops
    assert error[tracking].max() < 0.001
