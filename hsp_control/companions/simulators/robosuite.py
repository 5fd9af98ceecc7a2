"""A controller for robosuite's arms, selected like its own OSC_POSE.

After importing this module, a controller configuration may contain::

    config = robosuite.load_composite_controller_config(robot="Panda")
    config["type"] = "HSP"  # as BASIC; but an arm may be of our type
    config["body_parts"]["right"]["type"] = "HSP_POSE"
    config["body_parts"]["right"]["hsp"] = "hand.yaml"  # or its data; or leave it out

Actions have the meaning that they have for OSC_POSE, whose code interprets them: deltas
or absolute poses, input and output ranges, reference frames. robosuite requests an
effort at every step of the simulation, at 500 Hz, whatever the rate of the actions.
"""

from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError, GainError
from hsp_control.companions.mujoco import MujocoCoordinates
from hsp_control.companions.mujoco.scene import Names, joint_actuators, motor
from hsp_control.companions.simulators.hand_control import HandControl
from hsp_control.companions.simulators.mujoco_arm import arm_of
from hsp_control.declaration import within
from hsp_control.tasks import Gains

try:
    from robosuite.controllers.composite import composite_controller
    from robosuite.controllers.parts.arm.osc import OperationalSpaceController
except ImportError as error:
    raise ControllerError(
        f"robosuite cannot be imported ({error}); "
        "hsp_control/companions/simulators/page.md shows how to install it"
    ) from error

TYPE = "HSP_POSE"
"""The ``type`` in an arm's configuration."""
_FIXED: dict[str, Any] = {
    "impedance_mode": "fixed",
    "interpolation": None,
    "position_limits": None,
    "orientation_limits": None,
}
"""Settings of OSC_POSE for which only one value is supported."""


class HspPose(OperationalSpaceController):  # type: ignore[misc]
    """A part controller whose efforts are those of the law.

    Attributes:
        hand: The law for this hand.
    """

    def __init__(self, hsp: Any = None, **settings: Any) -> None:
        """Build the arm of the compiled simulation, and its controller.

        Args:
            hsp: The path of a YAML file with `HandSettings`, or its data; None: the
                defaults.
            **settings: Those of OSC_POSE. ``kp`` and ``damping_ratio`` are the gains of
                the hand unless the file contains gains; ``uncouple_pos_ori``,
                ``kp_limits`` and ``damping_ratio_limits`` have no effect: position and
                orientation are always decoupled, and gains do not change.

        Raises:
            HspControlError: If a setting is wrong or not supported, the base moves, or
                an actuator is not a torque motor.
        """
        for key, value in _FIXED.items():
            given = settings.get(
                key, value
            )  # perhaps an array, which has no truth value
            if not isinstance(given, type(value)) or given != value:
                raise ControllerError(
                    f"{key}: {TYPE} supports {value!r} only; got {given!r}"
                )
        super().__init__(**settings)
        model, qpos = self.sim.model._model, self.sim.data.qpos
        frame = Names(model).sites[model.site(self.ref_name).id]
        robot = arm_of(model, qpos, frame, self.joint_names)
        self._coordinates = MujocoCoordinates.of(robot, model)
        self._factors = _motor_factors(model, robot.joint_names)
        self.hand = HandControl(robot, frame, hsp, gains=self._gains())

    def set_goal(self, action: Array) -> None:
        """Set the goal of an action; see OSC_POSE."""
        self._follow_jumps()
        super().set_goal(action)
        position, rotation = self.goal_pos, self.goal_ori
        if self.input_ref_frame == "base":
            position = self.origin_pos + self.origin_ori @ position
            rotation = self.origin_ori @ rotation
        self.hand.aim(pin.SE3(rotation, position), self._time)

    def run_controller(self) -> Array:
        """Return the torques of this step of the simulation, shape (joints,) [N·m]."""
        self._follow_jumps()
        period = float(self.sim.model.opt.timestep)
        tau = self.hand.effort(self._time, *self._state, period)
        self.torques = tau / self._factors
        self.new_update = True
        return self.torques

    def reset_goal(self, goal_update_mode: str = "achieved") -> None:
        """Restart: set the goal to the hand's pose."""
        super().reset_goal(goal_update_mode)
        self.hand.begin(self._time, *self._state)

    @property
    def name(self) -> str:
        """The controller's name."""
        return TYPE

    @property
    def _time(self) -> float:
        return float(self.sim.data.time)

    @property
    def _state(self) -> tuple[Array, Array]:
        data = self.sim.data
        return self._coordinates.from_mujoco(data.qpos, data.qvel)

    def _follow_jumps(self) -> None:
        """Restart if another state was loaded into the simulation."""
        if self.hand.has_jumped(self._time):
            self.update(force=True)
            self.reset_goal(self._goal_update_mode)

    def _gains(self) -> Gains:
        """Return Kp and Kv of OSC_POSE.

        Raises:
            GainError: If one of them is not positive.
        """
        for name, gains in (("kp", self.kp), ("damping_ratio", self.kd)):
            if not np.all(gains > 0.0):
                with within(name):
                    raise GainError(f"must be positive for {TYPE}")
        return Gains(kp=self.kp, kv=self.kd)


@composite_controller.register_composite_controller
class HspComposite(composite_controller.CompositeController):  # type: ignore[misc]
    """robosuite's BASIC, in which arms may be of the type HSP_POSE."""

    name = "HSP"

    def _init_controllers(self) -> None:
        for part, settings in self.part_controller_config.items():
            if settings["type"] == TYPE:
                made = HspPose(**{k: v for k, v in settings.items() if k != "type"})
            else:
                made = composite_controller.controller_factory(
                    part_name=part,
                    controller_type=settings["type"],
                    controller_params=settings,
                )
            self.part_controllers[part] = made


def _motor_factors(model: Any, joints: tuple[str, ...]) -> Array:
    """Return the effort per control of each joint's motor.

    Raises:
        ControllerError: If a joint is not driven by one torque motor.
    """
    names, by_joint = Names(model).joints, joint_actuators(model)
    factors = []
    for joint in joints:
        actuators = by_joint.get(names.index(joint), [])
        found = motor(model, actuators[0]) if len(actuators) == 1 else None
        if found is None or not found.factor:
            raise ControllerError(
                f"joint {joint!r} is not driven by exactly one torque motor"
            )
        factors.append(found.factor)
    return np.array(factors)
