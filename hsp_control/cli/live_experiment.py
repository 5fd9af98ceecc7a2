"""What a live run needs of an experiment: its period, and its plant as a robot."""

from dataclasses import replace

from hsp_control.config import Experiment
from hsp_control.declaration import within
from hsp_control.live import SimulatedRobot
from hsp_control.live.settings import check_held
from hsp_control.live.simulated_robot import sampled

FINAL_HOLD = 0.5
"""Time for which a simulated robot is held after its stop, before it ends [s]."""


def live_period(experiment: Experiment) -> float:
    """Return the period of a live run [s]: the control period, or a millisecond."""
    return experiment.scenario.simulation.control_period or 0.001


def check_live(experiment: Experiment) -> None:
    """Check that a live loop can hold the robot."""
    contacts = experiment.controller.contacts
    with within("live"):
        check_held(experiment.robot, contacts, experiment.scenario.live)


def simulated_robot(experiment: Experiment) -> SimulatedRobot:
    """Return the experiment's plant as a robot with a watchdog and a safe stop."""
    period, live = live_period(experiment), experiment.scenario.live
    check_live(experiment)
    return SimulatedRobot(
        sampled(experiment.plant, experiment.integrator, period),
        experiment.q0,
        experiment.v0,
        period,
        settings=replace(live, stop=replace(live.stop, hold=FINAL_HOLD)),
        limits=experiment.controller.limits,
        contacts=experiment.controller.contacts,
    )
