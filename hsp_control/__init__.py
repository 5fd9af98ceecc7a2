"""Whole-body torque control with a null space that provably converges.

The law of Hsu, Hauser and Sastry (1989) on any URDF: the task error obeys
e'' + Kv e' + Kp e = 0 exactly, and the null-space velocity converges to the projection
of a field that may move in time.
"""

from .config import Experiment as Experiment
from .config import load_experiment as load_experiment
from .controller import Controller as Controller
from .controller import ControlOutput as ControlOutput
from .controller import Diagnostics as Diagnostics
from .exceptions import HspControlError as HspControlError
from .fields import Cost as Cost
from .fields import EqualJointAngles as EqualJointAngles
from .fields import FunctionCost as FunctionCost
from .fields import FunctionField as FunctionField
from .fields import JointCentering as JointCentering
from .fields import NullSpaceField as NullSpaceField
from .fields import PointDistance as PointDistance
from .fields import Rest as Rest
from .fields import TargetPosture as TargetPosture
from .fields import Uncontrolled as Uncontrolled
from .fields import VectorField as VectorField
from .fields import WeightedSum as WeightedSum
from .loading import ToolFrame as ToolFrame
from .metrics import ConstantMetric as ConstantMetric
from .metrics import IdentityMetric as IdentityMetric
from .metrics import MassMatrixMetric as MassMatrixMetric
from .metrics import Metric as Metric
from .plants import Plant as Plant
from .plants import RigidBodyPlant as RigidBodyPlant
from .robot import Robot as Robot
from .robot import RobotState as RobotState
from .scene import Obstacle as Obstacle
from .scene import Scene as Scene
from .simulation import Dop853 as Dop853
from .simulation import Rk4 as Rk4
from .simulation import Rollout as Rollout
from .simulation import SemiImplicitEuler as SemiImplicitEuler
from .simulation import simulate as simulate
from .tasks import FrameOrientation as FrameOrientation
from .tasks import FramePose as FramePose
from .tasks import FramePosition as FramePosition
from .tasks import Gains as Gains
from .tasks import JointPosture as JointPosture
from .tasks import Pointing as Pointing
from .tasks import Task as Task
from .trajectories import Circle as Circle
from .trajectories import Hold as Hold
from .trajectories import Trajectory as Trajectory
from .version import __version__ as __version__
