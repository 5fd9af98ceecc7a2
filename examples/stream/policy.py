"""A policy in another process: twenty goals a second for the hand of a Panda."""

import json
import math
import socket
import sys
import time

port, duration = int(sys.argv[1]), float(sys.argv[2])
goals = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
begin = time.monotonic()
while (t := time.monotonic() - begin) < duration:
    y, z = 0.15 * math.sin(1.5 * t), 0.45 + 0.1 * math.sin(3.0 * t)
    goal = {"t": t, "value": [0.4, y, z, 1.0, 0.0, 0.0, 0.0]}  # x, y, z, quaternion
    goals.sendto(json.dumps(goal).encode(), ("127.0.0.1", port))
    time.sleep(0.05)
