"""Balance stands above hands unless a configuration says otherwise."""

import numpy as np
import pytest

import hsp_control as hsp

FAR = (
    "tasks.hand.trajectory={type: line, origin: start, end: [0.9, 0, 0], duration: 1.0}"
)


@pytest.mark.slow
def test_talos_stands_while_a_hand_reaches_for_what_is_too_far() -> None:
    """0.9 m in front: with tasks of one priority it falls within two seconds."""
    experiment = hsp.load_experiment(
        "whole_body/talos_circle", FAR, "simulation.duration=2"
    )
    order = [[task.name for task in level] for level in experiment.controller.levels]
    assert order == [["center_of_mass", "trunk"], ["hand"]]
    run = experiment.run()
    assert run.status == "completed"
    assert run.q[:, 2].min() > 0.9 * run.q[0, 2]
    tilt = 2.0 * np.arccos(np.clip(np.abs(run.q[:, 6]), 0.0, 1.0))
    assert tilt.max() < np.radians(25.0)
