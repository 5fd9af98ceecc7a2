"""Robots and plants from an MJCF in a configuration."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mjcf_texts import CELL
from wording import wording

from hsp_control import Robot, load_experiment
from hsp_control.cli.main import main
from hsp_control.common.errors import (
    AccessError,
    FrameNotFoundError,
    HspControlError,
    JointNotFoundError,
    ModelError,
    RobotNotFoundError,
    SimulationError,
)
from hsp_control.companions.mujoco import MujocoScenePlant
from hsp_control.robot import RobotDescription
from hsp_control.robot.description.access import only_within

pytest.importorskip("mujoco")

CONFIG = """\
robot: {mjcf: cell.xml, root: base, joints: [j1, j2, j3, j4], keyframe: home}
tasks:
  tip: {type: frame_position, frame: tip, trajectory: {type: hold}}
plant: {type: mujoco_scene, contacts: [ball]}
simulation: {duration: 0.02, control_period: 0.001}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "cell.xml").write_text(CELL)
    (tmp_path / "run.yaml").write_text(CONFIG)
    return tmp_path


def write(folder: Path, old: str, new: str) -> Path:
    path = folder / "changed.yaml"
    text = (folder / "run.yaml").read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


def test_a_configuration_runs_in_its_scene(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    experiment = load_experiment(folder / "run.yaml")
    plant = experiment.plant
    assert isinstance(plant, MujocoScenePlant)
    assert plant.data.ctrl[4] == 0.02  # the keyframe's
    np.testing.assert_allclose(experiment.q0, [0.0, 0.5, 0.0, 1.0], atol=1e-15)
    rollout = experiment.run()
    assert rollout.meta["plant"]["motors"] == ["j1", "j2", "j3", "j4"]
    assert "plant.contact.ball.force" in rollout.columns
    # The log suffices to repeat the run.
    path = folder / "run.npz"
    rollout.save(path)
    again = load_experiment(path).run()
    np.testing.assert_array_equal(again.q, rollout.q)
    assert "has changed" not in caplog.text
    (folder / "cell.xml").write_text(CELL.replace('mass="1"', 'mass="1.5"'))
    load_experiment(path)
    assert f"{folder / 'cell.xml'} has changed since the log was made" in caplog.text


def test_the_plant_may_be_another_mjcf_or_no_mjcf(folder: Path) -> None:
    """It takes the controller's root, joints and keyframe; a URDF has none of them."""
    (folder / "heavy.xml").write_text(CELL.replace('mass="1"', 'mass="1.5"'))
    scene = "{type: mujoco_scene, contacts: [ball]}"
    other = f"{{type: rigid_body, robot: {{mjcf: {folder}/heavy.xml}}}}"
    plant = load_experiment(write(folder, scene, other)).plant
    assert plant.robot.model.inertias[4].mass == pytest.approx(1.55)
    assert plant.robot.source.locked == {"f": 0.02}
    with pytest.raises(SimulationError, match="the plant moves panda with the joints"):
        load_experiment(
            write(folder, scene, "{type: rigid_body, robot: {name: panda}}")
        )


def test_the_examples_of_the_documentation_run(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (Path(__file__).parents[1] / "page.md").read_text(encoding="utf-8")
    (folder / "scene.xml").write_text(CELL)
    monkeypatch.chdir(folder)
    blocks = re.findall(r"```(python|yaml)\n(.*?)```", text, flags=re.DOTALL)
    names: dict[str, Any] = {}
    for language, block in blocks:
        if language == "python":
            exec(block, names)
    assert names["rollout"].t[-1] == pytest.approx(0.1)
    task = (
        "tasks: {tip: {type: frame_position, frame: tip, trajectory: {type: hold}}}\n"
    )
    config = task + "".join(block for kind, block in blocks if kind == "yaml")
    (folder / "docs.yaml").write_text(config)
    experiment = load_experiment(folder / "docs.yaml")
    assert isinstance(experiment.plant, MujocoScenePlant)
    assert experiment.robot.source.locked == {"f": 0.02}


MISTAKES = [
    ("cell.xml", "cel.xml", RobotNotFoundError,
     "robot.mjcf: cel.xml: no such file"),
    ("root: base", "root: bas", FrameNotFoundError,
     "robot.root: no ... 'bas' ... 'base'"),
    ("joints: [j1,", "joints: [k1,", JointNotFoundError,
     "robot.joints: no joint 'k1'"),
    ("keyframe: home", "keyframe: rest", ModelError,
     "robot.keyframe: no keyframe 'rest'"),
    ("mjcf: cell.xml", "name: panda, mjcf: cell.xml", ModelError,
     "robot: give one of ... mjcf ... parts"),
    ("mjcf: cell.xml, root: base", "name: panda", ModelError,
     "robot: joints is only for mjcf"),
    ("mjcf: cell.xml, root: base, joints: [j1, j2, j3, j4]", "name: panda", ModelError,
     "robot: keyframe is only for mjcf"),
    ("keyframe: home", "mimic: false", ModelError, "robot: mimic ... mjcf"),
    ("contacts: [ball]", "contacts: [bal]", FrameNotFoundError,
     "plant.contacts: no ... 'bal' ... 'ball'"),
    ("contacts: [ball]", "motor_inertia: 1", SimulationError,
     "plant: motor_inertia: ... MJCF"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "error", "message"), MISTAKES)
def test_mistakes_have_a_line(
    old: str, new: str, error: type[HspControlError], message: str, folder: Path
) -> None:
    path = write(folder, old, new)
    with pytest.raises(error) as caught:
        load_experiment(path)
    assert re.match(rf"{re.escape(str(path))}:\d+: ", str(caught.value))
    assert re.search(wording(f"{path} ... : {message}"), str(caught.value))


def test_a_scene_needs_an_mjcf(folder: Path) -> None:
    path = folder / "panda.yaml"
    path.write_text(
        "robot: {name: panda}\ntasks: {h: {type: frame_position, "
        "trajectory: {type: hold}}}\nplant: mujoco_scene\n"
        "simulation: {control_period: 0.001}\n"
    )
    with pytest.raises(
        SimulationError, match=r"plant: panda is not declared by an MJC"
    ):
        load_experiment(path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujoco><worldbody>", r"cell\.xml:1:20: malformed XML: no element found"),
        ("<robot name='r'/>", r"is <robot>; in an MJCF it is <mujoco>; give a URDF as"),
        ("<mujoco><boddy/></mujoco>", r"cell\.xml: MuJoCo rejects it: .*'boddy'"),
        ("<mujoco/>", r"^no joint of 'world' moves"),
        ("<!DOCTYPE x><mujoco/>", r"cell\.xml:1: a document type"),
    ],
)
def test_invalid_mjcf(text: str, message: str, folder: Path) -> None:
    path = folder / "cell.xml"
    path.write_text(text)
    with pytest.raises(ModelError, match=message):
        Robot.load(RobotDescription(mjcf=path))


def test_a_scene_may_be_too_large(folder: Path) -> None:
    path = folder / "cell.xml"
    free = "<body><freejoint/><geom size='.1'/></body>" * 34
    path.write_text(f"<mujoco><worldbody>{free}</worldbody></mujoco>")
    with pytest.raises(ModelError, match="204 degrees of freedom; at most 200"):
        Robot.load(RobotDescription(mjcf=path))


# --- untrusted files -----------------------------------------------------------------

MESH = (
    "<mujoco>{}<asset><mesh name='m' {}/></asset><worldbody><body><joint/>"
    "<geom size='.1'/></body></worldbody></mujoco>"
)
OUTSIDE = [
    "<mujoco><include file='../mine.xml'/></mujoco>",
    "<mujoco><include file='inner.xml'/></mujoco>",  # which includes ../mine.xml
    "<mujoco><asset><model name='m' file='../mine.xml'/></asset></mujoco>",
    MESH.format("", "file='../mine.stl'"),
    MESH.format("<compiler meshdir='..'/>", "file='mine.stl'"),
    MESH.format("<compiler assetdir='/'/>", "file='mine.stl'"),
    MESH.format("", "file='/mine.stl'"),
    "<mujoco><asset><texture type='cube' fileright='../mine.png'/></asset></mujoco>",
    "<mujoco><asset><hfield name='h' file='../mine.png'/></asset></mujoco>",
]


@pytest.mark.parametrize("text", OUTSIDE)
def test_strict_reading_opens_no_file_elsewhere(text: str, tmp_path: Path) -> None:
    theirs = tmp_path / "theirs"
    theirs.mkdir()
    (tmp_path / "mine.xml").write_text("<mujoco/>")
    (theirs / "inner.xml").write_text(OUTSIDE[0])
    (theirs / "cell.xml").write_text(text)
    with pytest.raises(AccessError, match=r"outside the folders that strict reading"):
        Robot.load(
            RobotDescription(mjcf=theirs / "cell.xml"), access=only_within([theirs])
        )


def test_strict_reading_loads_no_plugins_and_ends(folder: Path) -> None:
    strict = only_within([folder])
    path = folder / "cell.xml"
    assert Robot.load(RobotDescription(mjcf=path), access=strict).nv == 11
    for text, tag in (
        ("<mujoco><extension><plugin plugin='x'/></extension></mujoco>", "plugin"),
        ("<mujoco><worldbody><replicate count='9'/></worldbody></mujoco>", "replicate"),
    ):
        path.write_text(text)
        with pytest.raises(AccessError, match=f"strict reading allows no <{tag}>"):
            Robot.load(RobotDescription(mjcf=path), access=strict)
    path.write_text("<mujoco><include file='cell.xml'/></mujoco>")
    with pytest.raises(AccessError, match="includes more than 200 files"):
        Robot.load(RobotDescription(mjcf=path), access=strict)
    elsewhere = only_within([folder / "other"])
    with pytest.raises(AccessError, match=r"mjcf: mjcf .* outside the folders"):
        Robot.load(RobotDescription(mjcf=path), access=elsewhere)


def test_check_accepts_a_robot_of_a_mujoco_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "cell.xml").write_text(CELL)
    file = tmp_path / "cell.yaml"
    file.write_text(
        "robot: {mjcf: cell.xml, root: base, joints: [j1, j2, j3, j4]}\n"
        "start: {configuration: [0, 0.5, 0, 1]}\n"
        "tasks: {hand: {type: frame_position, frame: tip}}\n"
        "plant: mujoco_scene\n"
        "simulation: {duration: 1, control_period: 0.001}\n"
    )
    assert main(["check", str(file)]) == 0
    assert f"{file}: OK" in capsys.readouterr().out
