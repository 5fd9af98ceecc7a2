"""The acceleration of a motion, bound to the memory that it is computed from."""

from collections.abc import Callable
from typing import NamedTuple

from hsp_control.common.arrays import Array
from hsp_control.common.native import NativeCall


class Acceleration(NamedTuple):
    """v' for what some arrays hold when it is computed.

    Attributes:
        compute: Writes `value` for a time [s].
        value: v', shape (nv,) [rad/s² or m/s²]; the next call overwrites it.
        native: `compute` as a native call, where it does not depend on time; or None.
    """

    compute: Callable[[float], object]
    value: Array
    native: NativeCall | None = None
