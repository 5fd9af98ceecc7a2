"""Time placo in its own environment: it needs another version of Pinocchio.

    .venv-placo/bin/python benchmarks/placo_side.py CASE.npz

Runs the case written by `Case.save` in closed loop, then times placo's dynamics solver
together with the operational-space controller. Both environments run that controller:
it is the reference that relates their times. Prints one line of JSON.
"""

import json
import re
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pinocchio as pin
import placo

from shared.controllers import operational_space
from shared.timing import Compute, step_times

PLANT_STEP = 2.5e-4  # [s]


@dataclass
class Saved:
    """The case, with the attributes that the operational-space controller needs."""

    data: Any
    robot: SimpleNamespace

    def __post_init__(self) -> None:
        """Read the constants."""
        self.rows, self.frame = int(self.data["rows"]), str(self.data["frame"])
        self.q0, self.period = self.data["q0"], float(self.data["period"])
        self.kp, self.kv, self.posture_kp, self.posture_kv = self.data["gains"]
        self.position, self.rotation = self.data["position"], self.data["rotation"]
        self.turning = self.data["turning"]

    def desired(self, t: float) -> tuple[SimpleNamespace, SimpleNamespace]:
        """Return desired position and orientation with derivatives at time t [s]."""
        k = min(round(t / self.period), len(self.position) - 1)
        x, w = self.position[k], self.turning[k]
        return (
            SimpleNamespace(position=x[0], velocity=x[1], acceleration=x[2]),
            SimpleNamespace(
                rotation=self.rotation[k],
                angular_velocity=w[0],
                angular_acceleration=w[1],
            ),
        )

    def posture_acceleration(self, t: float, q: Any, v: Any) -> Any:
        """Return the null-space acceleration."""
        return self.posture_kp * (self.q0 - q) - self.posture_kv * v


def rigid_fingers(urdf: Path, folder: Path) -> Path:
    """Write the URDF with fixed fingers and without meshes; return the file."""
    text = urdf.read_text()
    text = re.sub(
        r'(name="panda_finger_joint[12]" type=)"prismatic"', r'\1"fixed"', text
    )
    text = re.sub(r"<mimic[^>]*/>", "", text)
    text = re.sub(r"<(visual|collision)\b.*?</\1>", "", text, flags=re.DOTALL)
    target = folder / "robot.urdf"
    target.write_text(text)
    return target


def make_placo(case: Saved, urdf: Path) -> Compute:
    """Return placo's dynamics solver: soft frame task, posture task, torque limits."""
    robot = placo.RobotWrapper(str(urdf))
    solver = placo.DynamicsSolver(robot)
    solver.dt = case.period
    solver.mask_fbase(True)
    solver.enable_torque_limits(True)
    hand = solver.add_frame_task(case.frame, np.eye(4))
    hand.configure("hand", "soft", 1.0, 1.0)
    for part in (hand.position(), hand.orientation()):
        part.kp, part.kd = case.kp, case.kv
    if case.rows == 3:
        hand.configure("hand", "soft", 1.0, 0.0)
    posture = solver.add_joints_task()
    names = list(robot.joint_names())
    posture.set_joints(dict(zip(names, case.q0.tolist(), strict=True)))
    posture.configure("posture", "soft", 1e-3)
    posture.kp, posture.kd = case.posture_kp, case.posture_kv
    n, position, orientation = len(case.q0), hand.position(), hand.orientation()

    def compute(t: float, q: Any, v: Any) -> Any:
        x, R = case.desired(t)
        robot.state.q[-n:], robot.state.qd[-n:] = q, v
        robot.update_kinematics()
        position.target_world = x.position
        position.dtarget_world = x.velocity
        position.ddtarget_world = x.acceleration
        orientation.R_world_frame = R.rotation
        orientation.omega_world = R.angular_velocity
        orientation.domega_world = R.angular_acceleration
        return np.asarray(solver.solve(False).tau)[-n:]

    compute.kept = (robot, solver)  # type: ignore[attr-defined]
    return compute


def tracking(case: Saved, model: Any, compute: Compute) -> float:
    """Return the rms error of the hand [m] after the transient, in closed loop."""
    data, frame = model.createData(), model.getFrameId(case.frame)
    q, v, squares = case.q0.copy(), np.zeros(model.nv), []
    for k in range(len(case.position) - 1):
        t = k * case.period
        pin.framesForwardKinematics(model, data, q)
        if t >= float(case.data["settled"]):
            error = case.position[k, 0] - data.oMf[frame].translation
            squares.append(float(error @ error))
        tau = compute(t, q, v)
        for _ in range(round(case.period / PLANT_STEP)):
            v = v + PLANT_STEP * pin.aba(model, data, q, v, tau)
            q = pin.integrate(model, q, PLANT_STEP * v)
    return float(np.sqrt(np.mean(squares)))


def main() -> None:
    """Run, measure times, and print the result."""
    data = np.load(sys.argv[1])
    rounds, block = int(sys.argv[2]), int(sys.argv[3])
    with tempfile.TemporaryDirectory() as folder:
        urdf = rigid_fingers(Path(str(data["urdf"])), Path(folder))
        model = pin.buildModelFromUrdf(str(urdf))
        case = Saved(data, SimpleNamespace(model=model))
        controllers = {
            "placo": make_placo(case, urdf),
            "reference": operational_space.make(case),
        }
        rms = {name: tracking(case, model, c) for name, c in controllers.items()}
        states = list(zip(data["times"].tolist(), data["q"], data["v"], strict=True))
        times = step_times(controllers, states, rounds, block)
    print(
        json.dumps(
            {
                "rms": rms,
                "ratio": (times["placo"] / times["reference"]).tolist(),
                "microseconds": 1e6 * float(np.median(times["placo"])),
                "pin": pin.__version__,
            }
        )
    )


if __name__ == "__main__":
    main()
