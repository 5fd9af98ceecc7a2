"""Options of LeRobot's command line for a loop."""

from dataclasses import dataclass, field

from lerobot.cameras import CameraConfig
from lerobot.robots import RobotConfig
from lerobot.teleoperators import TeleoperatorConfig


@CameraConfig.register_subclass("hsp")
@dataclass(kw_only=True)
class HspCameraConfig(CameraConfig):
    """A camera of a simulated scene."""

    camera: str  # its name in the scene
    url: str = "http://127.0.0.1:5008"  # of hsp live --cameras http://HOST:PORT
    timeout: float = 5.0  # of a picture [s]


@dataclass(kw_only=True)
class LoopConfig:
    """Where a loop publishes its state, and which part of it is an action."""

    states: str = "127.0.0.1:5006"  # HOST:PORT of hsp live --publish udp://HOST:PORT
    task: str = "hand"  # the task that follows actions
    action: str = "pose"  # pose: ee.x ... ee.wz; joints: JOINT.pos
    frame: str = ""  # whose pose is observed; by default the first of the state
    gripper_task: str = ""  # the joint_posture of a gripper; "": there is none
    timeout: float = 2.0  # silence after which the loop is regarded as ended [s]

    def __post_init__(self) -> None:
        """Check the action."""
        if self.action not in {"pose", "joints"}:
            raise ValueError(f"action is {self.action!r}; needs pose or joints")


@RobotConfig.register_subclass("hsp")
@dataclass(kw_only=True)
class HspRobotConfig(LoopConfig, RobotConfig):
    """An arm that a loop moves: simulated, a Franka, or another one."""

    targets: str = "127.0.0.1:5005"  # HOST:PORT, the source of the task's stream
    gripper_targets: str = "127.0.0.1:5007"  # that of the gripper's stream
    cameras: dict[str, CameraConfig] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check the action and the cameras."""
        LoopConfig.__post_init__(self)
        RobotConfig.__post_init__(self)


@TeleoperatorConfig.register_subclass("hsp_leader")
@dataclass(kw_only=True)
class HspLeaderConfig(LoopConfig, TeleoperatorConfig):
    """An arm whose loop publishes its pose, which the robot follows."""

    states: str = "127.0.0.1:5016"
