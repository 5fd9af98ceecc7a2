"""Detects moving joints with dead sensors, by the other joints' motion."""

from math import exp

import numpy as np

from hsp_control.common.arrays import Array, Flags

_WASHOUT = 0.1
"""Time constant with which a change of velocity is forgotten [s]."""
_LATELY = 0.2
"""Time constant with which the silent joints' own motion is forgotten [s]: until it is
found, they move unseen."""
_MEMORY = 0.1
"""Time constant of the mean squares that are compared [s]."""
_FELT, _MOST = 0.5, 1.6
"""Minimum and maximum share of the reaction that is measured: masses may be wrong, and
friction may brake the joint."""
_EXPLAINED = 0.8
"""Share of the others' unexpected motion that the reaction must explain."""
_LEAST = 0.1
"""Smallest reaction that is checked, relative to the error of velocities."""
_HELD = 0.03
"""Time for which the condition must hold [s]."""


class ReactionCheck:
    """Compares the others' motion with that for a joint at rest, and in motion.

    Some joints s report constant values to the last bit, under efforts that friction
    could hold. If they are at rest, the others o accelerate by M_oo⁻¹ (tau - h)_o; if
    they move, by the rows of M⁻¹ (tau - h). If the others move as if the silent ones
    moved, and not as if those were at rest, the sensors of the silent ones are dead.

    Attributes:
        felt: Whether the reaction on the others shows that the silent joints move.
        gained: The velocity that the silent ones have gained lately, as far as the
        reaction shows; 0 of the others, shape (nv,) [rad/s or m/s].
    """

    def __init__(self, error: float) -> None:
        """``error`` is the tolerance of velocities [rad/s or m/s]."""
        self._error = error
        self._silent: Flags = np.zeros(0, dtype=bool)
        self.restart()

    def restart(self) -> None:
        """Forget all motion."""
        self._begin(np.zeros(self._silent.size, dtype=bool))

    def _begin(self, silent: Flags) -> None:
        self._silent = silent
        others = int((~silent).sum())
        # velocity that is expected at rest, that motion adds, and that is measured
        self._sums = np.zeros((3, others))
        self._squares = np.zeros(3)
        self._rest, self._added = np.zeros((2, others))
        self._free, self._sum = np.zeros((2, silent.size))
        self.gained: Array = np.zeros(silent.size)
        self._inertia = np.zeros((others, others))
        self._v: Array | None = None
        self._lasts = 0.0
        self.felt = False

    def expect(self, silent: Flags, inertia: Array, free: Array) -> None:
        """Record the expectation from now on.

        Args:
            silent: Joints whose readings do not change, shape (nv,).
            inertia: The mass matrix M, shape (nv, nv).
            free: The acceleration if all joints move, M⁻¹ (tau - h), shape (nv,).
        """
        if not np.array_equal(silent, self._silent):
            self._begin(silent.copy())
        others = ~silent
        if not others.any():
            return
        self._inertia = inertia[np.ix_(others, others)]
        self._rest[:] = np.linalg.solve(self._inertia, (inertia @ free)[others])
        self._added = free[others] - self._rest
        self._free = np.where(silent, free, 0.0)

    def update(self, v: Array, passed: float) -> None:
        """Check a new state.

        Args:
            v: Mean measured velocity of some milliseconds, shape (nv,).
            passed: Time since the last one [s].
        """
        if not self._silent.any() or self._silent.all():
            return
        now = v[~self._silent]
        last = now if self._v is None else self._v
        self._v = now
        self._sum = exp(-passed / _LATELY) * self._sum + passed * self._free
        self._sums *= exp(-passed / _WASHOUT)
        self._sums += np.stack([passed * self._rest, passed * self._added, now - last])
        at_rest, added, measured = self._sums
        beyond = measured - at_rest
        products = np.array(
            [
                x @ self._inertia @ y
                for x, y in ((beyond,) * 2, (beyond, added), (added,) * 2)
            ]
        )
        part = 1.0 - exp(-passed / _MEMORY)
        self._squares += part * (products - self._squares)
        own, both, reaction = self._squares
        least = (_LEAST * self._error) ** 2 * np.trace(self._inertia)
        felt = (
            reaction > least
            and _FELT * reaction < both < _MOST * reaction
            and both * both > _EXPLAINED * own * reaction
        )
        self._lasts = self._lasts + passed if felt else 0.0
        self.felt = self._lasts >= _HELD
        if self.felt:
            self.gained = min(both / reaction, 1.0) * self._sum
