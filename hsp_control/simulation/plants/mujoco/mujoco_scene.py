"""The plant that is the scene of the robot's MJCF, as a value."""

from dataclasses import KW_ONLY
from pathlib import Path
from typing import Any

from hsp_control.common.exceptions import SimulationError
from hsp_control.declaration.quantities import Flag
from hsp_control.declaration.quantities import Names as NameList
from hsp_control.robot import Robot
from hsp_control.robot.description.mujoco.compiling import compile_mjcf
from hsp_control.robot.description.mujoco.names import Names
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants.declared import PlantPart
from hsp_control.simulation.plants.mujoco.engine import import_mujoco
from hsp_control.simulation.plants.mujoco.scene_plant import MujocoScenePlant


class MujocoScene(PlantPart, type="mujoco_scene"):
    """The MuJoCo scene that the robot is declared in, with all that is in it.

    The timestep, the integrator, friction and contacts are the scene's own. In Python,
    `MujocoScenePlant` takes any model and its data.
    """

    _: KW_ONLY
    contacts: NameList = ()
    """Bodies of the scene whose contact forces are logged [-]."""
    disable_servos: Flag = False
    """Whether servos on the robot's joints are switched off [-]; if not, they are an
    error."""

    def __post_init__(self) -> None:
        """Check that the scene is left as it is."""
        own = {"robot", "inertias", "payload", "motor_inertia"}
        if given := own & {*self.changed_fields()}:
            raise SimulationError(
                f"{', '.join(sorted(given))}: the scene has its own bodies; change "
                "them in the MJCF"
            )

    def engine(self, robot: Robot, integrator: Integrator) -> MujocoScenePlant:
        """Return the plant, which has its own integrator.

        Raises:
            SimulationError: If the robot has no MJCF, MuJoCo is not installed, or a
                servo acts on a joint of the robot.
            ModelError: If MuJoCo rejects the scene.
            FrameNotFoundError: If the scene has no such body.
        """
        description = robot.description
        if description is None or description.mjcf is None:
            raise SimulationError(
                f"{robot.name} is not declared by an MJCF, whose scene this plant "
                "would be; declare it with robot: {mjcf: ...}, or choose the plant "
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
    """Return the scene at its keyframe, with locked joints where the robot has them."""
    mujoco = import_mujoco()
    data = mujoco.MjData(model)
    if keyframe is not None:
        mujoco.mj_resetDataKeyframe(model, data, model.key(keyframe).id)
    joints = Names(model).joints
    for name, value in robot.source.locked.items():
        data.qpos[model.jnt_qposadr[joints.index(name)]] = value
    return data
