"""A controller without tasks: gravity compensation and the field."""

from pathlib import Path

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.cli import main
from hsp_control.common.errors import ConfigError
from hsp_control.null_space.metrics import IdentityMetric, MassMatrixMetric, Metric
from hsp_control.simulation.plants.model_changes import Inertias, changed

GAIN = 4.0
V0 = np.array([0.3, -0.2, 0.4, 0.1, -0.5, 0.2, 0.6])


@pytest.mark.parametrize("metric", [IdentityMetric(), MassMatrixMetric()], ids=str)
def test_the_velocity_converges_to_the_field(metric: Metric) -> None:
    """P = I: e_N = g - v, and ‖e_N‖_W decays like exp(-K_N t)."""
    robot = hsp.Robot.load("panda")
    field = hsp.TargetPosture(robot.home(), weight=1.5)
    controller = hsp.Controller(
        robot, [], field, metric=metric, null_space_gain=GAIN, limits=None
    )
    q0 = robot.integrate(robot.home(), 0.2 * np.ones(7))
    run = hsp.simulate(controller, q0, V0, duration=1.0)
    norm = run["null_space_norm"]
    np.testing.assert_allclose(norm, norm[0] * np.exp(-GAIN * run.t), rtol=1e-5)
    output = controller.compute(0.0, q0, V0)
    np.testing.assert_allclose(output.null_space_error, output.field.g - V0, atol=1e-12)


def test_tasks_come_and_go() -> None:
    """The effort is continuous where the only task begins or ends."""
    robot = hsp.Robot.load("panda")
    controller = hsp.Controller(robot, [], hsp.JointCentering())
    controller.at(0.2).ramp(0.2).add(hsp.FramePosition("panda_tcp", name="hand"))
    controller.at(0.6).ramp(0.2).remove("hand")
    run = hsp.simulate(controller, robot.home(), duration=1.0, log_period=1e-3)
    there = np.isfinite(run["task.hand.error"]).all(axis=1)
    assert there[(run.t > 0.2005) & (run.t < 0.7995)].all()
    assert not there[(run.t < 0.1995) | (run.t > 0.8005)].any()
    np.testing.assert_array_equal(np.isfinite(run["task.hand.bounded"]), there)
    # The ramp is C²: a jump would be as large as the efforts, not as their change.
    change = np.abs(np.diff(run.tau, axis=0)).max()
    assert change < 0.2 < 0.01 * np.abs(run.tau).max()


def test_a_configuration_declares_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    led = tmp_path / "led.yaml"
    led.write_text(
        "robot: {name: panda}\ntasks: {}\n"
        "null_space: {fields: [{type: joint_centering}]}\n"
        "simulation: {duration: 0.1}\n"
    )
    assert main(["check", str(led)]) == 0
    assert main(["run", str(led), "--out", str(tmp_path)]) == 0
    assert "singular" not in capsys.readouterr().out
    assert main(["plot", str(tmp_path / "led.npz"), "--out", str(tmp_path)]) == 0
    forgotten = tmp_path / "forgotten.yaml"
    forgotten.write_text("robot: {name: panda}\n")
    with pytest.raises(ConfigError, match=r"tasks: nothing given; .* write \{\} for n"):
        hsp.load_experiment(str(forgotten))


def test_its_held_loop_is_checked_for_other_masses() -> None:
    """The field alone: there is no error whose acceleration would be less."""
    robot = hsp.Robot.load("panda")
    controller = hsp.Controller(robot, [], hsp.TargetPosture(robot.home()))
    heavy = hsp.plants.RigidBodyPlant(changed(robot, [Inertias(1.2)]))
    run = hsp.simulate(
        controller, robot.home(), duration=0.05, control_period=1e-3, plant=heavy
    )
    assert run.status == "completed"
