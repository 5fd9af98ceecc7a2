"""The simulated plant: its engine, and its differences from the model."""

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from hsp_control.common.exceptions import SceneError
from hsp_control.config.models.base import (
    Model,
    NonNegative,
    Number,
    Positive,
    Vector3,
    Weights,
)
from hsp_control.config.models.robot import LoadModel
from hsp_control.declaration import AnyOf
from hsp_control.declaration.quantities import OrInstance
from hsp_control.geometry.shapes import Box, Capsule, Cylinder, Shape, Sphere
from hsp_control.simulation.plants import PlantPart

Share = Annotated[float, Field(ge=0.0, lt=1.0, allow_inf_nan=False)]
Count = Annotated[int, Field(ge=0)]
Periods = Annotated[int, Field(ge=0, le=100_000)]


class InertiasModel(Model):
    """Differences of the bodies from the controller's model."""

    mass_factor: Positive = 1.0
    """Factor on every mass [-]; it also scales the rotational inertias."""
    inertia_factor: Positive = 1.0
    """Further factor on every inertia about the centre of mass [-]."""
    com_shift: Vector3 = [0.0, 0.0, 0.0]
    """Displacement of every centre of mass in its joint's frame [m]."""
    random_mass: Share = 0.0
    """Largest relative error of a mass [-], drawn for each body: 0.2 is ±20 %."""
    random_inertia: Share = 0.0
    """Largest relative error of a principal second moment [-], drawn for each body."""
    random_com: NonNegative = 0.0
    """Largest error of a centre of mass along each axis [m], drawn for each body."""


class PayloadModel(Model):
    """A solid ball at a frame, which the controller does not know about."""

    frame: str
    """Name of the frame that the payload is fixed to."""
    mass: Positive
    """Mass of the payload [kg]."""
    center: Vector3 = [0.0, 0.0, 0.0]
    """Centre of the ball in the frame [m]."""
    radius: NonNegative = 0.0
    """Radius of the ball [m]; 0 is a point mass."""


class FrictionModel(Model):
    """Friction of the joints."""

    coulomb: Weights = 0.0
    """Coulomb friction [N·m or N], one number or nv."""
    viscous: Weights = 0.0
    """Viscous friction [N·m·s/rad or N·s/m], one number or nv."""


class PushModel(Model):
    """An external wrench on a frame, for a limited time."""

    frame: str
    """Name of the frame; the wrench acts at its origin."""
    force: Vector3 = [0.0, 0.0, 0.0]
    """Force in world axes [N]."""
    moment: Vector3 = [0.0, 0.0, 0.0]
    """Moment in world axes [N·m]."""
    start: Number = 0.0
    """Time at which the push begins [s]."""
    duration: Positive = 0.1
    """Duration of the push [s]."""


class SensorsModel(Model):
    """Imperfections of the measurements, applied in this order."""

    delay: Periods = 0
    """Delay of the measurements [control periods]."""
    position_noise: Weights = 0.0
    """Standard deviation of position noise [rad or m], one number or nv."""
    encoder_resolution: Weights = 0.0
    """Resolution of the encoders [rad or m], one number or nv; 0 is exact."""
    differenced_velocity: bool = False
    """Whether the velocity is computed from the last two positions."""
    velocity_noise: Weights = 0.0
    """Standard deviation of velocity noise [rad/s or m/s], one number or nv."""


class DrivesModel(Model):
    """Imperfections of the drives, applied to a commanded effort in this order."""

    dropped: Share = 0.0
    """Probability that an effort is lost and the previous one continues [-]."""
    delay: Periods = 0
    """Delay of the efforts [control periods]."""
    jitter: NonNegative = 0.0
    """Maximum additional delay [s], drawn for each period."""
    noise: Weights = 0.0
    """Standard deviation of effort noise [N·m or N], one number or nv."""
    saturation: Literal["model"] | Weights | None = None
    """Maximum effort [N·m or N], one number or nv; ``model`` takes it from the URDF.
    Unlimited by default."""


