"""The schema: what a YAML configuration may say, as a tree of typed models.

Each ``type:`` is one class in one visible union; `build` maps it to the object of the
same name. Units are SI: metres, radians, seconds.
"""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from hsp_control.loading import Root

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
NonNegative = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
Vector = list[Number]
Vector3 = Annotated[list[Number], Field(min_length=3, max_length=3)]
Gain = Positive | Annotated[list[Positive], Field(min_length=1)] | list[Vector]
Weights = NonNegative | list[NonNegative]


class Model(BaseModel):
    """A part of the tree: unknown keys are refused, values never change."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, use_attribute_docstrings=True
    )


# -- robot ----------------------------------------------------------------------------


class ToolFrameModel(Model):
    """A frame fixed to one of the robot's own."""

    parent: str
    """The frame that it is fixed to."""
    translation: Vector3 = [0.0, 0.0, 0.0]
    """Its origin in the parent frame [m]."""
    rpy: Vector3 = [0.0, 0.0, 0.0]
    """Its roll, pitch and yaw in the parent frame [rad]."""


class RobotModel(Model):
    """Which robot, and how it stands in the world."""

    name: str
    """A bundled name, a name of example-robot-data, or a path to a URDF file."""
    root: Root | None = None
    """How it stands in the world; as its source says by default."""
    locked: dict[str, Number] | None = None
    """Joints held still, name to value [rad or m]; as its source says by default."""
    tool_frames: dict[str, ToolFrameModel] = {}
    """Frames to add, by name."""
    gravity: Vector3 | None = None
    """Acceleration of gravity in the world [m/s²]; -9.81 along z by default."""
    mimic: bool = True
    """Whether joints that mimic others follow them, or are free."""


class StartModel(Model):
    """Where the robot starts; at most one way to say it. By default its home."""

    joints: Vector | dict[str, Number] | None = None
    """Joint positions [rad or m], all nv of them or some by name, the rest at home."""
    coordinates: Vector | None = None
    """Joint coordinates theta = A q, where the robot's source defines A."""
    configuration: Vector | None = None
    """The configuration itself, nq numbers."""
    velocity: Literal["rest", "flow"] | Vector = "rest"
    """At rest, on the flow that the law leads to, or nv numbers [rad/s or m/s]."""


# -- trajectories ---------------------------------------------------------------------


class Moving(Model):
    """What all trajectories of a point share."""

    origin: Literal["world", "start"] = "world"
    """What points are given relative to: zero, or where the robot starts."""


class HoldModel(Moving):
    """Stand still."""

    type: Literal["hold"]
    point: Vector | None = None
    """Where; where the robot starts by default."""


class LineModel(Moving):
    """Move straight from rest to rest, by a quintic."""

    type: Literal["line"]
    start: Vector | None = None
    """First point; where the robot starts by default."""
    end: Vector
    """Last point."""
    duration: Positive
    """How long it takes [s]."""
    start_time: Number = 0.0
    """When it leaves [s]."""


class UniformLineModel(Moving):
    """Move straight for ever."""

    type: Literal["uniform_line"]
    start: Vector
    """The point at t = 0."""
    velocity: Vector
    """Its velocity."""


class CircleModel(Moving):
    """Go round a circle, in the plane or in space."""

    type: Literal["circle"]
    center: Vector
    """Its centre."""
    radius: Positive
    """Its radius [m]."""
    angular_rate: Number
    """How fast it is gone round [rad/s]."""
    phase: Number = 0.0
    """Where on it at t = 0 [rad]."""
    normal: Vector3 | None = None
    """In space: the direction that it is seen counter-clockwise from."""
    axes: Annotated[list[Vector], Field(min_length=2, max_length=2)] | None = None
    """In space, instead of the normal: the directions of phase 0 and of a quarter."""


class LissajousModel(Moving):
    """Swing along each axis: center + amplitude · sin(rate t + phase)."""

    type: Literal["lissajous"]
    center: Vector
    """The middle."""
    amplitudes: Vector
    """How far along each axis."""
    rates: Vector
    """How fast along each axis [rad/s]."""
    phases: Vector | None = None
    """Phase of each axis at t = 0 [rad]; zero by default."""


class MinimumJerkModel(Moving):
    """Pass through waypoints with the least jerk, from rest to rest."""

    type: Literal["minimum_jerk"]
    waypoints: Annotated[list[Vector], Field(min_length=2)]
    """The points."""
    times: Vector
    """When to be there [s]."""


class SplineModel(Moving):
    """Pass through waypoints along a spline, from rest to rest."""

    type: Literal["spline"]
    waypoints: Annotated[list[Vector], Field(min_length=2)]
    """The points."""
    times: Vector
    """When to be there [s]."""
    degree: Literal[3, 5, 7] = 5
    """Degree of the polynomials."""


PointTrajectory = Annotated[
    HoldModel
    | LineModel
    | UniformLineModel
    | CircleModel
    | LissajousModel
    | MinimumJerkModel
    | SplineModel,
    Field(discriminator="type"),
]


