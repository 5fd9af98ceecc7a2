"""Talos makes two steps and stands: on MuJoCo, by its configuration."""

import re
from functools import cache
from math import radians, tan
from pathlib import Path

import numpy as np
import pytest
import yaml
from places import further
from ramps import ramp

from hsp_control import Rollout, load_experiment
from hsp_control.companions.walking import Walk

pytest.importorskip("example_robot_data")
pytest.importorskip("mujoco")
SWINGING = {23: 0.25, 30: -0.25}  # the elbows, in v [rad]
RATE, FOLLOWS = 2.0 * np.pi / 1.5, 6.0  # once in two steps [rad/s]; how fast [1/s]
FEET = {"left_foot": "left_sole_link", "right_foot": "right_sole_link"}
COARSE = "simulation.control_period=0.002"  # at its own period it walks in `walk`


@cache
def walk() -> Rollout:
    """Return a walk of one step, the step that closes, and a second of standing.

    The arms swing by a field, as a test of the law's theorem.
    """
    amplitudes, weights = np.zeros(36), np.ones(36)
    amplitudes[[*SWINGING]], weights[[*SWINGING]] = [*SWINGING.values()], FOLLOWS
    swings = (
        f"{{type: lissajous, center: {np.zeros(36).tolist()}, "
        f"amplitudes: {amplitudes.tolist()}, rates: {np.full(36, RATE).tolist()}}}"
    )
    settings = (
        f"null_space.fields.0.displacement={swings}",
        f"null_space.fields.0.weights={weights.tolist()}",
        "plan.steps=1",
        "simulation.duration=4.2",
        "simulation.log_period=0.004",
    )
    return load_experiment("walking/talos_walk", *settings).run()


@pytest.mark.slow
def test_it_walks_and_stands_again():
    run = walk()
    assert run.status == "completed"
    assert run["plan.steps"][-1] == 2
    assert run["plan.phase"][-1] == 0
    # One step of 0.75 s, at the speed after 0.4 m/s² in this time.
    assert run.q[-1, 0] == pytest.approx(0.4 * 0.75**2, abs=0.02)
    assert np.abs(np.delete(run.v[-1], [*SWINGING])).max() < 0.05
    error = run["plan.dcm"] - run["plan.dcm_reference"]
    assert np.sqrt((error**2).sum(axis=1).mean()) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize("degrees", further(5.0))
def test_it_walks_down_a_ramp_of_which_it_does_not_know(degrees):
    """From a platform: soles are flat on it, the centre of mass stays above it."""
    run = load_experiment("walking/talos_walk", *ramp(degrees, 0.3)).run()
    assert run.status == "completed"
    assert run["plan.phase"][-1] == 0
    fallen = tan(radians(degrees)) * (run.q[-1, 0] - 0.3)
    assert fallen > 0.05
    sunk = run["task.center_of_mass.actual"][[110, -1], 2]
    assert sunk[0] - sunk[1] == pytest.approx(fallen, abs=0.03)


@pytest.mark.slow
def test_a_contact_changes_no_effort_by_a_jump():
    """Before the foot lifts its force has faded; after it lands the force rises."""
    run = walk()
    jumps = np.abs(np.diff(run.tau, axis=0)).max(axis=1)
    phase = run["plan.phase"]
    lifts = np.flatnonzero((phase[:-1] == 1) & (phase[1:] > 1))
    assert len(lifts) == 2
    assert jumps[lifts].max() < 0.1 * np.abs(run.tau).max()


@pytest.mark.slow
def test_the_null_space_error_decays_within_each_phase():
    """‖e_N‖ obeys exp(-K_N t) where the law is exact and no contact changes."""
    run, gain = walk(), 6.0
    phase, t = run["plan.phase"], run.t
    changes = np.flatnonzero(np.diff(phase)) + 1
    compared = 0
    for first, last in zip(changes, [*changes[1:], len(t)], strict=True):
        if phase[first] in {2, 3}:  # until the foot feels the ground
            foot = FEET["left_foot" if phase[first] == 2 else "right_foot"]
            force = run[f"plant.contact.{foot}.force"][first + 5 : last, 2]
            last = first + 5 + int((force == 0.0).sum())
        part = slice(first + 5, last)
        e_N, status = run["null_space_norm"][part], run["status"][part]
        if (status > 1).any() or phase[first] == 1:
            continue
        decay = e_N[0] * np.exp(-gain * (t[part] - t[part][0]))
        # Efforts are held for a millisecond, and the contacts are MuJoCo's.
        assert (e_N < 1.1 * decay + 0.05).all()
        compared += 1
    assert compared >= 2


