"""MuJoCo as a plant: its stepping, and the robot as a MuJoCo model."""

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY
from typing import Any, Literal

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ModelError, SimulationError
from hsp_control.companions.mujoco import scene
from hsp_control.companions.mujoco.carried import CarriedInMujoco
from hsp_control.companions.mujoco.coordinates import MujocoCoordinates, joints_of
from hsp_control.companions.mujoco.mjcf import (
    ContactShapes,
    Ground,
    Solids,
    geoms_of,
    write_mjcf,
)
from hsp_control.control.interface import LogChannel
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Flag, Positive
from hsp_control.engine import Dynamics
from hsp_control.robot import Robot
from hsp_control.robot.integrators import Integrator, number_of_steps
from hsp_control.simulation.plants.plant import (
    FloatingRoots,
    SampledPlant,
    contact_channels,
    to_json_data,
)
from hsp_control.simulation.plants.plant_part import FrictionalPart
from hsp_control.simulation.plants.push import Push, Pushes

MujocoIntegrator = Literal["Euler", "RK4", "implicit", "implicitfast"]


def import_mujoco() -> Any:
    """Return the module ``mujoco``; its warnings go to our log, not to a file."""
    try:
        return scene.import_mujoco()
    except ModelError as error:
        raise SimulationError(f"the plant cannot be made: {error}") from error


class MujocoEngine(SampledPlant):
    """A robot that MuJoCo moves, in any MuJoCo model.

    Attributes:
        model: The ``mujoco.MjModel``.
        data: The ``mujoco.MjData``.
        coordinates: Converts between the robot's coordinates and MuJoCo's.
        pushes: External wrenches.
    """

    def __init__(
        self,
        robot: Robot,
        model: Any,
        data: Any,
        coordinates: MujocoCoordinates,
        pushes: Sequence[Push],
    ) -> None:
        super().__init__(robot)
        self.model, self.data, self.coordinates = model, data, coordinates
        self.pushes = Pushes(robot, pushes)
        self._roots = FloatingRoots(robot)
        # whose contact forces are reported, by the geom
        self._owners: dict[int, str] = {}

    @property
    def _mujoco(self) -> Any:
        """The module mujoco; not an attribute, because a module cannot be pickled."""
        return importlib.import_module("mujoco")

    def describe(self) -> dict[str, Any]:
        """Return its type and its pushes."""
        return {
            "type": type(self).__name__,
            "mujoco": self._mujoco.__version__,
            "timestep": float(self.model.opt.timestep),
            "pushes": to_json_data(self.pushes.pushes),
        }

    def _drive(self, data: Any, t: float, q: Array, effort: Array) -> None:
        """Write an effort, and the pushes at t, into MuJoCo's data."""
        effort = effort + self.pushes.effort(t, q)
        self.coordinates.effort_to_mujoco(q, effort, data.qfrc_applied)

    def _step(
        self, t: float, end: float, tau: Array, longest: float
    ) -> tuple[Array, Array]:
        """Step from t to ``end`` [s], by equal steps; return (q, v) there."""
        data, effort = self.data, self._roots.remove_effort(t, tau)
        steps = number_of_steps(end - t, longest)
        h = self.model.opt.timestep = (end - t) / steps
        pushed = self.pushes.any_active(t, end)
        constant = self.coordinates.constant_effort and not pushed
        at_once = steps if constant else 1
        q, v = self.coordinates.from_mujoco(data.qpos, data.qvel)
        for k in range(0, steps, at_once):
            self._drive(data, t + (k + 0.5) * h, q, effort)
            self._mujoco.mj_step(self.model, data, at_once)
            self._check_motion(end)
            q, v = self.coordinates.from_mujoco(data.qpos, data.qvel)
        return q, v

    def _check_motion(self, end: float) -> None:
        """Check that the motion has not diverged."""
        kinds = self._mujoco.mjtWarning
        bad = (
            kinds.mjWARN_BADQPOS,
            kinds.mjWARN_BADQVEL,
            kinds.mjWARN_BADQACC,
            kinds.mjWARN_BADCTRL,  # which MuJoCo replaces by zero
        )
        if any(self.data.warning[kind].number for kind in bad):
            raise SimulationError(
                f"the motion diverged before t = {end:.6g} s: MuJoCo's state, "
                "acceleration or control is not finite, or beyond 1e10"
            )

    def _wrenches_about(
        self, data: Any, origins: Mapping[str, Array]
    ) -> dict[str, Array]:
        """Return the wrench of all contacts on each owner, shape (6,), in world axes.

        ``origins`` are the points about which their moments are; contacts between two
        bodies of one owner cancel.
        """
        count, names = data.ncon, list(origins)
        sums = np.zeros((len(names), 6))
        if count and names:
            index = np.full(self.model.ngeom, -1)
            for geom, name in self._owners.items():
                index[geom] = names.index(name)
            contact, local = data.contact, np.zeros((count, 6))
            touched = index[contact.geom]
            for k in np.flatnonzero((touched >= 0).any(axis=1)).tolist():
                self._mujoco.mj_contactForce(self.model, data, k, local[k])
            points = np.array([origins[name] for name in names])
            where = np.ascontiguousarray(contact.pos)  # both are members of structs
            axes = np.ascontiguousarray(contact.frame).reshape(count, 3, 3)
            engine.AddContactWrenches(
                touched=touched,
                positions=where,
                frames=axes,
                wrenches=local,
                origins=points,
                sums=sums,
            )()
        return dict(zip(names, sums, strict=True))


