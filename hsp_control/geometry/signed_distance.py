"""Signed distances in closed form, and the terms for their exact rates, as kernels.

Either between two segments (spheres, capsules), or from a point to a solid about its
own origin (box, cylinder, half-space), with gradient n and Hessian H.
"""

from math import sqrt

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel

SEGMENT, BOX, CYLINDER, HALF_SPACE = 0, 1, 2, 3
"""Kinds of shapes; a sphere is a segment of length zero."""

_PARALLEL = 1e-13  # threshold of sin² of the angle between two segments
_COINCIDENT = 1e-12  # below this distance two points define no direction [m]


@kernel
def dot(a: Array, b: Array) -> float:
    """Return a · b; shapes (3,)."""
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@kernel
def nearest_on_segments(
    segments: Array, i: int, j: int
) -> tuple[float, float, bool, bool]:
    """Return (s, t, free, free) of the nearest points a + s e and b + t f.

    A free point is inside its segment, where it can slide; a fixed one is at an end
    (Ericson, Real-Time Collision Detection, 2005, 5.1.9). A row of segments (k, 2, 3)
    is a start and an axis.
    """
    ee = ff = ef = er = fr = 0.0
    for c in range(3):
        e, f = segments[i, 1, c], segments[j, 1, c]
        r = segments[i, 0, c] - segments[j, 0, c]
        ee += e * e
        ff += f * f
        ef += e * f
        er += e * r
        fr += f * r
    s = t = 0.0
    if ff > 0.0:
        square = ee * ff - ef * ef
        if square > _PARALLEL * ee * ff:
            s = min(max((ef * fr - er * ff) / square, 0.0), 1.0)
        t = (ef * s + fr) / ff
    if ee > 0.0 and not 0.0 < t < 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((ef * t - er) / ee, 0.0), 1.0)
    t = min(max(t, 0.0), 1.0)
    return s, t, 0.0 < s < 1.0, 0.0 < t < 1.0


@kernel
def nearest_rates(
    a: Array,
    a_dot: Array,
    e: Array,
    e_dot: Array,
    b: Array,
    b_dot: Array,
    f: Array,
    f_dot: Array,
    s: float,
    t: float,
    s_free: bool,
    t_free: bool,
) -> tuple[float, float]:
    """Return (s', t') of the nearest points of two moving segments.

    With r = a - b + s e - t f, a free s obeys e·r = 0 and a free t obeys f·r = 0. The
    time derivatives of these equations are linear in s' and t'. The lengths of the
    segments are constant. Vectors have shape (3,).
    """
    if not (s_free or t_free):
        return 0.0, 0.0
    ef, along_e, along_f = 0.0, 0.0, 0.0
    for i in range(3):
        r = a[i] - b[i] + s * e[i] - t * f[i]
        drift = a_dot[i] - b_dot[i] + s * e_dot[i] - t * f_dot[i]
        along_e -= e_dot[i] * r + e[i] * drift
        along_f += f_dot[i] * r + f[i] * drift
        ef += e[i] * f[i]
    ee, ff = dot(e, e), dot(f, f)
    if not t_free:
        return along_e / ee, 0.0
    if not s_free:
        return 0.0, along_f / ff
    # ee s' - ef t' = along_e,  -ef s' + ff t' = along_f
    square = ee * ff - ef * ef
    return (ff * along_e + ef * along_f) / square, (
        ee * along_f + ef * along_e
    ) / square


@kernel
def distance_to_solid(kind: int, size: Array, x: Array, n: Array, H: Array) -> float:
    """Return the signed distance of a point x to a solid, in the solid's frame.

    The size is a box's half edges; a cylinder's radius, radius and half height [m]. The
    gradient n, a unit vector, and the Hessian H [1/m] are written.
    """
    for i in range(3):
        n[i] = 0.0
        for j in range(3):
            H[i, j] = 0.0
    if kind == HALF_SPACE:
        n[2] = 1.0
        return float(x[2])
    if kind == BOX:
        return float(_box(size, x, n, H))
    return float(_cylinder(size, x, n, H))


@kernel
def _box(size: Array, x: Array, n: Array, H: Array) -> float:
    """Return the distance to a box, write n and H, which must be zero before."""
    square, nearest, largest = 0.0, 0, -1e300
    for i in range(3):
        beyond = abs(x[i]) - size[i]
        if beyond > largest:
            nearest, largest = i, beyond
        if beyond > 0.0:
            n[i] = beyond if x[i] > 0.0 else -beyond
            square += beyond * beyond
    if largest <= 0.0:  # inside: to the nearest face
        n[nearest] = 1.0 if x[nearest] > 0.0 else -1.0
        return float(largest)
    distance = sqrt(square)
    for i in range(3):
        n[i] /= distance
    for i in range(3):
        if n[i] != 0.0:
            H[i, i] += 1.0 / distance
        for j in range(3):
            H[i, j] -= n[i] * n[j] / distance
    return distance


@kernel
def _cylinder(size: Array, x: Array, n: Array, H: Array) -> float:
    """Return the distance to a cylinder along z, write n and H, zero before."""
    r = sqrt(x[0] * x[0] + x[1] * x[1])
    side, end = r - size[0], abs(x[2]) - size[2]
    up = 1.0 if x[2] > 0.0 else -1.0
    # (c, s) is the radial unit vector. On the axis any direction is right, and none
    # turns: there 1/r would be infinite.
    on_axis = r < _COINCIDENT
    c, s = (1.0, 0.0) if on_axis else (x[0] / r, x[1] / r)
    if side <= 0.0 and end <= 0.0:  # inside: to the nearer of side and end
        if side > end:
            n[0], n[1] = c, s
            distance, curvature = side, 0.0 if on_axis else 1.0 / r
        else:
            n[2] = up
            return float(end)
    elif side <= 0.0:
        n[2] = up
        return float(end)
    elif end <= 0.0:
        n[0], n[1] = c, s
        distance, curvature = side, 1.0 / r
    else:  # to the edge
        distance = sqrt(side * side + end * end)
        out, along = side / distance, up * end / distance
        n[0], n[1], n[2] = out * c, out * s, along
        # (p0, p1, p2) is normal to the gradient, in the plane through the axis
        p0, p1, p2 = along * c, along * s, -out
        H[0, 0] += p0 * p0 / distance
        H[0, 1] += p0 * p1 / distance
        H[0, 2] += p0 * p2 / distance
        H[1, 1] += p1 * p1 / distance
        H[1, 2] += p1 * p2 / distance
        H[2, 2] += p2 * p2 / distance
        H[1, 0], H[2, 0], H[2, 1] = H[0, 1], H[0, 2], H[1, 2]
        curvature = out / r
    H[0, 0] += curvature * s * s
    H[0, 1] -= curvature * s * c
    H[1, 0] -= curvature * s * c
    H[1, 1] += curvature * c * c
    return float(distance)


@kernel
def direction(points: Array) -> float:
    """Return the distance of two points, write the unit vector from second to first.

    ``points`` has the rows x, y and n = (x - y)/|x - y|, which is written: the z axis
    if the points coincide, so that all results are finite.
    """
    square = 0.0
    for c in range(3):
        points[2, c] = points[0, c] - points[1, c]
        square += points[2, c] * points[2, c]
    distance = sqrt(square)
    if distance < _COINCIDENT:
        points[2, 0], points[2, 1], points[2, 2] = 0.0, 0.0, 1.0
        return 0.0
    for c in range(3):
        points[2, c] /= distance
    return distance
