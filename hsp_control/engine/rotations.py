"""Rotations for plain Python: exp, log and their Jacobians on SO(3), as new arrays.

A rotation vector y is a rotation by the angle √(y·y) about y, shape (3,) [rad]; a
quaternion is x, y, z, w. The equations are in the engine's ``rotations.hpp``.

- ``exp3(y)``: the rotation exp([y]×), shape (3, 3).
- ``log3(R)``: the rotation vector of R, |y| ≤ π; at π either sign is right.
- ``jexp3(y)``: the right Jacobian of exp, ω = Jexp(y) y' in the body's axes.
- ``jexp3_dot(y, y_dot)``: its rate, so that ω' = Jexp(y) y'' + Jexp' y'.
- ``jlog3(y)``: its inverse, y' = Jlog(y) ω, for |y| < 2π.
- ``quaternion_from_rotation(R)``: of length 1, with a scalar part that is not negative.
- ``rotation_from_quaternion(q)``: of a quaternion of any length but zero.
- ``stumpff(s)``: the functions C0 to C5 from which the others are computed, at
s = |y|².
- ``cross3(a, b)``: a × b of two arrays of shape (3,).

All but ``cross3`` accept array-like arguments, and raise TypeError for another shape.
"""

import numpy as np

from hsp_control.common.arrays import Array

from ._engine import exp3 as exp3
from ._engine import jexp3 as jexp3
from ._engine import jexp3_dot as jexp3_dot
from ._engine import jlog3 as jlog3
from ._engine import log3 as log3
from ._engine import quaternion_from_rotation as quaternion_from_rotation
from ._engine import rotation_from_quaternion as rotation_from_quaternion
from ._engine import stumpff as stumpff


def cross3(a: Array, b: Array) -> Array:
    """Return a × b: `np.cross` takes ten times as long for two vectors."""
    (a1, a2, a3), (b1, b2, b3) = a.tolist(), b.tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])
