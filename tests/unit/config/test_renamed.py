"""Keys of version 0.1 still load, with one warning; errors keep their lines."""

import json
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from hsp_control import Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.common.exceptions import ConfigError
from hsp_control.config import renamed
from hsp_control.config.document import Document
from hsp_control.config.renamed import Renamed, RenamedKeyWarning
from hsp_control.config.scenario import Scenario
from hsp_control.config.validation import validate
from hsp_control.declaration.schema import entry, shape
from hsp_control.sweeps.factor import factors
from hsp_control.sweeps.plan import document
from hsp_control.trajectories import (
    ComposedPose,
    Hold,
    HoldOrientation,
    OrientationPath,
)

OLD = """\
robot: {name: panda}
tasks:
  hand: {type: frame_position, trajectory: {type: hold}}
simulation: {duration: 0.02, control_period: 0.001}
remedies:
  velocity_filter:
    cutoff: 100
"""
SAYS = "remedies is now compensation"


def written(folder: Path, text: str = OLD) -> Path:
    """Return a configuration file with a text."""
    file = folder / "mine.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def read(text: str) -> Document:
    """Return the document of a text with old keys, without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RenamedKeyWarning)
        return Document.parse(text, "mine.yaml")


def test_an_old_key_in_a_file_loads_with_a_warning(tmp_path: Path) -> None:
    file = written(tmp_path)
    with pytest.warns(FutureWarning) as caught:
        experiment = load_experiment(file)
    assert [str(each.message) for each in caught] == [f"{file}:5: {SAYS}"]
    assert experiment.compensation.names == ("velocity_filter",)


def test_an_old_key_in_an_override(tmp_path: Path) -> None:
    file = written(tmp_path, OLD.replace("remedies", "compensation"))
    override = "remedies.predictor={}"
    with pytest.warns(FutureWarning) as caught:
        experiment = load_experiment(file, override)
    assert [str(each.message) for each in caught] == [f"--set {override}: {SAYS}"]
    assert experiment.compensation.names == ("velocity_filter", "predictor")


def test_a_new_key_in_an_override_of_an_old_file(tmp_path: Path) -> None:
    with pytest.warns(FutureWarning, match=SAYS):
        experiment = load_experiment(
            written(tmp_path), "compensation.velocity_filter.cutoff=50"
        )
    assert experiment.scenario.compensation.velocity_filter.cutoff == 50


def test_an_old_key_in_a_log(tmp_path: Path) -> None:
    with pytest.warns(FutureWarning):
        rollout = load_experiment(written(tmp_path)).run()
    config = rollout.meta["config"]
    config["remedies"] = config.pop("compensation")
    log = rollout.save(tmp_path / "old.npz")
    with pytest.warns(FutureWarning) as caught:
        again = load_experiment(log)
    assert [str(each.message) for each in caught] == [f"{log}: {SAYS}"]
    assert again.compensation.names == ("velocity_filter",)
    assert Rollout.load(log).config == config  # the log itself is not changed


def test_data_of_the_caller_are_not_changed() -> None:
    data = yaml.safe_load(OLD)
    with pytest.warns(FutureWarning, match=f"^configuration: {SAYS}$"):
        load_experiment(data, "simulation.duration=0.01")
    assert data == yaml.safe_load(OLD)


def test_errors_below_an_old_key_keep_their_line(tmp_path: Path) -> None:
    file = written(tmp_path, OLD.replace("100", "-1"))
    with pytest.warns(FutureWarning), pytest.raises(ConfigError) as caught:
        load_experiment(file)
    assert str(caught.value) == (
        f"{file}:7: compensation.velocity_filter.cutoff: -1 is negative; "
        "must be greater than 0"
    )


def test_the_old_and_the_new_key_at_once_are_an_error(tmp_path: Path) -> None:
    file = written(tmp_path, f"{OLD}compensation: {{predictor: {{}}}}\n")
    with pytest.raises(ConfigError) as caught:
        load_experiment(file)
    assert str(caught.value) == (
        f"{file}:5: remedies: is now compensation, which is also given; "
        "remove one of them"
    )


def test_the_command_line_prints_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path)
    override = "remedies.predictor={}"
    assert main(["check", str(file), "--set", override]) == 0
    assert capsys.readouterr().err.splitlines() == [
        f"hsp: {file}:5: {SAYS}",
        f"hsp: --set {override}: {SAYS}",
    ]
    assert main(["run", str(file), "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().err == f"hsp: {file}:5: {SAYS}\n"


def test_an_old_key_in_a_sweep() -> None:
    with pytest.warns(FutureWarning) as caught:
        (factor,) = factors(["remedies.velocity_filter.cutoff=50,100"])
    assert factor.name == "compensation.velocity_filter.cutoff"
    message = f"--over remedies.velocity_filter.cutoff=50,100: {SAYS}"
    assert [str(each.message) for each in caught] == [
        message.split("=")[0] + f": {SAYS}"
    ]


def test_an_old_key_in_the_file_of_a_sweep() -> None:
    change = {"keys": ["remedies", "effort_rate"], "value": 5.0, "origin": "--over x"}
    task = {"name": "a.yaml", "data": yaml.safe_load(OLD), "changes": [change]}
    with pytest.warns(FutureWarning):
        found = document(json.dumps(task)).to_dict()
    assert found["compensation"] == {
        "velocity_filter": {"cutoff": 100},
        "effort_rate": 5.0,
    }


# -- keys of trajectories and distances -----------------------------------------------

TURNED = """\
robot: {name: panda}
scene:
  obstacles:
    board:
      shape: {type: box, size: [0.1, 0.1, 0.1]}
      center: {type: hold, point: [1, 1, 1]}
      orientation:
        type: spin
        rpy: [0, 0, 1]
        axis: [0, 0, 1]
        rate: 2
