"""Figures of a run, drawn from its log only."""

from hsp_control.simulation.log_series import chosen_rows as chosen_rows

from .conditioning import draw_manipulability as draw_manipulability
from .conditioning import draw_singular_values as draw_singular_values
from .figures import diagnostics_figure as diagnostics_figure
from .figures import paper_figure as paper_figure
from .frames import draw_frame as draw_frame
from .frames import draw_frames as draw_frames
from .frames import draw_superimposed as draw_superimposed
from .joints import draw_efforts as draw_efforts
from .joints import draw_joint_positions as draw_joint_positions
from .null_space import draw_distances as draw_distances
from .null_space import draw_field_terms as draw_field_terms
from .null_space import draw_field_value as draw_field_value
from .null_space import draw_null_space_error as draw_null_space_error
from .paths import draw_end_effector as draw_end_effector
from .saving import save_figure as save_figure
from .saving import save_figures as save_figures
from .style import new_figure as new_figure
from .style import styled as styled
from .style import use_style as use_style
from .task_errors import draw_task_errors as draw_task_errors
