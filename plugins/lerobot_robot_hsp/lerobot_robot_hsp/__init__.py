"""LeRobot on an arm whose torques an ``hsp live`` loop computes: ``--robot.type=hsp``.

LeRobot imports this package by its name; then it knows the robot ``hsp`` and the
teleoperator ``hsp_leader``, an arm that another loop moves or that is led by hand.
"""

from .config_hsp import HspLeaderConfig, HspRobotConfig
from .hsp import HspLeader, HspRobot

__all__ = ["HspLeader", "HspLeaderConfig", "HspRobot", "HspRobotConfig"]
