"""Settings of the 3-D view.

They are here, below the view itself, because a configuration contains them.
"""

import re
from dataclasses import KW_ONLY
from typing import Annotated

from pydantic import BeforeValidator, Field

from hsp_control.common.exceptions import ViewerError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Flag, Positive, Vector3

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
    """What is shown at first; the rows of the page's legend switch each."""

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
    grid: Flag = True
    """The grid on the floor [-]."""


class ViewSettings(Part, error=ViewerError):
    """The 3-D view."""

    _: KW_ONLY
    camera: Vector3 | None = None
    """Position of the camera [m]; by default the whole robot is visible."""
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
    """What is shown at first."""
