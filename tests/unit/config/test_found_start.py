"""A searched start: logged, repeated, refused with numbers, suggested by check."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from robot_texts import ARM, INERTIA

from hsp_control import Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.common.errors import ConfigError, ConfigurationError, ModelError
from hsp_control.robot import RobotDescription

IIWA: dict[str, Any] = {
    "robot": {"name": "iiwa14"},
    "tasks": {"hand": {"type": "frame_pose"}},
    "simulation": {
        "duration": 0.02,
        "control_period": 0.001,
        "integrator": {"type": "rk4", "step": 0.001},
    },
}


def test_auto_is_regular_for_the_tasks_and_recorded(tmp_path: Path) -> None:
    experiment = load_experiment({**IIWA, "start": "auto"})
    output = experiment.controller.compute(0.0, experiment.q0, experiment.v0)
    assert not output.damped
    again = load_experiment(yaml.safe_load(experiment.to_yaml()))
    np.testing.assert_array_equal(again.q0, experiment.q0)
    log = experiment.run().save(tmp_path / "run.npz")
    np.testing.assert_array_equal(Rollout.load(log).q[0], experiment.q0)
    repeated = load_experiment(log)
    np.testing.assert_array_equal(repeated.q0, experiment.q0)
    assert repeated.scenario.start.configuration is not None


def test_a_given_orientation_is_used() -> None:
    pose = {"position": [0.5, 0.0, 0.5], "rotation": [0.0, 2.5, 0.0]}
    experiment = load_experiment({**IIWA, "start": {"pose": pose}})
    robot = experiment.robot
    frame = robot.state(0.0, experiment.q0, np.zeros(7)).frame(robot.end_effector)
    np.testing.assert_allclose(frame.position, pose["position"], atol=1e-8)
    turned = [np.sin(2.5), 0.0, np.cos(2.5)]
    np.testing.assert_allclose(frame.rotation[:, 2], turned, atol=1e-8)


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ({"pose": {"position": [3, 0, 0]}}, r"start\.pose: frame .* cannot reach its"),
        ({"pose": {"position": [1, 0]}}, r"start\.pose\.position: .* needs 3"),
        (
            {"pose": {"frame": "tpi", "position": [1, 0, 0]}},
            r"start\.pose\.frame: no frame 'tpi'",
        ),
        ({"pose": {"position": [1, 0, 0]}, "joints": "auto"}, "only one of joints and"),
        ("auot", r"start: .* expected 'auto' or a dict; did you mean 'auto'"),
    ],
)
def test_mistakes_have_their_place(start: Any, message: str) -> None:
    with pytest.raises((ConfigurationError, ConfigError, LookupError), match=message):
        load_experiment({**IIWA, "start": start})


def test_a_floating_base_needs_more_than_joints() -> None:
    data = {
        **IIWA,
        "robot": {"name": "iiwa14", "root": "free_flyer"},
        "base": "flying",
        "start": "auto",
    }
    with pytest.raises(ConfigurationError, match=r"start\.joints: .* free-flyer root;"):
        load_experiment(data)


def write(folder: Path, **changes: Any) -> str:
    path = folder / "iiwa.yaml"
    path.write_text(yaml.safe_dump({**IIWA, **changes}))
    return str(path)


def test_check_offers_a_start_that_can_be_pasted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", write(tmp_path, start={"joints": [0.0] * 7})]) == 0
    printed = capsys.readouterr().out
    assert "The tasks hand are singular at the start" in printed
    (line,) = [line for line in printed.splitlines() if line.startswith("    start: ")]
    offered = yaml.safe_load(line)["start"]
    assert main(["check", write(tmp_path, start=offered)]) == 0
    assert "singular at the start:" not in capsys.readouterr().out


def test_check_names_colliding_links(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ball = {
        "shape": {"type": "sphere", "radius": 0.1},
        "center": {"type": "hold", "point": [0.0, 0.0, 0.6]},
    }
    assert main(["check", write(tmp_path, scene={"obstacles": {"ball": ball}})]) == 0
    printed = capsys.readouterr().out
    assert "The start is in collision: iiwa_link_" in printed
    assert "to ball overlap by 0." in printed


def test_check_names_inertias_that_no_body_can_have(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = INERTIA.replace('izz="0.1"', 'izz="0.5"')
    (tmp_path / "arm.urdf").write_text(ARM.replace(INERTIA, wrong, 1))
    tasks = {"hand": {"type": "frame_position", "axes": "xy"}}
    robot: dict[str, Any] = {"name": "arm.urdf"}
    assert main(["check", write(tmp_path, robot=robot, tasks=tasks)]) == 0
    printed = capsys.readouterr().out
    assert (
        "arm: no body can have the inertias of upper; project_inertias: true" in printed
    )
    robot["project_inertias"] = True
    assert main(["check", write(tmp_path, robot=robot, tasks=tasks)]) == 0
    assert "no body" not in capsys.readouterr().out


def test_a_description_is_located_at_its_key(tmp_path: Path) -> None:
    path = write(tmp_path, robot={"description": "no_such_description"})
    with pytest.raises(
        FileNotFoundError, match=r"iiwa\.yaml:\d+: robot\.description: "
    ):
        load_experiment(path)
    with pytest.raises(
        ModelError, match="robot: give one of name, description, mjcf and parts"
    ):
        load_experiment({**IIWA, "robot": {"locked": {}}})
    assert (
        RobotDescription(description="arm_description").located(tmp_path).name is None
    )
