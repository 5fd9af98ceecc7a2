"""Plants: what answers the controller's effort."""

from .contact import ContactKind as ContactKind
from .contact import ContactPlant as ContactPlant
from .contact import RigidContact as RigidContact
from .imperfect import ImperfectPlant as ImperfectPlant
from .integrated import IntegratedPlant as IntegratedPlant
from .plant import ContinuousPlant as ContinuousPlant
from .plant import Plant as Plant
from .plant import SampledPlant as SampledPlant
from .plant import check_plant as check_plant
from .plant import differing_bodies as differing_bodies
from .push import Push as Push
from .rigid_body import RigidBodyPlant as RigidBodyPlant
from .sticking import StickingPlant as StickingPlant
