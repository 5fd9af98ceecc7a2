"""Plants from YAML: the configurations on another engine, and every imperfection."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from places import ROOT
from wording import wording

from hsp_control import load_experiment
from hsp_control.common.errors import HspControlError
from hsp_control.simulation.plants import (
    ImperfectPlant,
)

EVERYTHING: dict[str, Any] = {
    "type": "rigid_body",
    "inertias": {"mass_factor": 1.1, "com_shift": [0.001, 0.0, 0.0],
     "random_mass": 0.1, "random_inertia": 0.2, "random_com": 0.001},
    "payload": {"frame": "panda_tcp", "mass": 0.5, "radius": 0.03},
    "motor_inertia": 0.01,
    "friction": {"coulomb": 0.3, "viscous": [0.1] * 7},
    "pushes": [{"frame": "panda_tcp", "force": [5, 0, 0], "start": 0.01}],
    "sensors": {"delay": 1, "position_noise": 1e-5, "encoder_resolution": 1.2e-5,
     "differenced_velocity": True, "velocity_noise": 0.001},
    "drives": {"dropped": 0.05, "delay": 1, "jitter": 0.0003, "noise": 0.05,
     "saturation": "model"},
    "seed": 7,
}  # fmt: skip


def panda(plant: Any) -> dict[str, Any]:
    return {
        "robot": {"name": "panda"},
        "tasks": {"hand": {"type": "frame_position", "trajectory": {"type": "hold"}}},
        "plant": plant,
        "simulation": {"duration": 0.1, "control_period": 0.001},
    }


@pytest.mark.parametrize("kind", ["rigid_body", "mujoco"])
def test_everything_at_once(kind: str, tmp_path: Path) -> None:
    """It runs on both engines, and its log alone suffices to repeat the run."""
    if kind == "mujoco":
        pytest.importorskip("hsp_control.companions.mujoco")
    experiment = load_experiment(panda({**EVERYTHING, "type": kind}))
    plant = experiment.plant
    assert isinstance(plant, ImperfectPlant)
    engines = {"rigid_body": "StickingPlant", "mujoco": "MujocoPlant"}
    assert type(plant.plant).__name__ == engines[kind]
    sensors = [type(sensor).__name__ for sensor in plant.sensors]
    assert sensors == [
        "SensorDelay",
        "PositionNoise",
        "Encoder",
        "DifferencedVelocity",
        "VelocityNoise",
    ]
    drives = [type(drive).__name__ for drive in plant.drives]
    assert drives == [
        "DroppedPeriods",
        "EffortDelay",
        "Jitter",
        "EffortNoise",
        "Saturation",
    ]
    nominal = experiment.robot.model
    assert experiment.controller.robot is experiment.robot
    assert plant.robot is not experiment.robot
    assert plant.robot.model.inertias[7].mass > nominal.inertias[7].mass + 0.4
    np.testing.assert_allclose(plant.robot.model.armature - nominal.armature, 0.01)
    run = experiment.run()
    described = run.meta["plant"]
    assert described["friction"]["coulomb"] == [0.3] * 7
    assert described["pushes"][0]["force"] == [5.0, 0.0, 0.0]
    assert described["seed"] == 7
    again = load_experiment(run.save(tmp_path / "run.npz")).run()
    for name in run.columns:
        np.testing.assert_array_equal(again[name], run[name], err_msg=name)
    other = load_experiment(panda({**EVERYTHING, "type": kind, "seed": 8})).run()
    assert np.abs(other.q - run.q).max() > 1e-7


def test_another_description_of_the_robot_as_the_plant(tmp_path: Path) -> None:
    """A copy of the URDF with other masses, beside the configuration."""
    source = load_experiment("panda_limits").robot.source.urdf
    text = source.read_text(encoding="utf-8")
    changed = text.replace('<mass value="', '<mass value="1')
    assert changed != text
    (tmp_path / "real.urdf").write_text(changed, encoding="utf-8")
    config = panda({"type": "rigid_body", "robot": {"name": "real.urdf"}})
    config["robot"]["locked"] = {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    (tmp_path / "run.yaml").write_text(str(config), encoding="utf-8")
    experiment = load_experiment(tmp_path / "run.yaml")
    mine, real = experiment.robot.model, experiment.plant.robot.model
    assert real.inertias[3].mass > mine.inertias[3].mass + 5.0
    assert experiment.run().meta["config"]["plant"]["robot"]["name"] == str(
        tmp_path / "real.urdf"
    )


def test_the_page_s_configurations_run() -> None:
    pytest.importorskip("hsp_control.companions.mujoco")
    page = ROOT / "docs" / "plants.md"
    text = page.read_text(encoding="utf-8")
    blocks = re.findall(r"^```yaml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert len(blocks) == 2
    for block in blocks:
        experiment = load_experiment(yaml.safe_load(block), "simulation.duration=0.02")
        assert experiment.run().status == "completed"


@pytest.mark.parametrize(
    ("plant", "message"),
    [
        ("rigidbody", "plant.type: unknown ... 'rigidbody' ... 'rigid_body'"),
        ({"type": "rigidbody"}, "plant.type: unknown ... 'rigidbody' ... 'rigid_body'"),
        ({"type": "rigid_body", "payloda": 1},
         "plant.payloda: unknown ... 'payloda' ... 'payload'"),
        ({"type": "rigid_body", "payload": {"frame": "panda_tpc", "mass": 1}},
         "plant.payload.frame: no ... 'panda_tpc' ... 'panda_tcp'"),
        ({"type": "rigid_body", "pushes": [{"frame": "panda_tpc"}]},
         "plant.pushes.0.frame: no ... 'panda_tpc' ... 'panda_tcp'"),
        ({"type": "rigid_body", "friction": {"coulomb": [1, 2]}},
         "plant.friction.coulomb: ... (2,) ... one number"),
        ({"type": "rigid_body", "motor_inertia": [1, 2]},
         "plant.motor_inertia: ... (2,) ... one number"),
        ({"type": "rigid_body", "sensors": {"velocity_noise": [1]}},
         "plant.sensors.velocity_noise.std: ... (1,) ... one number"),
        ({"type": "rigid_body", "drives": {"noise": [1]}},
         "plant.drives.noise.std: ... (1,) ... one number"),
        ({"type": "rigid_body", "drives": {"dropped": 1.0}},
         "plant.drives.dropped.probability: 1.0 ... less than 1"),
        ({"type": "rigid_body", "robot": {"name": "planar3r"}},
         "plant: ... planar3r ... joint1, joint2, joint3"),
    ],
)  # fmt: skip
def test_plants_that_are_none(plant: Any, message: str) -> None:
    with pytest.raises(HspControlError, match=wording(f"... {message}")):
        load_experiment(panda(plant))


@pytest.mark.parametrize(
    "plant",
    ["mujoco", {"type": "rigid_body", "friction": "urdf"},
     {"type": "rigid_body", "drives": {"delay": 1}}],
)  # fmt: skip
def test_sampled_plants_need_a_control_period(plant: Any) -> None:
    if plant == "mujoco":
        pytest.importorskip("hsp_control.companions.mujoco")
    config = panda(plant)
    del config["simulation"]["control_period"]
    message = r"plant: this plant needs efforts that are held for a period: set "
    with pytest.raises(HspControlError, match=message):
        load_experiment(config)
