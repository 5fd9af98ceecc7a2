"""Arms with model errors, and controllers that hold their hands."""

from dataclasses import dataclass
from typing import Any

import numpy as np

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.compensation import Compensation
from hsp_control.robot.friction import JointFriction
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import (
    ImperfectPlant,
    IntegratedPlant,
    RigidBodyPlant,
    SampledPlant,
    StickingPlant,
)
from hsp_control.simulation.plants.drives import Drive, EffortDelay, EffortLag
from hsp_control.simulation.plants.model_changes import (
    Inertias,
    ModelChange,
    MotorInertia,
    Payload,
    changed,
)
from hsp_control.simulation.plants.sensors import Sensor, VelocityNoise

H = 1e-3
ARMS: dict[str, list[float] | None] = {
    "panda": None,
    "iiwa14": None,
    "xarm7": [0.0, -0.5, 0.0, 0.9, 0.0, 1.2, 0.0],
    "ur5": [0.0, -1.3, 1.8, -2.0, -1.57, 0.0],
}
"""The postures in which hands are held; None for home."""
MORE_ARMS: dict[str, list[float] | None] = {
    "ur10": ARMS["ur5"],
    "kinova": [0.0, 2.9, 1.3, 1.0, 1.4, 0.3],
}
"""Further postures for benchmarks; for continuous joints the angles."""


@dataclass(frozen=True)
class WrongArm:
    """An arm, and properties that its model lacks."""

    name: str
    seed: int
    mass: float = 0.2  # largest relative error of masses and inertias [-]
    com: float = 0.01  # largest error of a centre of mass [m]
    rotor: float = 0.0  # rotors that the model lacks [kg m²]
    load: float = 0.0  # mass at the hand, 4 cm off its frame [kg]
    coulomb: float = 0.0  # [N·m]
    viscous: float = 0.0  # [N·m·s/rad]
    delay: int = 0  # of the efforts [periods]
    lag: float = 0.0  # of the drives [s]
    noise: float = 0.0  # of the velocities [rad/s]
    motor_inertia: float | None = None  # rotors in the model

    @property
    def robot(self) -> hsp.Robot:
        return hsp.Robot.load(self.name, motor_inertia=self.motor_inertia)

    def plant(self, robot: hsp.Robot) -> SampledPlant:
        """Return the plant."""
        errors = {"random_mass": self.mass, "random_inertia": self.mass}
        changes: list[ModelChange] = []
        if self.mass:
            changes.append(Inertias(**errors, random_com=self.com))
        if self.rotor:
            changes.append(MotorInertia(self.rotor))
        if self.load:
            center = (0.03, 0.02, 0.02)
            changes.append(Payload(robot.end_effector, self.load, center=center))
        true = changed(robot, changes, self.seed)
        plant: SampledPlant = IntegratedPlant(RigidBodyPlant(true), Rk4(H))
        if self.coulomb or self.viscous:
            friction = JointFriction.of(true, self.coulomb, self.viscous)
            plant = StickingPlant(true, friction, H / 2.0)
        sensors: list[Sensor] = [VelocityNoise(self.noise)] if self.noise else []
        drives: list[Drive] = [EffortDelay(self.delay)] if self.delay else []
        drives += [EffortLag(self.lag)] if self.lag else []
        if not (sensors or drives):
            return plant
        return ImperfectPlant(plant, sensors, drives, self.seed)


def posture(robot: hsp.Robot, name: str) -> Array:
    """Return the posture in which an arm's hand is held."""
    given = (ARMS | MORE_ARMS)[name]
    if given is None:
        return robot.home()
    return robot.integrate(robot.neutral(), np.array(given))


def holding(arm: WrongArm, circle: float = 0.0) -> tuple[hsp.Controller, Array]:
    """Return a controller that holds a pose, or moves on a circle, and its start."""
    robot = arm.robot
    q = posture(robot, arm.name)
    task: hsp.Task = hsp.FramePose(robot.end_effector, name="hand")
    if circle:
        path = hsp.Circle(
            circle, 2.0, [0.0] * 3, origin="start", normal=[0.0, 0.0, 1.0]
        )
        task = hsp.FramePosition(robot.end_effector, path, blend=1.0, name="hand")
    field = hsp.TargetPosture(q) if robot.nv > 6 or circle else None
    return hsp.Controller(robot, [task], field, start=q), q


def held(
    arm: WrongArm, compensation: Compensation, circle: float = 0.0, **options: Any
) -> hsp.Rollout:
    """Return the run of an arm whose hand is held."""
    made, q = holding(arm, circle)
    options = {"duration": 3.0, **options}
    return hsp.simulate(
        made, q, control_period=H, plant=arm.plant(made.robot),
        compensation=compensation, check_rate=False, **options,
    )  # fmt: skip
