"""This law's step without Python: the call that `compute` makes, in a loop in C++.

Unlike TSID's step in C++ (`tsid_in_cpp`) it computes its references, too.
"""

import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.engine.own_kinds import build, load
from shared.timing import State

SOURCE = Path(__file__).with_suffix(".cpp")
BUILT = Path(sys.prefix) / "steps_in_cpp" / "steps_in_cpp.so"


@cache
def _built() -> SimpleNamespace:
    """Return the kind; it includes sources of the engine, and so is compiled anew."""
    return load(build(SOURCE, BUILT))


class StepsInCpp:
    """The steps of a controller in C++, for states known before."""

    def __init__(self, controller: hsp.Controller, states: Sequence[State]) -> None:
        """Bind the controller's step to the states.

        Args:
            controller: Nothing of it changes with time, and its whole step is in the
                engine, also where a limit binds: no distance is a limit, and no contact
                is held.
            states: The states.

        Raises:
            RuntimeError: If the last effort differs from that of `compute`.
        """
        expected = controller.compute(*states[-1]).tau
        bound = controller._settled_step
        assert bound is not None, "something changes at present"
        t, q, v = (np.array(each, dtype=float) for each in zip(*states, strict=True))
        self._begin, self._end = np.zeros((2, 1), dtype=np.int64)
        self._elapsed = np.zeros(len(t))
        self._steps = _built().StepsAtStates(
            step=bound.move,
            t=t,
            q=q,
            v=v,
            begin=self._begin,
            end=self._end,
            elapsed=self._elapsed,
        )
        self.elapsed(0, len(t))
        own = bound.actuation.delivered(bound.active.acceleration).effort
        if not np.array_equal(own, expected):
            raise RuntimeError(f"in C++ the effort is {own}, from Python {expected}")

    def elapsed(self, begin: int, end: int) -> Array:
        """Make the steps from one state to another; return their times [ns]."""
        self._begin[0], self._end[0] = begin, end
        self._steps()
        return self._elapsed[begin:end].copy()