class HoldOrientationModel(Model):
    """Keep an orientation."""

    type: Literal["hold"]
    rpy: Vector3 | None = None
    """Roll, pitch and yaw in the world [rad]; as the robot starts by default."""


class SpinModel(Model):
    """Turn about a fixed axis at a constant rate."""

    type: Literal["spin"]
    axis: Vector3
    """The axis in the world."""
    rate: Number
    """How fast [rad/s]."""
    rpy: Vector3 | None = None
    """Orientation at t = 0 [rad]; as the robot starts by default."""


class OrientationPathModel(Model):
    """Turn the shortest way from one orientation to the next, resting at each."""

    type: Literal["path"]
    rpy: Annotated[list[Vector3], Field(min_length=2)]
    """The orientations, each as roll, pitch and yaw [rad]."""
    times: Vector
    """When to be there [s]."""


OrientationModel = Annotated[
    HoldOrientationModel | SpinModel | OrientationPathModel,
    Field(discriminator="type"),
]


class ComposedPoseModel(Model):
    """The origin follows one trajectory, the orientation another."""

    type: Literal["composed"]
    position: PointTrajectory
    """The origin's."""
    orientation: OrientationModel = HoldOrientationModel(type="hold")
    """The orientation's; held by default."""


class ScrewModel(Model):
    """Move along a straight screw, from where the robot starts, rest to rest."""

    type: Literal["screw"]
    position: Vector3
    """Last position in the world [m]."""
    rpy: Vector3
    """Last orientation [rad]."""
    duration: Positive
    """How long it takes [s]."""
    start_time: Number = 0.0
    """When it leaves [s]."""


PoseModel = Annotated[ComposedPoseModel | ScrewModel, Field(discriminator="type")]

# -- tasks ----------------------------------------------------------------------------


class GainsModel(Model):
    """Kp and Kv of e'' + Kv e' + Kp e = 0, or the frequency and damping they mean."""

    kp: Gain | None = None
    """Stiffness [1/s²]: a number, one per row, or a matrix."""
    kv: Gain | None = None
    """Damping [1/s]: a number, one per row, or a matrix."""
    natural_frequency: Gain | None = None
    """ω0 [rad/s], instead of kp and kv."""
    damping_ratio: Gain | None = None
    """ζ [-]; 1, critical, by default."""


class TaskModel(Model):
    """What all tasks share."""

    gains: GainsModel = GainsModel(natural_frequency=10.0)
    """Feedback gains; critically damped at 10 rad/s by default."""


class Blended(TaskModel):
    """What all tasks with a trajectory share."""

    blend: Positive | None = None
    """How long the reference takes from the robot's start into the trajectory [s]."""


