"""User-defined types reach every command, by ``--import`` or by the list in YAML."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest
from places import THOROUGH, further
from typing_commands import hsp, script

PARTS = """
import hsp_control as hsp
from hsp_control.declaration.quantities import Number


def elbow(state):
    return (state.position("panda_link4")[1] - 0.2) ** 2


class Nod(hsp.Cost, type="nod"):
    '''The hand nods.'''

    height: Number = 1.0
    '''How high [m].'''

    def value(self, state):
        return (state.q[3] - self.height) ** 2
"""
CONFIG = """
robot: {name: panda}
tasks: {hand: {type: frame_position, trajectory: {type: hold}, blend: 1}}
null_space:
  fields:
    - {type: function_cost, function: elbow, weight: 0.001}
    - {type: nod, height: 1, weight: 0.001}
simulation: {duration: 0.05, control_period: 0.001}
"""
WITH_CONFIGURATION = {
    "run": "run mine.yaml",
    "check": "check mine.yaml",
    "live": "live mine.yaml --lockstep",
    "play": "play mine.yaml --no-browser",
    "sweep": "sweep mine.yaml --over null_space.gain=5,6 --workers 1",
}
WITH_LOG = {
    "view": "view out/mine.npz --no-browser",
    "export": "export out/mine.npz --html out/mine.html",
    "plot": "plot out/mine.npz --panels null_space",
    "run": "run out/mine.npz",
    "of a live loop": "view out/mine-live.npz --no-browser",
    "of its robot": "view out/mine-robot.npz --no-browser",
    "of a play": "run out/mine-play.npz",
}
USUAL = {
    "parts.py": ["run", "check", "live", "play"],
    "--import": ["run", "live", "sweep"],
}
"""Commands with the list and with the option; all pairs of both if thorough."""
WITHOUT_CONTROLLER = "no controller, only the log's columns are drawn"


CASES = [
    *(("parts.py", what) for what in WITH_LOG),
    *(("--import", what) for what in ("run", "of its robot")),
    *further(*(("--import", what) for what in WITH_LOG)),
]
"""A log names the modules of its types, however they were imported."""


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Make folders with logs, one for each way in which the types are named.

    Not a fixture with parameters: pytest makes one anew for each row of a table.
    """

    @cache
    def folder(how: str) -> Path:
        made = tmp_path_factory.mktemp("own")
        (made / "parts.py").write_text(PARTS)
        listed = how != "--import"
        imports = f"imports: [{how}]\n" if listed else ""
        (made / "mine.yaml").write_text(CONFIG + imports)
        option = "" if listed else " --import parts.py"
        for name, line in WITH_CONFIGURATION.items():
            if THOROUGH or name in USUAL[how]:
                hsp(line + option, made)
        return made

    return folder


@pytest.mark.parametrize(("how", "command"), CASES)
def test_a_log_is_read_with_its_own_types(
    folders: Callable[[str], Path], how: str, command: str
) -> None:
    reported = hsp(WITH_LOG[command], folders(how))
    assert WITHOUT_CONTROLLER not in reported
    assert "is not imported" not in reported


def test_a_module_of_a_package_is_found_on_the_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A reader of the log imports the modules as for a configuration."""
    package = tmp_path / "elsewhere" / "own_package"
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "parts.py").write_text(PARTS)
    (tmp_path / "mine.yaml").write_text(f"{CONFIG}imports: [own_package.parts]\n")
    monkeypatch.setenv("PYTHONPATH", str(package.parent))
    hsp("run mine.yaml", tmp_path)
    assert WITHOUT_CONTROLLER not in hsp(WITH_LOG["view"], tmp_path)


def test_an_edited_file_is_not_run_again(tmp_path: Path) -> None:
    parts = tmp_path / "parts.py"
    parts.write_text(PARTS)
    (tmp_path / "mine.yaml").write_text(f"{CONFIG}imports: [parts.py]\n")
    hsp("run mine.yaml", tmp_path)
    parts.write_text(f"{PARTS}\nopen('run', 'w').close()\n")
    reported = hsp("view out/mine.npz --no-browser", tmp_path)
    assert "missing or was edited since the run; --import" in reported
    assert WITHOUT_CONTROLLER in reported
    assert not (tmp_path / "run").exists()
    reported = hsp(f"view out/mine.npz --no-browser --import {parts}", tmp_path)
    assert WITHOUT_CONTROLLER not in reported
    assert (tmp_path / "run").exists()


def test_strict_reading_runs_no_code(tmp_path: Path) -> None:
    (tmp_path / "parts.py").write_text(f"{PARTS}\nopen('run', 'w').close()\n")
    (tmp_path / "mine.yaml").write_text(f"{CONFIG}imports: [parts.py]\n")
    reported = hsp("run mine.yaml --strict", tmp_path, status=2)
    assert "mine.yaml:9: imports.0: parts.py is code, which --strict does not run" in (
        reported
    )
    assert not (tmp_path / "run").exists()
    hsp("run mine.yaml", tmp_path)
    (tmp_path / "run").unlink()
    reported = hsp("view out/mine.npz --no-browser --strict", tmp_path)
    assert WITHOUT_CONTROLLER in reported
    assert not (tmp_path / "run").exists()


def test_a_script_s_log_names_the_module_of_its_types(tmp_path: Path) -> None:
    """Types of the script itself have no module: the log's columns are drawn."""
    (tmp_path / "parts.py").write_text(PARTS)
    run = """
robot = hsp.Robot.load("panda")
arm = hsp.Controller(robot, [hsp.FramePosition("panda_tcp")], Nod())
hsp.simulate(arm, robot.home(), duration=0.05).save("out/own.npz")
short = hsp.simulation.SimulationSettings(duration=0.05)
experiment = hsp.Experiment(
    "panda", [hsp.FramePosition("panda_tcp")], Nod(), simulation=short
)
experiment.run().save("out/experiment.npz")
open("experiment.yaml", "w").write(experiment.to_yaml())
with hsp.Recorder(arm, "out/recorded.npz") as recorder:
    for k in range(3):
        recorder.record(arm.compute(0.01 * k, robot.home(), [0.0] * 7))
"""
    for name, head in {
        "one": "import hsp_control as hsp\nfrom parts import Nod\n",
        "two": PARTS,
    }.items():
        (tmp_path / f"{name}.py").write_text(head + run)
        script(f"{name}.py", tmp_path)
        logs = "own", "experiment", "recorded"
        for log in logs if name == "one" or THOROUGH else logs[:1]:
            reported = hsp(f"view out/{log}.npz --no-browser", tmp_path)
            known = WITHOUT_CONTROLLER not in reported
            assert known == (name == "one"), (name, log)
        if THOROUGH:  # other commands: test_every_log.py
            hsp("export out/experiment.npz --html out/experiment.html", tmp_path)
            hsp("plot out/own.npz", tmp_path)
        if name == "one":
            hsp("run experiment.yaml --set simulation.duration=0.05", tmp_path)
            hsp("run out/recorded.npz", tmp_path)


def test_freeze_and_inspect_import_too(tmp_path: Path) -> None:
    (tmp_path / "parts.py").write_text(f"{PARTS}\nopen('run', 'w').close()\n")
    (tmp_path / "mine.yaml").write_text(CONFIG)
    reported = hsp("freeze mine.yaml --import parts.py", tmp_path, status=2)
    assert "Python" in reported  # the type is known, but cannot be frozen
    assert "no type" not in reported
    (tmp_path / "run").unlink()
    hsp("inspect panda --import parts.py", tmp_path)
    assert (tmp_path / "run").exists()
