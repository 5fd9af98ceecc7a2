"""Colours, opacities and sizes of the objects in the view."""

from hsp_control.visualization import palette

ACTUAL, DESIRED = palette.ACTUAL, palette.DESIRED
OBSTACLE, SOLID = palette.OBSTACLE, palette.SOLID
LINK, JOINT = palette.LINK, palette.JOINT
AXES = (palette.OBSTACLE, palette.TASK, palette.ACTUAL)
"""x, y and z axis of a target: like red, green, blue, but safe for colour blindness."""

HAZE = 0.19  # share of grey in the background's colour at the horizon
GRID = "#8794A1"

PATH_RADIUS = 0.0045  # radius of the actual path, over the size of the scene
DESIRED_WIDENING = 2.0
"""Radius of the desired path over that of the actual path, which it encloses."""
GHOST_NARROWING = 0.8
"""Radius of a ghost's path over that of the run, which encloses it."""
OBSTACLE_OPACITY = 0.75
ZONE_OPACITY = 0.13
INK, CHALK = palette.INK, palette.WALL
"""Colour of lines on a light and on a dark background."""
BAR_RADIUS = 0.003  # radius of a distance bar, over the size of the scene
BAR_END_RADIUS = 0.0075  # radius of the balls at its ends, over the size of the scene
MEASURED, MEASURED_OPACITY = palette.SERIES[4], 0.3
"""Colour and opacity of the shapes of links that distances are measured with."""
ELLIPSOID, ELLIPSOID_OPACITY = palette.TASK, 0.3
FIELD, FIELD_OPACITY = palette.FIELD, 0.4
ARROW_RADIUS = 0.007  # radius of an arrow's shaft, over the robot's size
CONTACT = palette.WARNING
