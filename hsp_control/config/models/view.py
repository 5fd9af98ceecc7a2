"""The 3-D view of a run."""

from typing import Annotated

from pydantic import Field

from hsp_control.config.models.base import Model, Positive, Vector3

Color = Annotated[str, Field(pattern="^#[0-9A-Fa-f]{6}$")]


class ShowModel(Model):
    """What is shown at first; the page's scene tree can switch each item."""

    paths: bool = True
    """The past references of the tasks, and the past motion."""
    targets: bool = True
    """The present references of the tasks."""
    obstacles: bool = True
    """The obstacles."""
    influence: bool = True
    """The influence zones of the obstacles."""
    distances: bool = True
    """The shortest distances of the clearance fields."""
    ellipsoid: bool = False
    """The manipulability ellipsoid of the tasks' frames."""
    self_motion: bool = True
    """Null-space velocity and projected field, at the joints that self-motion moves
    most."""
    contacts: bool = True
    """The contacts and their forces."""
    grid: bool = True
    """The grid on the floor."""


class ViewModel(Model):
    """The 3-D view."""

    camera: Vector3 | None = None
    """Position of the camera [m]; by default the whole robot is visible."""
    target: Vector3 | None = None
    """Point that the camera looks at [m]; by default the centre of the scene."""
    speed: Positive = 1.0
    """Playback speed: seconds of motion in one second [-]."""
    loop: bool = False
    """Whether playback repeats."""
    background: Color = "#FFFFFF"
    """Background colour, as ``#RRGGBB``; text is light on a dark background."""
    light: Positive = 1.0
    """Brightness of the light [-]; 1 is a bright room."""
    show: ShowModel = ShowModel()
    """What is shown at first."""
