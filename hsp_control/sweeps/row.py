"""A row: how one run ended and what it measured."""

from dataclasses import dataclass, field

CRASHED = "crashed"
"""The worker died: not a result, and tried again when the sweep is resumed."""


@dataclass(frozen=True)
class Row:
    """One run of a sweep.

    Attributes:
        run: Its place in the plan.
        status: ``completed``; ``diverged``: summarised as far as it came; ``refused``:
            the configuration is not one; ``failed``: an error nobody foresaw;
            ``crashed``: the worker died.
        message: Why, where it is not ``completed``.
        metrics: Numbers by name.
        wall_time: How long it took [s]; the only thing that may differ from one
            machine, or number of workers, to another.
    """

    run: int
    status: str
    message: str = ""
    metrics: dict[str, float] = field(default_factory=dict)
    wall_time: float = 0.0