tasks:
  hand:
    type: frame_orientation
    trajectory:
      type: path
      rpy: [[0, 0, 1], [0, 0, 2]]
      times: [0, 1]
  still: {type: frame_orientation, trajectory: {type: hold, rpy: [0, 1, 0]}}
  pose:
    type: frame_pose
    trajectory:
      type: composed
      position: {type: hold}
      orientation: {type: path, rpy: [[0, 0, 3], [0, 0, 4]], times: [0, 1]}
  screw:
    type: frame_pose
    trajectory: {type: screw, position: [1, 0, 1], rpy: [3, 0, 0], duration: 2}
limits:
  distances:
  - {type: obstacles, least: 0.03}
  - {type: self}
"""
NOW = {
    "scene.obstacles.board.orientation.rpy": (9, "rotation"),
    "tasks.hand.trajectory.rpy": (17, "rotations"),
    "tasks.still.trajectory.rpy": (19, "rotation"),
    "tasks.pose.trajectory.orientation.rpy": (25, "rotations"),
    "tasks.screw.trajectory.rpy": (28, "rotation"),
    "limits.distances.0.least": (31, "minimum"),
}
"""The line of each old key, and its new name."""


def test_each_old_key_warns_at_its_line() -> None:
    with pytest.warns(FutureWarning) as caught:
        Document.parse(TURNED, "mine.yaml")
    told = {str(each.message) for each in caught}
    assert told == {
        f"mine.yaml:{line}: {old} is now {old.rpartition('.')[0]}.{new}"
        for old, (line, new) in NOW.items()
    }
    assert len(caught) == len(told)


def test_old_keys_mean_what_the_new_ones_do() -> None:
    new = TURNED.replace("rpy: [[", "rotations: [[").replace("rpy", "rotation")
    new = new.replace("least", "minimum")
    current = validate(Document.parse(new, "mine.yaml"), Scenario)
    assert validate(read(TURNED), Scenario) == current
    assert current.tasks["hand"].trajectory == OrientationPath(
        [[0, 0, 1], [0, 0, 2]], [0, 1]
    )
    assert current.limits.distances[0].minimum == 0.03


@pytest.mark.parametrize("old", NOW)
def test_an_error_below_an_old_key_keeps_its_line(old: str) -> None:
    line = NOW[old][0] - 1
    lines = TURNED.splitlines()
    value = "[[a" if "[[" in lines[line] else "[a" if "rpy" in lines[line] else "a"
    key = old.rpartition(".")[2]
    lines[line] = re.sub(rf"({key}: )\[*[-0-9.]+", rf"\1{value}", lines[line])
    new = f"{old.rpartition('.')[0]}.{NOW[old][1]}"
    with pytest.raises(ConfigError) as caught:
        validate(read("\n".join(lines)), Scenario)
    inside = ".0" * value.count("[")
    assert str(caught.value) == (
        f"mine.yaml:{line + 1}: {new}{inside}: 'a' is text; expected a number"
    )


@pytest.mark.parametrize("old", NOW)
def test_an_override_of_an_old_key_is_that_of_the_new_one(old: str) -> None:
    found, new = read(TURNED), f"{old.rpartition('.')[0]}.{NOW[old][1]}"
    with pytest.warns(FutureWarning) as caught:
        found.override(f"{old}=7")
    assert [str(each.message) for each in caught] == [
        f"--set {old}=7: {old} is now {new}"
    ]
    path = tuple(int(key) if key.isdecimal() else key for key in new.split("."))
    assert found.location(path) == f"--set {old}=7"
    value: Any = found.to_dict()
    for key in path:
        value = value[key]
    assert value == 7


def test_the_old_name_in_a_sweep_is_resolved_where_the_type_is_known() -> None:
    old = "tasks.hand.trajectory.rpy"
    (factor,) = factors({old: [[[0, 0, 5], [0, 0, 6]]]})
    assert factor.name == old  # `rotation` or `rotations`: the type says which
    found = read(TURNED)
    with pytest.warns(FutureWarning, match=r"rpy is now .*rotations$"):
        found.assign(list(factor.keys), [[0, 0, 5], [0, 0, 6]], factor.origin)
    task = validate(found, Scenario).tasks["hand"]
    assert task.trajectory.rotations[0, 2] == 5


def test_every_new_key_exists() -> None:
    for each in renamed.RENAMED:
        holders = shape(Scenario).options
        for key in each.new[:-1]:
            inner = (entry(holder, 0 if key == "*" else key) for holder in holders)
            holders = tuple(o for found in inner if found for o in found.options)
        of_type = [
            holder
            for holder in holders
            if each.type in (None, getattr(holder, "yaml_type", None))
        ]
        assert any(entry(holder, each.new[-1]) for holder in of_type), each


# -- what logs of version 0.1 contain -------------------------------------------------

LOGGED = """\
robot: {name: solo12, root: null, locked: null}
scene:
  obstacles:
    ball:
      shape: {type: sphere, radius: 0.1}
      center: {origin: world, type: hold, point: [0, 0, 1]}
      orientation: null
