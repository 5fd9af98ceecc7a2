"""The schema of a YAML configuration, as a tree of typed models.

Each ``type:`` selects one class of a union; the builders map it to the object of the
same name. Units are SI: metres, radians, seconds.
"""

from collections.abc import Sequence
from copy import deepcopy
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field
from pydantic.json_schema import GenerateJsonSchema

from hsp_control.config.models.base import Model
from hsp_control.config.models.compensation import CompensationModel
from hsp_control.config.models.live import LiveModel
from hsp_control.config.models.null_space import NullSpaceModel
from hsp_control.config.models.plant import AnyPlant
from hsp_control.config.models.robot import RobotModel, StartModel
from hsp_control.config.models.simulation import SimulationModel
from hsp_control.config.models.view import ViewModel
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits
from hsp_control.control.changes import Change
from hsp_control.declaration import Part
from hsp_control.declaration.named import BY_NAME
from hsp_control.declaration.plain_data import plain_data
from hsp_control.declaration.quantities import Name
from hsp_control.geometry.scene import Scene
from hsp_control.tasks import Task


class Scenario(Model):
    """A whole configuration."""

    title: str = ""
    """One line that says what the configuration shows; the title of its plots."""
    description: str = ""
    """A longer description, for readers."""
    robot: RobotModel
    """The robot that is controlled."""
    start: StartModel = StartModel()
    """Configuration and velocity at t = 0."""
    scene: Scene = Scene()
    """The obstacles."""
    tasks: Annotated[dict[Name, Task], Field(min_length=1, max_length=100), BY_NAME]
    """The tasks, by name; tasks of the same priority form one level."""
    contacts: Annotated[dict[Name, Contact], Field(max_length=100), BY_NAME] = Field(
        default_factory=dict
    )
    """The contacts that support a robot with a free-flyer root, by name."""
    base: Literal["flying", "driven"] | None = None
    """For a free-flyer root without contacts: ``flying`` if nothing holds it,
    ``driven`` if something outside the controller moves it."""
    limits: Limits | None = None
    """Limits on efforts and motion that the controller keeps; no limits by default."""
    null_space: NullSpaceModel = NullSpaceModel()
    """The control of self-motion: fields, metric and gain."""
    changes: Annotated[Sequence[Change], AfterValidator(tuple)] = ()
    """Changes of tasks, gains, fields and contacts while the controller runs."""
    plant: AnyPlant = "rigid_body"
    """The simulated system that the efforts act on, and its differences from the
    controller's model."""
    compensation: CompensationModel = CompensationModel()
    """Compensators for the differences between the plant and the model."""
    simulation: SimulationModel = SimulationModel()
    """Settings of the simulation."""
    live: LiveModel = LiveModel()
    """Settings of `hsp live`."""
    view: ViewModel = ViewModel()
    """Settings of the 3-D view."""


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a configuration, for editors."""
    schema = Scenario.model_json_schema(schema_generator=_Generator)
    for model in schema["$defs"].values():
        if "const" in (kind := model.get("properties", {}).get("type", {})):
            kind.setdefault("description", f"{kind['const']}: {model['description']}")
    _name_added_tasks(schema["$defs"])
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "hsp_control configuration"
    return schema


class _Generator(GenerateJsonSchema):
    """Pydantic's generator, with the defaults as YAML would give them."""

    def encode_default(self, dft: Any) -> Any:
        """Return a default as plain data."""
        return plain_data(dft, defaults=not isinstance(dft, Part))


def _name_added_tasks(definitions: dict[str, Any]) -> None:
    """Let a task have a name where no key of a mapping is its name: in a change."""
    name = {"type": "string", "description": Task.documentation["name"]}
    for option in definitions["AddTask"]["properties"]["task"]["oneOf"]:
        task = option["$ref"].removeprefix("#/$defs/")
        added = deepcopy(definitions[task])
        added["properties"]["name"] = name
        definitions[f"Added{task}"] = added
        option["$ref"] = f"#/$defs/Added{task}"
