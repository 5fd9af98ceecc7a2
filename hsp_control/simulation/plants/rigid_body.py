"""Rigid bodies with friction, pushed and held: the plant of most simulations."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.engine import Dynamics
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.friction import JointFriction
from hsp_control.robot.integrators import Integrator, number_of_steps
from hsp_control.robot.kinematics import Term
from hsp_control.simulation.plants.plant import (
    ContinuousPlant,
    IntegratedPlant,
    Plant,
    SampledPlant,
    differing_bodies,
    to_json_data,
)
from hsp_control.simulation.plants.plant_part import FrictionalPart
from hsp_control.simulation.plants.push import Push, Pushes


class RigidBodyPlant(ContinuousPlant):
    """v' = M(q)⁻¹(tau + Σ Jᵀ push - N(q, v)), the model itself.

    Attributes:
        pushes: External wrenches.
    """

    def __init__(self, robot: Robot, pushes: Sequence[Push] = ()) -> None:
        super().__init__(robot)
        self.pushes = Pushes(robot, pushes)
        self._dynamics = robot.dynamics()

    @property
    def dynamics(self) -> Dynamics:
        """Of the rigid bodies; see `Plant.dynamics`."""
        return self._dynamics

    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        """Return v'; see `ContinuousPlant.acceleration`."""
        if self.pushes.any_active(t, t):
            tau = tau + self.pushes.effort(t, q)
        return self.robot.forward_dynamics(q, v, tau, self.dynamics)

    def bind(self, q: Array, v: Array, tau: Array) -> Term:
        """Return v'; see `ContinuousPlant.bind`."""
        changed = type(self).acceleration is not RigidBodyPlant.acceleration
        pushed = self.pushes.pushes or self.pushes.reachable
        if pushed or changed:  # a subclass has another one
            return super().bind(q, v, tau)
        return self.robot.bind_forward_dynamics(q, v, tau, self.dynamics)

    def describe(self) -> dict[str, Any]:
        """Return its pushes."""
        return {"type": "RigidBodyPlant", "pushes": to_json_data(self.pushes.pushes)}


def is_exact(plant: Plant, robot: Robot) -> bool:
    """Return whether a plant is a controller's own model, and nothing else.

    Pushes are no difference of the robot. Of another class it is not known.
    """
    if type(plant) is IntegratedPlant:
        plant = plant.plant
    return type(plant) is RigidBodyPlant and not differing_bodies(plant, robot)


class StickingPlant(SampledPlant):
    """M v' + N = tau - D v - f, where f_i = c_i sign(v_i), or |f_i| <= c_i at v_i = 0.

    A step of length h solves for the velocity v⁺ at its end

        v⁺ = argmin ½ xᵀ(M + ½hD)x - xᵀ[(M - ½hD)v + h(tau - N)] + h Σ c_i |x_i|,

    M and N at its middle. This is the implicit law of dry friction: joints stick and
    break away exactly, and the equations do not become stiff. A step in which no joint
    sticks or reverses is of second order.
    """

    def __init__(
        self,
        robot: Robot,
        friction: JointFriction,
        step: float = 1e-3,
        pushes: Sequence[Push] = (),
    ) -> None:
        """Set the robot, its friction, the step and the pushes."""
        super().__init__(robot)
        if not 0.0 < step < np.inf:
            raise SimulationError(f"step is {step}; must be positive")
        self.friction, self.step = friction, step
        self.pushes = Pushes(robot, pushes)
        self._q, self._v = robot.neutral(), np.zeros(robot.nv)
        self._state = RobotState(robot)

    @property
    def dynamics(self) -> Dynamics:
        """Of the rigid bodies; see `Plant.dynamics`."""
        return self._state.dynamics

    def reset(self, t: float, q: Array, v: Array) -> None:
        """Set the state; see `SampledPlant.reset`."""
        self._q, self._v = q.copy(), v.copy()

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Step from t to ``end``; see `SampledPlant.advance`."""
        steps = number_of_steps(end - t, self.step)
        h = (end - t) / steps
        for k in range(steps):
            effort = tau
            if self.pushes.any_active(t + k * h, t + (k + 1) * h):
                effort = tau + self.pushes.effort(t + (k + 0.5) * h, self._q)
            self._step(h, effort)
        return self._q.copy(), self._v.copy()

    def describe(self) -> dict[str, Any]:
        """Return its friction, step and pushes."""
        return {
            "type": "StickingPlant",
            "friction": to_json_data(self.friction),
            "step": self.step,
            "pushes": to_json_data(self.pushes.pushes),
        }

    def _step(self, h: float, tau: Array) -> None:
        q, v, robot = self._q, self._v, self.robot
        half = self._velocity(0.5 * h, q, v, v, tau)
        middle = robot.integrate(q, 0.25 * h * (v + half))
        after = self._velocity(h, middle, half, v, tau)
        self._q = robot.integrate(q, 0.5 * h * (v + after))
        self._v = after

    def _velocity(
        self, h: float, q: Array, v: Array, start: Array, tau: Array
    ) -> Array:
        """Return v⁺ after a time h from velocity ``start``, with M and N at (q, v)."""
        state = self._state.update(0.0, q, v)
        M, N = state.mass_matrix, state.nonlinear_effects
        damping = np.diag(0.5 * h * self.friction.viscous)
        after = start.copy()
        engine.DryFriction(
            A=np.ascontiguousarray(M + damping),
            b=(M - damping) @ start + h * (tau - N),
            c=h * self.friction.coulomb,
            x=after,
        )()
        return after


_STEP = 1e-3
"""Largest step of a plant with stiction, if the integrator has no step [s]."""


class RigidBody(FrictionalPart, type="rigid_body"):
    """Pinocchio's rigid-body dynamics; with friction, joints stick and slip."""

    def engine(self, robot: Robot, integrator: Integrator) -> Plant:
        """Return a `RigidBodyPlant`, or with friction a `StickingPlant`."""
        friction = self.joint_friction(robot)
        if friction is None:
            return RigidBodyPlant(robot, self.pushes)
        step = integrator.longest_step
        return StickingPlant(
            robot, friction, _STEP if step is None else step, self.pushes
        )
