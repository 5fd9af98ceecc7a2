"""Build the compensation, and check that the loop is stable at its rate."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import UnstableRateError
from hsp_control.config.document import Document
from hsp_control.config.models import compensation as r
from hsp_control.config.models.plant import PlantModel
from hsp_control.config.scenario import Scenario
from hsp_control.control.compensation import (
    Compensation,
    EffortRateClip,
    FrictionFeedForward,
    IntegralAction,
    MomentumObserver,
    Predictor,
    RateFinding,
    StartUpRamp,
    VelocityFilter,
    rate_findings,
)
from hsp_control.control.controller import Controller
from hsp_control.robot import Robot
from hsp_control.robot.friction import JointFriction


def build_compensation(
    document: Document, scenario: Scenario, controller: Controller
) -> Compensation:
    """Return the compensation, checked against the robot, its tasks and its limits."""
    model, robot = scenario.compensation, controller.robot
    compensation = Compensation(
        velocity_filter=_filter(model.velocity_filter),
        predictor=_predictor(document, model.predictor),
        momentum_observer=_observer(model.momentum_observer),
        friction_feed_forward=_friction(model.friction_feed_forward, robot),
        integral_action=_integral(document, model.integral_action),
        effort_rate=_clip(model.effort_rate),
        start_up_ramp=_ramp(model.start_up_ramp),
    )
    if compensation.names and scenario.simulation.control_period is None:
        raise document.error(
            ("compensation",),
            "compensation acts once per control period: set simulation.control_period "
            "[s], for example to 0.001",
        )
    for name in compensation.names:  # one by one, for the line of the error
        with document.at("compensation", name):
            only = Compensation(**{name: getattr(compensation, name)})
            only.check(robot, controller.tasks, controller.limits)
    return compensation


def check_rates(
    document: Document,
    scenario: Scenario,
    controller: Controller,
    compensation: Compensation,
    q0: Array,
) -> tuple[RateFinding, ...]:
    """Check that the loop is stable at its rate; return gains that are high for it.

    The delays are those of the plant, whether or not a predictor compensates them.

    Raises:
        UnstableRateError: If the loop is unstable.
    """
    settings, plant = scenario.simulation, scenario.plant
    if settings.control_period is None or not settings.check_rate:
        return ()
    delays = 0, 0
    if isinstance(plant, PlantModel):
        delays = plant.drives.delay, plant.sensors.delay
    if compensation.velocity_filter is not None:
        with document.at("compensation", "velocity_filter"):
            compensation.velocity_filter.coefficients(settings.control_period)
    found = rate_findings(
        controller,
        q0,
        settings.control_period,
        compensation,
        effort_delay=delays[0],
        sensor_delay=delays[1],
    )
    for finding in found:
        if finding.unstable:
            with document.at(*finding.path):
                raise UnstableRateError(finding.message)
    return tuple(found)


def _filter(model: r.VelocityFilterModel | None) -> VelocityFilter | None:
    return None if model is None else VelocityFilter(model.cutoff, model.order)


def _predictor(document: Document, model: r.PredictorModel | None) -> Predictor | None:
    if model is None:
        return None
    with document.at("compensation", "predictor"):
        return Predictor(model.effort_delay, model.sensor_delay)


def _observer(model: r.MomentumObserverModel | None) -> MomentumObserver | None:
    if model is None:
        return None
    clip = np.inf if model.clip is None else model.clip
    return MomentumObserver(model.bandwidth, clip)


def _friction(
    model: r.FrictionFeedForwardModel | str | None, robot: Robot
) -> FrictionFeedForward | None:
    if model is None:
        return None
    if isinstance(model, str):
        own = JointFriction.of_model(robot)
        return FrictionFeedForward(own.coulomb, own.viscous)
    return FrictionFeedForward(model.coulomb, model.viscous, model.smoothing)


def _integral(
    document: Document, model: r.IntegralActionModel | None
) -> IntegralAction | None:
    if model is None:
        return None
    with document.at("compensation", "integral_action"):
        limit = np.inf if model.limit is None else model.limit
        return IntegralAction(model.rate, ki=model.ki, tasks=model.tasks, limit=limit)


def _clip(rate: float | list[float] | None) -> EffortRateClip | None:
    return None if rate is None else EffortRateClip(rate)


def _ramp(model: r.StartUpRampModel | None) -> StartUpRamp | None:
    return (
        None if model is None else StartUpRamp(model.duration, model.natural_frequency)
    )
