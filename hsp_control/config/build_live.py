"""What a configuration says of a live run, as the objects of this package."""

from hsp_control.common.exceptions import LiveError
from hsp_control.config.experiment import Experiment
from hsp_control.live.settings import (
    EffortInterface,
    StopSettings,
    Tolerance,
    check_fixed,
)
from hsp_control.live.watched_robot import WatchedRobot
from hsp_control.robot.integrators import Dop853, Rk4
from hsp_control.simulation.plants import ContinuousPlant, IntegratedPlant, SampledPlant

LINGER = 0.5
"""How long a simulated robot that has stopped is held, and seen, before it ends [s]."""


def live_period(experiment: Experiment) -> float:
    """Return the period of a live run [s]: the control period, or a millisecond."""
    return experiment.scenario.simulation.control_period or 0.001


def interface_of(experiment: Experiment) -> EffortInterface:
    """Return how the experiment's robot wants its efforts.

    The greatest effort is that of the controller's limits, where it has some.
    """
    live, limits = experiment.scenario.live, experiment.controller.limits
    return EffortInterface(
        live.compensates_gravity,
        live.effort_rate,
        None if limits is None else limits.effort,
    )


def tolerance_of(experiment: Experiment) -> Tolerance:
    """Return what is put up with."""
    live = experiment.scenario.live
    return Tolerance(
        missing=live.missing,
        age=live.age,
        position_margin=live.position_margin,
        velocity_margin=live.velocity_margin,
    )


def stop_of(experiment: Experiment) -> StopSettings:
    """Return how the safe stop brakes and holds."""
    return StopSettings(**experiment.scenario.live.stop.model_dump())


def watched_robot(experiment: Experiment) -> WatchedRobot:
    """Return the experiment's plant as a robot that looks after itself.

    Raises:
        LiveError: If it has a floating base, or settings contradict each other.
    """
    check_fixed(experiment.robot)
    period, live = live_period(experiment), experiment.scenario.live
    stop = live.stop.model_dump() | {"hold": LINGER}
    return WatchedRobot(
        live_plant(experiment, period),
        experiment.q0,
        experiment.v0,
        period,
        interface=interface_of(experiment),
        watchdog=live.watchdog,
        stop=StopSettings(**stop),
    )


def live_plant(experiment: Experiment, period: float) -> SampledPlant:
    """Return an experiment's plant as one that moves on period by period.

    A continuous one is carried by the experiment's integrator, or where that is
    adaptive, and might take any time, by one Runge-Kutta step a period.

    Raises:
        LiveError: If it is neither continuous nor sampled.
    """
    plant, integrator = experiment.plant, experiment.integrator
    if isinstance(plant, ContinuousPlant):
        adaptive = isinstance(integrator, Dop853)
        return IntegratedPlant(plant, Rk4(period) if adaptive else integrator)
    if not isinstance(plant, SampledPlant):
        raise LiveError(f"{type(plant).__name__} is no plant that can move")
    return plant
