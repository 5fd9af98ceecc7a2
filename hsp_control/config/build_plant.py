"""Build the plant."""

from pathlib import Path

import numpy as np

from hsp_control.config.build_robot import load_robot, located_model
from hsp_control.config.document import Document
from hsp_control.config.models import plant as s
from hsp_control.config.models.robot import LoadModel
from hsp_control.config.scenario import Scenario
from hsp_control.robot import Robot
from hsp_control.robot.friction import JointFriction
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants import (
    ContactPlant,
    ContinuousPlant,
    ImperfectPlant,
    IntegratedPlant,
    Plant,
    PlantPart,
    Push,
    RigidBodyPlant,
    RigidContact,
    SampledPlant,
    StickingPlant,
    check_plant,
)
from hsp_control.simulation.plants.drives import (
    Drive,
    DroppedPeriods,
    EffortDelay,
    EffortNoise,
    Jitter,
    Saturation,
)
from hsp_control.simulation.plants.model_changes import (
    ModelChange,
    MotorInertia,
    Payload,
    RandomInertias,
    ScaledInertias,
    changed,
)
from hsp_control.simulation.plants.mujoco import ContactShape, Ground, MujocoPlant
from hsp_control.simulation.plants.sensors import (
    DifferencedVelocity,
    Encoder,
    PositionNoise,
    Sensor,
    SensorDelay,
    VelocityNoise,
)

_STEP = 1e-3
"""Largest step of a plant with stiction, if the integrator has no step [s]."""

AnyModel = s.RigidBodyPlantModel | s.ContactPlantModel | s.MujocoPlantModel

_BY_NAME: dict[str, AnyModel] = {
    "rigid_body": s.RigidBodyPlantModel(type="rigid_body"),
    "mujoco": s.MujocoPlantModel(type="mujoco"),
}


def build_plant(
    document: Document,
    scenario: Scenario,
    folder: Path,
    robot: Robot,
    integrator: Integrator,
) -> tuple[Plant, Scenario]:
    """Return the plant, and the scenario with its paths made absolute."""
    chosen = scenario.plant
    if isinstance(chosen, PlantPart):
        with document.at("plant"):
            made = chosen.build(robot, integrator)
            check_plant(made, robot)
        return _checked(document, made, scenario), scenario
    model = _BY_NAME[chosen] if isinstance(chosen, str) else chosen
    if model.robot is not None:
        found = located_model(_with_defaults(model.robot, scenario.robot), folder)
        model = model.model_copy(update={"robot": found})
        scenario = scenario.model_copy(update={"plant": model})
    with document.at("plant"):
        own = _robot(document, model, robot)
        plant = _engine(document, model, own, integrator)
        sensors, drives = _sensors(model), _drives(model)
        if isinstance(plant, ContinuousPlant) and (sensors or drives):
            plant = IntegratedPlant(plant, integrator)
        if isinstance(plant, SampledPlant) and (sensors or drives):
            plant = ImperfectPlant(plant, sensors, drives)
        check_plant(plant, robot)
        _check_imperfections(document, own, sensors, drives)
    return _checked(document, plant, scenario), scenario


def _checked(document: Document, plant: Plant, scenario: Scenario) -> Plant:
    """Return the plant, which has the control period that it needs."""
    period = scenario.simulation.control_period
    if isinstance(plant, SampledPlant) and period is None:
        raise document.error(
            ("plant",),
            "this plant needs efforts that are held for a period: set "
            "simulation.control_period [s], for example to 0.001",
        )
    return plant


def _check_imperfections(
    document: Document, robot: Robot, sensors: list[Sensor], drives: list[Drive]
) -> None:
    """Check that settings fit the robot, here where errors have a location."""
    with document.at("plant", "sensors"):
        for sensor in sensors:
            sensor.reset(robot, 0.0, robot.neutral(), np.zeros(robot.nv))
    with document.at("plant", "drives"):
        for drive in drives:
            drive.reset(robot)


def _with_defaults(model: LoadModel, controller: LoadModel) -> LoadModel:
    """Return the plant's robot, with the controller's settings where it has none."""
    given = {name: getattr(model, name) for name in model.model_fields_set}
    like = {name: getattr(controller, name) for name in LoadModel.model_fields}
    return LoadModel(**{**like, **given})


