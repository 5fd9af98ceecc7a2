"""An unmodelled push moves joints beyond their limits: this is reported."""

import numpy as np
import pytest
from places import THOROUGH

from hsp_control import Rollout, load_experiment
from hsp_control.cli.main import main
from hsp_control.constraints.limits.acceleration_bounds import (
    BEYOND_POSITION,
    BEYOND_SPEED,
)
from hsp_control.control.actuation import Status
from hsp_control.simulation.measures import measures

pytest.importorskip("mujoco")
TWIST = "{frame: panda_hand, moment: [0, 0, -60], start: 0.05, duration: 0.1}"
SHOVE = "{frame: arm_left_7_link, force: [0, 200, 0], start: 0.1, duration: 0.1}"
PANDA = {
    "robot": {"name": "panda"},
    "start": {"configuration": [0, 0, 0, -1.6, 0, 1.6, 2.8]},
    "tasks": {"hold": {"type": "joint_posture"}},
    "simulation": {"duration": 0.3, "control_period": 0.001, "log_period": 0.01},
}
TALOS_STANDS = "contacts: {left_sole_link: {}, right_sole_link: {}}"
CASES = {
    "panda on rigid bodies": (PANDA, f"plant={{type: rigid_body, pushes: [{TWIST}]}}"),
    "panda on mujoco": (
        PANDA,
        f"plant={{type: mujoco, joint_limits: false, pushes: [{TWIST}]}}",
    ),
    "talos on rigid contacts": (
        "whole_body/talos_circle",
        f"plant={{type: rigid_contacts, {TALOS_STANDS}, pushes: [{SHOVE}]}}",
    ),
    "talos on mujoco": (
        "whole_body/talos_circle",
        f"plant={{type: mujoco, {TALOS_STANDS}, pushes: [{SHOVE}]}}",
    ),
}
USUAL = [each for each in CASES if THOROUGH or each != "talos on mujoco"]


@pytest.mark.slow
@pytest.mark.parametrize("case", USUAL)
def test_a_joint_beyond_its_limit_is_reported(case, tmp_path, capsys):
    config, plant = CASES[case]
    if case.startswith("talos"):
        pytest.importorskip("example_robot_data")
    brief = (
        plant,
        "simulation.duration=0.3",
        "simulation.control_period=0.001",
        "simulation.log_period=0.01",
        "simulation.integrator={type: rk4, step: 0.001}",
    )
    experiment = load_experiment(config, *brief)
    run = experiment.run()
    every = load_experiment(config, *brief, "simulation.log_period=0.001").run()
    limits = experiment.controller.limits
    outside = np.maximum(
        every["joint_positions"] - limits.upper, limits.lower - every["joint_positions"]
    )
    outside = np.maximum(outside, 0.0)
    # The push exceeds the motors' efforts; the status shows when.
    worst, dof = np.unravel_index(outside.argmax(), outside.shape)
    assert outside[worst, dof] > 0.03
    fast = np.abs(every.v) > (1.0 + BEYOND_SPEED) * limits.velocity
    beyond = (outside > BEYOND_POSITION).any(axis=1) | fast.any(axis=1)
    np.testing.assert_array_equal(every["status"] == Status.BEYOND, beyond)
    np.testing.assert_array_equal(run["status"] == Status.BEYOND, beyond[::10])
    # A row has the worst control period since the row before it: none is missed.
    reported = run["position_excess"]
    assert len(reported) == 31
    for row in range(1, 31):
        since = outside[10 * row - 9 : 10 * row + 1].max(axis=0)
        np.testing.assert_allclose(reported[row], since, atol=1e-9)
    assert measures(run)["position_excess.max"].value == reported.max()
    run.save(tmp_path / "run.npz")
    assert Rollout.load(tmp_path / "run.npz")["position_excess"].max() == reported.max()
    # The summary has the joint and the time.
    name = experiment.robot.dof_names[dof]
    if isinstance(config, str):
        words = [each for setting in brief for each in ("--set", setting)]
        folder = str(tmp_path)
        assert main(["run", config, *words, "--out", folder]) == 0
        output = " ".join(capsys.readouterr().out.split())
        assert f"{name} is {reported.max():.3g} rad beyond its position limit" in output
        assert f"{beyond[::10].sum()} beyond a limit" in output


def test_without_a_push_no_joint_is_beyond():
    run = load_experiment(PANDA).run()
    assert not run["position_excess"].any()
    assert not run["velocity_excess"].any()
