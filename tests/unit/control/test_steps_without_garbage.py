"""Python's garbage collector does not run inside steps: they leave it nothing."""

import gc

import pytest

import hsp_control as hsp

STEPS = 600
"""Between two objects per step, and one in six steps: 700 wake the collector."""


@pytest.mark.parametrize("name", [
    "panda_limits", "limits/panda_towards_limit",
    "whole_body/talos_lift_foot", "whole_body/solo12_swing",
])  # fmt: skip
def test_steps_do_not_wake_the_collector(name: str) -> None:
    """Limits that bind, and contacts that are lifted and set down."""
    if "panda" not in name:
        pytest.importorskip("example_robot_data")
    experiment = hsp.load_experiment(name)
    controller, q, v = experiment.controller, experiment.q0, experiment.v0
    ran: list[str] = []
    for k in range(60):
        controller.compute(0.001 * k, q, v)
    gc.collect()
    assert gc.isenabled()
    gc.callbacks.append(lambda phase, _: ran.append(phase))
    try:
        before = gc.get_count()[0]
        for k in range(60, 60 + STEPS):
            controller.compute(0.001 * k, q, v)
        added = gc.get_count()[0] - before
    finally:
        gc.callbacks.pop()
    assert not ran
    assert added < STEPS // 4
