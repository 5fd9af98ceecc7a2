"""Plants: the simulated robots that the controller's effort moves."""

from .contact_plant import ContactKind as ContactKind
from .contact_plant import ContactPlant as ContactPlant
from .contact_plant import RigidContact as RigidContact
from .declared import PlantPart as PlantPart
from .imperfect_plant import ImperfectPlant as ImperfectPlant
from .integrated_plant import IntegratedPlant as IntegratedPlant
from .plant import ContinuousPlant as ContinuousPlant
from .plant import Plant as Plant
from .plant import SampledPlant as SampledPlant
from .plant import check_plant as check_plant
from .plant import differing_bodies as differing_bodies
from .push import Push as Push
from .rigid_body_plant import RigidBodyPlant as RigidBodyPlant
from .sticking_plant import StickingPlant as StickingPlant
