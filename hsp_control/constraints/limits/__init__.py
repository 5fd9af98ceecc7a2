"""Limits of motors, joints and distances."""

from hsp_control.common.entry_points import own_names

from .joint_numbers import ByJoint as ByJoint
from .joint_numbers import PositionRange as PositionRange
from .joint_numbers import PositionsByJoint as PositionsByJoint
from .joint_numbers import Scaled as Scaled
from .limits import Limits as Limits
from .limits import LimitsOrNone as LimitsOrNone
from .limits import MinimumDistance as MinimumDistance
from .limits import ObstacleDistance as ObstacleDistance
from .limits import RobotLimits as RobotLimits
from .limits import SelfDistance as SelfDistance
from .limits import StaticEffort as StaticEffort
from .limits import own_limits as own_limits

__dir__ = own_names(__name__)
