"""Solo takes some diagonal steps and stands: on MuJoCo, as its configuration says."""

from functools import cache

import numpy as np
import pytest

from hsp_control import Rollout, load_experiment

pytest.importorskip("example_robot_data")
pytest.importorskip("mujoco")
pytestmark = pytest.mark.slow


@cache
def trot() -> Rollout:
    settings = ("plan.until=1", "simulation.duration=3", "simulation.log_period=0.005")
    return load_experiment("whole_body/solo12_trot", *settings).run()


def test_it_trots_and_stands_again():
    run = trot()
    assert run.status == "completed"
    assert run["plan.phase"][-1] == 0
    assert run["plan.steps"][-1] >= 4
    assert 0.1 < run.q[-1, 0] < 0.4
    assert np.abs(run.q[:, 2] - run.q[0, 2]).max() < 0.02
    assert (run["status"] < 3).all()


def test_diagonal_feet_swing_together_and_the_others_bear():
    run = trot()
    for phase, swinging in ((2, ("FL_FOOT", "HR_FOOT")), (3, ("FR_FOOT", "HL_FOOT"))):
        middle = run["plan.phase"] == phase
        assert middle.any()
        for foot in ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"):
            force = run[f"plant.contact.{foot}.force"][middle, 2]
            aloft = (force == 0.0).mean()
            assert (aloft > 0.7) if foot in swinging else (aloft < 0.1)


def test_its_velocity_changes_no_faster_than_it_may():
    run = trot()
    rates = np.diff(run["plan.velocity"], axis=0) / np.diff(run.t)[:, None]
    assert np.abs(rates).max() < 0.5 * (1.0 + 1e-6)
    assert run["plan.velocity"][:, 0].max() == pytest.approx(0.3, abs=0.12)
