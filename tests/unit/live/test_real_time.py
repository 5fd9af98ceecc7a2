"""Real-time settings of a loop: priority, no garbage collection."""

import gc
import inspect
import os
from typing import Any

import pytest

import hsp_control as hsp
from hsp_control.common.errors import SimulationError
from hsp_control.live.real_time import no_garbage_collection, real_time_priority


def test_the_collector_is_away_and_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    counted = inspect.unwrap(gc.get_freeze_count)  # replaced in conftest.py
    monkeypatch.setattr(gc, "get_freeze_count", counted)
    assert gc.isenabled()
    with no_garbage_collection():
        assert not gc.isenabled()
    frozen = gc.get_freeze_count()
    assert frozen > 1000  # objects that the tests had frozen before still are
    gc.unfreeze()
    with no_garbage_collection():
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 1000
    assert gc.isenabled()
    assert gc.get_freeze_count() == 0
    with pytest.raises(ZeroDivisionError), no_garbage_collection():
        _ = 1 / 0
    assert gc.isenabled()
    gc.disable()
    try:
        with no_garbage_collection():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()
        gc.freeze()


@pytest.mark.parametrize("config", ["paper/4_moving_obstacle", "iiwa_null_space"])
def test_steps_leave_nothing_to_collect(config: str) -> None:
    experiment = hsp.load_experiment(config)
    controller, q, v = experiment.controller, experiment.q0, experiment.v0

    def steps(first: int, last: int) -> None:
        for k in range(first, last):
            controller.applied(controller.compute(0.001 * k, q, v).tau, 0.001)

    steps(0, 2)  # objects bound or cached by a first step stay
    with no_garbage_collection():
        tracked = len(gc.get_objects())
        steps(2, 52)
        assert len(gc.get_objects()) < tracked + 25  # not one in two steps
        assert gc.collect() == 0


def test_priority_is_set_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    calls: list[Any] = []
    monkeypatch.setattr(
        os, "sched_setscheduler", lambda *call: calls.append((call[1], call[2]))
    )
    before = os.sched_getscheduler(0)
    with real_time_priority(40):
        assert [policy for policy, _ in calls] == [os.SCHED_FIFO]
        assert calls[0][1].sched_priority == 40
    assert calls[1][0] == before


def test_priority_that_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SimulationError, match="must be from 1 to 99"):
        real_time_priority(0).__enter__()

    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with pytest.raises(SimulationError, match="not permitted; needs root, CAP_SYS"):
        real_time_priority(40).__enter__()


def test_priority_where_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "sched_setscheduler")
    with pytest.raises(SimulationError, match="priority 40: this system has none"):
        real_time_priority(40).__enter__()
