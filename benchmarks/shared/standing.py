"""The common case on two feet: circles of the centre of mass and of a hand.

Robot, start, soles, trajectories, gains and posture have the same numbers for every
controller, and all are measured in the same way.
"""

from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import nnls

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.companions.mujoco import Ground
from hsp_control.companions.mujoco.plant import Mujoco, MujocoPlant
from hsp_control.constraints.contacts import SurfaceContact
from hsp_control.geometry.shapes import Box
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import ContactPlant, RigidContact
from hsp_control.trajectories import Blend, HoldOrientation

COM, HAND, TRUNK = "center_of_mass", "hand", "trunk"
PERIOD = 1e-3  # how long an effort is held [s]
FRICTION = 0.7  # coefficient of the ground, also in both controllers
CONTACT_DAMPING = 40.0  # Kd of the contacts; their stiffness is 0 [1/s]
FREQUENCY = 10.0  # ω0 of the critically damped tasks [rad/s]
GAIN, POSTURE_RATE = 6.0, 2.0  # K_N, and α of g = -α (q - q_start) [1/s]
EDGES = 16  # edges of the pyramid that approximates a friction cone in the check
THICKNESS = 0.02  # of the boxes that are the soles in MuJoCo [m]


@dataclass(frozen=True)
class Body:
    """The data that differ between the robots.

    Attributes:
        name: Name in the catalogue of robots.
        soles: Frames of the feet.
        size: Length and width of a sole, along the frame's x and y [m].
        center: Centre of the sole in its frame [m].
        hand: Frame of the hand.
        trunk: Frame of the trunk.
        locked: Joints that are fixed here, and their positions [rad].
        bent: Joints that differ from the home posture [rad].
    """

    name: str
    soles: tuple[str, str]
    size: tuple[float, float]
    center: tuple[float, float, float]
    hand: str
    trunk: str
    locked: dict[str, float] = field(default_factory=dict)
    bent: dict[str, float] = field(default_factory=dict)


def _both(name: str, value: float) -> dict[str, float]:
    return {f"{side}_{name}_joint": value for side in ("left", "right")}


TALOS = Body(
    "talos",
    ("left_sole_link", "right_sole_link"),
    (0.16, 0.1),
    (0.0, 0.0, 0.0),
    "gripper_right_base_link",
    "torso_2_link",
    locked={"gripper_left_joint": 0.0, "gripper_right_joint": 0.0},
)
# The spheres below G1's ankles, of 5 mm, are the corners of a sole.
G1 = Body(
    "g1",
    ("left_ankle_roll_link", "right_ankle_roll_link"),
    (0.17, 0.05),
    (0.035, 0.0, -0.035),
    "right_rubber_hand",
    "torso_link",
    bent=_both("hip_pitch", -0.3)
    | _both("knee", 0.6)
    | _both("ankle_pitch", -0.3)
    | _both("elbow", 0.6)
    | {"left_shoulder_roll_joint": 0.2, "right_shoulder_roll_joint": -0.2},
)


