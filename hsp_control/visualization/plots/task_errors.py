"""The tasks' errors over time."""

import numpy as np
from matplotlib.axes import Axes

from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import task_errors
from hsp_control.visualization import palette
from hsp_control.visualization.plots.legends import legend_below, literal_text, note
from hsp_control.visualization.plots.lines import (
    log_scale,
    mark_damped,
    point_marker,
    time_axis,
)

_DASHES = {"rad": "--", "–": ":"}
"""Line styles by unit: all units share one axis; the legend names them."""


def draw_task_errors(axes: Axes, rollout: Rollout) -> None:
    """Draw the norm of every task's error, one line per unit, with a log axis."""
    t, parts = rollout.t, task_errors(rollout)
    if not parts:
        note(axes, "the log has no task")
    for part in parts:
        axes.plot(
            t,
            part.norm,
            color=palette.task(part.task),
            linestyle=_DASHES.get(part.unit, "-"),
            marker=point_marker(t),
            label=literal_text(f"{part.label} [{part.unit}]"),
        )
    mark_damped(axes, rollout)
    norms = [np.zeros(0), *(part.norm for part in parts)]
    log_scale(axes, np.concatenate(norms), top=1e-6)
    units = ", ".join(dict.fromkeys(part.unit for part in parts))
    axes.set_ylabel(rf"task error $\Vert e \Vert$ [{units}]")
    time_axis(axes, t)
    legend_below(axes)
