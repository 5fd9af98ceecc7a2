"""The box logs all events."""

from pathlib import Path

import numpy as np
import pytest
from franka_boxes import home, panda, plant

from hsp_control import Rollout, load_experiment
from hsp_control.cli.main import main
from hsp_control.common.errors import LogError
from hsp_control.companions.franka.layouts import (
    COMMAND,
    ControllerMode,
    MotionGenerator,
)
from hsp_control.companions.franka_box import ControlBox
from hsp_control.companions.franka_box.log import BoxLog


def test_the_log_has_the_true_motion(tmp_path: Path) -> None:
    experiment = load_experiment(
        {"robot": {"name": "panda"}, "tasks": {"hand": {"type": "frame_pose"}}}
    )
    box, seen = ControlBox(panda(), plant(), home(), print), []
    with BoxLog(tmp_path / "run.npz", experiment, box) as log:
        log_row = box.on_period
        box.on_period = lambda: (seen.append((box.t, box.q)), log_row())
        box.step(None)
        box.begin(1, ControllerMode.EXTERNAL, MotionGenerator.NONE)
        command = np.zeros(1, COMMAND)
        for step in range(100):
            command["tau_J_d"] = 0.01 * step
            box.step(command[0])
    run = Rollout.load(log.path)
    true = dict(seen)
    assert len(run["t"]) == 11
    for t, q in zip(run["t"], run["q"], strict=True):
        assert true[t].tolist() == q.tolist()
    assert set(run["box.mode"].tolist()) == {2.0}
    assert not log.path.with_suffix(".journal").exists()
    assert run.status == "completed"
    with pytest.raises(OSError, match="no line"), BoxLog(log.path, experiment, box):
        raise OSError("no line")
    torn = Rollout.load(log.path)
    assert (torn.status, torn.meta["message"]) == ("stopped", "no line")


@pytest.mark.parametrize(("arguments", "logged"), [
    (["planar3r"], "planar3r has the joints"),
    (["panda", "--host", "10.1.1.1"], "listens on loopback only"),
    (["panda", "--deadline", "0"], "deadline 0 µs; must be above 0"),
    (["panda", "--priority", "100"], "real-time priority 100"),
    (["panda", "--set", "start.velocity=[1, 0, 0, 0, 0, 0, 0]"], "at rest"),
])  # fmt: skip
def test_a_mistake_is_one_line(
    arguments: list[str], logged: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["franka-box", *arguments]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("hsp: ")
    assert logged in line


def test_a_log_has_the_name_of_one(tmp_path: Path) -> None:
    box = ControlBox(panda(), plant(), home(), print)
    experiment = load_experiment(
        {"robot": {"name": "panda"}, "tasks": {"hand": {"type": "frame_pose"}}}
    )
    with pytest.raises(LogError, match=r"the name of a log ends in \.npz"):
        BoxLog(tmp_path / "run.csv", experiment, box)
