"""LeRobot on an arm whose torques an ``hsp live`` loop computes: ``--robot.type=hsp``.

LeRobot imports this package by its name; then it knows the robot ``hsp`` and the
teleoperator ``hsp_leader``, an arm that another loop moves or that is led by hand, and
the camera ``hsp``, one of a simulated scene.
"""

from .camera import HspCamera
from .config_hsp import HspCameraConfig, HspLeaderConfig, HspRobotConfig
from .hsp import HspLeader, HspRobot

__all__ = [
    "HspCamera",
    "HspCameraConfig",
    "HspLeader",
    "HspLeaderConfig",
    "HspRobot",
    "HspRobotConfig",
]
