"""Messages of ROS 2 over DDS, as ROS 2 itself sends them; without ROS 2.

Only `address` and `installed` may be imported without Cyclone DDS, which the extra
`hsp_control[ros2]` brings.
"""
