from .figure import save_sweep_figure as save_sweep_figure
from .figure import sweep_figure as sweep_figure
from .results import Sweep as Sweep
from .sensitivities import Sensitivity as Sensitivity
from .sensitivities import sensitivity as sensitivity
from .sweep_runs import sweep as sweep
