"""A checked configuration with its robot and scene: nothing is compiled for it."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from hsp_control.common.arrays import Array
from hsp_control.config.document import Document
from hsp_control.config.scenario import Scenario
from hsp_control.config.streams import with_messages
from hsp_control.config.validation import validate
from hsp_control.declaration import within
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.geometry.shapes import Mesh
from hsp_control.robot import Robot
from hsp_control.robot.description.access import Access
from hsp_control.robot.description.mesh_files import check_references


class LoadedScenario(NamedTuple):
    """A checked configuration, with its robot and its scene."""

    document: Document  # the configuration as it was read; it locates errors
    scenario: Scenario  # the configuration, checked
    robot: Robot  # the robot
    scene: Scene  # its obstacles

    def start(self) -> Array:
        """Return the start configuration (nq,); home where it has to be found."""
        start, contacts = self.scenario.start, self.scenario.contacts.values()
        if start.is_found:
            return self.robot.home()
        return start.configuration_of(self.robot, contacts)


def load_scenario(document: Document) -> LoadedScenario:
    """Check a configuration, and load its robot and scene: no kernel is compiled."""
    if document.says_nothing("limits"):
        raise document.error(
            ("limits",),
            "nothing given; write none for no limits, or remove the key to keep the "
            "robot's own",
        )
    scenario = validate(document, Scenario)
    if not scenario.tasks and scenario.plan is None:
        raise document.error(("tasks",), "needs at least one task, or a plan")
    folder = Path(document.name).resolve().parent
    scenario = replace(scenario, robot=scenario.robot.located(folder))
    with document.at():
        scenario = with_messages(scenario, folder, document.access)
    robot = load_robot(document, scenario)
    for contact in scenario.contacts.values():
        with document.at("contacts", contact.name, "frame"):
            robot.frame_id(contact.frame)
    with document.at():
        scene = located_scene(scenario.scene, folder, document.access)
    return LoadedScenario(document, replace(scenario, scene=scene), robot, scene)


def load_robot(document: Document, scenario: Scenario) -> Robot:
    """Return the robot of a configuration."""
    keys = [key for key in ("name", "description") if getattr(scenario.robot, key)]
    with document.at("robot", *keys):
        return Robot.load(scenario.robot, access=document.access)


def located_scene(scene: Scene, folder: Path, access: Access) -> Scene:
    """Return the scene with absolute paths of its meshes, checked."""
    return Scene([_located(each, folder, access) for each in scene.values()])


def _located(obstacle: Obstacle, folder: Path, access: Access) -> Obstacle:
    with within("scene", "obstacles", obstacle.name, "shape"):
        shape = obstacle.shape.located(folder)
        if isinstance(shape, Mesh):
            with within("file"):
                access.check(Path(shape.file), "mesh")
                check_references(Path(shape.file), "mesh", access)
        shape.geometry()  # fails here, where the error has a location
        return replace(obstacle, shape=shape)
