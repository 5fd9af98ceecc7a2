"""A policy in another process, as in ``examples/stream``."""

import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hsp_control import Rollout
from hsp_control.cli import main

pytestmark = pytest.mark.process

EXAMPLE = Path(__file__).parents[2] / "examples" / "stream"


@pytest.mark.smoke
def test_a_run_follows_another_process_and_its_log_repeats_it(tmp_path: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
        policy = subprocess.Popen(
            [sys.executable, str(EXAMPLE / "policy.py"), str(port), "600"]
        )
        probe.recv(1000)  # started, also on a busy machine
    try:
        source = f"tasks.hand.trajectory.source=udp://127.0.0.1:{port}"
        arguments = ["run", str(EXAMPLE / "panda.yaml"), "--out", str(tmp_path)]
        overrides = ["--set", source, "--set", "simulation.duration=2"]
        # However late messages come: with these bounds no limit of the robot binds.
        for bound in ("acceleration=2", "jerk=30", "angular_acceleration=5"):
            overrides += ["--set", f"tasks.hand.trajectory.{bound}"]
        assert main([*arguments, *overrides]) == 0
    finally:
        policy.kill()
        policy.wait()
    (log,) = tmp_path.glob("*.npz")
    run = Rollout.load(log)
    assert run["stream.hand.taken"][-1] > 0
    assert run["stream.hand.rejected"][-1] == 0
    assert np.nanmax(np.abs(run["task.hand.error"])) < 2e-3
    assert np.ptp(run["task.hand.actual"][:, 0]) > 0.01
    again = tmp_path / "again"
    assert main(["run", str(log), "--out", str(again)]) == 0
    assert np.array_equal(Rollout.load(again / log.name).q, run.q)
