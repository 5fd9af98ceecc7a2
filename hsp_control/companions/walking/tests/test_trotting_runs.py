"""Solo makes some diagonal steps and stands: on MuJoCo, by its configuration."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from places import further
from ramps import ramp

from hsp_control import Experiment, Rollout, Stream, TargetPosture, load_experiment
from hsp_control.companions.play import Session
from hsp_control.companions.play.playable import playable
from hsp_control.companions.walking import Trot

pytest.importorskip("example_robot_data")
pytest.importorskip("mujoco")
COARSE = "simulation.control_period=0.002"  # at its own period it trots in `trot`


@cache
def trot() -> Rollout:
    settings = "plan.until=0.8", "simulation.duration=2", "simulation.log_period=0.005"
    return load_experiment("walking/solo12_trot", *settings).run()


@pytest.mark.slow
def test_it_trots_and_stands_again():
    run = trot()
    assert run.status == "completed"
    assert run["plan.phase"][-1] == 0
    assert run["plan.steps"][-1] >= 4
    assert 0.1 < run.q[-1, 0] < 0.4
    assert np.abs(run.q[:, 2] - run.q[0, 2]).max() < 0.02
    assert (run["status"] < 3).all()


@pytest.mark.slow
@pytest.mark.system
def test_it_returns_to_its_line_after_a_push():
    """Laterally; the error along the walk is not corrected."""
    push = "{frame: base_link, force: [-4, 8, 0], start: 1, duration: 0.1}"
    settings = f"plant.pushes=[{push}]", "plan.until=4.4", "simulation.duration=4.8"
    run = load_experiment("walking/solo12_trot", *settings, COARSE).run()
    assert run.status == "completed"
    beside = run.q[:, 1]
    assert beside.max() > 0.12  # farther than the reference permits
    assert np.abs(beside[run.t > 4.2]).max() < 0.03
    fast = (run.t > 2.5) & (run.t < 3.5)
    assert np.ptp(run.q[fast, 0]) == pytest.approx(0.3, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("degrees", further(10.0))
def test_down_a_ramp_a_foot_carries_while_the_other_seeks_ground(degrees):
    """A hind foot is on the platform, the diagonal one above missing ground."""
    until = "plan.until=2", "simulation.duration=4"
    run = load_experiment("walking/solo12_trot", *ramp(degrees, 0.4), *until).run()
    assert run.status == "completed"
    assert run["plan.phase"][-1] == 0
    assert run["task.front_left.actual"][-1, 2] < -0.04
    front, hind = (run[f"contact.{n}.weight"] for n in ("front_right", "hind_left"))
    assert ((hind > 0.5) & (front == 0.0) & (run["plan.phase"] == 3)).any()


@pytest.mark.slow
def test_a_robot_that_is_nowhere_named_trots_within_its_limits():
    """Go1 with all defaults: with barriers of 10 1/s it would fall at 0.9 s."""
    feet = ["FL_foot", "FR_foot", "RL_foot", "RR_foot"]
    ball = {"shape": {"type": "sphere", "radius": 0.02}}
    given = {
        "robot": {"name": "go1"},
        "start": {"ground": 0},
        "contacts": {f: {"type": "ball", "frame": f, "radius": 0.02} for f in feet},
        "plan": {"type": "trot", "speed": 0.4},
        "null_space": {"fields": [{"type": "target_posture", "target": "start"}]},
        "simulation": {"duration": 1.3, "control_period": 0.001},
        "plant": {"type": "mujoco", "contacts": dict.fromkeys(feet, ball)},
    }
    run = load_experiment(given).run()
    assert run.status == "completed"
    assert (run["status"] < 3).all()
    assert (run["position_excess"] == 0.0).all()
    assert run.q[-1, 0] > 0.2


@pytest.mark.slow
def test_feet_that_find_no_ground_are_named_where_it_falls():
    run = load_experiment("walking/solo12_trot", "plant={type: rigid_body}").run()
    assert run.status == "stopped"
    message = str(run.meta["message"])
    assert message.startswith("the robot falls: at t = ")
    assert "; no ground was ever sensed at front_left, front_right, hind_" in message


@pytest.mark.slow
@pytest.mark.system
def test_a_streamed_velocity_is_followed_and_repeated_from_the_log(tmp_path):
    velocity = Stream(acceleration=2.0)
    given = load_experiment("walking/solo12_trot").scenario
    experiment = Experiment(
        given.robot,
        [],
        TargetPosture(),
        start=given.start,
        contacts=list(given.contacts.values()),
        limits=given.limits,
        plan=Trot(velocity=velocity),
        plant=given.plant,
        simulation=replace(given.simulation, duration=1.5, control_period=0.002),
    )

    def drive(recorder):
        if recorder.count == 20:
            recorder.plan.streams[0].send([0.2, 0.0, 0.0])
        if recorder.count == 90:
            recorder.plan.streams[0].send([0.0, 0.0, 0.0])

    run = experiment.run(on_row=drive)
    assert (run["plan.phase"][:20] == 0).all()  # it stands until commanded
    assert run["plan.velocity"].max() > 0.1
    again = load_experiment(run.save(tmp_path / "trot.npz")).run()
    for name in run.columns:
        assert np.array_equal(run[name], again[name], equal_nan=True), name


@pytest.mark.slow
@pytest.mark.system
def test_it_trots_where_it_can_be_touched():
    session = Session(playable("walking/solo12_trot"))
    while session.t < 0.4:
        session.advance()
        assert not session.over
    run = session.rollout()
    assert run["plan.phase"][-1] == 2
    short = "simulation.duration=0.4", "simulation.log_period=0.005"
    untouched = load_experiment("walking/solo12_trot", *short).run()
    rows = run.t.searchsorted(0.3)
    same = untouched.t.searchsorted(run.t[rows])
    assert untouched.t[same] == pytest.approx(run.t[rows])
    assert run.q[rows] == pytest.approx(untouched.q[same], abs=1e-12)
