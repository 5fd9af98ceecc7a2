"""Null-space fields and costs: the goals of self-motion."""

from hsp_control.law import FieldSample as FieldSample

from .clearance import Clearance as Clearance
from .compiled_cost import CompiledCost as CompiledCost
from .cost import Cost as Cost
from .cost import FunctionCost as FunctionCost
from .equal_joint_angles import EqualJointAngles as EqualJointAngles
from .field import FieldSum as FieldSum
from .field import NullSpaceField as NullSpaceField
from .inverse_condition import InverseCondition as InverseCondition
from .jacobian_cost import JacobianCost as JacobianCost
from .jacobian_cost import JacobianTerms as JacobianTerms
from .joint_centering import JointCentering as JointCentering
from .limit_barrier import LimitBarrier as LimitBarrier
from .manipulability import Manipulability as Manipulability
from .obstacle_clearance import ObstacleClearance as ObstacleClearance
from .point_distance import PointDistance as PointDistance
from .rest import Rest as Rest
from .self_clearance import SelfClearance as SelfClearance
from .target_posture import TargetPosture as TargetPosture
from .transmission import Transmission as Transmission
from .uncontrolled import Uncontrolled as Uncontrolled
from .vector_field import FunctionField as FunctionField
from .vector_field import VectorField as VectorField
from .weight import ConstantWeight as ConstantWeight
from .weight import Ramp as Ramp
from .weight import StateWeight as StateWeight
from .weight import Weight as Weight
