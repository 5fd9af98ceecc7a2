"""A row: how one run ended, and its metrics."""

from dataclasses import dataclass, field

CRASHED, TIMED_OUT = "crashed", "timed out"
"""The worker died; the run took too long. Neither is a result: such runs are repeated
when the sweep resumes."""


@dataclass(frozen=True)
class SweepRow:
    """One run of a sweep.

    Attributes:
        run: Its number in the plan.
        status: ``completed``; ``diverged``: the metrics are those until then;
            ``refused``: the configuration is wrong; ``failed``: an unexpected error;
            ``crashed``: the worker died; ``timed out``: the run took too long.
        message: The reason, if the status is not ``completed``.
        metrics: Numbers by name.
        wall_time: Computation time [s]; the only entry that depends on the machine and
            the number of workers.
    """

    run: int
    status: str
    message: str = ""
    metrics: dict[str, float] = field(default_factory=dict)
    wall_time: float = 0.0
