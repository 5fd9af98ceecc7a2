"""A robot in a MuJoCo scene, simulated by MuJoCo.

MuJoCo has no contacts between a body and its parent unless the parent is fixed: a base
that overlaps its first link acts on it like a brake.
"""

import importlib
import logging
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import FrameNotFoundError, SimulationError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.mujoco.coordinates import MujocoCoordinates
from hsp_control.companions.mujoco.loading import compile_mjcf
from hsp_control.companions.mujoco.plant import MujocoEngine, import_mujoco
from hsp_control.companions.mujoco.scene import Motor, Names, joint_actuators, motor
from hsp_control.control.interface import LogChannel
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Flag
from hsp_control.declaration.quantities import Names as NameList
from hsp_control.robot import Robot
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants.plant import contact_channels
from hsp_control.simulation.plants.plant_part import PlantPart
from hsp_control.simulation.plants.push import Push

_DEEP = 1e-3
"""Depth up to which parts touch without overlapping [m]."""


def own_overlaps(robot: Robot, model: Any, data: Any) -> dict[str, float]:
    """Return the depths of overlaps of a robot's parts [m], by ``base and link1``."""
    names = Names(model)
    joints = [names.joints.index(name) for name in robot.joints]
    jointed = {int(model.jnt_bodyid[joint]) for joint in joints}
    moved = {
        body for body in range(model.nbody) if jointed & _with_parents(model, body)
    }
    mounts = set().union(*(_with_parents(model, body) for body in jointed))
    found: dict[str, float] = {}
    for contact in data.contact[: data.ncon]:
        if min(contact.geom1, contact.geom2) < 0 or contact.dist > -_DEEP:
            continue  # of a flex, or only touching
        pair = {int(model.geom_bodyid[g]) for g in (contact.geom1, contact.geom2)}
        if pair <= moved | mounts and pair & moved:
            name = " and ".join(names.bodies[body] for body in sorted(pair))
            found[name] = max(found.get(name, 0.0), -float(contact.dist))
    return found


def _with_parents(model: Any, body: int) -> set[int]:
    """Return a body and those that carry it, without the world."""
    found = set()
    while body:
        found.add(body)
        body = int(model.body_parentid[body])
    return found


_log = logging.getLogger(__name__)
_GROUPS = 31
"""Number of groups of actuators that MuJoCo can disable."""


