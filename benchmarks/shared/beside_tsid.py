"""The steps of one kind beside TSID's, through Python and in C++."""

from collections.abc import Sequence
from time import perf_counter_ns

import numpy as np

from hsp_control.common.arrays import Array
from shared.steps_in_cpp import StepsInCpp
from shared.timing import Compute, State, Timed, ratios, spread, step_times
from shared.tsid_in_cpp import CppSteps

HEADER = (
    "| steps | share | this law [µs], median / 99 % | TSID through Python = 1 | "
    "TSID in C++ = 1 | both in C++, TSID = 1 |\n|---|--:|--:|--:|--:|--:|\n"
)
CPP = (
    "*TSID in C++* is the same problem without any Python, with its references "
    "computed before (`benchmarks/shared/tsid_in_cpp.cpp`); this law is called from "
    "Python and computes its references. *Both in C++*: this law's step is called in "
    "C++, too (`benchmarks/shared/steps_in_cpp.cpp`), where all of it is in the "
    "engine.\n"
)
_REPEATS, _STATES = 5, 1000


def row(
    what: str,
    law: Compute,
    peer: Compute,
    states: Sequence[State],
    chosen: Array,
    rounds: int = 25,
    block: int = 40,
) -> str:
    """Return a row of the table of `HEADER`.

    Args:
        what: The kind of steps.
        law: This law; with ``controller``, if its whole step is in the engine.
        peer: TSID, with ``parts``, see `CppSteps`.
        states: The states of a run.
        chosen: Which of them, shape (len(states),).
        rounds: Rounds of timing.
        block: Steps in a round.
    """
    steps = [states[i] for i in np.flatnonzero(chosen)]
    share = f"{100 * np.mean(chosen):.0f} %"
    block = min(block, len(steps) // 2)
    if block < 10:
        return f"| {what} | {share} | too few to time | | | |\n"
    compared: dict[str, Compute | Timed] = {"law": law, "Python": peer}
    compared["C++"] = CppSteps(peer, steps)
    if controller := getattr(law, "controller", None):
        compared["law in C++"] = StepsInCpp(controller, steps)
    times = step_times(compared, steps, rounds, block, warm_up=min(20, block))
    taken = 1e-3 * _best_times(law, steps[:: -(-len(steps) // _STATES)])
    return (
        f"| {what} | {share} | {np.median(taken):.1f} / {np.quantile(taken, 0.99):.1f} "
        f"| {spread(ratios(times, 'law', 'Python'))} "
        f"| {spread(ratios(times, 'law', 'C++'))} "
        f"| {spread(ratios(times, 'law in C++', 'C++')) if controller else ''} |\n"
    )


def _best_times(compute: Compute, states: Sequence[State]) -> Array:
    """Return the least time of each step in several passes [ns]."""
    elapsed = np.full((_REPEATS, len(states)), np.inf)
    for passed in elapsed:
        for i, (t, q, v) in enumerate(states):
            started = perf_counter_ns()
            compute(t, q, v)
            passed[i] = perf_counter_ns() - started
    return np.asarray(elapsed.min(axis=0))
