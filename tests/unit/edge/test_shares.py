"""The weight of the damped law near a singular posture, by NumPy's SVD."""

import numpy as np

from hsp_control import Controller, FramePose, Gains, JointCentering, Robot, engine
from hsp_control.engine.inspection import calls
from hsp_control.trajectories import HoldPose


def test_near_share_is_that_of_the_smallest_singular_value() -> None:
    """Elbows from 90° to nearly straight, with a distant target.

    μ = 3x² - 2x³ with x = 2 - 2σ/σ_x. Errors are small enough for this share alone.
    """
    robot, seen = Robot.load("panda"), []
    q, v, upper = robot.home(), np.zeros(7), robot.position_limits()[1]
    for angle in np.linspace(-1.6, upper[3] - 0.05, 60):
        q[3] = angle
        frame = robot.state(0.0, q, v).frame("panda_tcp")
        away = frame.position + np.array([0.05, 0.0, 0.05])
        target = FramePose(
            "panda_tcp",
            HoldPose(away, frame.rotation),
            gains=Gains(natural_frequency=20.0),
        )
        controller = Controller(robot, [target], JointCentering(), limits=None)
        controller.compute(0.0, q, v)
        law = controller.active_stack.law
        resolve = next(
            call.values
            for call in calls(controller.step_plan)
            if isinstance(call, engine.Call) and call.kind.name == "Resolve"
        )
        edge = max(resolve["following.near"], 2.0 * resolve["least"])
        J = law.problem.task.jacobian
        x = np.clip(2.0 - 2.0 * np.linalg.svd(J, compute_uv=False)[-1] / edge, 0.0, 1.0)
        expected = x * x * (3.0 - 2.0 * x)
        if law.edge_level[0]:
            seen.append(expected)
            np.testing.assert_allclose(law.edge.share, expected, atol=1e-10)
    assert sum(0.0 < share < 1.0 for share in seen) > 10
