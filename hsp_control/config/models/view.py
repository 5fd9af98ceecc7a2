"""How a run is shown."""

from typing import Annotated

from pydantic import Field

from hsp_control.config.models.base import Model, Positive, Vector3

Color = Annotated[str, Field(pattern="^#[0-9A-Fa-f]{6}$")]


class ShowModel(Model):
    """What is shown at first; all of it can be switched in the page's scene tree."""

    paths: bool = True
    """Where the tasks wanted the robot, and where it was."""
    targets: bool = True
    """Where the tasks want it now."""
    obstacles: bool = True
    """The obstacles."""
    influence: bool = True
    """The zones in which obstacles make themselves felt."""
    distances: bool = True
    """The shortest distances that the field watches."""
    ellipsoid: bool = False
    """The manipulability ellipsoid of the tasks' frames."""
    self_motion: bool = True
    """Null-space velocity and projected field, where they move the robot most."""
    contacts: bool = True
    """Contacts and their forces."""
    grid: bool = True
    """The grid on the floor."""


class ViewModel(Model):
    """The 3-D view."""

    camera: Vector3 | None = None
    """Where one looks from [m]; chosen to see the whole robot by default."""
    target: Vector3 | None = None
    """Where one looks at [m]."""
    speed: Positive = 1.0
    """Seconds of motion shown in one second."""
    loop: bool = False
    """Whether it is played again and again."""
    background: Color = "#FFFFFF"
    """Colour of the sky, as ``#RRGGBB``; texts are light where it is dark."""
    light: Positive = 1.0
    """How strong the light is; 1 is a bright room."""
    show: ShowModel = ShowModel()
    """What is shown at first."""
