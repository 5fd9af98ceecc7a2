"""Plants: simulated robots that an effort moves; their common interface."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import fields, is_dataclass
from typing import Any, ClassVar, Self, TypeVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.control.measurement import NO_WRENCHES, Inertial, LogChannel
from hsp_control.declaration import Part
from hsp_control.engine import Dynamics
from hsp_control.engine.plans import TIME, PartCall
from hsp_control.robot import Robot
from hsp_control.robot.integrators import Advance, Integrator, Steps
from hsp_control.robot.kinematics import Term

Kind = TypeVar("Kind", bound="Imperfection")


class Plant:
    """A simulated robot, which may differ from the controller's model.

    A plant is either a `ContinuousPlant` or a `SampledPlant`.

    Attributes:
        robot: The robot that moves; its joints are those of the controller's model.
        sensor_delay: Delay of the measurements [control periods].
        effort_delay: Delay of the efforts [control periods].
        effort_lag: Time constant with which efforts follow the commanded ones [s].
    """

    sensor_delay: int = 0
    effort_delay: int = 0
    effort_lag: float = 0.0

    def __init__(self, robot: Robot) -> None:
        self.robot = robot

    @property
    def dynamics(self) -> Dynamics | None:
        """The engine's dynamics that move it, with a controller's declared payload.

        None if it is moved by something else.
        """
        return None

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, LogChannel]:
        """Return the plant's values to log, by name of the column.

        Contact forces are named ``plant.contact.<name>.force``.

        Args:
            t: Time [s].
            q: True configuration, shape (nq,).
            v: True velocity, shape (nv,).
            tau: Effort, shape (nv,).
        """
        return {}

    def describe(self) -> dict[str, Any]:
        """Return the type and the settings as JSON data, for the log."""
        return {"type": type(self).__name__}

    def contact_wrenches(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, Array]:
        """Return the measurements of sensors in the contacts, by the name of the frame.

        Force and moment of the world on the robot, the moment about the frame's origin,
        in world axes, shape (6,) [N, N·m]; by default there are no sensors. An engine
        returns those of its last step, so that they belong to the period that ends.

        Args:
            t: Time [s].
            q: True configuration, shape (nq,).
            v: True velocity, shape (nv,).
            tau: Effort of the period that ends, shape (nv,).
        """
        return NO_WRENCHES

    def inertial(self) -> Inertial | None:
        """Return the last measurement of an inertial measurement unit.

        None if there is no such unit.
        """
        return None


class ContinuousPlant(Plant, ABC):
    """A plant without memory: v' is a function of time, state and effort.

    `simulate` integrates it, with the law in the integrator's stages or with held
    efforts.
    """

    @abstractmethod
    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        """Return v' at time t [s], shape (nv,), for an effort of shape (nv,).

        The arrays may be overwritten after the call: copy them to keep them.
        """

    def bind(self, q: Array, v: Array, tau: Array) -> Term:
        """Return v' for the values of these arrays when it is computed."""
        value = np.zeros(self.robot.nv)

        def compute(t: float) -> None:
            value[:] = self.acceleration(t, q, v, tau)

        return Term(value, [PartCall(compute, t=TIME)])


class SampledPlant(Plant, ABC):
    """A plant with its own state, which is advanced under an effort that is held.

    Examples are an engine with its own integrator, joints with stiction, drives with
    delays, and a real robot. A run is one `reset`, then one `measure` and one `advance`
    per control period. A copy moves by itself.
    """

    def __copy__(self) -> Self:
        return deepcopy(self, {id(self.robot): self.robot})

    @abstractmethod
    def reset(self, t: float, q: Array, v: Array) -> None:
        """Set the state at time t [s]: q, shape (nq,), and v, shape (nv,).

        All memory is cleared and random numbers start again, so that a run can be
        repeated exactly.
        """

    @abstractmethod
    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Advance from t to ``end`` [s] under an effort of shape (nv,).

        Returns:
            The true (q, v) at ``end``, shapes (nq,) and (nv,), in new arrays.
        """

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return the measured (q, v) for the true (q, v); here the true ones.

        It is called once per control period, in order of time: sensors may have memory.
        """
        return q, v


class IntegratedPlant(SampledPlant):
    """A continuous plant and its integrator, under efforts that are held.

    Attributes:
        plant: The continuous plant.
        integrator: The integrator.
        effort: The effort that is held, shape (nv,).
    """

    def __init__(self, plant: ContinuousPlant, integrator: Integrator) -> None:
        super().__init__(plant.robot)
        self.plant = plant
        self.integrator = integrator
        self._q, self._v = plant.robot.neutral(), np.zeros(plant.robot.nv)
        self.effort = np.zeros(plant.robot.nv)
        self._advance: Advance | None = None  # begun where it is needed

    def __getstate__(self) -> dict[str, Any]:
        return vars(self) | {"_advance": None}

    @property
    def dynamics(self) -> Dynamics | None:
        """Those of the plant; see `Plant.dynamics`."""
        return self.plant.dynamics

    def reset(self, t: float, q: Array, v: Array) -> None:
        """Set the state; see `SampledPlant.reset`."""
        self._q, self._v = q.copy(), v.copy()

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Integrate from t to ``end``; see `SampledPlant.advance`."""
        advance = self._advance or self._begin()
        self.effort[:] = tau
        self._q, self._v = advance(t, end, self._q, self._v)
        return self._q, self._v

    def _begin(self) -> Advance:
        """Begin the integrator."""
        self._advance = self.integrator.begin(
            self.robot, lambda q, v: self.plant.bind(q, v, self.effort)
        )
        return self._advance

    def native_steps(self) -> Steps | None:
        """Return the steps of `advance`, if they are native.

        A caller begins with `hold`, and ends with `moved`.
        """
        steps = self._advance or self._begin()
        return steps if isinstance(steps, Steps) and steps.native else None

    def hold(self, steps: Steps, tau: Array) -> None:
        """Write the present state and an effort, (nv,), where native steps read it."""
        steps.q[:], steps.v[:], self.effort[:] = self._q, self._v, tau

    def moved(self, steps: Steps) -> tuple[Array, Array]:
        """Continue where native steps have ended; return (q, v) there, as `advance`."""
        self._q, self._v = steps.q.copy(), steps.v.copy()
        return self._q, self._v

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, LogChannel]:
        """Return the continuous plant's log channels."""
        return self.plant.log_channels(t, q, v, tau)

    def contact_wrenches(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, Array]:
        """Return the continuous plant's; see `Plant.contact_wrenches`."""
        return self.plant.contact_wrenches(t, q, v, tau)

    def describe(self) -> dict[str, Any]:
        """Return the continuous plant's description."""
        return self.plant.describe()


