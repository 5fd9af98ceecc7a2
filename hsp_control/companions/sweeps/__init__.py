"""Sweeps: run one experiment many times with different values."""

from typing import TYPE_CHECKING

from hsp_control.companions.shared import at_first_use

if TYPE_CHECKING:  # for type checkers only: a help text must not import slow modules
    from .figure import save_sweep_figure as save_sweep_figure
    from .figure import sweep_figure as sweep_figure
    from .results import Sweep as Sweep
    from .sensitivities import Sensitivity as Sensitivity
    from .sensitivities import sensitivity as sensitivity
    from .sweep_runs import sweep as sweep

__getattr__, __dir__ = at_first_use(
    __name__,
    {
        "figure": "save_sweep_figure sweep_figure",
        "results": "Sweep",
        "sensitivities": "Sensitivity sensitivity",
        "sweep_runs": "sweep",
    },
)
