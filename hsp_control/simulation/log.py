"""The interface of a log for the summaries of a run: `Rollout` is one."""

from typing import Any, Protocol, Self

from hsp_control.common.arrays import Array


class Log(Protocol):
    """Columns of equal length, and their descriptions; see `Rollout`."""

    # Here and not `Rollout` itself, which prints its own summary.
    columns: dict[str, Array]
    meta: dict[str, Any]

    def __getitem__(self, name: str) -> Array: ...
    def __contains__(self, name: str) -> bool: ...
    def __len__(self) -> int: ...

    @property
    def t(self) -> Array:
        """Time [s], shape (N,)."""

    @property
    def v(self) -> Array:
        """Velocity, shape (N, nv)."""

    @property
    def tau(self) -> Array:
        """Effort, shape (N, nv)."""

    def before_stop(self) -> Self:
        """Return the rows before the safe stop of a live run, or all."""

    @property
    def status(self) -> str:
        """How the run ended."""