class Imperfection(Part, ABC, error=SimulationError):
    """The common base of sensors and drives: their place in a chain.

    A subclass declares its parameters as fields (see `Part`) and implements ``begin``.
    It refers to no robot and has no memory: ``begin`` returns the running part. A plant
    applies those of a chain in the order of their stages, however they are given.

    Attributes:
        stage: The place in the chain; by default behind all of this package.
        strength: The field that is zero, as a number or as nv numbers, where it changes
            nothing; empty: there is none.
    """

    stage: ClassVar[float] = 100.0
    strength: ClassVar[str] = ""

    @property
    def active(self) -> bool:
        """Whether it changes anything; a plant leaves out one that does not."""
        return not self.strength or bool(np.any(getattr(self, self.strength)))

    @property
    def periods(self) -> int:
        """Its delay in control periods, for the rate check."""
        return 0


def in_order(chain: tuple[Kind, ...]) -> tuple[Kind, ...]:
    """Return a chain in the order of its stages."""
    return tuple(sorted(chain, key=lambda each: each.stage))


def differing_bodies(plant: Plant, robot: Robot) -> dict[str, Any]:
    """Return the plant's inertias as JSON data, {} if they are those of the robot.

    By joint: ``mass`` [kg], ``com`` [m] and ``inertia`` (xx, xy, xz, yy, yz, zz) about
    it [kg·m²] in the joint's frame, and ``armature`` of each degree of freedom.
    """
    ours, theirs = robot.model, plant.robot.model
    pairs = zip(ours.inertias, theirs.inertias, strict=True)
    same = np.array_equal(ours.armature, theirs.armature)
    if same and all(our == their for our, their in pairs):
        return {}
    bodies = {}
    for index in range(1, theirs.njoints):
        body, joint = theirs.inertias[index], theirs.joints[index]
        armature = theirs.armature[joint.idx_v : joint.idx_v + joint.nv]
        bodies[str(theirs.names[index])] = {
            "mass": body.mass,
            "com": body.lever.tolist(),
            "inertia": body.inertia[np.triu_indices(3)].tolist(),
            "armature": armature.tolist(),
        }
    return {"bodies": bodies}


def check_plant(plant: Plant, robot: Robot) -> None:
    """Check that a plant has the joints of the controller's robot."""
    ours, theirs = (
        [(name, j.nq, j.nv) for name, j in r.joints.items()]
        for r in (robot, plant.robot)
    )
    if ours != theirs:
        raise SimulationError(
            f"the plant moves {plant.robot.name} with the joints "
            f"{', '.join(plant.robot.joint_names)}; the controller's {robot.name} has "
            f"{', '.join(robot.joint_names)}: load both with the same root and locks"
        )


def to_json_data(value: Any) -> Any:
    """Return a setting as JSON data; a dataclass becomes its type and its fields."""
    if is_dataclass(value):
        items = {f.name: to_json_data(getattr(value, f.name)) for f in fields(value)}
        return {"type": type(value).__name__, **items}
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [to_json_data(item) for item in value]
    return value


def contact_channels(wrenches: Mapping[str, Array]) -> dict[str, LogChannel]:
    """Return ``plant.contact.<name>.force`` and ``.moment`` for every contact.

    A wrench (6,) of the world on the robot is force and moment in world axes, about the
    origin of the contact's frame.
    """
    channels: dict[str, LogChannel] = {}
    for name, wrench in wrenches.items():
        force = LogChannel(wrench[:3], "N", "of the world on the robot, in world axes")
        moment = LogChannel(wrench[3:], "N·m", "on the robot, about the frame's origin")
        channels[f"plant.contact.{name}.force"] = force
        channels[f"plant.contact.{name}.moment"] = moment
    return channels


MAX_ROOT_EFFORT = 1e-3
"""Largest effort on a root [N or N·m] that a solver's tolerance explains; removed."""


class FloatingRoots:
    """The degrees of freedom of a robot's free-flyer joints."""

    def __init__(self, robot: Robot) -> None:
        self._unactuated = np.zeros(robot.nv, dtype=bool)
        for joint in robot.joints.values():
            if joint.shortname() == "JointModelFreeFlyer":
                self._unactuated[joint.idx_v : joint.idx_v + 6] = True

    def remove_effort(self, t: float, tau: Array) -> Array:
        """Return an effort, shape (nv,), with zeros for the roots."""
        largest = float(np.abs(tau[self._unactuated]).max(initial=0.0))
        if largest > MAX_ROOT_EFFORT:
            raise SimulationError(
                f"the effort at t = {t:.6g} s pushes the floating root with "
                f"{largest:.3g} N or N·m, but the root has no motor: the controller "
                "must move it through its contacts"
            )
        return np.where(self._unactuated, 0.0, tau)
