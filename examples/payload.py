"""A gripper takes up 2 kg after a second: declared, and not."""

import hsp_control as hsp

robot = hsp.Robot.load("panda")
for declared in (True, False):
    hand = hsp.FramePose("panda_tcp", name="hand")
    load = hsp.changes.ChangePayload(
        frame="panda_hand", mass=2.0, center=[0, 0, 0.06], at=1.0, ramp=0.3
    )
    push = hsp.plants.Push(  # the weight of an undeclared payload
        frame="panda_hand", force=[0, 0, -2.0 * 9.81], start=1.0, duration=2.0
    )
    experiment = hsp.Experiment(
        robot,
        [hand],
        hsp.JointCentering(),
        changes=[load] if declared else [],
        plant=hsp.plants.RigidBody(pushes=[] if declared else [push]),
        compensation=hsp.compensation.Compensation(momentum_observer=None),
        simulation=hsp.simulation.SimulationSettings(3.0, control_period=0.001),
    )
    run = experiment.run()
    sagged = 1e3 * abs(run["task.hand.error"][:, :3]).max()
    print(f"{'declared' if declared else 'unknown'}: the hand sags {sagged:.2f} mm")
    run.save(f"out/payload_{'declared' if declared else 'unknown'}.npz")