class FramePositionModel(Blended):
    """A frame's origin follows a point."""

    type: Literal["frame_position"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    axes: str = "xyz"
    """World axes that are tracked."""
    trajectory: PointTrajectory
    """Where to."""


class FrameOrientationModel(Blended):
    """A frame's orientation follows another."""

    type: Literal["frame_orientation"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    trajectory: OrientationModel
    """Where to."""


class FramePoseModel(Blended):
    """A frame follows a pose."""

    type: Literal["frame_pose"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    trajectory: PoseModel
    """Where to."""


class PointingModel(TaskModel):
    """An axis of a frame points along a direction."""

    type: Literal["pointing"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    axis: Vector3 = [0.0, 0.0, 1.0]
    """The axis in the frame."""
    direction: Vector3
    """The direction in the world."""


class JointPostureModel(TaskModel):
    """Joints follow a posture."""

    type: Literal["joint_posture"]
    reference: Literal["start", "home"] | Vector = "start"
    """Joint positions [rad or m], nv of them; where the robot starts by default."""
    joints: Annotated[list[str], Field(min_length=1)] | None = None
    """Names of the joints; all by default."""
    displacement: PointTrajectory | None = None
    """Motion about the reference [rad or m]."""


AnyTask = Annotated[
    FramePositionModel
    | FrameOrientationModel
    | FramePoseModel
    | PointingModel
    | JointPostureModel,
    Field(discriminator="type"),
]

# -- null space -----------------------------------------------------------------------


class RestModel(Model):
    """Self-motion comes to rest: g = 0."""

    type: Literal["rest"]


class UncontrolledModel(Model):
    """Self-motion is left alone: φ_N = 0, the paper's warning."""

    type: Literal["uncontrolled"]


class JointCenteringModel(Model):
    """Joints keep near the middle of their range."""

    type: Literal["joint_centering"]
    weight: NonNegative = 1.0
    """Weight of the cost [rad²/s]."""
    weights: Weights = 1.0
    """Weights of the joints, one number or nv."""


class TargetPostureModel(Model):
    """Joints are drawn to a posture."""

    type: Literal["target_posture"]
    target: Literal["start", "home"] | Vector = "start"
    """Joint positions [rad or m], nv of them; where the robot starts by default."""
    weight: NonNegative = 1.0
    """Weight of the cost [1/s]."""
    weights: Weights = 1.0
    """Weights of the joints, one number or nv."""


class EqualJointAnglesModel(Model):
    """Neighbouring joints bend by the same angle: Σ (q_{k+1} - q_k)²."""

    type: Literal["equal_joint_angles"]
    joints: Annotated[list[str], Field(min_length=2)]
    """Names of the joints in order."""
    weight: NonNegative = 1.0
    """Weight of the cost [1/s]."""


class PointDistanceModel(Model):
    """Frames keep away from an obstacle's centre: Σ 1/d²."""

    type: Literal["point_distance"]
    frames: Annotated[list[str], Field(min_length=1)]
    """Names of the frames."""
    obstacle: str
    """Name of the obstacle in the scene."""
    weight: NonNegative = 1.0
    """Weight of the cost [m²/s]."""


AnyField = Annotated[
    RestModel
    | UncontrolledModel
    | JointCenteringModel
    | TargetPostureModel
    | EqualJointAnglesModel
    | PointDistanceModel,
    Field(discriminator="type"),
]


class IdentityModel(Model):
    """W = I: every joint's motion counts the same."""

    type: Literal["identity"]


class CoordinatesModel(Model):
    """W = AᵀA: Euclidean in the joint coordinates theta = A q."""

    type: Literal["coordinates"]
    matrix: list[Vector] | None = None
    """A; as the robot's source defines it by default."""


class ConstantModel(Model):
    """W constant."""

    type: Literal["constant"]
    matrix: list[Positive] | list[Vector]
    """W, or its diagonal."""


class MassMatrixModel(Model):
    """W = M(q): the kinetic-energy metric, dynamically consistent."""

    type: Literal["mass_matrix"]


AnyMetric = Annotated[
    IdentityModel | CoordinatesModel | ConstantModel | MassMatrixModel,
    Field(discriminator="type"),
]


class NullSpaceModel(Model):
    """Where self-motion goes, and how fast."""

    gain: Gain = 10.0
    """K_N [1/s]: a number, one per freedom, or a matrix."""
    metric: AnyMetric = IdentityModel(type="identity")
    """The joint-space metric."""
    fields: list[AnyField] = []
    """Fields, added up; at rest when there is none."""
    singularity_threshold: Positive = 0.01
    """Singular value of the tasks' Jacobian below which its inverse is bounded."""


# -- scene, simulation, view ----------------------------------------------------------


class ObstacleModel(Model):
    """A ball; in the plane, a disk."""

    radius: NonNegative
    """Its radius [m]."""
    center: PointTrajectory
    """Its centre in the world, of dimension 3."""


class SceneModel(Model):
    """What stands or moves in the robot's world."""

    obstacles: dict[str, ObstacleModel] = {}
    """Obstacles by name."""


class Dop853Model(Model):
    """Dormand and Prince's adaptive eighth-order method."""

    type: Literal["dop853"]
    rtol: Positive = 1e-9
    """Relative tolerance of a step."""
    atol: Positive = 1e-9
    """Absolute tolerance of a step."""


class Rk4Model(Model):
    """The classical fourth-order Runge-Kutta step."""

    type: Literal["rk4"]
    step: Positive = 1e-3
    """The physics step [s], an integer fraction of the control period."""


class SemiImplicitEulerModel(Model):
    """The semi-implicit Euler step."""

    type: Literal["semi_implicit_euler"]
    step: Positive = 1e-3
    """The physics step [s], an integer fraction of the control period."""


AnyIntegrator = Annotated[
    Dop853Model | Rk4Model | SemiImplicitEulerModel, Field(discriminator="type")
]


class SimulationModel(Model):
    """How long, how finely, and how the law is evaluated."""

    duration: Positive = 10.0
    """Length of the run [s]."""
    log_period: Positive = 0.01
    """Time between two rows of the log [s]."""
    control_period: Positive | None = None
    """How long an effort is held [s]; none: evaluated in the integrator's stages."""
    integrator: AnyIntegrator = Dop853Model(type="dop853")
    """How the robot moves on."""


class ViewModel(Model):
    """The 3-D view."""

    camera: Vector3 | None = None
    """Where one looks from [m]; chosen to see the whole robot by default."""
    target: Vector3 | None = None
    """Where one looks at [m]."""
    speed: Positive = 1.0
    """Seconds of motion shown in one second."""


class Scenario(Model):
    """A whole configuration."""

    title: str = ""
    """One line on what it shows; plots are headed by it."""
    description: str = ""
    """More on it, for people."""
    robot: RobotModel
    """The robot."""
    start: StartModel = StartModel()
    """Where it starts."""
    scene: SceneModel = SceneModel()
    """What else there is."""
    tasks: Annotated[dict[str, AnyTask], Field(min_length=1)]
    """Tasks by name, stacked at one level."""
    null_space: NullSpaceModel = NullSpaceModel()
    """Where self-motion goes."""
    simulation: SimulationModel = SimulationModel()
    """How it is simulated."""
    view: ViewModel = ViewModel()
    """How it is shown."""


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of a configuration, for editors."""
    schema = Scenario.model_json_schema()
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
    schema["title"] = "hsp_control configuration"
    return schema
