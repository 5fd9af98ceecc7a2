"""Reference motions in Rⁿ, SO(3) and SE(3), with their first two derivatives."""

from hsp_control.trajectories.blend import Blend as Blend
from hsp_control.trajectories.blend_orientation import (
    BlendOrientation as BlendOrientation,
)
from hsp_control.trajectories.callable_orientation import (
    CallableOrientation as CallableOrientation,
)
from hsp_control.trajectories.callable_trajectory import (
    CallableTrajectory as CallableTrajectory,
)
from hsp_control.trajectories.circle import Circle as Circle
from hsp_control.trajectories.crossfade import Crossfade as Crossfade
from hsp_control.trajectories.crossfade import (
    CrossfadeOrientation as CrossfadeOrientation,
)
from hsp_control.trajectories.crossfade import crossfade as crossfade
from hsp_control.trajectories.hold import Hold as Hold
from hsp_control.trajectories.hold_orientation import HoldOrientation as HoldOrientation
from hsp_control.trajectories.hold_pose import HoldPose as HoldPose
from hsp_control.trajectories.line import Line as Line
from hsp_control.trajectories.lissajous import Lissajous as Lissajous
from hsp_control.trajectories.minimum_jerk import MinimumJerk as MinimumJerk
from hsp_control.trajectories.orientation import OrientationSample as OrientationSample
from hsp_control.trajectories.orientation import (
    OrientationTrajectory as OrientationTrajectory,
)
from hsp_control.trajectories.orientation_path import OrientationPath as OrientationPath
from hsp_control.trajectories.piecewise_polynomial import (
    PiecewisePolynomial as PiecewisePolynomial,
)
from hsp_control.trajectories.pose import ComposedPose as ComposedPose
from hsp_control.trajectories.pose import PoseSample as PoseSample
from hsp_control.trajectories.pose import PoseTrajectory as PoseTrajectory
from hsp_control.trajectories.schedule import Schedule as Schedule
from hsp_control.trajectories.screw_interpolation import (
    ScrewInterpolation as ScrewInterpolation,
)
from hsp_control.trajectories.spin import Spin as Spin
from hsp_control.trajectories.spline import Spline as Spline
from hsp_control.trajectories.stops import Stops as Stops
from hsp_control.trajectories.streams.stream import Stream as Stream
from hsp_control.trajectories.streams.stream import (
    StreamOrientation as StreamOrientation,
)
from hsp_control.trajectories.streams.stream import StreamPose as StreamPose
from hsp_control.trajectories.trajectory import Trajectory as Trajectory
from hsp_control.trajectories.trajectory import TrajectorySample as TrajectorySample
from hsp_control.trajectories.uniform_line import UniformLine as UniformLine
