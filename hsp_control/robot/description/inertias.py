"""Physically inconsistent inertias, and the nearest consistent ones.

About its centre of mass, a body of density ρ has the second moments Σ = ∫ ρ x xᵀ, which
are positive semidefinite, and the inertia I = tr(Σ) 1 - Σ. So a tensor I belongs to a
body only if Σ = ½ tr(I) 1 - I is positive semidefinite: no principal moment exceeds the
sum of the other two (the triangle inequality).

Mass m, centre of mass c and I are one 4 x 4 matrix, the pseudo-inertia (Wensing, Kim
and Slotine, Linear matrix inequalities for physically consistent inertial parameter
identification, IEEE Robotics and Automation Letters 3(1), 2018). At the centre of mass
it is diag(Σ, m). It does not change if its fourth axis is reflected, and so neither
does the nearest positive semidefinite matrix in the Frobenius norm, because that is
unique. It is therefore diag(Σ*, m), with Σ* nearest to Σ: mass and centre of mass are
kept.
"""

from collections.abc import Iterator
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from hsp_control.common.arrays import Array

ROUNDING = 1e-6
"""A second moment may be negative by this share of their sum: files are rounded."""
NEGLIGIBLE = 1e-9
"""It may also be negative by this fraction of the robot's mass [m²], the moment of all
of it within 30 µm, which has no observable effect. Zeros that were rounded are below it
(-5e-20 kg·m²), and so are links of 1e-8 kg that stand for a frame.
"""
FLOOR = 1e-3
"""Least second moment of a projected inertia, as a share of their sum.

A plate has this share if it is a thirtieth as thick as it is wide. Without a floor the
nearest tensor would be that of a body without thickness.
"""
ENTRIES = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_PLACES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


class ImpossibleInertia(NamedTuple):
    """The physically inconsistent inertia of a link."""

    link: str  # name of the link
    element: Element  # its element ``<inertia>``
    moments: Array  # the principal moments in the file, in ascending order [kg·m²]
    nearest: Array  # the nearest inertia of a body, shape (3, 3) [kg·m²]
    negative: bool  # whether a principal moment is negative beyond rounding

    @property
    def reason(self) -> str:
        """Why no body can have it."""
        low, middle, high = self.moments
        if self.negative:
            return f"a principal moment is {low:.3g} kg·m²; must not be negative"
        low, middle = max(low, 0.0), max(middle, 0.0)  # except for rounding
        return (
            f"the principal moment {high:.3g} exceeds the sum of the other two, "
            f"{low:.3g} + {middle:.3g} = {low + middle:.3g} kg·m²"
        )


def impossible_inertias(robot: Element) -> Iterator[ImpossibleInertia]:
    """Yield the links of a URDF with inconsistent inertias, in its order."""
    masses = (float(mass.get("value", 0.0)) for mass in robot.iter("mass"))
    slack = NEGLIGIBLE * sum(masses)
    for link in robot.findall("link"):
        element = link.find("inertial/inertia")
        if element is None:
            continue
        tensor = tensor_of(element)
        if not is_possible(tensor, slack):
            moments = np.asarray(np.linalg.eigvalsh(tensor), dtype=float)
            negative = bool(moments[0] < -max(slack, ROUNDING * moments[-1]))
            nearest, name = nearest_possible(tensor), link.get("name", "")
            yield ImpossibleInertia(name, element, moments, nearest, negative)


def project_inertias(robot: Element) -> None:
    """Replace inconsistent inertias by the nearest consistent ones, in place."""
    for found in list(impossible_inertias(robot)):
        for entry, place in zip(ENTRIES, _PLACES, strict=True):
            found.element.set(entry, repr(float(found.nearest[place])))


def is_possible(tensor: Array, slack: float = 0.0) -> bool:
    """Return whether a body can have an inertia (3, 3), to rounding or `slack`."""
    moments = _second_moments(np.asarray(np.linalg.eigvalsh(tensor), dtype=float))
    return bool(moments.min() >= -max(slack, ROUNDING * np.abs(moments).sum()))


def nearest_possible(tensor: Array) -> Array:
    """Return the inertia (3, 3) of a body that is nearest in its second moments.

    The nearest matrix has the same axes, so that only the second moments σ about them
    are projected: onto the cone σᵢ ≥ FLOOR Σⱼ σⱼ. With σ = A⁻¹ μ and A = 1 - FLOOR 11ᵀ
    this is a problem of non-negative least squares in μ. A consistent inertia is
    unchanged.
    """
    if is_possible(tensor):
        return tensor
    from scipy.optimize import nnls  # here: importing SciPy is slow

    moments, axes = np.linalg.eigh(tensor)
    basis = np.eye(3) + FLOOR / (1.0 - 3.0 * FLOOR)
    second = basis @ nnls(basis, _second_moments(moments))[0]
    nearest: Array = (axes * (second.sum() - second)) @ axes.T
    return 0.5 * (nearest + nearest.T)


def tensor_of(element: Element) -> Array:
    """Return the tensor of an element ``<inertia>``, shape (3, 3) [kg·m²]."""
    tensor = np.zeros((3, 3))
    for entry, (i, j) in zip(ENTRIES, _PLACES, strict=True):
        tensor[i, j] = tensor[j, i] = float(element.get(entry, 0.0))
    return tensor


def _second_moments(moments: Array) -> Array:
    """Return σ, shape (3,), from the principal moments: σᵢ = ½ tr(I) - Iᵢ [kg·m²]."""
    return np.asarray(0.5 * moments.sum() - moments)
