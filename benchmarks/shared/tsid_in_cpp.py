"""TSID's step in C++: no Python in it, and the references computed before.

`tsid_in_cpp.cpp` is compiled once, against the TSID of `install_peers.py`, and
kept beside it. It takes the objects that a peer made in Python: the same problem.
"""

import importlib
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from shared.timing import Compute, State

SOURCE = Path(__file__).with_suffix(".cpp")
BUILT = Path(sys.prefix) / "tsid_in_cpp" / "tsid_in_cpp_built.so"
FLAGS = ("-O3", "-DNDEBUG", "-std=c++17", "-shared", "-fPIC", "-w")
LIBRARIES = ("-ltsid", "-lpinocchio_default")


@cache
def _built() -> Any:
    """Return the module, compiled if it is older than its source."""
    if not BUILT.exists() or BUILT.stat().st_mtime < SOURCE.stat().st_mtime:
        prefix = Path(sysconfig.get_paths()["purelib"]) / "cmeel.prefix"
        headers = prefix / "include"
        folders = [headers, headers / "pinocchio" / "deprecated", headers / "eigen3"]
        python = "".join(map(str, sys.version_info[:2]))
        BUILT.parent.mkdir(exist_ok=True)
        command = [
            *("g++", *FLAGS, "-o", BUILT, SOURCE),
            *(f"-I{folder}" for folder in folders),
            f"-I{sysconfig.get_paths()['include']}",
            *(f"-L{prefix / 'lib'}", f"-Wl,-rpath,{prefix / 'lib'}", *LIBRARIES),
            f"-lboost_python{python}",
        ]
        subprocess.run(list(map(str, command)), check=True)
    sys.path.insert(0, str(BUILT.parent))
    return importlib.import_module(BUILT.stem)


class CppSteps:
    """The steps of a peer in C++, for states known before."""

    def __init__(self, peer: Compute, states: Sequence[State]) -> None:
        """Let the peer compute every state once, and keep the references that it set.

        Args:
            peer: A function with ``parts``: TSID's problem, solver and tasks.
            states: The states.

        Raises:
            RuntimeError: If the last effort differs from the peer's.
        """
        self._steps = _built().Steps(*peer.parts)  # type: ignore[attr-defined]
        tau = np.zeros(0)
        for t, q, v in states:
            tau = peer(t, q, v)
            self._steps.add(t, [*map(float, q)], [*map(float, v)])
        self.elapsed(len(states) - 1, len(states))
        own = np.array(self._steps.efforts())
        if not np.allclose(own, tau[-len(own) :], rtol=1e-6, atol=1e-6):
            raise RuntimeError(f"TSID in C++ computes {own}, through Python {tau}")

    def elapsed(self, begin: int, end: int) -> Array:
        """Make the steps from one state to another; return their times [ns]."""
        return np.array(self._steps.run(begin, end))