class Mujoco(FrictionalPart, type="mujoco"):
    """MuJoCo, with its own integrator, friction and contacts."""

    _: KW_ONLY
    timestep: Positive = 0.001
    """Maximum step of MuJoCo [s]."""
    integrator: MujocoIntegrator = "implicitfast"
    """Integrator of MuJoCo [-]."""
    joint_limits: Flag = True
    """Whether MuJoCo keeps joints within their limits [-]."""
    contacts: ContactShapes = ()
    """Shapes that may touch the ground and the solids, by frame name [-]."""
    ground: Ground = Ground()
    """The ground [-]; it exists only if `contacts` has entries."""
    solids: Solids = ()
    """Walls, tables, slopes and stairs, by name [-]."""

    def __post_init__(self) -> None:
        if self.solids and not self.contacts:
            with within("solids"):
                raise SimulationError(
                    "nothing may touch them: declare contacts, the shapes of the robot "
                    "that may"
                )

    @property
    def longest_step(self) -> float:
        """The longest step of MuJoCo [s]."""
        return self.timestep

    @property
    def push_off(self) -> float:
        """Rate of its slowest solid [1/s]; see `Solid` and docs/forces.md."""
        return min((each.push_off for each in self.solids), default=0.0)

    def engine(self, robot: Robot, integrator: Integrator) -> "MujocoPlant":
        """Return the plant, which has its own integrator."""
        return MujocoPlant(robot, self)


_DESCRIBED = "timestep", "integrator", "joint_limits", "contacts", "ground", "solids"


