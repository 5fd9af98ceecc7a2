"""Check that the compensation fits, and that the loop is stable at its rate."""

from hsp_control.common.arrays import Array
from hsp_control.config.document import Document
from hsp_control.config.scenario import Scenario
from hsp_control.control.compensation import RateFinding, check_rate
from hsp_control.control.controller import Controller
from hsp_control.robot import Robot


def check_compensation(
    document: Document, scenario: Scenario, controller: Controller
) -> None:
    """Check the compensation against the robot, its tasks and contacts."""
    compensation = scenario.compensation
    if compensation.names and scenario.simulation.control_period is None:
        raise document.error(
            ("compensation",),
            "compensation acts once per control period: set simulation.control_period "
            "[s], for example to 0.001",
        )
    with document.at("compensation"):
        compensation.check(controller.robot, controller.tasks, controller.contacts)


def check_rates(
    document: Document,
    scenario: Scenario,
    controller: Controller,
    q0: Array,
    moving: Robot,
) -> tuple[RateFinding, ...]:
    """Check that the loop is stable at its rate; return gains that are high for it."""
    settings, plant = scenario.simulation, scenario.plant
    if settings.control_period is None or not settings.check_rate:
        return ()
    with document.at():
        found = check_rate(
            controller,
            q0,
            settings.control_period,
            scenario.compensation,
            effort_delay=plant.effort_delay,
            sensor_delay=plant.sensor_delay,
            plant=moving,
        )
    return tuple(found)
