"""``hsp live --robot``: a run begins where the robot is, and ends with one line."""

from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from hsp_control import Robot, Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.cli.live_experiment import loaded_live, simulated_robot
from hsp_control.config.document import read_document
from hsp_control.live import InProcessRobot
from hsp_control.live import hardware as live_hardware
from hsp_control.live.hardware import AdaptingHardware, LocatedHardware
from hsp_control.simulation.run_summary import summary_rows

AWAY = 0.1


class Somewhere(InProcessRobot):
    """A robot whose first joint is away from the start, at ``hold``, ``halt`` or
    ``lost``.

    Attributes:
        q: Its configuration, shape (nq,).
    """

    def __init__(self, address: str, robot: Robot, period: float) -> None:
        q = load_experiment("panda_obstacle").q0.copy()
        q[0] += AWAY if address != "lost" else np.nan
        start = f"start={{configuration: {q.tolist()}}}".replace("nan", "0")
        super().__init__(simulated_robot(load_experiment("panda_obstacle", start)))
        self.q, self._halts = q, address == "halt"

    def write(self, effort: np.ndarray) -> None:
        super().write(effort)
        if self._halts and self.robot.t > 0.05:
            self.robot.halt("a door was opened")


class Here(InProcessRobot):
    """A robot at the configuration's start, which does not tell where it is."""

    def __init__(self, *_: object) -> None:
        super().__init__(simulated_robot(load_experiment("panda_obstacle")))


@pytest.fixture(autouse=True)
def offered(monkeypatch: pytest.MonkeyPatch) -> None:
    entries = {
        name: EntryPoint(name, f"{__name__}:{kind}", "hsp_control.hardware")
        for name, kind in (("some", "Somewhere"), ("here", "Here"))
    }
    monkeypatch.setattr(live_hardware, "entry_points", lambda group: entries)


def command(tmp_path: Path, address: str, kind: str = "some") -> list[str]:
    words = ["live", "panda_obstacle", "--duration", "0.1", "--out", str(tmp_path)]
    return [*words, "--robot", f"{kind}://{address}"]


@pytest.mark.system
def test_it_begins_where_the_robot_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hardware = Somewhere("hold", Robot.load("panda"), 0.001)
    assert isinstance(hardware, LocatedHardware)
    assert not isinstance(hardware, AdaptingHardware)
    assert main(command(tmp_path, "hold")) == 0
    run = Rollout.load(tmp_path / "panda_obstacle-live.npz")
    assert run["q"][0] == pytest.approx(hardware.q, abs=1e-6)
    assert run.config is not None
    assert run.config["simulation"]["duration"] == 0.1  # in the loop, not in the file
    assert np.abs(run["task.hand.error"][run.t < 0.1]).max() < 1e-5
    # The outcome is printed as `hsp run` prints it.
    printed = " ".join(capsys.readouterr().out.split())
    for name, words in summary_rows(run):
        assert " ".join(f"{name} {words}".split()) in printed


@pytest.mark.system
@pytest.mark.parametrize("kind", ["some", "here"])
def test_a_live_run_begins_at_0_and_so_does_its_repetition(
    kind: str, tmp_path: Path
) -> None:
    """Also of a configuration whose simulation begins later."""
    late = ["--set", "simulation.start_time=2"]
    assert main([*command(tmp_path, "hold", kind), *late]) == 0
    log = tmp_path / "panda_obstacle-live.npz"
    run, again = Rollout.load(log), load_experiment(log).run()
    assert run.t[0] == again.t[0] == 0.0
    running = again.t < 0.1
    name = "task.hand.reference"
    np.testing.assert_allclose(
        again[name][running], run[name][: running.sum()], atol=1e-9
    )


@pytest.mark.parametrize(
    ("log_period", "control_period"), [(0.01, 0.001), (0.0025, None), (0.0002, None)]
)
def test_a_live_log_says_for_how_long_efforts_are_held(
    log_period: float, control_period: float | None
) -> None:
    """A log whose rows are no multiple apart could not be read again."""
    document = read_document("paper/4_moving_obstacle")
    document.override(f"simulation.log_period={log_period}")
    settings = loaded_live(document).scenario.simulation
    assert settings.control_period == control_period
    assert settings.log_period == log_period


@pytest.mark.system
def test_a_fault_is_one_line_of_the_errors(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(command(tmp_path, "halt")) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("hsp: ")
    assert "stopped" in line