class MujocoPlant(MujocoEngine):
    """A robot in MuJoCo, built from the Pinocchio model.

    The declared contacts can touch a flat ground and the declared solids; there are no
    other collisions.
    """

    def __init__(self, robot: Robot, declared: Mujoco) -> None:
        """Build the MuJoCo model."""
        mujoco = import_mujoco()
        self.declared, self.contacts = declared, declared.contacts
        self.friction = declared.joint_friction(robot)
        joints = joints_of(robot)
        geoms: dict[int, list[Any]] = {}
        frame_of_geom: dict[str, str] = {}
        for contact in self.contacts:
            with within("contacts", contact.frame):
                joint = robot.model.frames[robot.frame_id(contact.frame)].parentJoint
                found = geoms_of(robot, contact)
            for geom in found:
                name = f"{contact.frame}/{len(frame_of_geom)}"
                geoms.setdefault(joint, []).append((name, geom))
                frame_of_geom[name] = contact.frame
        # the model as MJCF text, for MuJoCo's own tools
        self.mjcf = write_mjcf(
            robot,
            joints,
            integrator=declared.integrator,
            joint_limits=declared.joint_limits,
            friction=self.friction,
            geoms=geoms,
            ground=declared.ground,
            solids=declared.solids,
        )
        try:
            model = mujoco.MjModel.from_xml_string(self.mjcf)
        except ValueError as error:
            reason = str(error).strip().splitlines()[0]
            raise SimulationError(f"MuJoCo rejects {robot.name}: {reason}") from error
        names = [name for joint in joints for name in joint.mujoco_names]
        made = [model.joint(name) for name in names]
        coordinates = MujocoCoordinates(
            robot,
            joints,
            {name: int(j.qposadr[0]) for name, j in zip(names, made, strict=True)},
            {name: int(j.dofadr[0]) for name, j in zip(names, made, strict=True)},
        )
        data, pushes = mujoco.MjData(model), declared.pushes
        super().__init__(robot, model, data, coordinates, pushes)
        self._owners = {
            model.geom(name).id: frame for name, frame in frame_of_geom.items()
        }
        self._carried = CarriedInMujoco(robot, model, joints)
        self._data = robot.model.createData()
        self._origins = {c.frame: robot.frame_id(c.frame) for c in self.contacts}

    @property
    def dynamics(self) -> Dynamics:
        """Those whose bodies, payloads and gravity MuJoCo has; see `Plant.dynamics`."""
        return self._carried.dynamics

    def reset(self, t: float, q: Array, v: Array) -> None:
        """Set the state; see `SampledPlant.reset`."""
        self._mujoco.mj_resetData(self.model, self.data)
        self.data.time = t
        self.coordinates.to_mujoco(q, v, self.data.qpos, self.data.qvel)

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Step MuJoCo from t to ``end``; see `SampledPlant.advance`."""
        self._carried.write()
        return self._step(t, end, tau, self.declared.timestep)

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, LogChannel]:
        """Return the contacts' forces and moments at a true state under an effort."""
        if not self.contacts:
            return {}
        self._carried.write()
        self._drive(self.data, t, q, self._roots.remove_effort(t, tau))
        self._mujoco.mj_forward(self.model, self.data)
        return contact_channels(self._wrenches(q)) | self._places()

    def contact_wrenches(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, Array]:
        """Return the wrenches of MuJoCo's last step; zeros before the first one."""
        return self._wrenches(q)

    def clearance(self, q: Array) -> float:
        """Return the height of the lowest contact above the ground [m], negative below.

        To start a robot on its feet, lower its root by that height.

        Args:
            q: Configuration, shape (nq,).

        Raises:
            SimulationError: If there are no contacts.
        """
        if not self.contacts:
            raise SimulationError(f"{self.robot.name} has no contacts with the ground")
        probe = self._mujoco.MjData(self.model)
        rest = np.zeros(self.robot.nv)
        self.coordinates.to_mujoco(q, rest, probe.qpos, probe.qvel)
        self._mujoco.mj_kinematics(self.model, probe)
        ground = self.model.geom("ground").id
        distance = self._mujoco.mj_geomDistance
        return min(
            float(distance(self.model, probe, ground, geom, 1e6, None))
            for geom in self._owners
        )

    def describe(self) -> dict[str, Any]:
        """Return its settings."""
        return {
            **super().describe(),
            **{name: to_json_data(getattr(self.declared, name)) for name in _DESCRIBED},
            "friction": to_json_data(self.friction),
        }

    def _places(self) -> dict[str, LogChannel]:
        """Return positions and orientations of the free solids."""
        found = {}
        for solid in self.declared.solids:
            for k in range(solid.copies if solid.mass is not None else 0):
                body = self.data.body(f"solid/{solid.name}/{k}")
                prefix = f"plant.solid.{solid.name}" + (f"_{k + 1}" if k else "")
                found[f"{prefix}.position"] = LogChannel(
                    body.xpos.copy(), "m", "of its middle in the world"
                )
                found[f"{prefix}.quaternion"] = LogChannel(
                    body.xquat[[1, 2, 3, 0]], "-", "orientation (x, y, z, w)"
                )
        return found

    def _wrenches(self, q: Array) -> dict[str, Array]:
        """Return the contacts' wrenches about their frames' origins, in world axes."""
        model, data = self.robot.model, self._data
        pin.forwardKinematics(model, data, q)
        origins = {
            name: pin.updateFramePlacement(model, data, frame).translation
            for name, frame in self._origins.items()
        }
        return self._wrenches_about(self.data, origins)