@pytest.mark.slow
@pytest.mark.system
def test_a_push_that_causes_a_fall_is_reported():
    push = "{frame: torso_2_link, force: [0, 900, 0], start: 0.1, duration: 0.3}"
    settings = (f"plant.pushes=[{push}]", "simulation.duration=3", COARSE)
    run = load_experiment("walking/talos_walk", *settings).run()
    assert run.status == "stopped"
    assert run.meta["message"].startswith("the robot falls: at t = ")
    assert run.t[-1] < 2.0


@pytest.mark.slow
@pytest.mark.system
def test_a_push_that_one_sole_does_not_hold_is_held_by_both():
    """To the left, just before the right foot swings, which cannot cross over."""
    push = "{frame: torso_2_link, force: [0, 200, 0], start: 1.62, duration: 0.1}"
    settings = (f"plant.pushes=[{push}]", "simulation.duration=4.1", COARSE)
    run = load_experiment("walking/talos_walk", *settings).run()
    assert run.status == "completed"
    phase, t = run["plan.phase"], run.t
    begins = t[np.flatnonzero(np.diff(phase)) + 1]
    held = (t > 1.8) & (phase == 0.0)
    assert held.any()
    assert run["plan.steps"][held].max() == 1
    assert (run["contact.right_foot.weight"][held][20:] == 1.0).all()
    left = run["task.left_foot.actual"][held]
    outer_edge = left[0, 1] + 0.05
    dcm = run["plan.dcm"][held]
    assert dcm[0, 1] == pytest.approx(outer_edge, abs=0.01)  # one sole barely holds it
    # It has settled below 20 mm a row later.
    assert np.abs(dcm[-1] - run["plan.dcm_reference"][held][-1]).max() < 0.022
    # It continues with the foot that was to swing.
    assert phase[-1] == 3.0
    assert begins[-1] > t[held][-1] + 0.5


@pytest.mark.slow
def test_the_page_s_yaml_and_python_run():
    text = (Path(__file__).parents[1] / "page.md").read_text(encoding="utf-8")
    yaml_text, _ = re.findall(r"^```yaml\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    (snippet,) = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert len(yaml_text.splitlines()) <= 10
    data = yaml.safe_load(yaml_text)
    data["simulation"]["duration"] = 0.05
    assert load_experiment(data).run().status == "completed"
    space: dict = {}
    exec(compile(snippet, "plans.md", "exec"), space)
    made = space["walk"].scenario
    assert made.plan == Walk(speed=0.3, steps=4)
    assert load_experiment(yaml.safe_load(space["walk"].to_yaml())).scenario == made


@pytest.mark.slow
@pytest.mark.system
def test_it_walks_on_footsteps_that_are_given():
    """A step ahead to the left, and the other foot next to it."""
    rows = "[[0.15, 0.1, 0.1], [0.15, -0.08, 0.1]]"
    plan = f"plan={{type: walk, footsteps: {rows}}}"
    settings = (plan, "simulation.duration=4.2", COARSE)
    run = load_experiment("walking/talos_walk", *settings).run()
    assert run.status == "completed"
    assert run["plan.steps"][-1] == 2
    assert run["plan.phase"][-1] == 0
    assert np.abs(run.v[-1]).max() < 0.05
    first = run["task.left_foot.actual"][0], run["task.right_foot.actual"][0]
    middle = 0.5 * (first[0][:2] + first[1][:2])
    for name, place in (("left_foot", (0.15, 0.1)), ("right_foot", (0.15, -0.08))):
        there = run[f"task.{name}.actual"][-1][:2] - middle
        assert there == pytest.approx(place, abs=0.02), name
