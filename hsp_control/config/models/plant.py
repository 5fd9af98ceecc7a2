"""What the effort moves: an engine, and how the world differs from the model."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import (
    Model,
    NonNegative,
    Number,
    Positive,
    Vector3,
    Weights,
)
from hsp_control.config.models.robot import LoadModel
from hsp_control.config.models.scene import (
    BoxModel,
    CapsuleModel,
    CylinderModel,
    SphereModel,
)

Share = Annotated[float, Field(ge=0.0, lt=1.0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0)]
Periods = Annotated[int, Field(ge=0, le=100_000)]


class InertiasModel(Model):
    """How every body differs from the controller's model of it."""

    mass_factor: Positive = 1.0
    """Every mass times this; rotational inertias grow with it."""
    inertia_factor: Positive = 1.0
    """Every inertia about its centre of mass times this, besides."""
    com_shift: Vector3 = [0.0, 0.0, 0.0]
    """Every centre of mass moved by this in its joint's frame [m]."""
    random_mass: Share = 0.0
    """Largest relative error of a mass, drawn for each body: 0.2 is ±20 %."""
    random_inertia: Share = 0.0
    """Largest relative error of a principal second moment, drawn for each body."""
    random_com: NonNegative = 0.0
    """Largest error of a centre of mass along each axis [m], drawn for each body."""


class PayloadModel(Model):
    """A solid ball in the hand that the controller does not know of."""

    frame: str
    """The frame that it is fixed to."""
    mass: Positive
    """Its mass [kg]."""
    center: Vector3 = [0.0, 0.0, 0.0]
    """Its centre in the frame [m]."""
    radius: NonNegative = 0.0
    """Its radius [m]; 0 is a point."""


class FrictionModel(Model):
    """Friction in the joints."""

    coulomb: Weights = 0.0
    """Dry friction [N·m or N]: of all joints, or of each freedom."""
    viscous: Weights = 0.0
    """Friction for each unit of speed [N·m·s/rad or N·s/m]: of all, or of each."""


class PushModel(Model):
    """A wrench from outside, for a while."""

    frame: str
    """The frame whose origin it acts on."""
    force: Vector3 = [0.0, 0.0, 0.0]
    """In the world's axes [N]."""
    moment: Vector3 = [0.0, 0.0, 0.0]
    """In the world's axes [N·m]."""
    start: Number = 0.0
    """When it begins [s]."""
    duration: Positive = 0.1
    """How long it lasts [s]."""


class SensorsModel(Model):
    """What the controller is shown, in this order."""

    delay: Periods = 0
    """Control periods that a measurement is old."""
    position_noise: Weights = 0.0
    """Standard deviation of positions [rad or m]: of all joints, or of each freedom."""
    encoder_resolution: Weights = 0.0
    """One count [rad or m]: of all joints, or of each freedom; 0 is exact."""
    differenced_velocity: bool = False
    """Whether velocity is the difference of the last two positions."""
    velocity_noise: Weights = 0.0
    """Standard deviation of velocities [rad/s or m/s]: of all, or of each."""


class DrivesModel(Model):
    """What becomes of an effort that is commanded, in this order."""

    dropped: Share = 0.0
    """Probability that an effort is lost, and the last one goes on."""
    delay: Periods = 0
    """Control periods that an effort comes late."""
    jitter: NonNegative = 0.0
    """The longest further lateness [s], drawn for each period."""
    noise: Weights = 0.0
    """Standard deviation of the effort [N·m or N]: of all joints, or of each."""
    saturation: Literal["model"] | Weights | None = None
    """Largest effort [N·m or N], ``model`` for the URDF's own; none by default."""


class PlantModel(Model):
    """What all plants share."""

    robot: LoadModel | None = None
    """The robot that moves, with the same joints; the controller's by default."""
    inertias: InertiasModel = InertiasModel()
    """Bodies that are not as the controller thinks."""
    payload: PayloadModel | None = None
    """Something in the hand."""
    motor_inertia: Weights = 0.0
    """Rotor inertia times gear ratio squared [kg·m² or kg]: of all, or of each."""
    pushes: list[PushModel] = []
    """Wrenches from outside."""
    sensors: SensorsModel = SensorsModel()
    """What the controller is shown."""
    drives: DrivesModel = DrivesModel()
    """What becomes of its efforts."""
    seed: Count = 0
    """Of all random numbers."""


class FrictionalPlantModel(PlantModel):
    """A plant whose joints may have friction."""

    friction: FrictionModel | Literal["urdf"] | None = None
    """In the joints; ``urdf``: as the robot's file says. None by default."""


class RigidBodyPlantModel(FrictionalPlantModel):
    """Pinocchio's rigid bodies."""

    type: Literal["rigid_body"]


class RigidContactModel(Model):
    """How the world holds a frame, both ways and without slip."""

    kind: Literal["point", "surface"] = "surface"
    """Whether its origin is held, or its orientation too."""
    on: list[Annotated[list[Number], Field(min_length=2, max_length=2)]] | None = None
    """When it holds, begin and end [s] each; always by default."""


class ContactPlantModel(PlantModel):
    """Pinocchio's rigid bodies, held by rigid contacts."""

    type: Literal["rigid_contacts"]
    contacts: Annotated[dict[str, RigidContactModel], Field(min_length=1)]
    """What is held, by frame."""
    damping: NonNegative = 100.0
    """How fast the velocity of a contact dies out [1/s]."""


class ContactShapeModel(Model):
    """What of a frame may touch the ground."""

    shape: (
        Annotated[
            SphereModel | CapsuleModel | CylinderModel | BoxModel,
            Field(discriminator="type"),
        ]
        | None
    ) = None
    """Its form; made of the link's collision geometry by default."""
    position: Vector3 = [0.0, 0.0, 0.0]
    """Where the shape is in the frame [m]."""
    rpy: Vector3 = [0.0, 0.0, 0.0]
    """How it is turned in the frame [rad]."""


class GroundModel(Model):
    """A horizontal floor."""

    height: Number = 0.0
    """Where it is [m]."""
    friction: NonNegative = 0.8
    """Coulomb's coefficient between it and whatever touches it."""


class MujocoPlantModel(FrictionalPlantModel):
    """MuJoCo, with its own integrator, friction and contacts."""

    type: Literal["mujoco"]
    timestep: Positive = 0.001
    """MuJoCo's step [s], at most."""
    integrator: Literal["Euler", "RK4", "implicit", "implicitfast"] = "implicitfast"
    """MuJoCo's integrator."""
    joint_limits: bool = True
    """Whether MuJoCo keeps joints within their limits."""
    contacts: dict[str, ContactShapeModel] = {}
    """What may touch the ground, by frame."""
    ground: GroundModel = GroundModel()
    """The ground; it is there if something may touch it."""


AnyPlant = (
    Literal["rigid_body", "mujoco"]
    | Annotated[
        RigidBodyPlantModel | ContactPlantModel | MujocoPlantModel,
        Field(discriminator="type"),
    ]
)
