"""The schema: what a YAML configuration may say, as a tree of typed models.

Each ``type:`` is one class in one visible union; the builders map it to the object of
the same name. Units are SI: metres, radians, seconds.
"""

from typing import Annotated, Any, Literal

from pydantic import Field

from hsp_control.config.models.base import Model, Name
from hsp_control.config.models.compensation import CompensationModel
from hsp_control.config.models.contacts import AnyContact
from hsp_control.config.models.limits import LimitsModel
from hsp_control.config.models.live import LiveModel
from hsp_control.config.models.null_space import NullSpaceModel
from hsp_control.config.models.plant import AnyPlant
from hsp_control.config.models.robot import RobotModel, StartModel
from hsp_control.config.models.scene import SceneModel
from hsp_control.config.models.simulation import SimulationModel
from hsp_control.config.models.tasks import AnyTask
from hsp_control.config.models.view import ViewModel


class Scenario(Model):
    """A whole configuration."""

    title: str = ""
    """One line on what it shows; plots are headed by it."""
    description: str = ""
    """More on it, for people."""
    robot: RobotModel
    """The robot."""
    start: StartModel = StartModel()
    """Where it starts."""
    scene: SceneModel = SceneModel()
    """What else there is."""
    tasks: Annotated[dict[Name, AnyTask], Field(min_length=1, max_length=100)]
    """Tasks by name; those of one priority are stacked at one level."""
    contacts: Annotated[dict[Name, AnyContact], Field(max_length=100)] = Field(
        default_factory=dict
    )
    """Where a robot with a free-flyer root rests, by name."""
    base: Literal["flying", "driven"] | None = None
    """What moves a free-flyer root where no contact does."""
    limits: LimitsModel | None = None
    """What efforts and motion are kept within; no limits by default."""
    null_space: NullSpaceModel = NullSpaceModel()
    """Where self-motion goes."""
    plant: AnyPlant = "rigid_body"
    """What its efforts move, and how that differs from the controller's model."""
    compensation: CompensationModel = CompensationModel()
    """What is done about that difference."""
    simulation: SimulationModel = SimulationModel()
    """How it is simulated."""
    live: LiveModel = LiveModel()
    """How it is run live."""
    view: ViewModel = ViewModel()
    """How it is shown."""


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a configuration, for editors."""
    schema = Scenario.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "hsp_control configuration"
    return schema
