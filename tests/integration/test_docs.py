"""The documents' claims are true; test_pages.py runs them."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import yaml
from places import ROOT

import hsp_control
from hsp_control import load_experiment
from hsp_control.cli.options import command_line
from hsp_control.common.resources import bundled_configs, bundled_robots
from hsp_control.config.scenario import ShownItems
from hsp_control.robot import RobotDescription
from hsp_control.simulation import InitialState, StartPose

# No example starts a robot with a jump of its effort.
pytestmark = pytest.mark.filterwarnings("error:the first effort of joint:UserWarning")

README = (ROOT / "README.md").read_text(encoding="utf-8")


SMALL = """
robot: {name: planar3r}
tasks: {tip: {type: frame_position, axes: xy, trajectory: {type: hold}}}
simulation: {duration: 0.1}
"""


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def test_the_readme_s_python_is_short() -> None:
    (snippet,) = blocks(README, "python")
    assert len([line for line in snippet.splitlines() if line.strip()]) <= 16


def commands(text: str) -> list[list[str]]:
    """Return the words after `hsp` of the commands in a page's shell blocks."""
    shell = "".join(blocks(text, "sh") + blocks(text, "text")).replace("\\\n", " ")
    found = (
        re.match(r"(?:\$ |\.venv/bin/)?hsp ((?:\S[#>&|]|[^#>&|])*)", line.strip())
        for line in shell.splitlines()
    )
    return [shlex.split(command[1]) for command in found if command]


PAGES = sorted(
    page.relative_to(ROOT).as_posix()
    for folder in ("docs", "robots", "examples", "hsp_control/companions")
    for page in (ROOT / folder).rglob("*.md")
    if not {"_build", "generated"} & set(page.parts)
    and commands(page.read_text(encoding="utf-8"))
)


@pytest.mark.parametrize("page", PAGES)
def test_every_command_of_a_page_can_be_given(page: str) -> None:
    bundled = {*bundled_configs(), *bundled_robots()}
    for words in commands((ROOT / page).read_text(encoding="utf-8")):
        options = command_line().parse_args(words)
        name = str(getattr(options, "config", None) or "CONFIG")
        a_reader_s_own = name == "CONFIG" or Path(name).suffix
        assert a_reader_s_own or name in bundled, words


def test_the_compensators_of_the_document_are_a_configuration() -> None:
    text = (ROOT / "docs" / "robustness.md").read_text(encoding="utf-8")
    *others, configuration = blocks(text, "yaml")
    for other in others:
        assert load_experiment(yaml.safe_load(other)).run().status == "completed"
    experiment = load_experiment(
        yaml.safe_load(configuration), "simulation.duration=0.02"
    )
    named = re.findall(r"^- `(\w+)`:", text, re.MULTILINE)
    assert tuple(named) == experiment.compensation.names
    assert experiment.run().status == "completed"


def test_the_view_s_document_is_true() -> None:
    text = (ROOT / "hsp_control/companions/viewer/page.md").read_text(encoding="utf-8")
    (view,) = blocks(text, "yaml")
    configuration = {**yaml.safe_load(view), **yaml.safe_load(SMALL)}
    assert load_experiment(configuration).scenario.view.show.ellipsoid
    (layers,) = re.findall(
        r"reference/generated/yaml.md\)\): (.*?) are off", text, re.DOTALL
    )
    on, off = (re.findall(r"`(\w+)`", part) for part in layers.split(" are on, "))
    defaults = ShownItems().all_fields()
    assert dict.fromkeys(on, True) | dict.fromkeys(off, False) == defaults


def test_the_export_s_document_is_true() -> None:
    text = (ROOT / "hsp_control/companions/viewer/export.md").read_text(
        encoding="utf-8"
    )
    known = command_line().parse_args(["export", "log.npz"])
    for option in re.findall(r"`--(?:no-)?(\w+)`", text):
        assert {"from": "first", "to": "last"}.get(option, option) in vars(known)


def test_the_law_in_the_document_is_the_law_of_the_code() -> None:
    (snippet,) = blocks(
        (ROOT / "docs" / "law.md").read_text(encoding="utf-8"), "python"
    )
    space: dict = {"np": np}
    exec(compile(snippet, "law.md", "exec"), space)
    experiment = load_experiment("paper/4_moving_obstacle")
    robot, controller = experiment.robot, experiment.controller
    rng = np.random.default_rng(0)
    for _ in range(20):
        state = robot.state(
            rng.uniform(0, 9), robot.random_configuration(rng), rng.standard_normal(3)
        )
        output = controller.compute(state)
        a, e_N = space["law"](
            output.task.jacobian,
            output.task.jacobian_dot,
            output.task.acceleration,
            state.v,
            *output.field,
            controller.null_space_gain,
            controller.metric.W,
            np.zeros((3, 3)),
        )
        if not output.damped:
            # Relative to the largest term: near singular random states are large.
            scale = np.abs(a).max()
            np.testing.assert_allclose(
                output.acceleration / scale, a / scale, atol=1e-9
            )
            np.testing.assert_allclose(output.null_space_error, e_N, atol=1e-9)


def test_every_public_name_is_documented_and_importable() -> None:
    for name in vars(hsp_control):
        thing = getattr(hsp_control, name)
        if isinstance(thing, type):
            assert thing.__doc__, name
            assert not name.startswith("_")


def test_the_page_on_a_user_s_robot_is_true() -> None:
    text = (ROOT / "docs" / "own_robot.md").read_text(encoding="utf-8")
    (configuration,) = blocks(text, "yaml")
    lines = [yaml.safe_load(line) for line in configuration.splitlines()]
    for line in lines:
        if "robot" in line:
            RobotDescription(**line["robot"])
        else:
            start = line["start"]
            assert start == "auto" or InitialState(pose=StartPose(**start["pose"]))
