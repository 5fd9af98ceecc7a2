"""What users write, for a type checker: `make lint` runs it over this file.

An error that is expected is ignored by its name; strict checking refuses an ignored
error that does not occur. Nothing here is run.
"""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import hsp_control as hsp

# -- what a bare value means --------------------------------------------------------

hsp.FramePosition("hand", [0.3, 0.0, 0.5])
hsp.FramePosition("hand", np.zeros(3), gains=hsp.Gains(natural_frequency=4))
hsp.FramePosition("hand", hsp.Circle(0.1, angular_rate=2.0))
hsp.FrameOrientation("hand", [0.0, 0.0, 0.0, 1.0])
hsp.FramePose("hand", pin.SE3.Identity())
hsp.FramePose("hand", [0.3, 0.0, 0.5])
hsp.Obstacle("ball", hsp.Sphere(0.1), (0, 0, 1))
hsp.changes.MoveObstacle("ball", [0, 0, 1], at=1.0)
hsp.changes.ChangeReference("hand", [0.3, 0.0, 0.5], at=1.0)

point: hsp.trajectories.Trajectory = hsp.FramePosition("hand", [0.3, 0, 0.5]).trajectory
center: hsp.trajectories.Trajectory = hsp.Obstacle(
    "ball", hsp.Sphere(0.1), [0, 0, 1]
).center


def run(robot: hsp.Robot) -> NDArray[np.float64]:
    """Return the efforts of a run."""
    controller = hsp.Controller(robot, tasks=[hsp.FramePosition("hand", [0.3, 0, 0.5])])
    controller.at(1.0).reference("hand", [0.4, 0.0, 0.5])
    controller.set_target("hand", [0.3, 0.1, 0.5])
    rollout = hsp.simulate(controller, np.zeros(7), duration=1.0)
    hsp.plots.draw_efforts  # noqa: B018
    return rollout.tau


# -- what a checker and an editor say ----------------------------------------------

hsp.FramPose  # type: ignore[attr-defined]  # noqa: B018
hsp.plots.draw_eforts  # type: ignore[attr-defined]  # noqa: B018
hsp.fields.JointCentring  # type: ignore[attr-defined]  # noqa: B018
hsp.FramePosition("hand", {0.3, 0.0, 0.5})  # type: ignore[arg-type]
hsp.FramePosition("hand", target=[0.3, 0.0, 0.5])  # type: ignore[call-arg]
hsp.Controller("panda", tasks=[])  # type: ignore[arg-type]
hsp.Circle([0.3, 0.0, 0.5], 0.1)  # type: ignore[arg-type]