contacts:
  sole: {friction: 0.7, schedule: null, type: surface, frame: FL_FOOT, length: null,
         width: null, center: [0, 0, 0], corners: [[0, 0, 0], [0, 1, 0], [1, 0, 0]]}
tasks:
  spin:
    priority: 1
    schedule: null
    gains: {kp: null, kv: null, natural_frequency: 10.0, damping_ratio: null}
    type: angular_momentum
    rate: 10.0
    trajectory: {origin: world, type: hold, point: [0, 0, 0]}
  trunk:
    priority: 1
    gains: {kp: null, kv: null, natural_frequency: 10.0, damping_ratio: null}
    blend: null
    type: frame_pose
    frame: base_link
    trajectory:
      type: composed
      position: {origin: world, type: hold, point: null}
      orientation: {type: hold, rpy: null}
limits: null
null_space:
  metric: {type: identity}
  fields:
  - {type: target_posture, weight: 1.0, target: start, weights: 1.0}
"""


def test_what_a_log_of_version_0_1_contains() -> None:
    with pytest.warns(FutureWarning) as caught:
        found = Document.parse(LOGGED, "old.npz")
    assert sorted(str(each.message) for each in caught) == [
        "old.npz:15: tasks.spin.gains has no effect; remove it",
        "old.npz:28: tasks.trunk.trajectory.orientation.rpy is now "
        "tasks.trunk.trajectory.orientation.rotation",
    ]
    scenario = validate(found, Scenario)
    ball = scenario.scene["ball"]
    np.testing.assert_array_equal(ball.orientation.sample(0.0).rotation, np.eye(3))
    assert scenario.contacts["sole"].points.shape == (3, 3)
    assert scenario.tasks["spin"].priority == 1
    assert scenario.tasks["trunk"].trajectory == ComposedPose(Hold(), HoldOrientation())


@pytest.mark.parametrize("robot", ["panda", "solo12"])
def test_gains_of_another_task_are_not_removed(robot: str) -> None:
    task = {"type": "center_of_mass", "gains": {"kp": 1, "kv": 2}}
    data = {"robot": {"name": robot}, "tasks": {"a": task}}
    assert Document(data, {}, "data").to_dict() == data


# -- tables with nested keys ----------------------------------------------------------

NESTED = (
    Renamed(("limits", "margin"), ("limits", "position_margin")),
    Renamed(("frequency",), ("simulation", "control", "frequency")),
    Renamed(("tasks", "*", "gain"), ("tasks", "*", "gains", "kp")),
    Renamed(("fields", "*", "size"), ("fields", "*", "extent"), "box"),
    Renamed(("fields", "*", "size"), ("fields", "*", "influence")),
)


@pytest.fixture
def nested(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the table by one with nested keys."""
    monkeypatch.setattr(renamed, "RENAMED", NESTED)


