"""Rows of a log with a distant or unreachable target are detected."""

from typing import Any

import numpy as np

from hsp_control.simulation.measures import RESTING, STAYS, Unreached, unreached

HAND = {
    "hand": {"error": [["position", "m", "m/s", 3], ["orientation", "rad", "rad/s", 3]]}
}
T = np.linspace(0.0, 1.0, 101)
STAY = round(STAYS / 0.01)


def log(**changes: Any) -> dict[str, Any]:
    """Rows in which a hand rests 0.31 m from its target, damped."""
    error = np.tile([0.31, 0.0, 0.0, 0.0, 0.2, 0.0], (len(T), 1))
    return {
        "t": T,
        "damped": np.ones(len(T)),
        "status": np.zeros(len(T)),
        "task.hand.error": error,
        "task.hand.error_rate": np.zeros((len(T), 6)),
        "task.hand.bounded": np.zeros(len(T)),
    } | {name.replace("__", "."): value for name, value in changes.items()}


def found(columns: dict[str, Any]) -> Unreached:
    (only,) = unreached(columns, HAND)
    return only


def test_an_error_that_stays_is_out_of_reach() -> None:
    """From the time at which it has rested long enough: a step begins at rest, too."""
    task = found(log())
    assert not task.out[:STAY].any()
    assert (task.out[STAY + 1 :] == 0.31).all()
    assert task.words(0) == ""
    assert task.words(-1) == "target out of reach, 0.31 m"


def test_a_limit_is_a_reason_and_friction_is_none() -> None:
    exact = log(damped=np.zeros(len(T)))
    assert not found(exact).out.any()
    limited = log(damped=np.zeros(len(T)), status=np.full(len(T), 2.0))
    assert found(limited).out.any()


def test_a_moving_hand_is_on_its_way() -> None:
    rate = np.full((len(T), 6), RESTING * 0.31)
    bounded = np.where(T > 0.5, 0.4, 0.0)
    far = found(log(task__hand__error_rate=rate, task__hand__bounded=bounded))
    assert not far.out.any()
    assert far.words(0) == ""
    assert far.words(-1) == "target far away"
    pushed = np.zeros((len(T), 6))
    pushed[50] = 1.0  # it must rest anew
    out = found(log(task__hand__error_rate=pushed)).out
    assert out[49] == out[-1] == 0.31
    assert not out[50 : 50 + STAY].any()


def test_an_inactive_task_and_a_sparse_log_report_nothing() -> None:
    columns = log(task__hand__error=np.full((len(T), 6), np.nan))
    for name in ("damped", "status", "task.hand.bounded"):
        del columns[name]
    assert found(columns).words(-1) == ""
    assert list(unreached({"t": T}, HAND)) == []
