"""One palette for plots and viewer: colours by what they stand for, as hex strings.

After Okabe and Ito (2008), whose colours stay apart for every kind of colour blindness;
greys for what is context. Needs no plotting package.
"""

ACTUAL = "#0072B2"
"""What was measured (blue)."""
DESIRED = "#E69F00"
"""What a task asks for (orange)."""
OBSTACLE = "#D55E00"
"""What must not be touched (vermilion)."""
TASK = "#009E73"
"""A task's frame, its error (bluish green)."""
FIELD = "#CC79A7"
"""The null-space field, self-motion, e_N (reddish purple)."""
WARNING = "#882255"
"""Where the law was bounded, a run that ended early (wine)."""

LINK = "#8C969F"
"""A robot's links (grey)."""
JOINT = "#2F363D"
"""A robot's joints (near black)."""
SHADOW = "#E3E6E9"
"""What only helps the eye: a shadow on the floor (pale grey)."""
WALL = "#F6F7F8"
"""The walls behind a picture in space."""

INK = "#22272B"
"""Text and axes."""
MUTED = "#6B7680"
"""Notes, and lines that are not named."""
GRID = "#DFE3E6"
"""Grid lines."""
PAPER = "#FFFFFF"
"""The background."""

EARLY, LATE = "#C9DCEA", "#0A3A5C"
"""The two ends of the scale of time, light to dark blue."""
OBSTACLE_EARLY = "#F7DCCB"
"""An obstacle at the early end of that scale."""

SERIES = (
    "#0072B2",  # blue
    "#E69F00",  # orange
    "#009E73",  # bluish green
    "#CC79A7",  # reddish purple
    "#56B4E9",  # sky blue
    "#D55E00",  # vermilion
    "#22272B",  # ink
)
"""Lines of one kind, such as joints; Okabe and Ito's yellow is lost on white."""

TASKS = (ACTUAL, TASK, "#CC79A7", "#56B4E9", INK)
"""What was measured of one task, of a second and so on."""


def blend(start: str, end: str, fraction: float) -> str:
    """Return the colour at a fraction of the way from ``start`` to ``end``."""
    pairs = zip(_channels(start), _channels(end), strict=True)
    mixed = (round(a + fraction * (b - a)) for a, b in pairs)
    return "#" + "".join(f"{channel:02X}" for channel in mixed)


def series(index: int) -> str:
    """Return the colour of line ``index``; after the last comes the first again."""
    return SERIES[index % len(SERIES)]


def task(index: int) -> str:
    """Return the colour of task ``index``."""
    return TASKS[index % len(TASKS)]


def _channels(color: str) -> tuple[int, int, int]:
    red, green, blue = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    return red, green, blue
