"""The palette of plots and viewer: colours by their meaning, as hex strings.

The colours of Okabe and Ito (2008), which are distinct for every kind of colour
blindness, and greys for the context. Needs no plotting package.
"""

ACTUAL = "#0072B2"
"""Measured values (blue)."""
DESIRED = "#E69F00"
"""Desired values of a task (orange)."""
OBSTACLE = "#D55E00"
"""Obstacles (vermilion)."""
SOLID = "#A08465"
"""Solid things that a robot may touch (brown)."""
TASK = "#009E73"
"""A task's frame, its error (bluish green)."""
FIELD = "#CC79A7"
"""The null-space field, self-motion, e_N (reddish purple)."""
WARNING = "#882255"
"""Damped intervals near a singularity; a run that ended early (wine)."""

COLLISION = "#D00020"
"""A link inside an obstacle or another link (red)."""

LINK = "#8C969F"
"""A robot's links (grey)."""
JOINT = "#2F363D"
"""A robot's joints (near black)."""
SHADOW = "#E3E6E9"
"""A shadow on the floor, which shows depth (pale grey)."""
WALL = "#F6F7F8"
"""The walls behind a three-dimensional plot."""

INK = "#22272B"
"""Text and axes."""
MUTED = "#6B7680"
"""Notes, and lines without a name in the legend."""
GRID = "#DFE3E6"
"""Grid lines."""
PAPER = "#FFFFFF"
"""The background."""

STAGE = "#10171E"
"""A dark background, on which the robot is lit."""

EARLY, LATE = "#C9DCEA", "#0A3A5C"
"""The two ends of the time scale, light to dark blue."""
OBSTACLE_EARLY = "#F7DCCB"
"""An obstacle at the early end of the time scale."""

SERIES = (
    "#0072B2",  # blue
    "#E69F00",  # orange
    "#009E73",  # bluish green
    "#CC79A7",  # reddish purple
    "#56B4E9",  # sky blue
    "#D55E00",  # vermilion
    "#22272B",  # ink
)
"""Lines of one kind, such as joints; without yellow, which is invisible on white."""

RUNS = ("#332288", "#AA4499", "#117733", "#999933", "#882255", "#44AA99")
"""Lines of one run each, by Tol: none is a colour of `SERIES`, which is for joints."""

TASKS = (ACTUAL, TASK, "#CC79A7", "#56B4E9", INK)
"""Measured values of the first task, the second and so on."""


def blend(start: str, end: str, fraction: float) -> str:
    """Return the colour at a fraction of the way from ``start`` to ``end``."""
    pairs = zip(_channels(start), _channels(end), strict=True)
    mixed = (round(a + fraction * (b - a)) for a, b in pairs)
    return "#" + "".join(f"{channel:02X}" for channel in mixed)


def series(index: int) -> str:
    """Return the colour of line ``index``; the colours repeat."""
    return SERIES[index % len(SERIES)]


def run(index: int) -> str:
    """Return the colour of run ``index`` of several; the colours repeat."""
    return RUNS[index % len(RUNS)]


def task(index: int) -> str:
    """Return the colour of task ``index``; the colours repeat."""
    return TASKS[index % len(TASKS)]


def fractions(color: str) -> list[float]:
    """Return red, green and blue of a colour, from 0 to 1."""
    return [channel / 255 for channel in _channels(color)]


def _channels(color: str) -> tuple[int, int, int]:
    red, green, blue = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue
