"""Rotations: exp, log and their Jacobians on SO(3), as kernels.

A rotation vector y is a rotation by the angle √(y·y) about y. With s = y·y and the
Stumpff functions C_k(s) = Σ_j (-s)^j / (k + 2j)!, each matrix below is a linear
combination of I, [y]× and y yᵀ. It is regular at 0; only Jlog is singular, at 2π:

    exp(y)   =  C0 I        + C1 [y]×  + C2 y yᵀ
    Jexp(y)  =  C1 I        - C2 [y]×  + C3 y yᵀ      ω = Jexp(y) y'
    Jlog(y)  =  C1/(2C2) I  + ½ [y]×   + d  y yᵀ      y' = Jlog(y) ω,  Jlog = Jexp⁻¹

where d = (C3 - 2 C4) / (2 C2) and ω is the angular velocity in the body frame. Results
are written to ``out``, which must not share memory with a matrix argument unless the
docstring allows it.
"""

from math import atan2, factorial, sin, sqrt

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel

# Threshold of s. It is above π², so that the range of log uses the series only.
_SERIES_BELOW = 10.0
_C4_TERMS = tuple(1.0 / factorial(4 + 2 * j) for j in reversed(range(14)))
_C5_TERMS = tuple(1.0 / factorial(5 + 2 * j) for j in reversed(range(14)))
# Tracking errors are usually small. Below s = 0.2, six terms reach rounding accuracy.
_SHORT_BELOW, _SHORT, _ALL = 0.2, 6, len(_C4_TERMS)
_C4_SHORT, _C5_SHORT = _C4_TERMS[-_SHORT:], _C5_TERMS[-_SHORT:]


@kernel
def stumpff(s: float) -> tuple[float, float, float, float, float, float]:
    """Return the Stumpff functions C0 to C5 at s = |y|² >= 0.

    They are cos t, sin t / t, (1 - cos t) / t², (t - sin t) / t³, ... with t = √s, and
    C_k = 1/k! - s C_{k+2}. Their derivative is dC_k/ds = (k C_{k+2} - C_{k+1}) / 2.
    Absolute errors are at rounding. For s < 10, C4 and C5 come from a series and the
    others from the recurrence downwards; for larger s, C1 comes from the sine and the
    others from the recurrence upwards.
    """
    if s < _SERIES_BELOW:
        c4 = c5 = 0.0
        if s < _SHORT_BELOW:
            for k in range(_SHORT):
                c4 = _C4_SHORT[k] - s * c4
                c5 = _C5_SHORT[k] - s * c5
        else:
            for k in range(_ALL):
                c4 = _C4_TERMS[k] - s * c4
                c5 = _C5_TERMS[k] - s * c5
        c2 = 0.5 - s * c4
        c3 = 1.0 / 6.0 - s * c5
        return 1.0 - s * c2, 1.0 - s * c3, c2, c3, c4, c5
    t = sqrt(s)
    half_sine = sin(0.5 * t)
    c1 = sin(t) / t
    c2 = 2.0 * half_sine * half_sine / s
    c3 = (1.0 - c1) / s
    return 1.0 - s * c2, c1, c2, c3, (0.5 - c2) / s, (1.0 / 6.0 - c3) / s


@kernel
def cross(a: Array, b: Array, out: Array) -> None:
    """Write a x b; each argument has shape (3,), ``out`` may be ``a`` or ``b``."""
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    out[0], out[1], out[2] = x, y, z


@kernel
def rotate(R: Array, a: Array, out: Array) -> None:
    """Write R a, body to world; shapes (3, 3) and (3,), ``out`` may be ``a``."""
    x = R[0, 0] * a[0] + R[0, 1] * a[1] + R[0, 2] * a[2]
    y = R[1, 0] * a[0] + R[1, 1] * a[1] + R[1, 2] * a[2]
    z = R[2, 0] * a[0] + R[2, 1] * a[1] + R[2, 2] * a[2]
    out[0], out[1], out[2] = x, y, z


@kernel
def rotate_back(R: Array, a: Array, out: Array) -> None:
    """Write Rᵀ a, world to body; shapes (3, 3) and (3,), ``out`` may be ``a``."""
    x = R[0, 0] * a[0] + R[1, 0] * a[1] + R[2, 0] * a[2]
    y = R[0, 1] * a[0] + R[1, 1] * a[1] + R[2, 1] * a[2]
    z = R[0, 2] * a[0] + R[1, 2] * a[1] + R[2, 2] * a[2]
    out[0], out[1], out[2] = x, y, z


@kernel
def compose(A: Array, B: Array, out: Array) -> None:
    """Write A B; shapes (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@kernel
def compose_back(A: Array, B: Array, out: Array) -> None:
    """Write Aᵀ B, the rotation from A to B in the axes of A; shapes (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j]


@kernel
def _combine(identity: float, skew: float, outer: float, y: Array, out: Array) -> None:
    """Write identity · I + skew · [y]× + outer · y yᵀ."""
    for i in range(3):
        for j in range(3):
            out[i, j] = outer * y[i] * y[j]
        out[i, i] += identity
    for i in range(3):
        j = (i + 1) % 3
        k = (i + 2) % 3
        out[k, j] += skew * y[i]
        out[j, k] -= skew * y[i]


@kernel
def turn(R: Array, a: Array, scale: float, out: Array) -> None:
    """Write exp(scale · a) R: R rotated about a, in world axes; ``out`` may be R."""
    s = scale * scale * (a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    c0, c1, c2, _, _, _ = stumpff(s)
    skew = scale * c1
    outer = scale * scale * c2
    for j in range(3):
        x, y, z = R[0, j], R[1, j], R[2, j]
        along = outer * (a[0] * x + a[1] * y + a[2] * z)
        out[0, j] = c0 * x + skew * (a[1] * z - a[2] * y) + along * a[0]
        out[1, j] = c0 * y + skew * (a[2] * x - a[0] * z) + along * a[1]
        out[2, j] = c0 * z + skew * (a[0] * y - a[1] * x) + along * a[2]


@kernel
def exp3(y: Array, out: Array) -> None:
    """Write the rotation exp([y]×)."""
    c0, c1, c2, _, _, _ = stumpff(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
    _combine(c0, c1, c2, y, out)


@kernel
def jexp3(y: Array, out: Array) -> None:
    """Write the right Jacobian of exp: ω = Jexp(y) y' in the body frame of exp(y)."""
    _, c1, c2, c3, _, _ = stumpff(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
    _combine(c1, -c2, c3, y, out)


@kernel
def jexp3_dot(y: Array, y_dot: Array, out: Array) -> None:
    """Write the time derivative of `jexp3`, so that ω' = Jexp y'' + Jexp' y'."""
    _, _, c2, c3, c4, c5 = stumpff(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
    half_s_dot = y[0] * y_dot[0] + y[1] * y_dot[1] + y[2] * y_dot[2]
    c1_dot = (c3 - c2) * half_s_dot
    c2_dot = (2.0 * c4 - c3) * half_s_dot
    c3_dot = (3.0 * c5 - c4) * half_s_dot
    _combine(c1_dot, -c2_dot, c3_dot, y, out)
    for i in range(3):
        for j in range(3):
            out[i, j] += c3 * (y[i] * y_dot[j] + y_dot[i] * y[j])
    for i in range(3):
        j = (i + 1) % 3
        k = (i + 2) % 3
        out[k, j] -= c2 * y_dot[i]
        out[j, k] += c2 * y_dot[i]


@kernel
def jlog3(y: Array, out: Array) -> None:
    """Write the inverse of `jexp3`: y' = Jlog(y) ω for y = log(R), |y| < 2π."""
    _, c1, c2, c3, c4, _ = stumpff(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
    _combine(0.5 * c1 / c2, 0.5, 0.5 * (c3 - 2.0 * c4) / c2, y, out)


@kernel
def log3(R: Array, out: Array) -> None:
    """Write the rotation vector of R, |y| <= π, accurate to rounding from 0 to π.

    It is computed from the quaternion, whose vector part stays accurate near π, where
    the trace and the skew part of R both lose digits. At π either sign of y is right.
    """
    x, y, z, w = _quaternion(R)
    sine = sqrt(x * x + y * y + z * z)  # of the half angle; w >= 0 is its cosine
    scale = 2.0 * atan2(sine, w) / sine if sine > 0.0 else 2.0
    out[0], out[1], out[2] = scale * x, scale * y, scale * z


@kernel
def rotation_from_quaternion(quaternion: Array, out: Array) -> None:
    """Write the rotation matrix of a quaternion (x, y, z, w) of any non-zero norm."""
    x, y, z, w = quaternion[0], quaternion[1], quaternion[2], quaternion[3]
    length_squared = x * x + y * y + z * z + w * w
    scale = 2.0 / length_squared
    _combine(w * w * scale - 1.0, w * scale, scale, quaternion, out)


@kernel
def quaternion_from_rotation(R: Array, out: Array) -> None:
    """Write R's unit quaternion (x, y, z, w) whose scalar part is not negative."""
    out[0], out[1], out[2], out[3] = _quaternion(R)


@kernel
def _quaternion(R: Array) -> tuple[float, float, float, float]:
    """Return (x, y, z, w), w >= 0, from the row of 4 q qᵀ with the largest diagonal."""
    a, b, c = R[0, 0], R[1, 1], R[2, 2]
    if a + b + c >= max(a, b, c):
        x, y, z = R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]
        w = 1.0 + a + b + c
    elif a >= b and a >= c:
        x, y, z = 1.0 + a - b - c, R[0, 1] + R[1, 0], R[2, 0] + R[0, 2]
        w = R[2, 1] - R[1, 2]
    elif b >= c:
        x, y, z = R[0, 1] + R[1, 0], 1.0 - a + b - c, R[1, 2] + R[2, 1]
        w = R[0, 2] - R[2, 0]
    else:
        x, y, z = R[2, 0] + R[0, 2], R[1, 2] + R[2, 1], 1.0 - a - b + c
        w = R[1, 0] - R[0, 1]
    scale = 1.0 / sqrt(x * x + y * y + z * z + w * w)
    if w < 0.0:
        scale = -scale
    return scale * x, scale * y, scale * z, scale * w
