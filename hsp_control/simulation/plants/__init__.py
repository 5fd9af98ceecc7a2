"""Plants: the simulated robots that the controller's effort moves."""

from hsp_control.common.entry_points import own_names
from hsp_control.robot.friction import Friction as Friction

from .drives import Drive as Drive
from .drives import DroppedPeriods as DroppedPeriods
from .drives import EffortDelay as EffortDelay
from .drives import EffortLag as EffortLag
from .drives import EffortNoise as EffortNoise
from .drives import Jitter as Jitter
from .drives import Saturation as Saturation
from .imperfect_plant import ImperfectPlant as ImperfectPlant
from .model_changes import Inertias as Inertias
from .model_changes import Payload as Payload
from .plant import ContinuousPlant as ContinuousPlant
from .plant import IntegratedPlant as IntegratedPlant
from .plant import Plant as Plant
from .plant import SampledPlant as SampledPlant
from .plant import check_plant as check_plant
from .plant import differing_bodies as differing_bodies
from .plant_part import AnyPlant as AnyPlant
from .plant_part import FrictionalPart as FrictionalPart
from .plant_part import PlantPart as PlantPart
from .push import Push as Push
from .rigid_body import RigidBody as RigidBody
from .rigid_body import RigidBodyPlant as RigidBodyPlant
from .rigid_body import StickingPlant as StickingPlant
from .rigid_body import is_exact as is_exact
from .rigid_contacts import ContactKind as ContactKind
from .rigid_contacts import ContactPlant as ContactPlant
from .rigid_contacts import RigidContact as RigidContact
from .rigid_contacts import RigidContacts as RigidContacts
from .sensors import DifferencedVelocity as DifferencedVelocity
from .sensors import Encoder as Encoder
from .sensors import Imu as Imu
from .sensors import PositionNoise as PositionNoise
from .sensors import Sensor as Sensor
from .sensors import SensorDelay as SensorDelay
from .sensors import VelocityNoise as VelocityNoise

__dir__ = own_names(__name__)
