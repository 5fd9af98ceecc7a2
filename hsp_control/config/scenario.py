"""The contents of a YAML configuration: the parts of an experiment.

A ``type:`` selects a class of a family. Units are SI: metres, radians, seconds.
"""

import re
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import KW_ONLY, field
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, TypeAdapter
from pydantic.json_schema import GenerateJsonSchema

from hsp_control.common.errors import ConfigError, FieldError, ViewerError
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits, LimitsOrNone
from hsp_control.control.changes import Change
from hsp_control.control.compensation import Compensation
from hsp_control.control.estimation import Estimators
from hsp_control.control.plans import MotionPlan
from hsp_control.declaration import Part, within
from hsp_control.declaration.nested import BY_NAME
from hsp_control.declaration.plain_data import plain_data
from hsp_control.declaration.quantities import (
    READ_ONLY,
    Flag,
    Gain,
    Name,
    Positive,
    ReadOnlyDict,
    Vector3,
)
from hsp_control.geometry.scene import Scene
from hsp_control.live.settings import LiveSettings
from hsp_control.null_space.fields import FieldSum, NullSpaceField
from hsp_control.null_space.metrics import Metric
from hsp_control.robot.description.robot_description import RobotDescription
from hsp_control.simulation.initial_state import InitialState, StartOrAuto
from hsp_control.simulation.plants import AnyPlant, RigidBody
from hsp_control.simulation.simulate import SimulationSettings
from hsp_control.tasks import Task


def _summable(fields: Sequence[NullSpaceField]) -> tuple[NullSpaceField, ...]:
    """Return the fields in a tuple."""
    for k, each in enumerate(fields):
        if len(fields) > 1 and not each.controls:
            with within(k):
                raise FieldError(f"{each.name!r} cannot be combined with other fields")
    return tuple(fields)


class NullSpaceSettings(Part, error=FieldError):
    """The control of self-motion."""

    gain: Gain = 10.0
    """Null-space gain K_N [1/s], the rate at which the null-space error decays: a
    number, nv numbers, or a matrix; over a metric that changes with q, one number."""
    metric: Metric | None = None
    """The joint-space metric W [-]; by default the identity, or the mass matrix if a
    task has an impedance."""
    fields: Annotated[Sequence[NullSpaceField], AfterValidator(_summable)] = ()
    """Fields [rad/s or m/s]; their sum is used. Without fields, self-motion comes to
    rest."""
    singularity_threshold: Positive = 0.03
    """Singular value of the task Jacobian below which its pseudo-inverse is damped
    [-]."""

    @property
    def field(self) -> NullSpaceField | None:
        """The sum of the fields; None if there are none."""
        if len(self.fields) == 1:
            return self.fields[0]
        return FieldSum(self.fields) if self.fields else None


_COLOR = "^#[0-9A-Fa-f]{6}$"


def _color(value: object) -> object:
    if value is None:
        raise ValueError(
            'nothing given; write a colour in quotes, "#14202B": # begins a comment'
        )
    if isinstance(value, str) and not re.match(_COLOR, value):
        raise ValueError(f"{value!r} is not a colour, such as '#14202B'")
    return value


Color = Annotated[str, Field(pattern=_COLOR), BeforeValidator(_color)]
"""A colour as ``#RRGGBB``."""


class ShownItems(Part, error=ViewerError):
    """The layers shown at first; rows of the page's legend switch them."""

    _: KW_ONLY
    paths: Flag = True
    """The past references of the tasks, and the past motion [-]."""
    targets: Flag = True
    """The present references of the tasks [-]."""
    obstacles: Flag = True
    """The obstacles [-]."""
    solids: Flag = True
    """The solid things of the plant, which the robot may touch [-]."""
    influence: Flag = True
    """The influence zones of the obstacles [-]."""
    distances: Flag = True
    """The shortest distances of the clearance fields [-]."""
    capsules: Flag = False
    """The shapes of the links that clearance fields and minimum distances measure
    [-]."""
    ellipsoid: Flag = False
    """The manipulability ellipsoid of the tasks' frames [-]."""
    self_motion: Flag = True
    """Null-space velocity and projected field, at the joints that self-motion moves
    most [-]."""
    contacts: Flag = True
    """The contacts and their forces [-]."""
    frames: Flag = False
    """The axes of the tasks' frames, at the robot and at their targets [-]."""
    grid: Flag = True
    """The grid on the floor [-]."""


