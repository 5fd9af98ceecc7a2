"""A checked configuration with its robot and scene."""

from dataclasses import replace
from functools import reduce
from operator import getitem
from pathlib import Path
from typing import NamedTuple, Self, TypeVar

from pydantic import TypeAdapter, ValidationError

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HspControlError
from hsp_control.common.suggestions import did_you_mean
from hsp_control.config.document import Document
from hsp_control.config.own_code import located_imports, run_imports
from hsp_control.config.scenario import Scenario
from hsp_control.config.streams import with_messages
from hsp_control.declaration import Part, within
from hsp_control.declaration.located import locate
from hsp_control.declaration.mistakes import Mistake, domain_error, explained, findings
from hsp_control.declaration.schema import shape
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.geometry.shapes import Mesh
from hsp_control.robot import Robot
from hsp_control.robot.description.access import Access
from hsp_control.robot.description.mesh_files import check_references
from hsp_control.robot.recorded import name_a_changed_scene, recorded_robot

Value = TypeVar("Value", bound=Part)


class LoadedScenario(NamedTuple):
    """A checked configuration, with its robot and its scene."""

    document: Document  # the configuration as read, which locates errors
    scenario: Scenario  # the configuration, checked
    robot: Robot  # the robot
    scene: Scene  # its obstacles

    def start(self) -> Array:
        """Return the start configuration (nq,); home if it has to be searched."""
        start, contacts = self.scenario.start, self.scenario.contacts.values()
        if start.is_found:
            return self.robot.home()
        return start.configuration_of(self.robot, contacts)

    def from_zero(self) -> Self:
        """Return it for a run that begins at t = 0, as live runs and plays do."""
        settings = replace(self.scenario.simulation, start_time=0.0)
        return self._replace(scenario=replace(self.scenario, simulation=settings))


def load_scenario(document: Document) -> LoadedScenario:
    """Check a configuration, and load its robot and scene."""
    if document.says_nothing("limits"):
        raise document.error(
            ("limits",),
            "nothing given; write none for no limits, or remove the key to keep the "
            "robot's own",
        )
    run_imports(document)
    scenario = validate(document, Scenario)
    if "tasks" not in document.to_dict() and scenario.plan is None:
        raise document.error(
            ("tasks",),
            "nothing given; needs tasks by name, or a plan; write {} for none: gravity "
            "compensation and the field alone",
        )
    folder = Path(document.name).resolve().parent
    scenario = replace(
        scenario,
        robot=scenario.robot.located(folder),
        imports=located_imports(scenario.imports, folder),
    )
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
    """Return the robot of a configuration; that of a log is in the log."""
    there = scenario.robot.mjcf is not None and Path(scenario.robot.mjcf).is_file()
    if document.recorded_robot is not None and not there:  # scenes are in their files
        with document.at("robot"):
            return recorded_robot(document.recorded_robot, document.access)
    keys = [key for key in ("name", "description") if getattr(scenario.robot, key)]
    with document.at("robot", *keys):
        robot = Robot.load(scenario.robot, access=document.access)
    if document.recorded_robot is not None:
        name_a_changed_scene(robot, document.recorded_robot)
    return robot


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
        shape.geometry()  # raises here, where the error has a location
        return replace(obstacle, shape=shape)


# --- its mistakes, in one error -------------------------------------------------------

_OTHERS = 5


def validate(document: Document, part: type[Value]) -> Value:
    """Return the document as a part; an error names up to six mistakes in order."""
    with document.reading():
        try:
            return TypeAdapter(part).validate_python(document.to_dict())
        except ValidationError as error:
            pending = [(each["loc"], each) for each in error.errors(include_url=False)]
            found = findings(document, shape(part), pending)
        found.sort(key=lambda finding: _order(document, finding))
        raise _summary([_error(document, each) for each in found])


def _order(document: Document, finding: Mistake) -> tuple[bool, tuple[int, ...]]:
    """Return the sort key of a finding: its place in the file, overrides last."""
    mark = document.mark(finding.path)
    return mark is None, tuple(mark or ())


def _error(document: Document, finding: Mistake) -> HspControlError:
    """Return the error of a finding; one that a part raised keeps its class."""
    own = domain_error(finding.error)
    if own is None:
        message, (*holder, key) = explained(finding), finding.path or ("",)
        if finding.kind == "union_tag_not_found" and isinstance(key, str):
            beside = reduce(getitem, holder, document.to_dict())  # type: ignore[arg-type]
            message += did_you_mean(key, [name for name in beside if name != key])
        return document.error(finding.path, message)
    path = (*finding.path, *own.path)
    error = type(own)(own.bare_message)
    locate(error, document.location(path), path)
    return error


def _summary(errors: list[HspControlError]) -> HspControlError:
    messages = list(dict.fromkeys(str(error) for error in errors))
    first, others = errors[0], messages[1:]
    if others:
        lines = [f"{first}\nand {len(others)} more:", *others[:_OTHERS]]
        if len(others) > _OTHERS:
            lines.append(f"... ({len(others) - _OTHERS} not shown)")
        first.args = ("\n  ".join(lines),)
    return first