class MujocoScenePlant(MujocoEngine):
    """A robot in a MuJoCo scene: the user's own ``MjModel`` and ``MjData``.

    An effort goes through the robot's torque motors, as a control that MuJoCo limits,
    and for joints without exactly one such motor through ``qfrc_applied``. Everything
    else in ``data`` belongs to the user: controls of other actuators, forces on
    objects, mocap bodies. It may be read and written between periods.

    A run begins at the state that ``data`` had when the plant was made, with the
    robot's joints at the start of the run.

    Attributes:
        motors: The motors, by their degree of freedom's index in v.
        contacts: The bodies whose contact forces are logged.
    """

    def __init__(
        self,
        robot: Robot,
        model: Any,
        data: Any,
        *,
        contacts: Sequence[str] = (),
        disable_servos: bool = False,
        pushes: Sequence[Push] = (),
    ) -> None:
        """Find the robot in the scene.

        Args:
            robot: The robot, usually from `Robot.from_mujoco` with this model.
            model: The scene.
            data: Its state, where a run begins.
            contacts: Names of the bodies whose contact forces are logged.
            disable_servos: Whether servos on the robot's joints are switched off: they
                get their own group in ``model``, which is disabled. Without it
                they are an error, since they would work against the controller.
            pushes: External wrenches on the robot.
        """
        mujoco = import_mujoco()
        coordinates = MujocoCoordinates.of(robot, model)
        super().__init__(robot, model, data, coordinates, pushes)
        self.contacts = tuple(contacts)
        names = Names(model)
        self._bodies = _bodies(names, self.contacts)
        self._owners = {
            geom: name
            for name, body in self._bodies.items()
            for geom in range(model.ngeom)
            if model.geom_bodyid[geom] == body
        }
        on_joints = _actuators_on(robot, model, names)
        _switch_off_servos(model, names, on_joints, allowed=disable_servos)
        self.motors: dict[int, Motor] = _motors(model, on_joints)
        dofs = sorted(self.motors)
        self._driven: Indices = np.array(dofs, dtype=np.int64)
        self._controls = np.array([self.motors[i].control for i in dofs], dtype=int)
        self._factors = np.array([self.motors[i].factor for i in dofs])
        self._kind = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        self._begin = np.zeros(mujoco.mj_stateSize(model, self._kind))
        mujoco.mj_getState(model, data, self._begin, self._kind)
        self._probe: Any = mujoco.MjData(model) if self.contacts else None
        self._overlaps_told = False

    def reset(self, t: float, q: Array, v: Array) -> None:
        """Set the robot's state, and reset the rest; see `SampledPlant.reset`."""
        mujoco, data = self._mujoco, self.data
        mujoco.mj_resetData(self.model, data)  # also its warnings
        mujoco.mj_setState(self.model, data, self._begin, self._kind)
        data.time = t
        self.coordinates.to_mujoco(q, v, data.qpos, data.qvel)
        mujoco.mj_forward(self.model, data)
        self._tell_overlaps()

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Step MuJoCo from t to ``end``; see `SampledPlant.advance`."""
        own = self.model.opt.timestep
        try:
            return self._step(t, end, tau, own)
        finally:
            self.model.opt.timestep = own

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, LogChannel]:
        """Return the contacts' force and moment on every body that was requested."""
        if not self.contacts:
            return {}
        mujoco, probe = self._mujoco, self._probe  # the data itself is not touched
        state = np.zeros_like(self._begin)
        mujoco.mj_getState(self.model, self.data, state, self._kind)
        mujoco.mj_setState(self.model, probe, state, self._kind)
        self._drive(probe, t, q, self._roots.remove_effort(t, tau))
        mujoco.mj_forward(self.model, probe)
        origins = {name: probe.xpos[body] for name, body in self._bodies.items()}
        return contact_channels(self._wrenches_about(probe, origins))

    def describe(self) -> dict[str, Any]:
        """Return its settings, and the joints that are driven through their motors."""
        names = self.robot.dof_names
        return {
            **super().describe(),
            "motors": [names[i] for i in self.motors],
            "contacts": list(self.contacts),
        }

    def _tell_overlaps(self) -> None:
        """Warn once of a robot that overlaps itself where it starts."""
        if self._overlaps_told:
            return
        self._overlaps_told = True
        if found := own_overlaps(self.robot, self.model, self.data):
            pairs = [f"{pair} ({1e3 * deep:.3g} mm)" for pair, deep in found.items()]
            _log.warning(
                "%s: parts overlap in the scene, and MuJoCo pushes them apart, which "
                "the controller does not know: %s; exclude these contacts in the MJCF",
                self.robot.name,
                listing(pairs),
            )

    def _drive(self, data: Any, t: float, q: Array, effort: Array) -> None:
        """Write an effort as controls and as applied forces."""
        applied = effort.copy()
        applied[self._driven] = 0.0
        applied += self.pushes.effort(t, q)
        self.coordinates.effort_to_mujoco(q, applied, data.qfrc_applied)
        data.ctrl[self._controls] = effort[self._driven] / self._factors


def _bodies(names: Names, contacts: Sequence[str]) -> dict[str, int]:
    found = {}
    for name in contacts:
        if name not in names.bodies:
            with within("contacts"):
                raise FrameNotFoundError(
                    f"no body {name!r}{did_you_mean(name, names.bodies)} "
                    f"(the scene has {listing(names.bodies)})"
                )
        found[name] = names.bodies.index(name)
    return found


