"""From a checked configuration to its objects: controller, start and plant."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from hsp_control.common.arrays import Array
from hsp_control.config.document import Document
from hsp_control.config.loop_check import check_compensation, check_rates
from hsp_control.config.scenario import Scenario
from hsp_control.config.setup import Setup
from hsp_control.control.compensation import RateFinding
from hsp_control.control.controller import Controller
from hsp_control.estimation import begun
from hsp_control.geometry.scene import Scene
from hsp_control.robot import Robot
from hsp_control.simulation.initial_state import InitialState
from hsp_control.simulation.plants import Plant, SampledPlant
from hsp_control.simulation.simulate import check_steps


class Composed(NamedTuple):
    """The objects of one configuration; see `Experiment`."""

    name: str
    scenario: Scenario
    robot: Robot
    controller: Controller
    scene: Scene
    q0: Array
    v0: Array
    plant: Plant
    rate_findings: tuple[RateFinding, ...]


def compose(document: Document, setup: Setup) -> Composed:
    """Make the objects of a configuration.

    Args:
        document: The configuration.
        setup: What `set_up` made of it.

    Raises:
        HspControlError: If the configuration is wrong; see `load_experiment`.
    """
    scenario, robot, scene = setup
    folder = Path(document.name).resolve().parent
    contacts = tuple(scenario.contacts.values())
    null_space, tasks = scenario.null_space, tuple(scenario.tasks.values())
    # First, as its engine may not be installed: what follows may compile for a while.
    scenario = replace(scenario, plant=scenario.plant.located(folder))
    plant = _plant(document, scenario, robot)
    with document.at("start"):
        q0 = scenario.start.configuration_of(
            robot, contacts, tasks, scene, null_space.singularity_threshold
        )
        if scenario.start.is_found:  # the log repeats the run where another is found
            found = InitialState(configuration=q0, velocity=scenario.start.velocity)
            scenario = replace(scenario, start=found)
    with document.at():
        limits = scenario.limits
        if scenario.plan is not None:
            tasks, contacts = scenario.plan.parts(robot, tasks, contacts)
            limits = scenario.plan.limits(limits)
        controller = Controller(
            robot,
            tasks,
            null_space.field,
            null_space_gain=null_space.gain,
            metric=null_space.metric,
            singularity_threshold=null_space.singularity_threshold,
            limits=limits,
            contacts=contacts,
            base=scenario.base,
            scene=scene,
            start=q0,
            changes=scenario.changes,
        )
    with document.at("start"):
        v0 = scenario.start.velocity_of(controller, q0)
        if controller.limits is not None:
            controller.limits.check_start(q0, v0)
    if scenario.plan is not None:
        with document.at("plan"):
            scenario.plan.begin(controller).start(robot.state(0.0, q0, v0))
    with document.at():
        begun(scenario.estimators, controller, plant.inertial())
    check_compensation(document, scenario, controller)
    rates = check_rates(document, scenario, controller, q0, plant.robot)
    name = Path(document.name).stem
    return Composed(name, scenario, robot, controller, scene, q0, v0, plant, rates)


def _plant(document: Document, scenario: Scenario, robot: Robot) -> Plant:
    """Return the plant, which has the control period and the steps that it needs."""
    settings = scenario.simulation
    if (step := scenario.plant.longest_step) is not None:
        with document.at("simulation"):
            check_steps(settings.duration, step, "plant.timestep")
    with document.at("plant"):
        plant = scenario.plant.build(robot, settings.integrator, access=document.access)
    if isinstance(plant, SampledPlant) and settings.control_period is None:
        raise document.error(
            ("plant",),
            "this plant needs efforts that are held for a period: set "
            "simulation.control_period [s], for example to 0.001",
        )
    return plant
