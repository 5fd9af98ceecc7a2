"""The cases of `edge.py`: targets out of reach, and some within.

"Out of reach" is certain: the target is that far beyond the arm's reach in its
direction with any posture. The nearest point is that of inverse kinematics, the best of
several starts.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.optimize import minimize

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.robot.inverse_kinematics import Target, reach
from shared.edge_loop import Case

KINDS = ("position", "pose", "stream", "step", "circle")
BEYOND = (0.05, 1.0)  # how far out of reach [m]
SPREAD = 0.3  # of the starts about a flexed posture [rad]
STEP, RADIUS, RATES = 0.5, 0.1, (2.0, 4.0)  # [m, m, rad/s]
STARTS = 8  # of inverse kinematics
ROOM = 0.1  # to the ends of joints along paths within reach [rad]
WELL = 0.05  # smallest singular value along them
HURRY = 0.5  # of the joints' speeds along them
POINTS = 24  # of a path

BENT = {
    "ur5": (0.0, -1.2, 1.8, -2.2, -1.57, 0.0),
    "xarm7": (0.0, -0.5, 0.0, 1.2, 0.0, 1.5, 0.0),
}
"""Postures to start about, where that of the robot is stretched."""


class Arm:
    """An arm, and where its hand can be."""

    def __init__(self, name: str) -> None:
        """Load the robot."""
        self.robot = hsp.Robot.load(name)
        self.name, self.frame = name, self.robot.end_effector
        home = self.robot.joint_positions(self.robot.home())
        self.bent = np.array(BENT.get(name, home))
        self.lower, self.upper = self.robot.position_limits()
        self._state = hsp.RobotState(self.robot)
        self._rest = np.zeros(self.robot.nv)

    def configuration(self, x: Array) -> Array:
        """Return q, shape (nq,), of displacements from neutral, shape (nv,)."""
        return self.robot.integrate(self.robot.neutral(), x)

    def at(self, x: Array) -> tuple[pin.SE3, Array]:
        """Return the hand's pose and Jacobian, shape (6, nv)."""
        q = self.configuration(x)
        frame = self._state.update(0.0, q, self._rest).frame(self.frame)
        pose = pin.SE3(frame.rotation.copy(), frame.position.copy())
        return pose, frame.jacobian.copy()

    def start(self, rng: np.random.Generator) -> Array:
        """Return displacements from neutral to start from, shape (nv,)."""
        q = self.bent + rng.uniform(-SPREAD, SPREAD, self.robot.nv)
        return np.clip(q, self.lower + ROOM, self.upper - ROOM)

    def extent(self, direction: Array, rng: np.random.Generator) -> float:
        """Return the largest coordinate of the hand in a direction [m]."""

        def cost(q: Array) -> tuple[float, Array]:
            pose, J = self.at(q)
            return -float(direction @ pose.translation), -(direction @ J[:3])

        return -float(min(self.minimized(cost, q).fun for q in self._starts(rng)))

    def nearest(self, target: Target, q0: Array, rng: np.random.Generator) -> Array:
        """Return the position that the hand has where it is nearest, shape (3,) [m]."""

        def cost(q: Array) -> tuple[float, Array]:
            pose, J = self.at(q)
            e = target.place.translation - pose.translation
            if target.rows == 6:
                turn = pin.log3(target.place.rotation @ pose.rotation.T)
                e = np.concatenate([e, turn])
            return 0.5 * float(e @ e), -(e @ J[: target.rows])

        found = []
        for q in (q0, *self._starts(rng)):
            start, lower, upper = self.configuration(q), self.lower, self.upper
            # refined, since its steps are made for targets within reach
            near = reach(self.robot, target, start, self.bent, lower, upper)
            x = self.robot.joint_positions(near.q)
            found.append(self.minimized(cost, np.clip(x, self.lower, self.upper)))
        best = min(found, key=lambda each: each.fun)
        return np.array(self.at(best.x)[0].translation)

    def follows(self, q: Array, poses: list[pin.SE3], rows: int, period: float) -> bool:
        """Return whether an arm can follow a path with ease, ``period`` a point [s]."""
        lower, upper = self.lower + ROOM, self.upper - ROOM
        fastest = HURRY * self.robot.model.velocityLimit
        for k, pose in enumerate(poses):
            target, start = Target(self.frame, pose, rows), self.configuration(q)
            found = reach(self.robot, target, start, q, lower, upper)
            x = self.robot.joint_positions(found.q)
            _, J = self.at(x)
            well = np.linalg.svd(J[:rows], compute_uv=False)[-1] >= WELL
            turned = np.abs(self.robot.difference(start, found.q))
            slow = k == 0 or (turned <= fastest * period).all()
            if not (found.converged and well and slow):
                return False
            q = x
        return True

    def _starts(self, rng: np.random.Generator) -> Iterator[Array]:
        low, high = np.maximum(self.lower, -np.pi), np.minimum(self.upper, np.pi)
        for _ in range(STARTS):
            yield rng.uniform(low, high)

    def minimized(self, cost: Callable[[Array], tuple[float, Array]], q: Array) -> Any:
        """Return SciPy's result: where a cost is least, downhill from q."""
        bounds = list(zip(self.lower, self.upper, strict=True))
        return minimize(cost, q, jac=True, bounds=bounds, method="L-BFGS-B")


def unit(rng: np.random.Generator) -> Array:
    """Return a random direction."""
    d = rng.normal(size=3)
    return np.asarray(d / np.linalg.norm(d))


def case(arm: Arm, kind: str, rng: np.random.Generator) -> Case:
    """Return a random case of a kind."""
    rows = 3 if kind in ("position", "step") else 6
    while True:
        q0 = arm.start(rng)
        here, _ = arm.at(q0)
        start, rotation = here.translation, here.rotation
        made = Case(
            arm.name, kind, str(arm.robot.source.urdf), list(arm.robot.model.names),
            arm.frame, rows, arm.configuration(q0), start, rotation, start, start,
        )  # fmt: skip
        if kind == "step":
            made.goal = made.nearest = start + STEP * unit(rng)
            way = np.linspace(0.0, 1.0, POINTS)[:, None] * (made.goal - start) + start
            if arm.follows(q0, [pin.SE3(rotation, x) for x in way], rows, 1.0):
                return made
        elif kind == "circle":
            a, b = unit(rng), unit(rng)
            b -= (a @ b) * a
            made.plane = np.array([a, b / np.linalg.norm(b)])
            made.radius, made.rate = RADIUS, float(rng.uniform(*RATES))
            turn = made.duration - made.measured_from
            times = made.measured_from + np.linspace(0.0, turn, POINTS + 1)
            way = [made.desired(t).position for t in times]
            poses = [pin.SE3(rotation, x) for x in way]
            if arm.follows(q0, poses, rows, turn / POINTS):
                return made
        else:
            d = unit(rng)
            away = arm.extent(d, rng) - d @ start + rng.uniform(*BEYOND)
            made.goal = start + away * d
            target = Target(arm.frame, pin.SE3(rotation, made.goal), rows)
            made.nearest = arm.nearest(target, q0, rng)
            return made


def cases(robots: list[str], count: int) -> list[Case]:
    """Return ``count`` cases of each kind for every robot; the same in every call."""
    found = []
    for name in robots:
        arm = Arm(name)
        for kind in KINDS:
            for seed in range(count):
                rng = np.random.default_rng([seed, KINDS.index(kind)])
                found.append(case(arm, kind, rng))
    return found
