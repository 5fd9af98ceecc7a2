"""The robot and the leader: LeRobot's calls as datagrams of a loop."""

from functools import cached_property
from typing import Any

from hsp_datagrams import Loop, LoopError, quaternion_of, rotation_vector_of
from lerobot.cameras.utils import make_cameras_from_configs
from lerobot.robots import Robot
from lerobot.teleoperators import Teleoperator
from lerobot.utils.errors import DeviceAlreadyConnectedError, DeviceNotConnectedError

from .config_hsp import HspLeaderConfig, HspRobotConfig, LoopConfig

_POSE = ("ee.x", "ee.y", "ee.z", "ee.wx", "ee.wy", "ee.wz")
_WRENCH = ("ee.fx", "ee.fy", "ee.fz", "ee.mx", "ee.my", "ee.mz")
GRIPPER = "gripper.pos"
_ANSWER = 2.0
"""Longest time until a Franka's gripper answers: a motion of its fingers [s]."""


class Arm:
    """Reads a loop's states, and knows the names of their numbers."""

    def __init__(self, config: LoopConfig) -> None:
        """Begin without a connection."""
        self._config = config
        self._loop: Loop | None = None
        self._turn: list[float] | None = None  # the last rotation vector

    @property
    def loop(self) -> Loop:
        """The connection."""
        if self._loop is None:
            raise DeviceNotConnectedError("the loop is not connected; call connect()")
        return self._loop

    @property
    def is_connected(self) -> bool:
        """Whether it listens."""
        return self._loop is not None

    def connect(self) -> None:
        """Listen, and wait for the first state."""
        if self._loop is not None:
            raise DeviceAlreadyConnectedError("the loop is already connected")
        loop = self._loop = Loop(self._config.states, self._config.timeout)
        try:
            self._check(loop.state())
        except Exception:
            self.disconnect()
            raise
        self._turn = None

    def disconnect(self) -> None:
        """Stop listening; the loop goes on."""
        self.loop.close()
        self._loop = None

    @cached_property
    def first(self) -> dict[str, Any]:
        """A state of the loop, for names: LeRobot reads them before it connects."""
        if self._loop is not None:
            return self._loop.state()
        self.connect()
        try:
            return self.loop.state()
        finally:
            self.disconnect()

    @property
    def action_features(self) -> dict[str, type]:
        """The names of an action's numbers."""
        names = [*_POSE] if self._config.action == "pose" else self._joints(self.first)
        if self._config.gripper_task:
            names.append(GRIPPER)
        return dict.fromkeys(names, float)

    @property
    def observation_features(self) -> dict[str, type]:
        """The names of an observation's numbers."""
        return dict.fromkeys(self.observation(self.first), float)

    def observation(self, state: dict[str, Any]) -> dict[str, float]:
        """Return the numbers of an observation."""
        config = self._config
        found = {}
        for k, joint in enumerate(state["joints"]):
            found[f"{joint}.pos"], found[f"{joint}.vel"] = state["q"][k], state["v"][k]
        found.update(self.pose(state))
        wrench = state["log"].get(f"observer.wrench.{config.task}", ())
        found.update(zip(_WRENCH, wrench, strict=False))
        for name, value in state["log"].items():
            if name.startswith("contact.") and len(value) == 1:
                found[name] = value[0]
        found["ee.bounded"] = state["bounded"].get(config.task, 0.0)
        found["limited"] = float(state["status"] in {"limited", "relaxed"})
        if config.gripper_task:
            found[GRIPPER] = self._opening(state)
        return {
            name: float("nan") if value is None else float(value)
            for name, value in found.items()
        }

    def pose(self, state: dict[str, Any]) -> dict[str, float]:
        """Return the hand's pose, its rotation as a vector that does not jump."""
        *position, x, y, z, w = state["frames"][self._frame(state)]
        self._turn = rotation_vector_of((x, y, z, w), self._turn)
        return dict(zip(_POSE, [*position, *self._turn], strict=True))

    def action(self, state: dict[str, Any]) -> dict[str, float]:
        """Return the action that leads a follower to a state."""
        config = self._config
        if config.action == "pose":
            found = self.pose(state)
        else:
            where = state["tasks"][config.task]["actual"]
            found = dict(zip(self._joints(state), where, strict=True))
        if config.gripper_task:
            found[GRIPPER] = self._opening(state)
        return found

    def values(self, action: dict[str, Any]) -> list[float]:
        """Return the target that an action declares, as a stream receives it."""
        missing = [name for name in self.action_features if name not in action]
        if missing:
            raise ValueError(f"the action has no {missing[0]}; it needs {missing}")
        if self._config.action == "joints":
            return [float(action[name]) for name in self._joints(self.first)]
        numbers = [float(action[name]) for name in _POSE]
        return numbers[:3] + quaternion_of(numbers[3:])

    def _opening(self, state: dict[str, Any]) -> float | None:
        """Return the opening, by the gripper's task or as a Franka's gripper sends."""
        task = state["tasks"].get(self._config.gripper_task)
        if task is not None or self._loop is None:
            return task["actual"][0] if task else None
        return self._loop.opening(self._config.gripper_targets)

    def _joints(self, state: dict[str, Any]) -> list[str]:
        return [f"{each}.pos" for each in state["tasks"][self._config.task]["joints"]]

    def _frame(self, state: dict[str, Any]) -> str:
        return self._config.frame or next(iter(state["frames"]))

    def _has_gripper(self) -> bool:
        """Whether a Franka's gripper answers at the address of its targets."""
        there = getattr(self._config, "gripper_targets", "")
        return bool(there) and self.loop.opening(there, _ANSWER) is not None

    def _check(self, state: dict[str, Any]) -> None:
        """Refuse a loop without the requested tasks and frame."""
        config, tasks = self._config, state["tasks"]
        for task in filter(None, (config.task, config.gripper_task)):
            if task not in tasks and not (task != config.task and self._has_gripper()):
                raise LoopError(f"the loop has no task {task!r}; it has {[*tasks]}")
        if config.action == "joints" and "joints" not in tasks[config.task]:
            raise LoopError(f"task {config.task!r} moves no joints; action is joints")
        if self._frame(state) not in state["frames"]:
            raise LoopError(
                f"the loop publishes no pose of {config.frame!r}; "
                f"it has {[*state['frames']]}"
            )


