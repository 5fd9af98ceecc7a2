"""Limits of motors and joints, and barriers."""

from hsp_control.common.entry_points import own_names

from .barriers import Barrier as Barrier
from .barriers import MinimumDistance as MinimumDistance
from .barriers import ObstacleDistance as ObstacleDistance
from .barriers import SelfDistance as SelfDistance
from .barriers import StaticEffort as StaticEffort
from .barriers import barrier_names as barrier_names
from .joint_numbers import ByJoint as ByJoint
from .joint_numbers import PositionRange as PositionRange
from .joint_numbers import PositionsByJoint as PositionsByJoint
from .joint_numbers import Scaled as Scaled
from .limits import Limits as Limits
from .limits import LimitsOrNone as LimitsOrNone
from .limits import RobotLimits as RobotLimits
from .limits import in_degrees as in_degrees
from .limits import own_limits as own_limits

__dir__ = own_names(__name__)
