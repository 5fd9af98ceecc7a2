"""Null-space fields and costs: the goals of self-motion."""

from .clearance import Clearance as Clearance
from .clearance import ObstacleClearance as ObstacleClearance
from .clearance import SelfClearance as SelfClearance
from .conditioning import InverseCondition as InverseCondition
from .cost import Cost as Cost
from .cost import FunctionCost as FunctionCost
from .equal_joint_angles import EqualJointAngles as EqualJointAngles
from .field import FieldSample as FieldSample
from .field import NullSpaceField as NullSpaceField
from .field import WeightedSum as WeightedSum
from .joint_centering import JointCentering as JointCentering
from .limit_barrier import LimitBarrier as LimitBarrier
from .manipulability import Manipulability as Manipulability
from .point_distance import PointDistance as PointDistance
from .rest import Rest as Rest
from .rest import Uncontrolled as Uncontrolled
from .target_posture import TargetPosture as TargetPosture
from .transmission import Transmission as Transmission
from .vector_field import FunctionField as FunctionField
from .vector_field import VectorField as VectorField
from .weight import ConstantWeight as ConstantWeight
from .weight import Ramp as Ramp
from .weight import StateWeight as StateWeight
from .weight import Weight as Weight
