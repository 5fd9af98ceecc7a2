"""Minutes of simulated time at 1 kHz, as on a robot: memory use is constant.

The loop is that of a robot: measure, compute, apply, store nothing. Python's
allocations (tracemalloc) and the memory of the process (its resident set) are read
every simulated half minute, after a warm-up.
"""

import gc
import tracemalloc
from dataclasses import dataclass, field

import psutil
from rich.progress import Progress

import hsp_control as hsp
from campaigns.results import keep
from hsp_control.robot import RobotState
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import IntegratedPlant

CONFIG = "panda_obstacle"
PERIOD = 1e-3
MINUTES = 10.0
PYTHON_GROWTH = 100_000
"""Largest growth of Python's allocations between warm-up and end [bytes]."""
PROCESS_GROWTH = 8_000_000
"""Largest growth of the process [bytes]: pages of the allocator; a leak of 16 bytes per
step would exceed it in 600000 steps."""


@dataclass
class Soak:
    """Readings of memory.

    Attributes:
        steps: Control steps.
        python: Allocations of Python [bytes], from the warm-up on.
        process: Memory of the process [bytes], at the same moments.
        worst_error: The largest task error after the first second, in the task's units.
    """

    steps: int = 0
    python: list[int] = field(default_factory=list)
    process: list[int] = field(default_factory=list)
    worst_error: float = 0.0

    @property
    def growth(self) -> tuple[int, int]:
        """Growth from begin to end [bytes]: Python, process."""
        return self.python[-1] - self.python[0], self.process[-1] - self.process[0]

    @property
    def good(self) -> bool:
        """Whether memory use stayed constant."""
        python, process = self.growth
        return python < PYTHON_GROWTH and process < PROCESS_GROWTH


def soak(seconds: float, log_channels: int, show: object = None) -> Soak:
    """Run the loop for a simulated time [s], with that many memory readings."""
    experiment = hsp.load_experiment(CONFIG)
    controller, robot = experiment.controller, experiment.robot
    plant = IntegratedPlant(hsp.plants.RigidBodyPlant(robot), Rk4(PERIOD))
    state = RobotState(robot)
    plant.reset(0.0, experiment.q0, experiment.v0)
    q, v = experiment.q0.copy(), experiment.v0.copy()
    controller.restart()
    result, steps = Soak(), round(seconds / PERIOD)
    every, warm_up = max(1, steps // log_channels), min(2000, steps // 4)
    process = psutil.Process()
    tracemalloc.start()
    try:
        for k in range(steps):
            t = k * PERIOD
            output = controller.compute(state.update(t, *plant.measure(t, q, v)))
            controller.applied(output.tau, PERIOD)
            if k > 1000:
                error = float(abs(output.task.error).max())
                result.worst_error = max(result.worst_error, error)
            q, v = plant.advance(t, t + PERIOD, output.tau)
            if k >= warm_up and (k - warm_up) % every == 0:
                gc.collect()
                result.python.append(tracemalloc.get_traced_memory()[0])
                result.process.append(process.memory_info().rss)
                result.steps = k + 1
                if callable(show):
                    show(result)
    finally:
        tracemalloc.stop()
    result.steps = steps
    return result


def campaign(progress: Progress, seed: int, share: float) -> bool:
    """Run the soak for ten minutes."""
    seconds = share * MINUTES * 60.0
    bar = progress.add_task("soak", total=seconds / PERIOD)
    found = soak(
        seconds, 20, lambda so_far: progress.update(bar, completed=so_far.steps)
    )
    progress.update(bar, completed=found.steps)
    keep("soak", vars(found) | {"wanted": round(MINUTES * 60.0 / PERIOD)})
    return found.good
