"""Figures of a run, drawn from its log only."""

from typing import TYPE_CHECKING

from hsp_control.companions.shared import at_first_use

if TYPE_CHECKING:  # for type checkers only: a help text must not import slow modules
    from .curves import draw_decay as draw_decay
    from .curves import draw_determinant as draw_determinant
    from .curves import draw_distances as draw_distances
    from .curves import draw_efforts as draw_efforts
    from .curves import draw_field_terms as draw_field_terms
    from .curves import draw_field_value as draw_field_value
    from .curves import draw_joint_positions as draw_joint_positions
    from .curves import draw_null_space_error as draw_null_space_error
    from .curves import draw_singular_values as draw_singular_values
    from .curves import draw_speeds as draw_speeds
    from .curves import draw_task_errors as draw_task_errors
    from .figures import diagnostics_figure as diagnostics_figure
    from .figures import differing as differing
    from .figures import new_figure as new_figure
    from .figures import paper_figure as paper_figure
    from .figures import save_figure as save_figure
    from .figures import save_figures as save_figures
    from .figures import save_for_a_column as save_for_a_column
    from .figures import styled as styled
    from .figures import use_style as use_style
    from .frames import draw_frame as draw_frame
    from .frames import draw_frames as draw_frames
    from .frames import draw_superimposed as draw_superimposed
    from .log_series import chosen_rows as chosen_rows
    from .paths import draw_end_effector as draw_end_effector

__getattr__, __dir__ = at_first_use(
    __name__,
    {
        "curves": (
            "draw_decay draw_determinant draw_distances draw_efforts draw_field_terms "
            "draw_field_value draw_joint_positions draw_null_space_error "
            "draw_singular_values draw_speeds draw_task_errors"
        ),
        "figures": (
            "diagnostics_figure differing new_figure paper_figure save_figure "
            "save_figures save_for_a_column styled use_style"
        ),
        "frames": "draw_frame draw_frames draw_superimposed",
        "log_series": "chosen_rows",
        "paths": "draw_end_effector",
    },
)
