"""MuJoCo as a plant: the robot is translated to a MuJoCo model."""

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY
from typing import Any, Literal, get_args

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.control.measurement import LogChannel
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Flag, Positive
from hsp_control.robot import Robot
from hsp_control.robot.friction import JointFriction
from hsp_control.robot.integrators import Integrator
from hsp_control.robot.motion import number_of_steps
from hsp_control.robot.mujoco_coordinates import MujocoCoordinates, joints_of
from hsp_control.simulation.plants.declared import FrictionalPart
from hsp_control.simulation.plants.mujoco.engine import (
    check_motion,
    contact_wrenches,
    import_mujoco,
)
from hsp_control.simulation.plants.mujoco.mjcf import (
    ContactShape,
    ContactShapes,
    Ground,
    Solid,
    Solids,
    geoms_of,
    write_mjcf,
)
from hsp_control.simulation.plants.plant import (
    FloatingRoots,
    SampledPlant,
    contact_channels,
    to_json_data,
)
from hsp_control.simulation.plants.push import Push, Pushes

MujocoIntegrator = Literal["Euler", "RK4", "implicit", "implicitfast"]


class MujocoPlant(SampledPlant):
    """A robot in MuJoCo, built from the Pinocchio model.

    The declared contacts can touch a flat ground and the declared solids; there are no
    other collisions.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        timestep: float = 1e-3,
        integrator: MujocoIntegrator = "implicitfast",
        contacts: Sequence[ContactShape] = (),
        ground: Ground | None = None,
        solids: Sequence[Solid] = (),
        joint_limits: bool = True,
        friction: JointFriction | None = None,
        pushes: Sequence[Push] = (),
    ) -> None:
        """Build the MuJoCo model."""
        super().__init__(robot)
        mujoco = import_mujoco()
        if not 0.0 < timestep < np.inf:
            raise SimulationError(f"mujoco: timestep is {timestep}; must be positive")
        if integrator not in get_args(MujocoIntegrator):
            raise SimulationError(
                f"mujoco: integrator {integrator!r}: choose among "
                f"{', '.join(get_args(MujocoIntegrator))}"
            )
        self.timestep, self.integrator = timestep, integrator
        self.contacts = tuple(contacts)
        self.ground = Ground() if ground is None else ground
        self.solids = tuple(solids)
        if self.solids and not self.contacts:
            with within("solids"):
                raise SimulationError(
                    "nothing may touch them: declare contacts, the shapes of the robot "
                    "that may"
                )
        self.joint_limits, self.friction = joint_limits, friction
        self.pushes = Pushes(robot, pushes)
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
            integrator=integrator,
            joint_limits=joint_limits,
            friction=friction,
            geoms=geoms,
            ground=self.ground,
            solids=self.solids,
        )
        try:
            # MuJoCo's model
            self.model: Any = mujoco.MjModel.from_xml_string(self.mjcf)
        except ValueError as error:
            reason = str(error).strip().splitlines()[0]
            raise SimulationError(f"MuJoCo rejects {robot.name}: {reason}") from error
        self.data: Any = mujoco.MjData(self.model)  # MuJoCo's data
        names = [name for joint in joints for name in joint.mujoco_names]
        made = [self.model.joint(name) for name in names]
        # converts between Pinocchio's coordinates and MuJoCo's
        self.coordinates = MujocoCoordinates(
            robot,
            joints,
            {name: int(j.qposadr[0]) for name, j in zip(names, made, strict=True)},
            {name: int(j.dofadr[0]) for name, j in zip(names, made, strict=True)},
        )
        self._roots = FloatingRoots(robot)
        self._geoms = {
            self.model.geom(name).id: frame for name, frame in frame_of_geom.items()
        }
        self._data = robot.model.createData()
        self._origins = {c.frame: robot.frame_id(c.frame) for c in self.contacts}

    def reset(self, t: float, q: Array, v: Array) -> None:
        """Set the state; see `SampledPlant.reset`."""
        self._mujoco.mj_resetData(self.model, self.data)
        self.data.time = t
        self.coordinates.to_mujoco(q, v, self.data.qpos, self.data.qvel)

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Step MuJoCo from t to ``end``; see `SampledPlant.advance`."""
        data = self.data
        motors = self._roots.remove_effort(t, tau)
        steps = number_of_steps(end - t, self.timestep)
        h = self.model.opt.timestep = (end - t) / steps
        q, v = self.coordinates.from_mujoco(data.qpos, data.qvel)
        pushed = self.pushes.any_active(t, end)
        constant = self.coordinates.constant_effort and not pushed
        steps_at_once = steps if constant else 1
        for k in range(0, steps, steps_at_once):
            effort = motors + self.pushes.effort(t + (k + 0.5) * h, q)
            self.coordinates.effort_to_mujoco(q, effort, data.qfrc_applied)
            self._mujoco.mj_step(self.model, data, steps_at_once)
            check_motion(data, end)
            q, v = self.coordinates.from_mujoco(data.qpos, data.qvel)
        return q, v

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, LogChannel]:
        """Return each contact's force and moment at a true state under an effort."""
        if not self.contacts:
            return {}
        effort = self._roots.remove_effort(t, tau) + self.pushes.effort(t, q)
        self.coordinates.effort_to_mujoco(q, effort, self.data.qfrc_applied)
        self._mujoco.mj_forward(self.model, self.data)
        return contact_channels(self._wrenches(q)) | self._places()

    def contact_wrenches(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, Array]:
        """Return those of MuJoCo's last step; zeros before the first one."""
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
            for geom in self._geoms
        )

    def describe(self) -> dict[str, Any]:
        """Return its settings."""
        return {
            "type": "MujocoPlant",
            "mujoco": self._mujoco.__version__,
            "timestep": self.timestep,
            "integrator": self.integrator,
            "joint_limits": self.joint_limits,
            "contacts": to_json_data(self.contacts),
            "ground": to_json_data(self.ground),
            "solids": to_json_data(self.solids),
            "friction": to_json_data(self.friction),
            "pushes": to_json_data(self.pushes.pushes),
        }

    @property
    def _mujoco(self) -> Any:
        """The module mujoco; not an attribute, because a module cannot be pickled."""
        return importlib.import_module("mujoco")

    def _places(self) -> dict[str, LogChannel]:
        """Return position and orientation of each loose solid."""
        found = {}
        for solid in self.solids:
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
        """Return each contact's wrench about its frame's origin, in world axes."""
        model, data = self.robot.model, self._data
        pin.forwardKinematics(model, data, q)
        origins = {
            name: pin.updateFramePlacement(model, data, frame).translation
            for name, frame in self._origins.items()
        }
        return contact_wrenches(self.model, self.data, self._geoms, origins)


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

    @property
    def longest_step(self) -> float:
        """The longest step of MuJoCo [s]."""
        return self.timestep

    def engine(self, robot: Robot, integrator: Integrator) -> MujocoPlant:
        """Return the plant, which has its own integrator."""
        return MujocoPlant(
            robot,
            timestep=self.timestep,
            integrator=self.integrator,
            contacts=self.contacts,
            ground=self.ground,
            solids=self.solids,
            joint_limits=self.joint_limits,
            friction=self.joint_friction(robot),
            pushes=self.pushes,
        )