def _actuators_on(robot: Robot, model: Any, names: Names) -> dict[int, list[int]]:
    """Return the actuators on the robot's joints, by the joint's first index in v."""
    by_joint = joint_actuators(model)
    return {
        joint.idx_v: by_joint.get(names.joints.index(name), [])
        for name, joint in robot.joints.items()
    }


def _motors(model: Any, on_joints: Mapping[int, list[int]]) -> dict[int, Motor]:
    """Return the motors of joints with exactly one, and no other actuator."""
    found = {}
    for dof, actuators in on_joints.items():
        own = motor(model, actuators[0]) if len(actuators) == 1 else None
        if own is not None and own.factor and _works(model, own.actuator):
            found[dof] = own
    return found


def _works(model: Any, actuator: int) -> bool:
    """Return whether an actuator is not disabled, with its group or all of them."""
    flags = importlib.import_module("mujoco").mjtDisableBit
    group = int(model.actuator_group[actuator])
    of_group = 0 <= group < _GROUPS and int(model.opt.disableactuator) >> group & 1
    return not (of_group or int(model.opt.disableflags) & int(flags.mjDSBL_ACTUATION))


def _switch_off_servos(
    model: Any, names: Names, on_joints: Mapping[int, list[int]], *, allowed: bool
) -> None:
    servos = [
        actuator
        for actuators in on_joints.values()
        for actuator in actuators
        if motor(model, actuator) is None and _works(model, actuator)
    ]
    if servos and not allowed:
        raise SimulationError(
            f"actuators {listing([names.actuators[a] for a in servos])} of the scene "
            "are no torque motors and act on the robot's joints, where they would work "
            "against the controller: remove them from the MJCF, or set "
            "disable_servos"
        )
    if servos:
        unused = max({*range(_GROUPS)} - {*map(int, model.actuator_group)})
        model.actuator_group[servos] = unused
        model.opt.disableactuator |= 1 << unused


class MujocoScene(PlantPart, type="mujoco_scene"):
    """The MuJoCo scene in which the robot is declared, with all its objects.

    The timestep, the integrator, friction and contacts are the scene's own. In Python,
    `MujocoScenePlant` accepts any model and its data.
    """

    _: KW_ONLY
    contacts: NameList = ()
    """Bodies of the scene whose contact forces are logged [-]."""
    disable_servos: Flag = False
    """Whether servos on the robot's joints are switched off [-]; if not, they are an
    error."""

    def __post_init__(self) -> None:
        own = {"robot", "inertias", "payload", "motor_inertia"}
        if given := own & {*self.changed_fields()}:
            raise SimulationError(
                f"{', '.join(sorted(given))}: the scene has its own bodies; change "
                "them in the MJCF"
            )

    def engine(self, robot: Robot, integrator: Integrator) -> MujocoScenePlant:
        """Return the plant, which has its own integrator."""
        description = robot.description
        if description is None or description.mjcf is None:
            raise SimulationError(
                f"{robot.name} is not declared by an MJCF, whose scene this plant "
                "would be (a log contains the robot, not the scene: its MJCF is "
                "needed); declare it with robot: {mjcf: ...}, or choose the plant "
                "mujoco, which is made of any robot"
            )
        model = compile_mjcf(Path(description.mjcf), robot.source.access)
        return MujocoScenePlant(
            robot,
            model,
            _start(model, description.keyframe, robot),
            contacts=self.contacts,
            disable_servos=self.disable_servos,
            pushes=self.pushes,
        )


def _start(model: Any, keyframe: str | None, robot: Robot) -> Any:
    """Return the scene at its keyframe, with locked joints at the robot's values."""
    mujoco = import_mujoco()
    data = mujoco.MjData(model)
    if keyframe is not None:
        mujoco.mj_resetDataKeyframe(model, data, model.key(keyframe).id)
    joints = Names(model).joints
    for name, value in robot.source.locked.items():
        data.qpos[model.jnt_qposadr[joints.index(name)]] = value
    return data