class PlantModel(Model):
    """Settings of all plants."""

    robot: LoadModel | None = None
    """The simulated robot, with the same joints; the controller's robot by default."""
    inertias: InertiasModel = InertiasModel()
    """Differences of masses and inertias from the controller's model."""
    payload: PayloadModel | None = None
    """A payload that the controller does not know about."""
    motor_inertia: Weights = 0.0
    """Rotor inertia times gear ratio squared [kg·m² or kg], one number or nv."""
    pushes: list[PushModel] = []
    """External wrenches."""
    sensors: SensorsModel = SensorsModel()
    """Imperfections of the measurements."""
    drives: DrivesModel = DrivesModel()
    """Imperfections of the drives."""
    seed: Count = 0
    """Seed of all random numbers [-]."""


class FrictionalPlantModel(PlantModel):
    """Settings of plants whose joints may have friction."""

    friction: FrictionModel | Literal["urdf"] | None = None
    """Friction of the joints; ``urdf`` takes it from the robot's file. None by
    default."""


class RigidBodyPlantModel(FrictionalPlantModel):
    """Pinocchio's rigid-body dynamics."""

    type: Literal["rigid_body"]


class RigidContactModel(Model):
    """A rigid contact that pushes and pulls on a frame, without slip."""

    kind: Literal["point", "surface"] = "surface"
    """Whether only the frame's origin is held, or also its orientation."""
    on: list[Annotated[list[Number], Field(min_length=2, max_length=2)]] | None = None
    """Intervals in which the contact is active: begin and end [s]; always by
    default."""


class ContactPlantModel(PlantModel):
    """Pinocchio's rigid-body dynamics with rigid contacts."""

    type: Literal["rigid_contacts"]
    contacts: Annotated[dict[str, RigidContactModel], Field(min_length=1)]
    """The contacts, by frame name."""
    damping: NonNegative = 100.0
    """Rate at which the velocity of a contact decays [1/s]."""


def _supported(shape: Shape) -> Shape:
    """Return a shape that MuJoCo has.

    Raises:
        SceneError: If it has none such.
    """
    if not isinstance(shape, Sphere | Capsule | Cylinder | Box):
        raise SceneError(
            f"{shape.yaml_type} is not possible here; needs a sphere, capsule, "
            "cylinder or box"
        )
    return shape


class ContactShapeModel(Model):
    """A shape at a frame that may touch the ground."""

    shape: Annotated[Shape, AfterValidator(_supported)] | None = None
    """The shape; by default made from the link's collision geometry."""
    position: Vector3 = [0.0, 0.0, 0.0]
    """Position of the shape in the frame [m]."""
    rpy: Vector3 = [0.0, 0.0, 0.0]
    """Roll, pitch and yaw of the shape in the frame [rad]."""


class GroundModel(Model):
    """A horizontal floor."""

    height: Number = 0.0
    """Height of the floor above the world's origin [m]."""
    friction: NonNegative = 0.8
    """Coulomb friction coefficient of the floor [-]."""


class MujocoPlantModel(FrictionalPlantModel):
    """MuJoCo, with its own integrator, friction and contacts."""

    type: Literal["mujoco"]
    timestep: Positive = 0.001
    """Maximum step of MuJoCo [s]."""
    integrator: Literal["Euler", "RK4", "implicit", "implicitfast"] = "implicitfast"
    """Integrator of MuJoCo."""
    joint_limits: bool = True
    """Whether MuJoCo keeps joints within their limits."""
    contacts: dict[str, ContactShapeModel] = {}
    """Shapes that may touch the ground, by frame name."""
    ground: GroundModel = GroundModel()
    """The ground; it exists only if `contacts` has entries."""


def _installed(plant: object) -> object:
    """Return the plant of an installed package that a mapping names, if it does."""
    name = plant.get("type") if isinstance(plant, dict) else None
    if isinstance(name, str) and name not in ("rigid_body", "rigid_contacts", "mujoco"):
        family = AnyOf(PlantPart)
        PlantPart.family.load(name)  # type: ignore[union-attr]
        if name in family.members:
            return family.validate(plant)
    return plant


_OwnPlant = RigidBodyPlantModel | ContactPlantModel | MujocoPlantModel
AnyPlant = Annotated[
    Literal["rigid_body", "mujoco"] | _OwnPlant | PlantPart,
    OrInstance(
        Literal["rigid_body", "mujoco"]
        | Annotated[_OwnPlant, Field(discriminator="type")],
        PlantPart,
    ),
    BeforeValidator(_installed),
]