class Uncalibrated:
    """LeRobot's interface to a device that calibrates itself."""

    is_calibrated = True

    def calibrate(self) -> None:
        """Do nothing."""

    def configure(self) -> None:
        """Do nothing: the configuration of ``hsp live`` has all."""


class HspRobot(Uncalibrated, Robot):
    """An arm that a loop moves, on the other side of a socket."""

    config_class = HspRobotConfig
    name = "hsp"

    def __init__(self, config: HspRobotConfig) -> None:
        """Begin without a connection."""
        super().__init__(config)
        self.config, self.arm = config, Arm(config)
        self.cameras = make_cameras_from_configs(config.cameras)

    @property
    def observation_features(self) -> dict[str, Any]:
        """Joints, the hand, forces, whether its target is bounded; then the cameras."""
        images = {
            name: (each.height, each.width, 3)
            for name, each in self.config.cameras.items()
        }
        return {**self.arm.observation_features, **images}

    @property
    def action_features(self) -> dict[str, type]:
        """A pose of the hand or joint positions, and the gripper's if there is one."""
        return self.arm.action_features

    @property
    def is_connected(self) -> bool:
        """Whether it receives the loop's states, and all cameras are open."""
        cameras = self.cameras.values()
        return self.arm.is_connected and all(each.is_connected for each in cameras)

    def connect(self, calibrate: bool = True) -> None:
        """Listen to the loop, and open the cameras.

        Raises:
            LoopError: If no loop publishes its state, or it lacks a requested task.
        """
        self.arm.connect()
        try:
            for camera in self.cameras.values():
                camera.connect()
        except Exception:
            self.disconnect()
            raise

    def get_observation(self) -> dict[str, Any]:
        """Return the newest state and pictures.

        Raises:
            LoopError: If the loop has ended, with its reason, or is silent.
        """
        numbers = self.arm.observation(self.arm.loop.state())
        return numbers | {
            name: each.async_read() for name, each in self.cameras.items()
        }

    def send_action(self, action: dict[str, Any]) -> dict[str, Any]:
        """Send a target, and return it as it was sent.

        The loop goes there within its bounds; a target out of reach is no error, and
        ``ee.bounded`` is its distance beyond them.
        """
        self.arm.loop.send(self.config.targets, self.arm.values(action))
        if self.config.gripper_task:
            opening = [float(action[GRIPPER])]
            self.arm.loop.send(self.config.gripper_targets, opening)
        return {name: float(action[name]) for name in self.action_features}

    def send_chunk(self, actions: list[dict[str, Any]], times: list[float]) -> None:
        """Send a policy's chunk, which replaces the rest of earlier ones.

        Args:
            actions: One after another, as for `send_action`.
            times: When, from now, increasing [s]; of an old chunk the first are past.
        """
        rows = [self.arm.values(each) for each in actions]
        self.arm.loop.send_chunk(self.config.targets, rows, times)
        if self.config.gripper_task:
            openings = [[float(each[GRIPPER])] for each in actions]
            self.arm.loop.send_chunk(self.config.gripper_targets, openings, times)

    def disconnect(self) -> None:
        """Close the cameras and stop listening; the loop holds the arm."""
        for camera in self.cameras.values():
            if camera.is_connected:
                camera.disconnect()
        self.arm.disconnect()


class HspLeader(Uncalibrated, Teleoperator):
    """An arm that is led by hand, or moved by its own loop; actions are where it is."""

    config_class = HspLeaderConfig
    name = "hsp_leader"

    def __init__(self, config: HspLeaderConfig) -> None:
        """Begin without a connection."""
        super().__init__(config)
        self.arm = Arm(config)

    @property
    def action_features(self) -> dict[str, type]:
        """Those of a robot with the same settings."""
        return self.arm.action_features

    @property
    def feedback_features(self) -> dict[str, type]:
        """None: it feels nothing."""
        return {}

    @property
    def is_connected(self) -> bool:
        """Whether it receives its loop's states."""
        return self.arm.is_connected

    def connect(self, calibrate: bool = True) -> None:
        """Listen to the leader's loop.

        Raises:
            LoopError: If no loop publishes its state, or it lacks a requested task.
        """
        self.arm.connect()

    def get_action(self) -> dict[str, float]:
        """Return where the leader is.

        Raises:
            LoopError: If its loop has ended, with its reason, or is silent.
        """
        return self.arm.action(self.arm.loop.state())

    def send_feedback(self, feedback: dict[str, Any]) -> None:
        """Do nothing."""

    def disconnect(self) -> None:
        """Stop listening."""
        self.arm.disconnect()
