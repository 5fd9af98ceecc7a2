"""The ground of MuJoCo's world."""

from hsp_control.common.exceptions import SimulationError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import NonNegative, Number


class Ground(Part, error=SimulationError):
    """A horizontal floor."""

    height: Number = 0.0
    """Height of the floor above the world's origin [m]."""
    friction: NonNegative = 0.8
    """Coulomb friction coefficient of the floor [-]."""
