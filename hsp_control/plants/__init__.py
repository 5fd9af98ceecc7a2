"""Plants: what answers the controller's effort."""

from .friction import JointFriction as JointFriction
from .imperfect import ImperfectPlant as ImperfectPlant
from .integrated import IntegratedPlant as IntegratedPlant
from .integrators import Dop853 as Dop853
from .integrators import Integrator as Integrator
from .integrators import Rk4 as Rk4
from .integrators import SemiImplicitEuler as SemiImplicitEuler
from .plant import ContinuousPlant as ContinuousPlant
from .plant import Plant as Plant
from .plant import Reading as Reading
from .plant import SampledPlant as SampledPlant
from .plant import check_plant as check_plant
from .plant import differing_bodies as differing_bodies
from .push import Push as Push
from .rigid_body import RigidBodyPlant as RigidBodyPlant
from .sticking import StickingPlant as StickingPlant