class ViewSettings(Part, error=ViewerError):
    """The 3-D view."""

    _: KW_ONLY
    camera: Vector3 | Literal["front", "side", "top", "tool"] | None = None
    """Position of the camera [m], or a view by its name: the whole robot from a side,
    or the tool, which the camera follows; by default the whole robot is visible."""
    target: Vector3 | None = None
    """Point that the camera looks at [m]; by default the centre of the scene."""
    speed: Positive = 1.0
    """Playback speed: seconds of motion in one second [-]."""
    loop: Flag = False
    """Whether playback repeats [-]."""
    background: Color = "#FFFFFF"
    """Background colour, as ``#RRGGBB`` [-]; text is light on a dark background."""
    light: Positive = 1.0
    """Brightness of the light [-]; 1 is a bright room."""
    show: ShownItems = ShownItems()
    """The layers shown at first."""


class Scenario(Part, error=ConfigError):
    """A whole configuration."""

    _: KW_ONLY
    title: Annotated[str, Field(max_length=300)] = ""
    """The configuration in one line; the title of its plots."""
    description: str = ""
    """A longer description, for readers."""
    imports: Annotated[Sequence[str], Field(max_length=100), AfterValidator(tuple)] = ()
    """Your own Python code with the types and functions named in the configuration:
    files, such as ``parts.py`` beside it, and modules that Python can import, such as
    ``my_package.parts``."""
    robot: RobotDescription
    """The robot that is controlled."""
    start: StartOrAuto = InitialState()
    """Configuration and velocity at t = 0; ``auto``: a good configuration is found."""
    scene: Scene = Scene()
    """The obstacles."""
    tasks: Annotated[dict[Name, Task], Field(max_length=100), BY_NAME, READ_ONLY] = (
        field(default_factory=ReadOnlyDict)
    )
    """The tasks, by name; tasks of the same priority form one level. A plan adds
    its own. Without any, the arm follows the field alone, with gravity compensated."""
    plan: MotionPlan | None = None
    """The plan that writes references and switches contacts while the robot moves; none
    by default."""
    contacts: Annotated[
        dict[Name, Contact], Field(max_length=100), BY_NAME, READ_ONLY
    ] = field(default_factory=ReadOnlyDict)
    """The contacts that support a robot with a free-flyer root, by name."""
    base: Literal["flying", "driven"] | None = None
    """For a free-flyer root without contacts: ``flying`` if it is free, ``driven`` if
    another device moves it."""
    limits: LimitsOrNone = Limits()
    """Limits on efforts and motion that the controller enforces: the robot's own by
    default; ``none``: no limits."""
    null_space: NullSpaceSettings = NullSpaceSettings()
    """The control of self-motion: fields, metric and gain."""
    changes: Annotated[Sequence[Change], AfterValidator(tuple)] = ()
    """Changes of tasks, gains, fields and contacts at run time."""
    plant: AnyPlant = RigidBody()
    """The simulated system on which the efforts act, and its differences from the
    controller's model."""
    compensation: Compensation = Compensation()
    """Compensators for the differences between the plant and the model."""
    estimators: Estimators = ()
    """Estimators that complete each measurement, by type: the base of a robot, or
    forces of contacts; by default the measurement is used unchanged."""
    simulation: SimulationSettings = SimulationSettings()
    """Settings of the simulation."""
    live: LiveSettings = LiveSettings()
    """Settings of `hsp live`."""
    view: ViewSettings = ViewSettings()
    """Settings of the 3-D view."""


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a configuration, for editors."""
    schema = TypeAdapter(Scenario).json_schema(schema_generator=_SchemaOfScenario)
    for model in schema["$defs"].values():
        if "const" in (kind := model.get("properties", {}).get("type", {})):
            about = model.get("description", "")  # python -OO leaves docstrings out
            kind.setdefault("description", f"{kind['const']}: {about}")
    _name_added_tasks(schema["$defs"])
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "hsp_control configuration"
    return schema


class _SchemaOfScenario(GenerateJsonSchema):
    """Pydantic's generator, with the defaults in YAML's form."""

    def encode_default(self, dft: Any) -> Any:
        """Return a default as plain data."""
        return plain_data(dft, defaults=not isinstance(dft, Part))


def _name_added_tasks(definitions: dict[str, Any]) -> None:
    """Permit a task's name where it is not the key of a mapping: in a change."""
    name = {"type": "string", "description": Task.documentation["name"]}
    for option in definitions["AddTask"]["properties"]["task"]["oneOf"]:
        task = option["$ref"].removeprefix("#/$defs/")
        added = deepcopy(definitions[task])
        added["properties"]["name"] = name
        definitions[f"Added{task}"] = added
        option["$ref"] = f"#/$defs/Added{task}"
