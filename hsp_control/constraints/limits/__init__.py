"""Limits of motors, joints and distances."""

from .limits import Limits as Limits
from .limits import LimitsOrNone as LimitsOrNone
from .limits import own_limits as own_limits
from .maximum import ByJoint as ByJoint
from .maximum import Scaled as Scaled
from .minimum_distance import MinimumDistance as MinimumDistance
from .minimum_distance import ObstacleDistance as ObstacleDistance
from .minimum_distance import SelfDistance as SelfDistance
from .position_range import PositionRange as PositionRange
from .position_range import PositionsByJoint as PositionsByJoint
from .robot_limits import RobotLimits as RobotLimits
from .static_effort import StaticEffort as StaticEffort
