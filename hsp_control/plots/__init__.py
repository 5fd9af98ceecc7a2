"""Figures of a run, drawn from its log alone.

Matplotlib is imported with the first name that needs it, so that the palette can be had
without.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hsp_control.plots.conditioning import (
        draw_manipulability as draw_manipulability,
    )
    from hsp_control.plots.conditioning import (
        draw_singular_values as draw_singular_values,
    )
    from hsp_control.plots.errors import PlotError as PlotError
    from hsp_control.plots.figures import diagnostics_figure as diagnostics_figure
    from hsp_control.plots.figures import paper_figure as paper_figure
    from hsp_control.plots.frames import draw_frame as draw_frame
    from hsp_control.plots.frames import draw_frames as draw_frames
    from hsp_control.plots.frames import draw_superimposed as draw_superimposed
    from hsp_control.plots.joints import draw_efforts as draw_efforts
    from hsp_control.plots.joints import draw_joint_positions as draw_joint_positions
    from hsp_control.plots.null_space import draw_distances as draw_distances
    from hsp_control.plots.null_space import draw_field_terms as draw_field_terms
    from hsp_control.plots.null_space import draw_field_value as draw_field_value
    from hsp_control.plots.null_space import (
        draw_null_space_error as draw_null_space_error,
    )
    from hsp_control.plots.paths import draw_end_effector as draw_end_effector
    from hsp_control.plots.readings import chosen_rows as chosen_rows
    from hsp_control.plots.saving import save_figures as save_figures
    from hsp_control.plots.style import new_figure as new_figure
    from hsp_control.plots.style import styled as styled
    from hsp_control.plots.task_errors import draw_task_errors as draw_task_errors

_HOMES = {
    "PlotError": "errors",
    "chosen_rows": "readings",
    "diagnostics_figure": "figures",
    "draw_distances": "null_space",
    "draw_efforts": "joints",
    "draw_end_effector": "paths",
    "draw_field_terms": "null_space",
    "draw_field_value": "null_space",
    "draw_frame": "frames",
    "draw_frames": "frames",
    "draw_joint_positions": "joints",
    "draw_manipulability": "conditioning",
    "draw_null_space_error": "null_space",
    "draw_singular_values": "conditioning",
    "draw_superimposed": "frames",
    "draw_task_errors": "task_errors",
    "new_figure": "style",
    "paper_figure": "figures",
    "save_figures": "saving",
    "styled": "style",
}
__all__ = list(_HOMES)


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