class Standing:
    """A robot that stands on both soles, and its tasks.

    Attributes:
        body: The data of the robot.
        robot: The robot.
        q0: Start configuration, at rest, with the soles on the ground, shape (nq,).
        weight: Weight of the robot [N].
        soles_at: Positions of the sole frames at the start, shapes (3,) [m].
        com: Trajectory of the centre of mass.
        hand: Trajectory of the hand.
        upright: Desired orientation of the trunk, shape (3, 3).
        gains: Gains of all tasks.
    """

    def __init__(self, body: Body) -> None:
        """Put the robot on its feet, and make the trajectories."""
        self.body = body
        self.robot = robot = hsp.Robot.load(body.name, locked=body.locked)
        q = robot.home().copy()
        for joint, value in body.bent.items():
            q[robot.joints[joint].idx_q] = value
        rest = np.zeros(robot.nv)
        sole = robot.state(0.0, q, rest).frame(body.soles[0])
        q[2] -= (sole.position + sole.rotation @ np.array(body.center))[2]
        self.q0 = q
        state = robot.state(0.0, q, rest)
        self.weight = 9.81 * sum(inertia.mass for inertia in robot.model.inertias)
        self.soles_at = [state.position(name).copy() for name in body.soles]
        up, ahead = [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]
        start = state.centroidal.position.copy()
        circle = hsp.Circle(0.03, 2.5, start, normal=up)
        self.com = Blend(circle, 1.5, start=start)
        start = state.position(body.hand).copy()
        circle = hsp.Circle(0.08, 3.8, start + np.array([0.05, 0.0, 0.1]), normal=ahead)
        self.hand = Blend(circle, 1.5, start=start)
        self.upright = state.frame(body.trunk).rotation.copy()
        self.gains = hsp.Gains(natural_frequency=FREQUENCY)
        self._reference = self.controller(limited=False, threshold=1e-6)  # an exact P
        self._state = hsp.RobotState(robot)
        self._edges = _cone_edges(self.corners)

    @property
    def corners(self) -> Array:
        """The corners of a sole in its frame, shape (4, 3) [m]."""
        x, y = 0.5 * np.array(self.body.size)
        flat = np.array([[x, y, 0.0], [x, -y, 0.0], [-x, y, 0.0], [-x, -y, 0.0]])
        return flat + np.array(self.body.center)

    def controller(
        self, *, limited: bool = True, threshold: float = 0.03
    ) -> hsp.Controller:
        """Return this law; its posture field excludes the root, as TSID's task does.

        All tasks are of one level, as in TSID.
        """
        robot, body = self.robot, self.body
        weights = np.full(robot.nv, POSTURE_RATE)
        weights[list(robot.unactuated)] = 0.0
        common: dict[str, Any] = {"gains": self.gains, "priority": 1}
        upright = HoldOrientation(self.upright)
        tasks = [
            hsp.CenterOfMass(self.com, **common, name=COM),
            hsp.FramePosition(body.hand, self.hand, **common, name=HAND),
            hsp.FrameOrientation(body.trunk, upright, **common, name=TRUNK),
        ]
        return hsp.Controller(
            robot,
            tasks,
            hsp.TargetPosture(self.q0, weights=weights),
            null_space_gain=GAIN,
            singularity_threshold=threshold,
            contacts=[
                SurfaceContact(
                    name,
                    corners=self.corners,
                    friction=FRICTION,
                    damping=CONTACT_DAMPING,
                )
                for name in body.soles
            ],
            limits=hsp.Limits(velocity=None, position=None) if limited else None,
        )

    # -- plants -----------------------------------------------------------------------

    def ideal(self) -> "Engine":
        """Return rigid contacts that hold any force, with a Runge-Kutta step."""
        soles = [RigidContact(name) for name in self.body.soles]
        plant, integrator = ContactPlant(self.robot, soles), Rk4(PERIOD)

        def advance(t: float, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
            acceleration = partial(_acceleration, plant, tau)
            return integrator.advance(self.robot, acceleration, t, t + PERIOD, q, v)

        return Engine(plant, advance)

    def mujoco(self) -> "Engine":
        """Return MuJoCo, with boxes as soles."""
        x, y, z = self.body.center
        shapes = [
            hsp.mujoco.ContactShape(name, Box((*self.body.size, THICKNESS)), at)
            for name in self.body.soles
            for at in [(x, y, z + 0.5 * THICKNESS)]
        ]
        plant = MujocoPlant(
            self.robot,
            Mujoco(
                contacts=shapes,
                ground=Ground(friction=FRICTION),
                joint_limits=False,
            ),
        )
        plant.reset(0.0, self.q0, np.zeros(self.robot.nv))

        def advance(t: float, q: Array, v: Array, tau: Array) -> tuple[Array, Array]:
            return plant.advance(t, t + PERIOD, tau)

        return Engine(plant, advance)

    # -- measurements -----------------------------------------------------------------

    def measure(self, t: float, q: Array, v: Array) -> dict[str, float]:
        """Measure one instant, in the same way for every controller."""
        state = self._state.update(t, q, v)
        output = self._reference.compute(t, q, v)
        errors = {
            name: float(np.linalg.norm(output.task.error[rows]))
            for name, rows in self._reference.task_rows.items()
        }
        feet = zip(self.body.soles, self.soles_at, strict=True)
        return errors | {
            "posture": float(np.linalg.norm(q[7:] - self.q0[7:])),
            "null_space_error": float(np.linalg.norm(output.null_space_error)),
            "slip": max(
                float(np.linalg.norm(state.position(name) - at)) for name, at in feet
            ),
        }

    def outside_cones(self, q: Array, wrenches: list[Array]) -> bool:
        """Return whether a sole's wrench needs pulling forces or more than friction.

        Args:
            q: Configuration, shape (nq,).
            wrenches: Force and moment on every sole, about its frame's origin, in world
                axes, shapes (6,) [N, N·m].
        """
        state = self._state.update(0.0, q, np.zeros(self.robot.nv))
        for name, wrench in zip(self.body.soles, wrenches, strict=True):
            R = state.frame(name).rotation
            local = np.concatenate([R.T @ wrench[:3], R.T @ wrench[3:]])
            if nnls(self._edges, local)[1] > 1e-3 * self.weight:
                return True
        return False


class Engine:
    """A plant, and the function that advances it by one period."""

    def __init__(self, plant: Any, advance: Any) -> None:
        """Set both."""
        self.plant, self.advance = plant, advance

    def wrenches(self, t: float, q: Array, v: Array, tau: Array) -> list[Array]:
        """Return the wrench on every sole, about its frame's origin, shapes (6,)."""
        channels = self.plant.log_channels(t, q, v, tau)
        forces = [name for name in channels if name.endswith(".force")]
        return [
            np.concatenate(
                [
                    channels[name].value,
                    channels[name.replace(".force", ".moment")].value,
                ]
            )
            for name in forces
        ]


def _acceleration(
    plant: ContactPlant, tau: Array, t: float, q: Array, v: Array
) -> Array:
    return plant.acceleration(t, q, v, tau)


def _cone_edges(corners: Array) -> Array:
    """Return wrenches of unit normal force along the edges, shape (6, 4 EDGES)."""
    around = 2.0 * np.pi * np.arange(EDGES) / EDGES
    side = FRICTION / np.cos(np.pi / EDGES)  # the pyramid contains the cone
    edge = np.column_stack(
        [side * np.cos(around), side * np.sin(around), np.ones(EDGES)]
    )
    columns = [
        np.hstack([edge, np.cross(np.broadcast_to(corner, edge.shape), edge)])
        for corner in corners
    ]
    return np.vstack(columns).T
