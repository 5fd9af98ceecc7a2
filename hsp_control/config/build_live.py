"""Build the objects of a live run."""

from hsp_control.common.exceptions import LiveError
from hsp_control.config.experiment import Experiment
from hsp_control.live.settings import (
    EffortInterface,
    StopSettings,
    Tolerance,
    check_fixed,
)
from hsp_control.live.simulated_robot import SimulatedRobot
from hsp_control.robot.integrators import Dop853, Rk4
from hsp_control.simulation.plants import ContinuousPlant, IntegratedPlant, SampledPlant

FINAL_HOLD = 0.5
"""Time for which a simulated robot is held after its stop, before it ends [s]."""


def live_period(experiment: Experiment) -> float:
    """Return the period of a live run [s]: the control period, or a millisecond."""
    return experiment.scenario.simulation.control_period or 0.001


def interface_of(experiment: Experiment) -> EffortInterface:
    """Return the effort interface of the experiment's robot.

    The maximum effort is that of the controller's limits, if it has limits.
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
    """Return the settings of the safe stop."""
    return StopSettings(**experiment.scenario.live.stop.model_dump())


def simulated_robot(experiment: Experiment) -> SimulatedRobot:
    """Return the experiment's plant as a robot with a watchdog and a safe stop.

    Raises:
        LiveError: If it has a floating base, or a setting is invalid.
    """
    check_fixed(experiment.robot)
    period, live = live_period(experiment), experiment.scenario.live
    stop = live.stop.model_dump() | {"hold": FINAL_HOLD}
    return SimulatedRobot(
        live_plant(experiment, period),
        experiment.q0,
        experiment.v0,
        period,
        interface=interface_of(experiment),
        watchdog=live.watchdog,
        stop=StopSettings(**stop),
    )


def live_plant(experiment: Experiment, period: float) -> SampledPlant:
    """Return an experiment's plant as one that advances period by period.

    A continuous plant is integrated by the experiment's integrator. An adaptive
    integrator may take any time, so one Runge-Kutta step per period replaces it.

    Raises:
        LiveError: If it is neither continuous nor sampled.
    """
    plant, integrator = experiment.plant, experiment.integrator
    if isinstance(plant, ContinuousPlant):
        adaptive = isinstance(integrator, Dop853)
        return IntegratedPlant(plant, Rk4(period) if adaptive else integrator)
    if not isinstance(plant, SampledPlant):
        raise LiveError(
            f"{type(plant).__name__} is neither a continuous nor a sampled plant"
        )
    return plant
