"""Interleaved timing, so that disturbances of the machine affect all controllers."""

import gc
from collections.abc import Callable, Mapping, Sequence
from time import perf_counter_ns
from typing import Any, Protocol, runtime_checkable

import numpy as np

State = tuple[float, Any, Any]
Compute = Callable[[float, Any, Any], Any]


@runtime_checkable
class Timed(Protocol):
    """Takes the steps at the states by itself, such as `tsid_in_cpp.CppSteps`."""

    def elapsed(self, begin: int, end: int) -> Any:
        """Make the steps of a part of the states; return their times [ns]."""


def step_times(
    controllers: Mapping[str, Compute | Timed],
    states: Sequence[State],
    rounds: int,
    block: int,
    warm_up: int = 20,
) -> dict[str, Any]:
    """Return the median time of a step in every round, shape (rounds,) [s], by name.

    In every round the controllers get the same block of consecutive states, one after
    the other, in a rotating order. A controller that times its own steps was made for
    these states.
    """
    for compute in controllers.values():
        if not isinstance(compute, Timed):
            for t, q, v in states[:warm_up]:
                compute(t, q, v)
    names = list(controllers)
    times = {name: np.zeros(rounds) for name in names}
    gc.collect()
    gc.disable()
    for k in range(rounds):
        begin = warm_up + (k * block) % (len(states) - warm_up - block + 1)
        chosen = states[begin : begin + block]
        for name in names[k % len(names) :] + names[: k % len(names)]:
            compute, elapsed = controllers[name], np.zeros(block)
            if isinstance(compute, Timed):
                elapsed = compute.elapsed(begin, begin + block)
            else:
                for i, (t, q, v) in enumerate(chosen):
                    started = perf_counter_ns()
                    compute(t, q, v)
                    elapsed[i] = perf_counter_ns() - started
            times[name][k] = 1e-9 * np.median(elapsed)
    gc.enable()
    return times


def ratios(times: dict[str, Any], name: str, reference: str) -> Any:
    """Return the quartiles over the rounds of the time ratios, shape (3,)."""
    return np.quantile(times[name] / times[reference], [0.25, 0.5, 0.75])


def spread(quartiles: Any) -> str:
    """Format a median with its quartiles."""
    low, middle, high = quartiles
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"
