"""Robots, simulated robots and watchers on ROS 2's topics; see docs/ros2.md."""

from .backend import connect as connect
from .backend import publish as publish
