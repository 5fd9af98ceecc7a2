"""A cost of your own, in both ways: as a function, and as a class that YAML knows.

`own_cost.yaml` beside it uses the class; this script runs both.
"""

import hsp_control as hsp
from hsp_control.declaration.quantities import Number


def elbow_to_the_left(state):
    """Return f, whose descent moves the elbow."""
    return (state.position("panda_link4")[1] - 0.25) ** 2


class ElbowAt(hsp.Cost, type="elbow_at"):
    """f = (y - side)²: the elbow goes to a side."""

    side: Number = 0.25
    """Where it goes [m]."""
    frame: str = "panda_link4"
    """Name of the frame [-]."""

    def value(self, state: hsp.RobotState) -> float:
        """Return f."""
        return (state.position(self.frame)[1] - self.side) ** 2


if __name__ == "__main__":
    robot = hsp.Robot.load("panda")
    for name, cost in {
        "function": hsp.FunctionCost(elbow_to_the_left, weight=20.0),
        "class": ElbowAt(weight=20.0),
    }.items():
        hand = hsp.FramePose("panda_tcp")
        field = cost + hsp.JointCentering(weight=0.2)
        controller = hsp.Controller(robot, [hand], field, null_space_gain=8.0)
        run = hsp.simulate(controller, robot.home(), duration=3.0, control_period=0.002)
        moved = run.measure(robot, lambda state: state.position("panda_link4")[1])
        print(f"{name}: the elbow goes from {moved[0]:.3f} to {moved[-1]:.3f} m")
        run.save(f"out/own_cost_{name}.npz")
