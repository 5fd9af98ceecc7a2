"""Keys of version 0.1 still load, with one warning; errors keep their lines."""

import json
import warnings
from pathlib import Path
from typing import Any

import pytest
import yaml

from hsp_control import Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.common.exceptions import ConfigError
from hsp_control.config import json_schema, renamed
from hsp_control.config.document import Document
from hsp_control.config.renamed import RenamedKeyWarning
from hsp_control.config.scenario import Scenario
from hsp_control.sweeps.factor import factors
from hsp_control.sweeps.plan import document

pytestmark = pytest.mark.filterwarnings("error")

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


def test_every_new_key_exists() -> None:
    for new in renamed.RENAMED.values():
        assert new[0] in Scenario.model_fields


# -- tables with nested keys ----------------------------------------------------------

NESTED: dict[tuple[str | int, ...], tuple[str | int, ...]] = {
    ("limits", "margin"): ("limits", "position_margin"),
    ("frequency",): ("simulation", "control", "frequency"),
    ("tasks", "*", "gain"): ("tasks", "*", "gains", "kp"),
    ("fields", "*", "size"): ("fields", "*", "influence"),
}


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


# -- the schema -----------------------------------------------------------------------


def test_every_key_of_the_schema_has_a_description() -> None:
    schema = json_schema()
    models = {"Scenario": schema, **schema["$defs"]}
    without = [
        f"{name}.{key}"
        for name, model in models.items()
        for key, value in model.get("properties", {}).items()
        if not value.get("description")
    ]
    assert without == []
