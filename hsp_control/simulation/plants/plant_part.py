"""Plants as values: a configuration's declaration of the simulated system."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, GetJsonSchemaHandler
from pydantic_core import CoreSchema

from hsp_control.common.errors import SimulationError
from hsp_control.declaration import AnyOf, Part, within
from hsp_control.declaration.families import Declared
from hsp_control.declaration.quantities import Count, Weights
from hsp_control.robot import Robot
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.description.robot_description import RobotDescription
from hsp_control.robot.friction import Friction, JointFriction
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants.drives import Drives
from hsp_control.simulation.plants.imperfect_plant import ImperfectPlant
from hsp_control.simulation.plants.model_changes import (
    Inertias,
    ModelChange,
    MotorInertia,
    Payload,
    changed,
)
from hsp_control.simulation.plants.plant import (
    ContinuousPlant,
    IntegratedPlant,
    Plant,
    SampledPlant,
    check_plant,
)
from hsp_control.simulation.plants.push import Push
from hsp_control.simulation.plants.sensors import Sensors


class PlantPart(Part, ABC, family="plants", error=SimulationError):
    """The declaration of a plant in Python and YAML; `build` returns the plant.

    A subclass declares the parameters of its engine as fields (see `Part`) and
    implements `engine`. The fields below are common to all plants. A
    package names its class as an entry point of the group ``hsp_control.plants``.

    Sensors and drives are applied in the order of their stages, whatever the order in
    which they are given.
    """

    _: KW_ONLY
    robot: RobotDescription | None = None
    """The simulated robot [-], with the same joints; the controller's robot by
    default. Its omitted settings are those of the controller's robot."""
    inertias: Inertias = Inertias()
    """Differences of masses and inertias from the controller's model [-]."""
    payload: Payload | None = None
    """A payload that the controller's model lacks [-]."""
    motor_inertia: Weights = 0.0
    """Rotor inertia times gear ratio squared [kg·m² or kg], one number or nv."""
    pushes: Annotated[Sequence[Push], AfterValidator(tuple)] = ()
    """External wrenches [-]; the engine applies them."""
    sensors: Sensors = ()
    """Imperfections of the measurements [-]."""
    drives: Drives = ()
    """Imperfections of the drives [-]."""
    seed: Count = 0
    """Seed of all random numbers [-]."""

    @abstractmethod
    def engine(self, robot: Robot, integrator: Integrator) -> Plant:
        """Return the plant without its sensors and drives.

        Args:
            robot: The simulated robot, with its inertias, motors and payload.
            integrator: The integrator of the simulation, for engines with stiction or
                contacts that need its step; `simulate` integrates a `ContinuousPlant`.

        Raises:
            HspControlError: If a field does not fit the robot; with its key path.
        """

    @property
    def longest_step(self) -> float | None:
        """The longest step of an engine with its own steps [s]; None: it has none."""
        return None

    @property
    def push_off(self) -> float:
        """Normal acceleration of a sliding body per sliding speed.

        A contact pressed with less is lost [1/s]; 0: nothing is pushed off.
        """
        return 0.0

    @property
    def sensor_delay(self) -> int:
        """Delay of the measurements [control periods]."""
        return sum(sensor.periods for sensor in self.sensors)

    @property
    def effort_delay(self) -> int:
        """Delay of the efforts [control periods]."""
        return sum(drive.periods for drive in self.drives)

    @property
    def effort_lag(self) -> float:
        """Time constant with which efforts follow the commanded ones [s]."""
        return sum(drive.lag for drive in self.drives)

    def located(self, folder: Path) -> Self:
        """Return it with the full path of its robot's URDF, if that is in a folder."""
        if self.robot is None:
            return self
        return replace(self, robot=self.robot.located(folder))

    def build(
        self, robot: Robot, integrator: Integrator, *, access: Access = ANYWHERE
    ) -> Plant:
        """Return the plant, which has the controller's joints."""
        plant = self.engine(self.simulated(robot, access), integrator)
        check_plant(plant, robot)
        sensors = [sensor for sensor in self.sensors if sensor.active]
        drives = [drive for drive in self.drives if drive.active]
        if not (sensors or drives):
            return plant
        if isinstance(plant, ContinuousPlant):
            plant = IntegratedPlant(plant, integrator)
        if not isinstance(plant, SampledPlant):
            raise SimulationError(
                f"{type(plant).__name__} is neither a continuous nor a sampled plant"
            )
        return ImperfectPlant(plant, sensors, drives, self.seed)

    def simulated(self, robot: Robot, access: Access) -> Robot:
        """Return the simulated robot; the controller's object if they are the same."""
        own = robot
        if self.robot is not None:
            with within("robot"):
                own = Robot.load(_completed(self.robot, robot), access=access)
        changes: dict[str, ModelChange] = {}
        if self.inertias != Inertias():
            changes["inertias"] = self.inertias
        if np.any(self.motor_inertia):
            changes["motor_inertia"] = MotorInertia(self.motor_inertia)
        if self.payload is not None:
            changes["payload"] = self.payload
        for key, change in changes.items():
            with within(key):
                own = changed(own, [change], self.seed)
        return own


class FrictionalPart(PlantPart, ABC):
    """A plant whose joints may have friction."""

    _: KW_ONLY
    friction: Literal["urdf"] | Friction | None = None
    """Friction of the joints [-]; ``urdf`` takes it from the robot's file. None by
    default."""

    def joint_friction(self, robot: Robot) -> JointFriction | None:
        """Return the friction of a robot's joints, None if there is none.

        Raises:
            SimulationError: If it does not fit the robot.
        """
        if self.friction is None:
            return None
        if self.friction == "urdf":
            return JointFriction.of_model(robot)
        with within("friction"):
            return self.friction.of(robot)


def _completed(own: RobotDescription, robot: Robot) -> RobotDescription:
    """Return the plant's robot, with the controller's settings where it has none."""
    given = own.changed_fields()
    like = {"gravity": robot.model.gravity.linear}
    theirs = robot.description
    alike = theirs is not None and (own.mjcf is None) == (theirs.mjcf is None)
    if own.parts is None and theirs is not None and alike:
        others = theirs.changed_fields()
        like = {**others, **like}
        like.pop("parts", None)
    return RobotDescription(**{**like, **given})


class _OrItsName(AnyOf):
    """The type of a field that holds a plant, or in YAML its type alone."""

    def validate(self, value: Any) -> Any:
        """Return a plant: the value itself, or that of a mapping or a name."""
        return super().validate({"type": value} if isinstance(value, str) else value)

    def _json_schema(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> Any:
        members = super()._json_schema(schema, handler)  # imports those of companions
        names = [
            name
            for name, member in self.members.items()
            if not any(field.is_required() for field in _fields(member))
        ]
        return {"anyOf": [{"enum": names}, members]}


def _fields(member: type[Declared]) -> list[Any]:
    return [*member.__pydantic_fields__.values()]  # type: ignore[attr-defined]


AnyPlant = Annotated[PlantPart, _OrItsName(PlantPart)]
"""A plant; in YAML also its type alone: ``plant: mujoco``."""
