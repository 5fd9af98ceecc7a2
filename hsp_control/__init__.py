"""Whole-body torque control with a null space that provably converges.

The law of Hsu, Hauser and Sastry (1989) on any URDF: the task error obeys
e'' + Kv e' + Kp e = 0 exactly, and the null-space velocity converges to the projection
of a field that may move in time.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from hsp_control.common.version import __version__ as __version__

if TYPE_CHECKING:  # what a type checker reads; the names are looked up below
    from .common.exceptions import HspControlError as HspControlError
    from .config import Experiment as Experiment
    from .config import load_experiment as load_experiment
    from .constraints.contacts import BallContact as BallContact
    from .constraints.contacts import Contact as Contact
    from .constraints.contacts import PointContact as PointContact
    from .constraints.contacts import SurfaceContact as SurfaceContact
    from .constraints.limits import Limits as Limits
    from .constraints.limits import MinimumDistance as MinimumDistance
    from .control import Controller as Controller
    from .control import ControlOutput as ControlOutput
    from .control import Diagnostics as Diagnostics
    from .control.compensation import Command as Command
    from .control.compensation import Compensation as Compensation
    from .control.compensation import EffortRateClip as EffortRateClip
    from .control.compensation import FrictionFeedForward as FrictionFeedForward
    from .control.compensation import IntegralAction as IntegralAction
    from .control.compensation import MomentumObserver as MomentumObserver
    from .control.compensation import Predictor as Predictor
    from .control.compensation import StartUpRamp as StartUpRamp
    from .control.compensation import VelocityFilter as VelocityFilter
    from .control.compensation import check_rate as check_rate
    from .control.log_channel import LogChannel as LogChannel
    from .geometry import Box as Box
    from .geometry import Capsule as Capsule
    from .geometry import Cylinder as Cylinder
    from .geometry import HalfSpace as HalfSpace
    from .geometry import HeightField as HeightField
    from .geometry import Mesh as Mesh
    from .geometry import Obstacle as Obstacle
    from .geometry import PointCloud as PointCloud
    from .geometry import Scene as Scene
    from .geometry import Shape as Shape
    from .geometry import Sphere as Sphere
    from .null_space.fields import Cost as Cost
    from .null_space.fields import EqualJointAngles as EqualJointAngles
    from .null_space.fields import FunctionCost as FunctionCost
    from .null_space.fields import FunctionField as FunctionField
    from .null_space.fields import InverseCondition as InverseCondition
    from .null_space.fields import JointCentering as JointCentering
    from .null_space.fields import LimitBarrier as LimitBarrier
    from .null_space.fields import Manipulability as Manipulability
    from .null_space.fields import NullSpaceField as NullSpaceField
    from .null_space.fields import ObstacleClearance as ObstacleClearance
    from .null_space.fields import PointDistance as PointDistance
    from .null_space.fields import Ramp as Ramp
    from .null_space.fields import Rest as Rest
    from .null_space.fields import SelfClearance as SelfClearance
    from .null_space.fields import StateWeight as StateWeight
    from .null_space.fields import TargetPosture as TargetPosture
    from .null_space.fields import Transmission as Transmission
    from .null_space.fields import Uncontrolled as Uncontrolled
    from .null_space.fields import VectorField as VectorField
    from .null_space.fields import WeightedSum as WeightedSum
    from .null_space.metrics import ConstantMetric as ConstantMetric
    from .null_space.metrics import IdentityMetric as IdentityMetric
    from .null_space.metrics import MassMatrixMetric as MassMatrixMetric
    from .null_space.metrics import Metric as Metric
    from .robot import Dop853 as Dop853
    from .robot import JointFriction as JointFriction
    from .robot import Rk4 as Rk4
    from .robot import Robot as Robot
    from .robot import RobotState as RobotState
    from .robot import SemiImplicitEuler as SemiImplicitEuler
    from .robot.description.loading import ToolFrame as ToolFrame
    from .simulation import Rollout as Rollout
    from .simulation import simulate as simulate
    from .simulation.plants import ContactPlant as ContactPlant
    from .simulation.plants import ContinuousPlant as ContinuousPlant
    from .simulation.plants import ImperfectPlant as ImperfectPlant
    from .simulation.plants import IntegratedPlant as IntegratedPlant
    from .simulation.plants import Plant as Plant
    from .simulation.plants import Push as Push
    from .simulation.plants import RigidBodyPlant as RigidBodyPlant
    from .simulation.plants import RigidContact as RigidContact
    from .simulation.plants import SampledPlant as SampledPlant
    from .simulation.plants import StickingPlant as StickingPlant
    from .simulation.plants.mujoco import ContactShape as ContactShape
    from .simulation.plants.mujoco import Ground as Ground
    from .simulation.plants.mujoco import MujocoPlant as MujocoPlant
    from .sweeps import Sweep as Sweep
    from .sweeps import sweep as sweep
    from .tasks import AngularMomentum as AngularMomentum
    from .tasks import CenterOfMass as CenterOfMass
    from .tasks import FrameOrientation as FrameOrientation
    from .tasks import FramePose as FramePose
    from .tasks import FramePosition as FramePosition
    from .tasks import Gains as Gains
    from .tasks import JointPosture as JointPosture
    from .tasks import Pointing as Pointing
    from .tasks import RelativePose as RelativePose
    from .tasks import Task as Task
    from .trajectories import Blend as Blend
    from .trajectories import BlendOrientation as BlendOrientation
    from .trajectories import CallableOrientation as CallableOrientation
    from .trajectories import CallableTrajectory as CallableTrajectory
    from .trajectories import Circle as Circle
    from .trajectories import ComposedPose as ComposedPose
    from .trajectories import Hold as Hold
    from .trajectories import HoldOrientation as HoldOrientation
    from .trajectories import HoldPose as HoldPose
    from .trajectories import Line as Line
    from .trajectories import Lissajous as Lissajous
    from .trajectories import MinimumJerk as MinimumJerk
    from .trajectories import OrientationPath as OrientationPath
    from .trajectories import OrientationTrajectory as OrientationTrajectory
    from .trajectories import PoseTrajectory as PoseTrajectory
    from .trajectories import Schedule as Schedule
    from .trajectories import ScrewInterpolation as ScrewInterpolation
    from .trajectories import Spin as Spin
    from .trajectories import Spline as Spline
    from .trajectories import Stops as Stops
    from .trajectories import Trajectory as Trajectory
    from .trajectories import UniformLine as UniformLine

_ROOMS = {
    "robot": "Dop853 JointFriction Rk4 Robot RobotState SemiImplicitEuler",
    "robot.description.loading": "ToolFrame",
    "geometry": (
        "Box Capsule Cylinder HalfSpace HeightField Mesh Obstacle PointCloud Scene "
        "Shape Sphere"
    ),
    "trajectories": (
        "Blend BlendOrientation CallableOrientation CallableTrajectory Circle "
        "ComposedPose Hold HoldOrientation HoldPose Line Lissajous MinimumJerk "
        "OrientationPath OrientationTrajectory PoseTrajectory Schedule "
        "ScrewInterpolation Spin Spline Stops Trajectory UniformLine"
    ),
    "tasks": (
        "AngularMomentum CenterOfMass FrameOrientation FramePose FramePosition Gains "
        "JointPosture Pointing RelativePose Task"
    ),
    "null_space.fields": (
        "Cost EqualJointAngles FunctionCost FunctionField InverseCondition "
        "JointCentering LimitBarrier Manipulability NullSpaceField ObstacleClearance "
        "PointDistance Ramp Rest SelfClearance StateWeight TargetPosture Transmission "
        "Uncontrolled VectorField WeightedSum"
    ),
    "null_space.metrics": "ConstantMetric IdentityMetric MassMatrixMetric Metric",
    "constraints.contacts": "BallContact Contact PointContact SurfaceContact",
    "constraints.limits": "Limits MinimumDistance",
    "control": "ControlOutput Controller Diagnostics",
    "control.log_channel": "LogChannel",
    "control.compensation": (
        "Command EffortRateClip FrictionFeedForward IntegralAction MomentumObserver "
        "Predictor Compensation StartUpRamp VelocityFilter check_rate"
    ),
    "simulation": "Rollout simulate",
    "simulation.plants": (
        "ContactPlant ContinuousPlant ImperfectPlant IntegratedPlant Plant Push "
        "RigidBodyPlant RigidContact SampledPlant StickingPlant"
    ),
    "simulation.plants.mujoco": "ContactShape Ground MujocoPlant",
    "config": "Experiment load_experiment",
    "sweeps": "Sweep sweep",
    "common.exceptions": "HspControlError",
}
"""The public names, by the room from which each is imported at its first use."""

_HOMES = {name: room for room, names in _ROOMS.items() for name in names.split()}

__all__ = ["__version__", *_HOMES]


def __getattr__(name: str) -> Any:
    """Return a public name, imported at its first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
