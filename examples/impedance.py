"""A hand that is a spring: a push of 20 N deflects it by F/k."""

import hsp_control as hsp

robot = hsp.Robot.load("panda")
spring = hsp.Impedance([400, 400, 400, 30, 30, 30], damping_ratio=0.8)
hand = hsp.FramePose("panda_tcp", impedance=spring, name="hand")
push = {"frame": "panda_tcp", "force": [0, 20, 0], "start": 1, "duration": 2}
experiment = hsp.Experiment(
    robot,
    [hand],
    hsp.TargetPosture("home"),
    plant=hsp.plants.RigidBody(pushes=[hsp.plants.Push(**push)]),
    simulation=hsp.simulation.SimulationSettings(duration=4.0, control_period=0.001),
)
run = experiment.run()
moved = run["task.hand.actual"][:, 1] - run["task.hand.reference"][:, 1]
print(f"20 N / 400 N/m = 50 mm; the hand moved {1e3 * abs(moved).max():.1f} mm")
print(run, run.save("out/impedance.npz"))
