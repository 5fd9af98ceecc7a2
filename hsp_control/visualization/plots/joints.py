"""Joint positions and joint efforts over time."""

from matplotlib.axes import Axes

from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import (
    effort_units,
    joint_names,
    joint_positions,
    position_units,
)
from hsp_control.visualization.plots.legends import legend_below
from hsp_control.visualization.plots.lines import draw_lines, time_axis


def draw_joint_positions(
    axes: Axes, rollout: Rollout, *, absolute: bool = True
) -> None:
    """Draw the joint positions, unwrapped: not limited to one turn."""
    positions, what = joint_positions(rollout, absolute=absolute)
    names, units = joint_names(rollout), position_units(rollout)
    unit = draw_lines(axes, rollout.t, positions, names, units)
    axes.set_ylabel(f"{what} [{unit}]")
    time_axis(axes, rollout.t)
    legend_below(axes)


def draw_efforts(axes: Axes, rollout: Rollout) -> None:
    """Draw the joints' efforts tau."""
    names, units = joint_names(rollout), effort_units(rollout)
    unit = draw_lines(axes, rollout.t, rollout.tau, names, units)
    axes.set_ylabel(f"effort τ [{unit}]")
    time_axis(axes, rollout.t)
    legend_below(axes)
