"""Null-space fields and costs: the goals of self-motion."""

from hsp_control.common.entry_points import own_names
from hsp_control.law import FieldSample as FieldSample

from .clearance import Clearance as Clearance
from .clearance import ObstacleClearance as ObstacleClearance
from .clearance import SelfClearance as SelfClearance
from .cost import Cost as Cost
from .cost import FunctionCost as FunctionCost
from .field import FieldSum as FieldSum
from .field import NullSpaceField as NullSpaceField
from .jacobian_cost import JacobianCost as JacobianCost
from .jacobian_cost import JacobianTerms as JacobianTerms
from .joint_costs import EqualJointAngles as EqualJointAngles
from .joint_costs import JointCentering as JointCentering
from .joint_costs import LimitBarrier as LimitBarrier
from .joint_costs import TargetPosture as TargetPosture
from .manipulability import InverseCondition as InverseCondition
from .manipulability import Manipulability as Manipulability
from .point_distance import PointDistance as PointDistance
from .vector_field import FunctionField as FunctionField
from .vector_field import Rest as Rest
from .vector_field import Uncontrolled as Uncontrolled
from .vector_field import VectorField as VectorField
from .weight import ConstantWeight as ConstantWeight
from .weight import Ramp as Ramp
from .weight import StateWeight as StateWeight
from .weight import Weight as Weight

__dir__ = own_names(__name__)
