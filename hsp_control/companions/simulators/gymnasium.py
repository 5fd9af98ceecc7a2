"""Targets of a hand as actions of a Gymnasium environment with MuJoCo.

env = HandTargets(gymnasium.make("Pusher-v5"), "tips_arm", "hand.yaml", axes="xyz")
observation, reward, terminated, truncated, info = env.step([0.0, 0.5, 0.0])
"""

from math import inf, nan
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError, ShapeError
from hsp_control.companions.mujoco.plant import import_mujoco
from hsp_control.companions.mujoco.scene_plant import MujocoScenePlant
from hsp_control.companions.simulators.hand_control import HandControl
from hsp_control.companions.simulators.hand_settings import Source
from hsp_control.companions.simulators.mujoco_arm import arm_of
from hsp_control.tasks import Gains

try:
    import gymnasium
except ImportError as error:
    raise ControllerError(
        "Gymnasium is not installed; install it with: pip install gymnasium"
    ) from error

_GAINS = Gains(natural_frequency=12.0)
"""Default gains, close to those of robosuite's OSC_POSE."""
_NEEDED = "model", "data", "frame_skip", "do_simulation"
"""Required attributes, as of Gymnasium's ``MujocoEnv``."""


class HandTargets(
    gymnasium.Wrapper,  # type: ignore[misc]
    gymnasium.utils.RecordConstructorArgs,  # type: ignore[misc]
):
    """An environment whose actions are targets of a hand, instead of controls.

    At every step of the simulation the law computes the efforts of the arm: all joints
    between the world and the hand. Their own actuation is replaced. The other entries
    of the environment's own action, such as those of fingers, follow after the target.
    The environment sees zeros as the action of the arm, and so does a reward that
    includes it.

    An action is a change of the hand's pose, or, if ``absolute``, the pose itself: a
    position [m], and unless only ``axes`` are tracked, a rotation vector [rad], in
    world axes. A change begins where the hand is; its entries are clipped to ±1 and
    multiplied by ``scale``.

    Attributes:
        hand: The law for the hand.
        plant: The arm in the environment's scene.
    """

    def __init__(
        self,
        env: Any,
        frame: str,
        config: Source = None,
        *,
        axes: str | None = None,
        absolute: bool = False,
        scale: tuple[float, float] = (0.05, 0.5),
        disable_servos: bool = False,
    ) -> None:
        """Find the arm in the environment's scene, and take control of it.

        Args:
            env: The environment: Gymnasium's ``MujocoEnv`` below any wrappers, whose
                actions are the controls of its actuators.
            frame: The hand: a body or a site.
            config: The path of a YAML file with `HandSettings`, or its data.
            axes: World axes of a position, such as ``xyz``; None: the whole pose.
            absolute: Whether an action is a pose, and not a change.
            scale: The change of an action of 1: position [m], orientation [rad].
            disable_servos: See `MujocoScenePlant`.

        Raises:
            ControllerError: If it is not such an environment.
            HspControlError: If the hand does not exist, or a setting is wrong.
        """
        gymnasium.utils.RecordConstructorArgs.__init__(
            self,
            frame=frame,
            config=config,
            axes=axes,
            absolute=absolute,
            scale=scale,
            disable_servos=disable_servos,
        )
        gymnasium.Wrapper.__init__(self, env)
        base = env.unwrapped
        missing = [name for name in _NEEDED if not hasattr(base, name)]
        if missing:
            raise ControllerError(
                f"{type(base).__name__} is none of Gymnasium's MujocoEnv: it has no "
                f"{missing[0]}"
            )
        own = env.action_space
        if own.shape != (base.model.nu,):
            raise ControllerError(
                f"the actions of {type(base).__name__} have the shape {own.shape}; "
                f"needs a number for each of its {base.model.nu} controls"
            )
        robot = arm_of(base.model, base.data.qpos, frame)
        self.plant = MujocoScenePlant(
            robot, base.model, base.data, disable_servos=disable_servos
        )
        self.hand = HandControl(robot, frame, config, gains=_GAINS, axes=axes)
        self._absolute = absolute
        rows = 6 if axes is None else len(axes)
        linear, angular = _two_numbers(scale)
        self._scale = np.repeat([linear, angular], 3)[:rows]
        taken = {each.control for each in self.plant.motors.values()}
        self._others = [k for k in range(base.model.nu) if k not in taken]
        limit = np.full(rows, inf if absolute else 1.0)
        low, high = own.low[self._others], own.high[self._others]
        self.action_space = gymnasium.spaces.Box(
            np.concatenate([-limit, low]).astype(np.float32),
            np.concatenate([limit, high]).astype(np.float32),
        )
        base.do_simulation = self._simulate  # its method, which ``step`` calls

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Reset the environment, and set the target to the hand's pose."""
        observation, info = self.env.reset(seed=seed, options=options)
        self.hand.begin(self._time, *self._state)
        return observation, info

    def step(self, action: ArrayLike) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Move the hand towards the target of an action.

        Raises:
            ShapeError: If the action has another shape.
            NonFiniteError: If it contains NaN or inf.
        """
        given = np.asarray(action, dtype=float)
        if given.shape != self.action_space.shape:
            raise ShapeError(
                f"the action has shape {given.shape}; needs {self.action_space.shape}"
            )
        if self.hand.has_jumped(self._time):
            self.hand.begin(self._time, *self._state)
        rows = len(self._scale)
        self.hand.aim(self._goal(given[:rows]), self._time)
        own = self.env.action_space
        passed_on = np.zeros(own.shape, dtype=own.dtype)
        passed_on[self._others] = given[rows:]
        observation, reward, terminated, truncated, info = self.env.step(passed_on)
        return observation, reward, terminated, truncated, info

    @property
    def _time(self) -> float:
        return float(self.plant.data.time)

    @property
    def _state(self) -> tuple[Array, Array]:
        data = self.plant.data
        return self.plant.coordinates.from_mujoco(data.qpos, data.qvel)

    def _goal(self, target: Array) -> pin.SE3:
        """Return the pose commanded by the entries of an action."""
        here = self.hand.pose(self._state[0])
        if not self._absolute:
            target = np.clip(target, -1.0, 1.0) * self._scale
        indices = ["xyz".index(axis) for axis in self.hand.axes or "xyz"]
        position = here.translation if not self._absolute else np.zeros(3)
        position = position.copy()
        position[indices] += target[: len(indices)]
        if self.hand.axes is not None:
            return pin.SE3(here.rotation, position)
        turned = pin.exp3(target[3:])
        rotation = turned if self._absolute else turned @ here.rotation
        return pin.SE3(rotation, position)

    def _simulate(self, controls: Array, steps: int) -> None:
        """Advance the simulation, with the law's efforts: ``do_simulation``."""
        data, plant = self.plant.data, self.plant
        period = float(plant.model.opt.timestep)
        data.ctrl[:] = controls
        for _ in range(steps):
            t = self._time
            effort = self.hand.effort(t, *self._state, period)
            plant.advance(t, t + period, effort)
        import_mujoco().mj_rnePostConstraint(plant.model, data)


def _two_numbers(scale: Any) -> tuple[float, float]:
    """Return the two numbers of a scale.

    Raises:
        ControllerError: If it is anything else.
    """
    try:
        linear, angular = (float(each) for each in scale)
    except (TypeError, ValueError):
        linear = angular = nan
    if not (0.0 <= linear < inf and 0.0 <= angular < inf):
        raise ControllerError(
            f"scale: needs two numbers of at least 0, for position [m] and orientation "
            f"[rad]; got {scale!r}"
        )
    return linear, angular
