"""Tasks: the motions that the robot tracks, with linear error equations."""

from hsp_control.common.entry_points import own_names
from hsp_control.law import TaskSample as TaskSample

from .centroidal import AngularMomentum as AngularMomentum
from .centroidal import CenterOfMass as CenterOfMass
from .feedback import ErrorPart as ErrorPart
from .feedback import Feedback as Feedback
from .frame_pose import FrameOrientation as FrameOrientation
from .frame_pose import FramePose as FramePose
from .frame_position import FramePosition as FramePosition
from .function_task import FunctionTask as FunctionTask
from .gains import Gains as Gains
from .impedance import Impedance as Impedance
from .joint_posture import JointPosture as JointPosture
from .pointing import Pointing as Pointing
from .relative_pose import RelativePose as RelativePose
from .task import SecondOrderTask as SecondOrderTask
from .task import Task as Task

__dir__ = own_names(__name__)
