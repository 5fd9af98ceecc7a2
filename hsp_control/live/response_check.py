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
"""Smallest change of velocity that is checked, relative to the error of velocities."""


class ResponseCheck:
    """Compares changes of the measured velocity with those expected of the efforts.

    A joint may follow its effort by less than the model expects, or not at all: its
    friction, its rotor and its contacts are unknown. A person may push it for a while.
    But if velocity and positions agree and a joint repeatedly moves against its effort,
    its sensor or its motor has the wrong sign. Feedback then accelerates it without
    bound. The varying part must agree: with a wrong mass an arm sinks while its
    effort, which grows, is against it, and a constant acceleration explains that.

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
        # of a constant 1, of the expected and of the measured acceleration: the changes
        # of velocity, and means of their products
        self._changes, self._products = np.zeros((3, nv)), np.zeros((3, 3, nv))
        self._v: Array | None = None
        self._held = np.zeros(nv)
        self.contrary: Flags = self._none

    def update(self, expected: Array, v: Array, passed: float) -> None:
        """Check a new state.

        Args:
            expected: The acceleration that the model expects since the last one,
                shape (nv,) [rad/s² or m/s²].
            v: Mean measured velocity of some milliseconds, shape (nv,).
            passed: Time since the last one [s].
        """
        if self._v is None:
            self._v = v
        self._changes *= exp(-passed / _WASHOUT)
        self._changes += np.stack(
            [np.full(v.size, passed), passed * expected, v - self._v]
        )
        self._v = v
        now = self._changes[:, None] * self._changes
        self._products += (1.0 - exp(-passed / _MEMORY)) * (now - self._products)
        constant, of_constant = self._products[0, 0], self._products[0, 1:]
        whole = self._products[1:, 1:]
        varying = whole - of_constant[:, None] * of_constant / constant
        # The opposite sign must explain the varying part better than no relation.
        contrary = _contrary(whole, _CONTRARY) & _contrary(varying, 1.0)
        first, second = whole[0, 0], whole[1, 1]
        contrary &= (np.minimum(first, second) > self._least) & self._judged
        self._held = np.where(contrary, self._held + passed, 0.0)
        self.contrary = self._held >= _HELD


def _contrary(products: Array, share: float) -> Flags:
    """Return whether the mean of (e + m)² is less than a share of those of e² and m².

    ``products`` are means of e e, e m, m e and m m, shape (2, 2, nv). With m = -e it is
    0; with e and m unrelated it is the sum of both.
    """
    smaller = np.minimum(products[0, 0], products[1, 1])
    less: Flags = products.sum(axis=(0, 1)) < share * smaller
    return less
