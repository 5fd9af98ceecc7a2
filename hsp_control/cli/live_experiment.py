"""The parts of an experiment for a live run: period, start, plant as a robot.

A live run begins at the robot's configuration, not at that of the file.
"""

import argparse
from dataclasses import replace
from math import isclose

import numpy as np

from hsp_control.cli.loading import read
from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError
from hsp_control.config import Experiment
from hsp_control.config.document import Document
from hsp_control.config.loaded_scenario import LoadedScenario, load_scenario
from hsp_control.config.streams import deaf
from hsp_control.declaration import within
from hsp_control.live import SimulatedRobot
from hsp_control.live.settings import check_held
from hsp_control.live.simulated_robot import sampled

FINAL_HOLD = 0.5
"""Time for which a simulated robot is held after its stop, before it ends [s]."""


_PERIOD = 0.001
"""Period of a live run of a configuration without a control period [s]."""


def loaded_live(document: Document) -> LoadedScenario:
    """Return a configuration as a live run follows it, and its log repeats it.

    It begins at t = 0, and efforts are held, for a millisecond by default; the log says
    so if its rows are whole multiples of that apart, as they must be in a simulation.
    """
    loaded = load_scenario(document).from_zero()
    settings = loaded.scenario.simulation
    rows = settings.log_period / _PERIOD
    whole = isclose(rows, max(round(rows), 1), rel_tol=1e-6)
    if settings.control_period is None and whole:
        settings = replace(settings, control_period=_PERIOD)
    return loaded._replace(scenario=replace(loaded.scenario, simulation=settings))


def of_a_robot(document: Document) -> Experiment:
    """Return the experiment of a robot, whose loop receives the streams."""
    loaded = loaded_live(document)
    return Experiment.of(loaded._replace(scenario=deaf(loaded.scenario)))


def live_period(experiment: Experiment) -> float:
    """Return the period of a live run [s]: the control period, or a millisecond."""
    return experiment.scenario.simulation.control_period or _PERIOD


def check_live(experiment: Experiment) -> None:
    """Check that a live loop can hold the robot."""
    contacts = experiment.controller.contacts
    with within("live"):
        check_held(experiment.robot, contacts, experiment.scenario.live)


def simulated_robot(experiment: Experiment) -> SimulatedRobot:
    """Return the experiment's plant as a robot with a watchdog and a safe stop."""
    period, live = live_period(experiment), experiment.scenario.live
    check_live(experiment)
    plant = sampled(experiment.plant, experiment.integrator, period)
    return SimulatedRobot(
        plant,
        experiment.q0,
        experiment.v0,
        period,
        settings=replace(live, stop=replace(live.stop, hold=FINAL_HOLD)),
        limits=experiment.controller.limits,
        contacts=experiment.controller.contacts,
        follow=experiment.controller.model_changes(plant.dynamics),
    )


_FARTHEST = 0.2
"""Maximum distance of a joint from the configuration's start [rad or m].

The accuracy of hand guiding; from there, the run is as rehearsed."""


def begun_where_it_is(
    experiment: Experiment, options: argparse.Namespace, q: Array
) -> Experiment:
    """Return the experiment with the robot's configuration as its start."""
    # Parts relative to the start (``origin: start``) then do not pull the robot.
    distances = np.abs(experiment.robot.difference(experiment.q0, q))
    worst = int(np.argmax(distances))
    start = f"start={{configuration: [{', '.join(f'{each:.6f}' for each in q)}]}}"
    if not distances[worst] <= _FARTHEST:  # also if the state is NaN
        raise HardwareError(
            f"{experiment.robot.dof_names[worst]} is {distances[worst]:.3g} from the "
            f"configuration's start; {_FARTHEST:g} is allowed. Move the robot there, "
            f"or begin where it is, after a rehearsal: --set '{start}'"
        )
    return Experiment.of(loaded_live(read(options, start)))
