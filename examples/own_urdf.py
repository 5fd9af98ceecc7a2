"""An arm of your own: load its URDF, find a start, draw a circle with its tool."""

from pathlib import Path

import hsp_control as hsp

robot = hsp.Robot.load(Path(__file__).parent / "arm.urdf")  # yours
hand = hsp.FramePose(  # of the end effector that the URDF suggests
    trajectory=hsp.Circle(radius=0.08, angular_rate=2.0), blend=1.0
)
experiment = hsp.Experiment(
    robot,
    [hand],
    hsp.JointCentering(),
    null_space_gain=8.0,
    start="auto",  # a posture away from singularities and limits
    simulation=hsp.simulation.SimulationSettings(duration=4.0, control_period=0.001),
)
run = experiment.run()
print(experiment.controller.tasks[0].name, experiment.q0.round(2))
print(run, run.save("out/own_urdf.npz"))
