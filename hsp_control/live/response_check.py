"""Detects joints that move against the direction of their efforts."""

from math import exp

import numpy as np

from hsp_control.common.arrays import Array, Flags

_WASHOUT = 0.1
"""Time constant with which a change of velocity is forgotten [s]."""
_MEMORY = 0.1
"""Time constant of the mean squares that are compared [s]."""
_CONTRARY = 0.1
"""Maximum residual of a joint's motion relative to the opposite of the expectation: for
a wrong sign a few hundredths; for a push to which a controller yields at least 0.13."""
_HELD = 0.03
"""Time for which the condition must hold [s]."""
_LEAST = 0.1
"""Smallest change of velocity that is judged, relative to the error of velocities."""


class ResponseCheck:
    """Compares changes of the measured velocity with what the efforts would cause.

    A joint may follow its effort by less than the model expects, or not at all: its
    friction, its rotor and its contacts are unknown. A person may push it for a while.
    But if velocity and positions agree and a joint repeatedly moves against its effort,
    its sensor or its motor has the wrong sign. Feedback then accelerates it without
    bound.

    Attributes:
        contrary: These joints, shape (nv,).
    """

    def __init__(self, error: float, judged: Flags) -> None:
        """``error`` is the tolerance of velocities; ``judged`` selects the joints."""
        self._least, self._judged = (_LEAST * error) ** 2, judged
        self._none = np.zeros(judged.size, dtype=bool)
        self.restart()

    def restart(self) -> None:
        """Forget all motion."""
        nv = self._judged.size
        # the changes that are expected and measured, and squares: sum, each of them
        self._changes, self._squares = np.zeros((2, nv)), np.zeros((3, nv))
        self._v: Array | None = None
        self._held = np.zeros(nv)
        self.contrary: Flags = self._none

    def update(self, expected: Array, v: Array, passed: float) -> None:
        """Judge a new state.

        Args:
            expected: The acceleration that the model expects since the last one,
                shape (nv,) [rad/s² or m/s²].
            v: Mean measured velocity of some milliseconds, shape (nv,).
            passed: Time since the last one [s].
        """
        if self._v is None:
            self._v = v
        self._changes *= exp(-passed / _WASHOUT)
        self._changes[0] += passed * expected
        self._changes[1] += v - self._v
        self._v = v
        of_efforts, measured = self._changes
        now = np.stack([of_efforts + measured, of_efforts, measured]) ** 2
        self._squares += (1.0 - exp(-passed / _MEMORY)) * (now - self._squares)
        both, first, second = self._squares
        contrary = both < _CONTRARY * np.minimum(first, second)
        contrary &= (np.minimum(first, second) > self._least) & self._judged
        self._held = np.where(contrary, self._held + passed, 0.0)
        self.contrary = self._held >= _HELD
