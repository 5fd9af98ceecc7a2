"""Every measure of a run agrees with its definition, computed by NumPy."""

from functools import cache

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.simulation.measures import (
    PULL_COLUMN,
    forces_kept,
    measures,
    unreached,
)


@cache
def changed_run() -> hsp.Rollout:
    """Return a log of random, hence distinct, columns."""
    panda = hsp.Robot.load("panda")
    q = panda.home()
    ball = hsp.Obstacle("ball", hsp.shapes.Sphere(0.1), hsp.Hold([0.6, 0.0, 0.6]))
    field = hsp.JointCentering() + hsp.ObstacleClearance(["ball"])
    hand = hsp.FramePose("panda_tcp", name="hand")
    controller = hsp.Controller(panda, [hand], field, scene=[ball])
    run = hsp.simulate(controller, q, duration=0.05, control_period=0.01)
    rng = np.random.default_rng(3)
    for name, column in run.columns.items():
        if column.dtype == float and name not in ("t", "q"):
            column[...] = rng.uniform(-3.0, 2.0, column.shape)
    run["damped"][:] = [1, 0, 0, 1, 1, 0]
    run.t[:] = [1.0, 1.1, 1.2, 1.4, 1.5, 1.7]  # a run may begin at any time
    return run


def test_a_target_that_a_pull_prevents_is_not_out_of_reach() -> None:
    t = np.arange(0.0, 1.0, 0.01)
    error = np.tile([0.3, 0.0, 0.0], (len(t), 1))
    columns = {"t": t, "task.hand.error": error, "damped": np.ones(len(t))}
    columns["task.hand.error_rate"] = np.zeros_like(error)
    tasks = {"hand": {"error": [["position", "m", "m/s", 3]]}}
    (alone,) = unreached(columns, tasks)
    assert alone.words(-1) == "target out of reach, 0.30 m"
    pulled = {**columns, PULL_COLUMN: np.where(t < 0.9, 37.0, 0.0)}
    (held,) = unreached(pulled, tasks)
    assert held.words(80) == ""
    assert held.words(-1) == ""  # released 0.1 s ago: it has not rested for long


def rms(values: Array) -> float:
    return float(np.sqrt((values**2).sum() / len(values)))


def expected(run: hsp.Rollout) -> dict[str, float]:
    e = run["task.hand.error"]
    parts = {"position": e[:, :3], "orientation": e[:, 3:]}
    found = {}
    for name, part in parts.items():
        norm = np.sqrt((part**2).sum(axis=1))
        label = f"tracking.hand.{name}"
        found |= {f"{label}.rms": rms(norm), f"{label}.max": norm.max()}
        found[f"{label}.end"] = norm[-1]
    e_N = run["null_space_norm"]
    return found | {
        "null_space_error.rms": rms(e_N),
        "null_space_error.max": e_N.max(),
        "null_space_error.end": e_N[-1],
        "manipulability.min": run["manipulability"].min(),
        "singular_value.min": run["singular_values"].min(),
        "damped.fraction": 0.5,
        "effort.max": np.abs(run.tau).max(),
        # of all joints together: the norm's, not the mean of the joints' squares
        "effort.rms": float(np.sqrt((run.tau**2).sum() / len(run))),
        "speed.max": np.abs(run.v).max(),
        "simulated_time": 0.7,
    }


def test_measures_equal_their_definitions() -> None:
    run = changed_run()
    found = measures(run)
    for name, value in expected(run).items():
        assert found[name].value == pytest.approx(value, rel=1e-12), name
    others = found.keys() - expected(run).keys()
    assert others, "a distance"
    for name in others:
        column, _, kind = name.rpartition(".")
        numbers = np.nan_to_num(run[column]) if kind == "max" else run[column]
        assert found[name].value == getattr(numbers, kind)(), name
    assert any(name.startswith("distance.") for name in others)


def test_a_robot_that_stands_needs_the_effort_of_gravity() -> None:
    """The same in a known run: rms and largest effort are those at rest."""
    panda = hsp.Robot.load("panda")
    controller = hsp.Controller(panda, [hsp.JointPosture("start")], limits=None)
    run = hsp.simulate(controller, panda.home(), duration=0.02, control_period=0.01)
    gravity = panda.inverse_dynamics(panda.home(), np.zeros(7), np.zeros(7))
    found = measures(run)
    assert found["effort.rms"].value == pytest.approx(np.linalg.norm(gravity), rel=1e-6)
    assert found["effort.max"].value == pytest.approx(np.abs(gravity).max(), rel=1e-6)
    assert found["effort.rms"].unit == "N·m"


def test_rows_that_come_later_go_on_where_the_others_ended() -> None:
    """As in a play: a persistent error is not reported anew in every piece."""
    t = np.arange(0.0, 1.0, 0.01)
    error = np.tile([0.3, 0.0, 0.0], (len(t), 1))
    columns = {"t": t, "task.hand.error": error, "damped": np.ones(len(t))}
    columns["task.hand.error_rate"] = np.where((t < 0.2)[:, None], 1.0, 0.0 * error)
    tasks = {"hand": {"error": [["position", "m", "m/s", 3]]}}
    (whole,) = unreached(columns, tasks)
    assert 0.0 in whole.out
    assert 0.3 in whole.out
    moved: dict[str, float] = {}
    found = []
    for first in range(0, len(t), 10):
        rows = {name: column[first : first + 10] for name, column in columns.items()}
        (piece,) = unreached(rows, tasks, moved)
        found.append(piece.out)
    np.testing.assert_array_equal(np.concatenate(found), whole.out)


def test_a_kept_force_is_without_its_feedback_and_lost_after_it_was_touched() -> None:
    normal = np.array([0.0, 0.6, 0.8])
    wanted = np.array([np.nan, 20.0, 20.0, 20.0, 20.0, 20.0])
    actual = np.array([0.0, 0.0, 18.0, 19.0, 0.0, 20.5])
    added = np.array([0.0, 0.0, 1.0, 2.0, 3.0, 3.0])
    columns = {
        "contact.tool.commanded": (wanted + added)[:, None] * normal,
        "contact.tool.force": (wanted + added - 0.5)[:, None] * normal,
        "contact.tool.integral": added,
        "plant.contact.tip.force": actual[:, None] * normal,
    }
    about = {"normal": normal.tolist(), "frame": "tip"}
    meta = {"columns": {"contact.tool.commanded": about, "contact.tool.force": {}}}
    (kept,) = forces_kept(hsp.Rollout(columns, meta))
    assert kept.contact == "tool"
    np.testing.assert_allclose(kept.wanted, np.full(5, 20.0), rtol=1e-14)
    np.testing.assert_allclose(kept.planned, np.full(5, 19.5), rtol=1e-14)
    np.testing.assert_allclose(kept.actual, actual[1:], rtol=1e-14)
    assert kept.lost == 1  # before contact nothing was lost
