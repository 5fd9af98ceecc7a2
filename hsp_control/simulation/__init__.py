"""Simulation: the closed loop and its rollout."""

from .integrators import Dop853 as Dop853
from .integrators import Integrator as Integrator
from .integrators import Rk4 as Rk4
from .integrators import SemiImplicitEuler as SemiImplicitEuler
from .rollout import Rollout as Rollout
from .simulate import simulate as simulate
