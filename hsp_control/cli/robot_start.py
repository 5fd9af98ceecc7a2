"""A live run begins where the robot is, not where the configuration thinks it is."""

import argparse

import numpy as np

from hsp_control.cli.loading import load
from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HardwareError
from hsp_control.config import Experiment

_FARTHEST = 0.2
"""Largest distance of a joint from the configuration's start [rad or m].

As near as one guides an arm by hand; from there, what was rehearsed is what happens."""


def begun_where_it_is(
    experiment: Experiment, options: argparse.Namespace, q: Array
) -> Experiment:
    """Return the experiment with the robot's configuration as its start.

    What is relative to the start (``origin: start``) then does not pull at the robot.
    """
    distances = np.abs(experiment.robot.difference(experiment.q0, q))
    worst = int(np.argmax(distances))
    start = f"start={{configuration: [{', '.join(f'{each:.6f}' for each in q)}]}}"
    if not distances[worst] <= _FARTHEST:  # also of a state that is NaN
        raise HardwareError(
            f"{experiment.robot.dof_names[worst]} is {distances[worst]:.3g} from the "
            f"configuration's start; {_FARTHEST:g} is allowed. Move the robot there, "
            f"or begin where it is, after a rehearsal: --set '{start}'"
        )
    return load(options, start)
