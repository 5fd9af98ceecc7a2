"""Isolation of the wrong one of two sources: a joint's velocity or its positions."""

import numpy as np

from hsp_control.common.arrays import Array, Flags

_CLEARLY = 0.5
"""Ratio of surprises below which one source is right, and the other wrong."""
_BEYOND_DOUBT = 0.3
"""The ratio below which the same kind of source is wrong in joints in doubt, too."""
_OTHERWISE = 0.1
"""The ratio below which it is another kind in another joint: the faults of some spoil
what is expected of the others."""
_EVIDENT = 0.05
"""Smallest surprise that is evidence of a kind of fault [rad/s or m/s]."""


class FaultIsolation:
    """Isolates the wrong source of joints whose velocity contradicts their positions.

    The wrong one deviates more from the model's expectation. If neither deviates, as
    in a slow drift, it is of the kind that other joints have lost. A fault often
    affects the sensors of several joints: once one kind of source was wrong beyond
    doubt, and not the other kind, it is wrong in joints in doubt, too, also in those of
    which neither was trusted. Unless a kind is known, the joints in doubt are decided
    together: none, if one of them is undecided; but like earlier ones, if these were
    decided alike: of a wrong model all joints may be in doubt. Where the case is not
    clear, and the difference is slight, a source that is constant to the last bit is
    the wrong one.

    Attributes:
        undecided: Joints of which neither source is trusted, since the wrong one is
        unknown, shape (nv,).
    """

    def __init__(self, joints: int) -> None:
        """``joints``: nv."""
        self._wrong_kind = np.zeros(2, dtype=bool)  # velocities, positions
        self._decided = np.zeros(2, dtype=bool)  # the same, if not beyond doubt
        self.undecided: Flags = np.zeros(joints, dtype=bool)

    def isolate(
        self,
        wrong: Flags,
        surprise: Array,
        constant: Flags,
        slight: Flags,
        trusted: Flags,
    ) -> tuple[Flags, Flags]:
        """Return whether the velocity, and whether the positions are right, (nv,).

        Args:
            wrong: Joints of which one source is wrong, shape (nv,); those of the others
                is not judged.
            surprise: Of each source: the largest recent difference from the
                expectation, shape (2, nv) [rad/s or m/s].
            constant: Whether a source does not change by a bit, shape (2, nv).
            slight: Whether a joint's sources are little different, shape (nv,).
            trusted: The sources that are trusted so far, shape (2, nv).
        """
        greatest = surprise.max(axis=0)
        right = surprise < _CLEARLY * greatest
        lost = ~trusted & trusted[::-1]
        alike = np.asarray(lost.any(axis=1))
        if alike[0] != alike[1]:
            right = np.where(greatest > _EVIDENT, right, ~alike[:, None])
        known = self._wrong_kind[0] != self._wrong_kind[1]
        clear = surprise < (_OTHERWISE if known else _BEYOND_DOUBT) * greatest
        clear &= greatest > _EVIDENT
        # One source changes, the other does not.
        alive = slight & ~clear.any(axis=0) & (constant[0] ^ constant[1])
        right = np.where(alive, ~constant, right)
        # A source is wrong beyond doubt where the other one is right.
        self._wrong_kind |= (wrong & clear[::-1]).any(axis=1)
        doubtful = self.undecided | ~(clear.any(axis=0) | alive)
        if self._wrong_kind[0] != self._wrong_kind[1]:
            right = np.where(doubtful, ~self._wrong_kind[:, None], right)
        else:
            right = right & ~self.undecided
            if (wrong & ~right.any(axis=0)).any():
                if self._decided[0] != self._decided[1]:
                    right = np.where(doubtful, ~self._decided[:, None], right)
                else:
                    right = right & (clear | alive)
        self._decided |= (wrong & right[::-1] & ~right).any(axis=1)
        return right[0], right[1]
