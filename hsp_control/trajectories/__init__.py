"""Reference motions in Rⁿ, SO(3) and SE(3), with their first two derivatives."""

from hsp_control.common.entry_points import own_names

from .along import Along as Along
from .along import AlongOrientation as AlongOrientation
from .along import AlongPose as AlongPose
from .blend import Blend as Blend
from .blend import BlendOrientation as BlendOrientation
from .callables import CallableOrientation as CallableOrientation
from .callables import CallableTrajectory as CallableTrajectory
from .crossfade import Crossfade as Crossfade
from .crossfade import CrossfadeOrientation as CrossfadeOrientation
from .crossfade import crossfade as crossfade
from .curves import Circle as Circle
from .curves import Lissajous as Lissajous
from .curves import UniformLine as UniformLine
from .hold import Hold as Hold
from .hold import HoldOrientation as HoldOrientation
from .orientation import OrientationPath as OrientationPath
from .orientation import OrientationSample as OrientationSample
from .orientation import OrientationTrajectory as OrientationTrajectory
from .orientation import Spin as Spin
from .piecewise_polynomial import Line as Line
from .piecewise_polynomial import MinimumJerk as MinimumJerk
from .piecewise_polynomial import PiecewisePolynomial as PiecewisePolynomial
from .piecewise_polynomial import Spline as Spline
from .piecewise_polynomial import Stops as Stops
from .polyline import Polyline as Polyline
from .polyline import PolylinePose as PolylinePose
from .pose import ComposedPose as ComposedPose
from .pose import HoldPose as HoldPose
from .pose import PoseSample as PoseSample
from .pose import PoseTrajectory as PoseTrajectory
from .pose import ScrewInterpolation as ScrewInterpolation
from .schedule import Schedule as Schedule
from .streams.stream import Stream as Stream
from .streams.stream import StreamOrientation as StreamOrientation
from .streams.stream import StreamPose as StreamPose
from .trajectory import Trajectory as Trajectory
from .trajectory import TrajectorySample as TrajectorySample

__dir__ = own_names(__name__)
