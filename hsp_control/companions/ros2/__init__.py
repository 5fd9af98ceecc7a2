"""Robots, simulated robots, targets and watchers on ROS 2's topics.

See page.md. Messages go over DDS, as those of ROS 2, without an installed ROS 2. Only
`address`, `installed` and `backend` may be imported without Cyclone DDS, which the
extra `hsp_control[ros2]` installs.
"""

from .backend import connect as connect
from .backend import publish as publish
