"""How the view looks: what each thing is coloured, and how thick things are."""

from hsp_control.visualization import palette

ACTUAL, DESIRED = palette.ACTUAL, palette.DESIRED
OBSTACLE = palette.OBSTACLE
LINK, JOINT = palette.LINK, palette.JOINT
AXES = (palette.OBSTACLE, palette.TASK, palette.ACTUAL)
"""x, y and z of a target: as near to red, green and blue as all eyes tell apart."""

HAZE = 0.19
"""How much darker the horizon is than the sky: the share of grey."""
GRID = "#8794A1"

PATH_RADIUS = 0.0045
"""Of the actual path, over the size of the scene."""
DESIRED_WIDENING = 2.0
"""How much thicker the desired path is: a sleeve, in which the actual one lies."""
GHOST_NARROWING = 0.8
"""How much thinner a ghost's path is: it lies within the path of the run."""
OBSTACLE_OPACITY = 0.75
ZONE_OPACITY = 0.13
INK, CHALK = palette.INK, palette.WALL
"""What is drawn on a light background, and on a dark one."""
BAR_RADIUS = 0.003
"""Of a distance, over the size of the scene."""
ELLIPSOID, ELLIPSOID_OPACITY = palette.TASK, 0.3
FIELD, FIELD_OPACITY = palette.FIELD, 0.4
ARROW_RADIUS = 0.007
"""Of an arrow's shaft, over the robot's size."""
CONTACT = palette.WARNING