@pytest.mark.usefixtures("nested")
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ({"limits": {"margin": 1, "a": 2}}, {"limits": {"position_margin": 1, "a": 2}}),
        ({"frequency": 5}, {"simulation": {"control": {"frequency": 5}}}),
        (
            {"frequency": 5, "simulation": None},
            {"simulation": {"control": {"frequency": 5}}},
        ),
        ({"frequency": 5, "simulation": 3}, {"frequency": 5, "simulation": 3}),
        (
            {"tasks": {"a": {"gain": 1}, "b": {"gain": 2, "gains": {"kv": 3}}, "c": 4}},
            {
                "tasks": {
                    "a": {"gains": {"kp": 1}},
                    "b": {"gains": {"kp": 2, "kv": 3}},
                    "c": 4,
                }
            },
        ),
        (
            {"fields": [{"size": 1}, {}, {"size": 2}]},
            {"fields": [{"influence": 1}, {}, {"influence": 2}]},
        ),
        (
            {"fields": [{"size": 1, "type": "box"}, {"size": 2, "type": "ball"}]},
            {
                "fields": [
                    {"extent": 1, "type": "box"},
                    {"influence": 2, "type": "ball"},
                ]
            },
        ),
        (
            {"tasks": [], "fields": {}, "limits": 1},
            {"tasks": [], "fields": {}, "limits": 1},
        ),
    ],
)
def test_nested_keys(old: dict[str, Any], new: dict[str, Any]) -> None:
    assert read(yaml.safe_dump(old)).to_dict() == new


@pytest.mark.usefixtures("nested")
def test_nested_keys_keep_their_lines() -> None:
    found = read("a: 1\nfields:\n- b: 1\n  size: {c: 1,\n    d: 2}\n")
    assert found.location(("fields", 0, "influence")) == "mine.yaml:4"
    assert found.location(("fields", 0, "influence", "d")) == "mine.yaml:5"
    with pytest.warns(FutureWarning, match=r"fields\.0\.size is now fields\.0\.infl"):
        found.override("fields.0.size.d=3")
    assert found.to_dict()["fields"][0]["influence"] == {"c": 1, "d": 3}
    assert found.location(("fields", 0, "influence", "d")) == "--set fields.0.size.d=3"


@pytest.mark.usefixtures("nested")
def test_old_keys_inside_the_value_of_an_override() -> None:
    found = Document.parse("a: 1", "mine.yaml")
    with pytest.warns(
        FutureWarning, match=r"^--set .*: limits\.margin is now limits\."
    ):
        found.override("limits={margin: 2}")
    assert found.to_dict()["limits"] == {"position_margin": 2}
    assert found.location(("limits", "position_margin")) == "--set limits={margin: 2}"


@pytest.mark.usefixtures("nested")
def test_old_and_new_nested_keys_at_once() -> None:
    with pytest.raises(ConfigError) as caught:
        Document.parse("limits:\n  position_margin: 1\n  margin: 2", "mine.yaml")
    assert str(caught.value) == (
        "mine.yaml:3: limits.margin: is now limits.position_margin, which is also "
        "given; remove one of them"
    )
