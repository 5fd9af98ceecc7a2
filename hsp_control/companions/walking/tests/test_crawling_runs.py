"""Solo crawls, and trots over a step: on MuJoCo."""

from functools import cache

import numpy as np
import pytest

from hsp_control import Rollout, load_experiment
from hsp_control.companions.walking.legs import hip_height, leg_length

pytest.importorskip("example_robot_data")
pytest.importorskip("mujoco")
FEET = {
    "front_left": "FL_FOOT",
    "front_right": "FR_FOOT",
    "hind_left": "HL_FOOT",
    "hind_right": "HR_FOOT",
}
COARSE = "simulation.control_period=0.002"  # at its own period it trots in other files


@cache
def crawl() -> Rollout:
    """Return a crawl of some steps until it stands again."""
    plan = "plan={type: crawl, speed: 0.06, until: 0.7}"
    settings = plan, "simulation.duration=5.4", "simulation.log_period=0.006"
    return load_experiment("walking/solo12_trot", *settings, COARSE).run()


@pytest.mark.slow
def test_it_crawls_and_stands_again():
    run = crawl()
    assert run.status == "completed"
    assert run["plan.phase"][-1] == 0
    assert np.abs(run.v[-1]).max() < 0.05
    # It has advanced by its velocity, and the feet are below it again.
    assert run.q[-1, 0] - run.q[0, 0] == pytest.approx(0.06 * 0.7, abs=0.015)
    places = [run[f"task.{name}.actual"][-1][:2] for name in FEET]
    mass = run["task.center_of_mass.actual"][-1]
    assert np.mean(places, axis=0) == pytest.approx(mass, abs=0.01)


@pytest.mark.slow
def test_it_could_stop_at_any_time():
    """The centre of mass is above the triangle of the standing feet."""
    run = crawl()
    mass = run["task.center_of_mass.actual"]
    for k in np.flatnonzero(run["plan.phase"] > 1):
        bearing = [n for n in FEET if run[f"contact.{n}.weight"][k] > 0.0]
        corners = np.array([run[f"task.{n}.actual"][k][:2] for n in bearing])
        if len(corners) == 3:
            shares = np.linalg.solve(
                np.vstack([corners.T, np.ones(3)]), np.append(mass[k], 1.0)
            )
            assert shares.min() > 0.05


@pytest.mark.slow
def test_a_velocity_in_time_is_followed_as_far_as_the_legs_reach():
    velocity = "{type: hold, point: [0.5, 0.1, 0]}"
    plan = f"plan={{type: crawl, acceleration: 1, velocity: {velocity}}}"
    settings = "walking/solo12_trot", plan, "simulation.duration=1"
    experiment = load_experiment(*settings)
    run = experiment.run()
    robot = experiment.robot
    state = robot.state(0.0, run.q[0], run.v[0])
    reach = 0.9 * min(
        np.sqrt(leg_length(robot, foot) ** 2 - hip_height(state, foot) ** 2)
        for foot in FEET.values()
    )
    fastest = reach / (2.0 * (0.35 + 0.45))  # half a cycle to each side of the hip
    followed = run["plan.velocity"]
    assert np.hypot(*followed[:, :2].T).max() == pytest.approx(fastest, rel=1e-9)
    assert followed[-1, 1] / followed[-1, 0] == pytest.approx(0.2, rel=1e-9)


@pytest.mark.slow
@pytest.mark.system
def test_it_goes_up_a_step_of_two_centimetres():
    """The trunk rises with the ground."""
    step = "{shape: {type: box, size: [2, 2, 0.04]}, position: [1.25, 0, 0]}"
    settings = (
        f"plant.solids={{step: {step}}}",
        "plan.until=2.2",
        "simulation.duration=3.4",
        COARSE,
    )
    run = load_experiment("walking/solo12_trot", *settings).run()
    assert run.status == "completed"
    assert run["plan.phase"][-1] == 0
    assert np.abs(run.v[-1]).max() < 0.5
    front = [run[f"task.{n}.actual"][-1, 2] for n in ("front_left", "front_right")]
    assert front == pytest.approx([0.02 + 0.0165] * 2, abs=0.004)
    heights = [run[f"task.{name}.actual"][-1, 2] for name in FEET]
    rise = run["task.height.actual"][-1] - run["task.height.actual"][0]
    assert rise == pytest.approx([np.mean(heights) - 0.0165], abs=0.006)
