"""The plots beside the scene of a live page: those of an exported page."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.arrays import Indices
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_writer import LogWriter, continuous_dofs
from hsp_control.simulation.rollout import complete_columns
from hsp_control.visualization.viewer.commands import Command, Json, set_plots
from hsp_control.visualization.viewer.comparison import ComparedRun
from hsp_control.visualization.viewer.packed.packing import ArrayTable
from hsp_control.visualization.viewer.packed.plot_packing import PlottedRun, pack_panels

PREVIEW_ROWS = 500  # about so many rows of a run that is being computed are plotted


def plots_of(runs: Sequence[ComparedRun]) -> Command:
    """Return the command that shows the plots of complete runs."""
    return _command(runs, None)


def plots_so_far(
    recorder: LogWriter, meta: Json, robot: Robot, duration: float
) -> Command:
    """Return the command that plots a run so far, on the whole run's axis."""
    rows = recorder.rows(0)
    chosen = _chosen(len(rows["t"]))
    columns = {name: values[chosen] for name, values in rows.items()}  # copies
    complete_columns(columns, continuous_dofs(robot))
    # Without the controller: the expected floor takes too long to compute meanwhile.
    return _command([ComparedRun("", robot, Rollout(columns, meta), None)], duration)


def _command(runs: Sequence[ComparedRun], end: float | None) -> Command:
    arrays = ArrayTable()
    plotted = [PlottedRun(run.name, run.rollout, run.controller) for run in runs]
    plots = pack_panels(plotted, arrays)
    if end is not None:
        plots["end"] = max(end, plots["end"])
    return set_plots(plots, arrays.entries)


def _chosen(count: int) -> Indices:
    """Return rows at distances of a power of two, so that curves don't flicker."""
    step = 1
    while count > step * PREVIEW_ROWS:
        step *= 2
    return np.append(np.arange(0, count - 1, step), count - 1)
