"""A Franka Research 3, or its control box on this computer: `hsp franka-box`.

With the box in another terminal (`hsp franka-box panda_obstacle --lockstep`) it is
`python franka_arm.py 127.0.0.1`.
"""

import sys

import hsp_control as hsp
from hsp_control.companions.franka import connect

address = sys.argv[1] if len(sys.argv) > 1 else "172.16.0.2"
if address.startswith("127."):
    address += "?realtime=ignore&lockstep=true"  # no real-time kernel
robot = hsp.Robot.load("panda")  # of an arm: written by `hsp franka-model`
arm = connect(address, robot, 0.001)
experiment = hsp.load_experiment(
    "panda_obstacle",
    f"start={{configuration: {arm.q.tolist()}}}",  # where it is
    "tasks.hand.gains.natural_frequency=3",  # begin gently
    "null_space.gain=1",
)
settings = arm.adapted(experiment.scenario.live)
report = hsp.run_loop(
    experiment.controller, arm, duration=2.0, settings=settings,
    scene=experiment.scene, log="out/franka_arm.journal",
)  # fmt: skip
print(report.ended, report.reason, arm.fault or "")
