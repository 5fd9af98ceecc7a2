"""Robots walk and trot on an estimated base, with a noisy IMU, on MuJoCo."""

import re
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
import yaml

from hsp_control import load_experiment
from hsp_control.control.compensation import CompensatedController

pytest.importorskip("example_robot_data")
pytest.importorskip("mujoco")
COARSE = "simulation.control_period=0.002"  # their own is that of test_live_on_feet.py


def largest(run, name):
    """Return the largest length of a logged error."""
    return np.linalg.norm(run[f"estimate.{name}"], axis=1).max()


@pytest.mark.system
@pytest.mark.slow
def test_talos_takes_a_step_on_an_estimated_base():
    """One key enables it; the rest of the configuration is unchanged."""
    given = ("plan.steps=1", "simulation.duration=2.2", COARSE)
    run = load_experiment("walking/talos_walk", "estimators.base=true", *given).run()
    assert run.status == "completed"
    assert run["plan.steps"][-1] == 1
    assert run["plan.phase"][-1] > 1
    assert largest(run, "position_error") < 0.02
    assert largest(run, "rotation_error") < 0.02
    assert largest(run, "velocity_error") < 0.03
    # The law used the estimate, and the log has both.
    assert not np.array_equal(run["estimate.base"], run.q[:, :7])
    error = run["estimate.base"][:, :3] - run.q[:, :3]
    assert error == pytest.approx(run["estimate.position_error"])
    swings = np.isin(run["plan.phase"], (2, 3))
    assert (run["estimate.contacts"][swings] == 1.0).mean() > 0.9


@pytest.mark.system
@pytest.mark.slow
def test_solo_trots_on_an_estimated_base_and_again_the_same(tmp_path):
    given = (
        "estimators.base=true",
        "plan.until=0.6",
        "simulation.duration=1.2",
        COARSE,
    )
    effort, sent = CompensatedController.effort, []

    def spy(command, t, *rest):
        tau = effort(command, t, *rest)
        sent.append(float(command.output.status))
        return tau

    with patch.object(CompensatedController, "effort", spy):
        run = load_experiment("walking/solo12_trot", *given).run()
    assert run.status == "completed"
    assert run["plan.steps"][-1] >= 3
    assert largest(run, "velocity_error") < 0.08
    assert largest(run, "rotation_error") < 0.03
    periods = (len(sent) - 1) // (len(run.t) - 1)  # in a row of the log
    assert np.array_equal(run["estimate.status"], sent[::periods])
    assert run["estimate.status"].any()
    again = load_experiment(run.save(tmp_path / "trot.npz")).run()
    assert np.array_equal(run.q, again.q)
    assert np.array_equal(run["estimate.base"], again["estimate.base"])


def test_the_page_s_yaml_runs():
    text = (Path(__file__).parents[1] / "estimation.md").read_text(encoding="utf-8")
    (given,) = re.findall(r"^```yaml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    data = yaml.safe_load(given)
    data["simulation"]["duration"] = 0.05
    run = load_experiment(data).run()
    assert run.status == "completed"
    assert "estimate.base" in run.columns
