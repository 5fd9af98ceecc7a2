"""A leader without an arm: publishes states like a loop, of a hand on a small circle.

python leader.py HOST:PORT X Y Z
"""

import json
import socket
import sys
from math import cos, pi, sin
from time import monotonic, sleep

host, port = sys.argv[1].rsplit(":", 1)
x, y, z = map(float, sys.argv[2:])
states = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
begin, number = monotonic(), 0
while (t := monotonic() - begin) < 600.0:
    number += 1
    grown = min(t, 1.0)
    angle = 0.4 * pi * t
    hand = [x, y + 0.08 * grown * sin(angle), z + 0.08 * grown * (1.0 - cos(angle))]
    state = {
        "number": number,
        "phase": "running",
        "t": t,
        "joints": [],
        "q": [],
        "v": [],
        "frames": {"hand": [*hand, 1.0, 0.0, 0.0, 0.0]},
        "tasks": {
            "hand": {"actual": [*hand, 1.0, 0.0, 0.0, 0.0]},
            "fingers": {"actual": [0.02 + 0.015 * sin(angle)], "joints": ["finger"]},
        },
        "bounded": {},
        "status": "exact",
        "log": {},
    }
    states.sendto(json.dumps(state).encode(), (host, int(port)))
    sleep(0.01)
