"""Functions and types of a Python file, named in YAML: `hsp --import` runs it first."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import hsp_control as hsp
from hsp_control.cli.main import main
from hsp_control.common.errors import ConfigError
from hsp_control.config import import_file
from hsp_control.config.logged_run import logged_controller
from hsp_control.declaration import imported
from hsp_control.robot.description.access import only_within
from hsp_control.robot.description.sources import packaged_folders

COSTS = """
import hsp_control as hsp
def elbow(state):
    return (state.position("panda_link4")[1] - 0.2) ** 2
class Nod(hsp.Cost, type="nod_of_a_test"):
    '''The hand nods.'''
    height: float
    '''How high [m].'''
    def value(self, state):
        return (state.q[3] - self.height) ** 2
class Above(hsp.Barrier, type="above_of_a_test"):
    '''A frame stays above a height.'''
    frame: str
    '''Its name.'''
    def values(self, state):
        return state.position(self.frame)[2]
"""
CONFIG = """
robot: {name: panda}
tasks: {hand: {type: frame_position}}
null_space:
  fields: [{type: function_cost, function: elbow, weight: 20},
           {type: nod_of_a_test, height: 1}]
limits: {barriers: [{type: above_of_a_test, frame: panda_tcp, minimum: 0.2}]}
simulation: {duration: 0.02, control_period: 0.001}
"""


@pytest.fixture
def costs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(imported, "_functions", {})
    Path("x.yaml").write_text(CONFIG)
    path = Path("costs_of_a_test.py")
    path.write_text(COSTS)
    yield path
    sys.modules.pop(path.stem, None)
    hsp.NullSpaceField.family.members.pop("nod_of_a_test", None)
    hsp.Barrier.family.members.pop("above_of_a_test", None)


def test_yaml_lists_the_content_of_a_file(
    costs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "x.yaml"]) == 2
    message = "no function 'elbow' was imported (there is none); --import FILE.py runs"
    assert message in capsys.readouterr().err
    assert main(["run", "x.yaml", "--import", str(costs), "--strict"]) == 2
    assert "--import costs_of_a_test.py runs code, which" in capsys.readouterr().err
    assert costs.stem not in sys.modules
    assert main(["run", "x.yaml", "--import", str(costs)]) == 0
    # A log names the function, too; the file is not run again.
    experiment = hsp.load_experiment("out/x.npz")
    elbow, nod = experiment.controller.field.terms  # type: ignore[attr-defined]
    assert elbow == 20.0 * hsp.FunctionCost(sys.modules[costs.stem].elbow)
    assert nod.height == 1.0
    (above,) = experiment.scenario.limits.barriers  # type: ignore[union-attr]
    assert above.minimum == 0.2
    assert "function: elbow" in experiment.to_yaml()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("none_of_a_test.py", None, "^none_of_a_test.py: no such file; needs a .py"),
        ("bad_of_a_test.py", "1 / 0", "^bad_of_a_test.py: ZeroDivisionError: division"),
        ("exit_of_a_test.py", "raise SystemExit(0)", "^exit_of.*: SystemExit: 0$"),
        ("json.py", "x = 1", "another module 'json' already; rename the file$"),
    ],
)
@pytest.mark.usefixtures("costs")
def test_a_file_that_cannot_be_run(name: str, text: str | None, message: str) -> None:
    if text is not None:
        Path(name).write_text(text)
    with pytest.raises(ConfigError, match=message):
        import_file(name)


def test_a_log_of_unchanged_code_has_its_controller_where_that_is_permitted(
    costs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As for the floor of a figure, which reads no file but packaged ones."""
    assert main(["run", "x.yaml", "--import", str(costs)]) == 0
    run, packaged = hsp.Rollout.load("out/x.npz"), only_within(packaged_folders())

    def forget() -> None:
        """A new program has not imported the code."""
        sys.modules.pop(costs.stem, None)
        monkeypatch.setattr(imported, "_functions", {})
        hsp.NullSpaceField.family.members.pop("nod_of_a_test", None)
        hsp.Barrier.family.members.pop("above_of_a_test", None)

    forget()
    assert logged_controller(run, packaged) is None
    assert costs.stem not in sys.modules
    assert logged_controller(run, packaged, imports_code=True) is not None
    forget()
    costs.write_text(COSTS + "# edited\n")
    assert logged_controller(run, packaged, imports_code=True) is None