def _robot(document: Document, model: s.PlantModel, robot: Robot) -> Robot:
    """Return the simulated robot; the controller's object if they are the same."""
    own = robot
    if model.robot is not None:
        gravity = robot.model.gravity.linear.tolist()
        own = load_robot(document, ("plant", "robot"), model.robot, gravity)
    changes: list[ModelChange] = []
    b = model.inertias
    if (b.mass_factor, b.inertia_factor, b.com_shift) != (1.0, 1.0, [0.0] * 3):
        changes.append(ScaledInertias(b.mass_factor, b.inertia_factor, b.com_shift))
    if b.random_mass or b.random_inertia or b.random_com:
        errors = b.random_mass, b.random_inertia, b.random_com
        changes.append(RandomInertias(*errors, seed=model.seed))
    if changes:
        own = changed(own, changes)
    if model.motor_inertia != 0.0:
        with document.at("plant", "motor_inertia"):
            own = changed(own, [MotorInertia(model.motor_inertia)])
    if (p := model.payload) is not None:
        with document.at("plant", "payload"):
            own = changed(own, [Payload(p.frame, p.mass, p.center, p.radius)])
    return own


def _engine(
    document: Document, model: AnyModel, robot: Robot, integrator: Integrator
) -> Plant:
    pushes = _pushes(document, model, robot)
    match model:
        case s.ContactPlantModel():
            return _rigid_contacts(document, model, robot, pushes)
        case s.MujocoPlantModel():
            friction = _friction(document, model, robot)
            return _mujoco(document, model, robot, friction, pushes)
        case s.RigidBodyPlantModel():
            friction = _friction(document, model, robot)
            if friction is None:
                return RigidBodyPlant(robot, pushes)
            step = getattr(integrator, "step", _STEP)
            return StickingPlant(robot, friction, step, pushes)


def _friction(
    document: Document, model: s.FrictionalPlantModel, robot: Robot
) -> JointFriction | None:
    with document.at("plant", "friction"):
        if model.friction == "urdf":
            return JointFriction.of_model(robot)
        if model.friction is None:
            return None
        return JointFriction.of(robot, model.friction.coulomb, model.friction.viscous)


def _pushes(document: Document, model: s.PlantModel, robot: Robot) -> list[Push]:
    pushes = []
    for k, p in enumerate(model.pushes):
        with document.at("plant", "pushes", k):
            robot.frame_id(p.frame)
            pushes.append(Push(p.frame, p.force, p.moment, p.start, p.duration))
    return pushes


def _rigid_contacts(
    document: Document, model: s.ContactPlantModel, robot: Robot, pushes: list[Push]
) -> ContactPlant:
    contacts = []
    for frame, contact in model.contacts.items():
        with document.at("plant", "contacts", frame):
            robot.frame_id(frame)
            on = None if contact.on is None else [(a, b) for a, b in contact.on]
            contacts.append(RigidContact(frame, contact.kind, on))
    return ContactPlant(robot, contacts, damping=model.damping, pushes=pushes)


def _mujoco(
    document: Document,
    model: s.MujocoPlantModel,
    robot: Robot,
    friction: JointFriction | None,
    pushes: list[Push],
) -> MujocoPlant:
    contacts = []
    for frame, contact in model.contacts.items():
        with document.at("plant", "contacts", frame):
            robot.frame_id(frame)
            contacts.append(
                ContactShape(frame, contact.shape, contact.position, contact.rpy)
            )
    return MujocoPlant(
        robot,
        timestep=model.timestep,
        integrator=model.integrator,
        contacts=contacts,
        ground=Ground(model.ground.height, model.ground.friction),
        joint_limits=model.joint_limits,
        friction=friction,
        pushes=pushes,
    )


def _sensors(model: s.PlantModel) -> list[Sensor]:
    settings, seed = model.sensors, model.seed
    chain: list[tuple[bool, Sensor]] = [
        (settings.delay > 0, SensorDelay(settings.delay)),
        (
            settings.position_noise != 0.0,
            PositionNoise(settings.position_noise, seed),
        ),
        (settings.encoder_resolution != 0.0, Encoder(settings.encoder_resolution)),
        (settings.differenced_velocity, DifferencedVelocity()),
        (
            settings.velocity_noise != 0.0,
            VelocityNoise(settings.velocity_noise, seed),
        ),
    ]
    return [sensor for wanted, sensor in chain if wanted]


def _drives(model: s.PlantModel) -> list[Drive]:
    settings, seed = model.drives, model.seed
    limit = None if settings.saturation == "model" else settings.saturation
    chain: list[tuple[bool, Drive]] = [
        (settings.dropped > 0.0, DroppedPeriods(settings.dropped, seed)),
        (settings.delay > 0, EffortDelay(settings.delay)),
        (settings.jitter > 0.0, Jitter(settings.jitter, seed)),
        (settings.noise != 0.0, EffortNoise(settings.noise, seed)),
        (settings.saturation is not None, Saturation(limit)),
    ]
    return [drive for wanted, drive in chain if wanted]
