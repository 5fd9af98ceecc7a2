"""Random states and references through the public step: no NaN, no excessive effort.

A batch is a random controller (a position, a pose or several levels, one of many
fields, a metric, limits) and a thousand adverse states: anywhere within the joints'
limits, on them, beyond, stretched; at rest or at ten times the largest speed.
References are near, far, fast or out of reach, since trajectory and time are random,
too; with rate limits the previous effort is random.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache
from time import monotonic

import numpy as np

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.geometry.scene import Scene, Start
from hsp_control.robot import RobotState

BATCH = 1000
PERIOD = 1e-3
"""The control period of rate limits [s]."""
ROUNDING = 1e-9
"""Tolerated excess of an effort over its limit, relative to it."""
OWN_EFFORTS = {"planar3r": (60.0, 40.0, 20.0)}
"""Limits for a robot without any [N·m]: slightly above and below gravity's efforts."""
OTHERS = (
    "dual_panda", "tiago_reach", "ur5_position", "whole_body/baxter_two_hands",
    "whole_body/solo12_trunk", "whole_body/talos_circle",
)  # fmt: skip
"""Bundled configurations whose own controllers are tried, too."""


@dataclass
class Tally:
    """The outcome of many steps.

    Attributes:
        steps: Steps.
        not_finite: Steps whose effort or acceleration holds a NaN or an infinity.
        beyond: Steps whose effort or rate exceeds its limit.
        worst: The largest effort relative to its limit.
        raised: Steps that were refused, by the name of the error.
        status: Steps by `ControlOutput.status`.
        damped: Steps near a singularity.
        limited: Steps with limited efforts.
        examples: The first failures: batch and step.
        seconds: Its duration [s].
    """

    steps: int = 0
    not_finite: int = 0
    beyond: int = 0
    worst: float = 0.0
    raised: Counter[str] = field(default_factory=Counter)
    status: Counter[int] = field(default_factory=Counter)
    damped: int = 0
    limited: int = 0
    examples: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def note(self, where: str, problem: str) -> None:
        """Keep an example of a failure."""
        if len(self.examples) < 20:
            self.examples.append(f"{where}: {problem[:200]}")

    @property
    def good(self) -> bool:
        """Whether every step gave an effort within the limits."""
        return not (self.not_finite or self.beyond or self.raised)


def bundled(name: str, seed: int, steps: int) -> Iterator[Tally]:
    """Step a bundled robot with random controllers; yield after every batch."""
    robot = hsp.Robot.load(name)
    yield from _drive(robot, seed, steps, lambda rng: drawn_controller(robot, rng))


def configured(config: str, seed: int, steps: int) -> Iterator[Tally]:
    """Step the robot of a bundled configuration with its own controller and limits."""
    experiment = hsp.load_experiment(config)
    if experiment.scenario.limits is None:
        limits = "limits={position: none, velocity: none}"
        experiment = hsp.load_experiment(config, limits)
    yield from _drive(experiment.robot, seed, steps, lambda _: experiment.controller)


def _drive(
    robot: hsp.Robot,
    seed: int,
    steps: int,
    controller_of: Callable[[np.random.Generator], hsp.Controller],
) -> Iterator[Tally]:
    tally, state, start = Tally(), RobotState(robot), monotonic()
    for batch in range(-(-steps // BATCH)):
        rng = np.random.default_rng([seed, batch])
        controller, count = controller_of(rng), min(BATCH, steps - batch * BATCH)
        times = np.where(rng.random(count) < 0.1, 0.0, rng.uniform(0.0, 100.0, count))
        q = drawn_configurations(robot, rng, count)
        v = drawn_velocities(robot, rng, count)
        step = _Step(controller, rng, tally)
        for k in range(count):
            step.take(state.update(times[k], q[k], v[k]), f"batch {batch}, step {k}")
        tally.seconds = monotonic() - start
        yield tally


class _Step:
    """Steps of one controller, checked."""

    def __init__(
        self, controller: hsp.Controller, rng: np.random.Generator, tally: Tally
    ) -> None:
        robot, limits = controller.robot, controller.limits
        self._controller, self._rng, self._tally = controller, rng, tally
        self._motors = np.setdiff1d(np.arange(robot.nv), robot.unactuated)
        self._effort = np.full(robot.nv, np.inf) if limits is None else limits.effort
        self._rate = np.full(robot.nv, np.inf)
        if limits is not None:
            self._rate = limits.effort_rate
        self._rated = bool(np.isfinite(self._rate).any())
        self._slack = ROUNDING * np.clip(self._effort, 1.0, 1e6)

    def take(self, state: RobotState, where: str) -> None:
        """Make a step and record its outcome."""
        tally = self._tally
        low, high = -self._effort, self._effort
        if self._rated:
            self._controller.restart()
            if self._rng.random() < 0.7:
                share = self._rng.uniform(-1.0, 1.0, len(low))
                last = np.minimum(self._effort, 1e6) * share
                self._controller.applied(last, PERIOD)
                low = np.maximum(low, last - PERIOD * self._rate)
                high = np.minimum(high, last + PERIOD * self._rate)
        tally.steps += 1
        try:
            output = self._controller.compute(state)
        except hsp.HspControlError as error:
            tally.raised[type(error).__name__] += 1
            tally.note(where, str(error))
            return
        tau, motors = output.tau, self._motors
        tally.status[output.status] += 1
        tally.damped += bool(output.damped)
        if not (np.isfinite(tau).all() and np.isfinite(output.acceleration).all()):
            tally.not_finite += 1
            tally.note(where, "not finite")
            return
        tally.limited += bool(np.isfinite(self._effort).any())
        used = float((np.abs(tau) / self._effort)[motors].max(initial=0.0))
        tally.worst = max(tally.worst, used)
        beyond = (tau < low - self._slack) | (tau > high + self._slack)
        if beyond[motors].any():
            tally.beyond += 1
            tally.note(where, "beyond its limit")


# ------------------------------------------------------------------ random choices


def drawn_configurations(
    robot: hsp.Robot, rng: np.random.Generator, count: int
) -> Array:
    """Return configurations, shape (count, nq), among them bad ones."""
    lower, upper = robot.position_limits()
    lower = np.where(np.isfinite(lower), lower, -np.pi)
    upper = np.where(np.isfinite(upper), upper, np.pi)
    middle, half, shape = (
        0.5 * (lower + upper),
        0.5 * (upper - lower),
        (count, robot.nv),
    )
    anywhere = middle + half * rng.uniform(-1.0, 1.0, shape)
    ends = np.where(rng.random(shape) < 0.5, lower, upper)
    on_limits = np.where(rng.random(shape) < rng.random((count, 1)), ends, anywhere)
    beyond = middle + 1.5 * half * rng.uniform(-1.0, 1.0, shape)
    noise = rng.choice([0.0, 1e-12, 1e-6, 1e-3], (count, 1))
    stretched = 0.5 * np.pi * rng.integers(-2, 3, shape)  # or folded, or nearly so
    stretched = stretched + noise * rng.standard_normal(shape)
    kinds = np.array([anywhere, on_limits, beyond, stretched])
    chosen = rng.choice(4, count, p=[0.55, 0.15, 0.1, 0.2])
    neutral = robot.neutral()
    drawn = kinds[chosen, np.arange(count)]
    return np.array([robot.integrate(neutral, row) for row in drawn])


def drawn_velocities(robot: hsp.Robot, rng: np.random.Generator, count: int) -> Array:
    """Return velocities, shape (count, nv): zero, or up to ten times the limit."""
    greatest = robot.model.upperVelocityLimit
    known = np.isfinite(greatest) & (greatest > 0.0) & (greatest < 100.0)
    scale = 10.0 ** rng.uniform(-4.0, 1.0, count) * (rng.random(count) > 0.1)
    share = rng.uniform(-1.0, 1.0, (count, robot.nv))
    return scale[:, None] * np.where(known, greatest, 3.0) * share


def drawn_controller(robot: hsp.Robot, rng: np.random.Generator) -> hsp.Controller:
    """Return a controller for a fixed arm; a quarter of them is limited."""
    return hsp.Controller(
        robot,
        _tasks(robot, rng),
        _field(robot, rng),
        null_space_gain=10.0 ** rng.uniform(-1.0, 2.0),
        metric=hsp.metrics.MassMatrixMetric() if rng.random() < 0.3 else None,
        singularity_threshold=10.0 ** rng.uniform(-4.0, -1.0),
        limits=_limits(robot, rng) if rng.random() < 0.25 else None,
        start=robot.home(),
    )


def _trajectory(center: Array, rng: np.random.Generator) -> hsp.trajectories.Lissajous:
    """Return a path about a point: near, far, or out of reach; slow or fast."""
    n, far = len(center), 10.0 ** rng.uniform(-3.0, 1.0)
    middle = center + far * rng.uniform(-1.0, 1.0, n)
    return hsp.trajectories.Lissajous(
        10.0 ** rng.uniform(-3.0, 0.5) * rng.uniform(-1.0, 1.0, n),
        10.0 ** rng.uniform(-1.0, 2.0) * rng.uniform(-1.0, 1.0, n),
        rng.uniform(-np.pi, np.pi, n),
        middle,
    )


def _gains(rng: np.random.Generator) -> hsp.Gains:
    return hsp.Gains(natural_frequency=10.0 ** rng.uniform(-0.5, 2.0))


def _tasks(robot: hsp.Robot, rng: np.random.Generator) -> list[hsp.Task]:
    frame = robot.end_effector
    home = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    here = home.position(frame)
    if robot.nv < 6:
        axes = str(rng.choice(["xy", "x", "y"]))
        path = _trajectory(here[["xyz".index(axis) for axis in axes]], rng)
        tasks: list[hsp.Task] = [
            hsp.FramePosition(frame, path, gains=_gains(rng), axes=axes)
        ]
        if rng.random() < 0.4:
            tasks.append(_posture(robot, rng))
        return tasks
    path = _trajectory(here, rng)
    turning = hsp.trajectories.Spin(
        rng.standard_normal(3), 10.0 ** rng.uniform(-1.0, 1.5), rotation=np.eye(3)
    )
    position = hsp.FramePosition(frame, path, gains=_gains(rng))
    match rng.integers(5):
        case 0:
            return [position]
        case 1:
            pose = hsp.trajectories.ComposedPose(path, turning)
            return [hsp.FramePose(frame, pose, gains=_gains(rng))]
        case 2:
            orientation = hsp.FrameOrientation(
                frame, turning, gains=_gains(rng), priority=2
            )
            return [position, orientation]
        case 3:
            return [position, _posture(robot, rng)]
        case _:
            half = robot.model.njoints // 2
            other = next(f.name for f in robot.model.frames if f.parentJoint == half)
            path = _trajectory(home.position(other), rng)
            elbow = hsp.FramePosition(
                other, path, gains=_gains(rng), priority=2, name="elbow"
            )
            return [position, elbow]


def _posture(robot: hsp.Robot, rng: np.random.Generator) -> hsp.Task:
    posture = drawn_configurations(robot, rng, 1)[0]
    return hsp.JointPosture(posture, gains=_gains(rng), priority=2)


def _field(robot: hsp.Robot, rng: np.random.Generator) -> hsp.NullSpaceField | None:
    frame = robot.end_effector
    limited = np.isfinite(robot.position_limits()[0]).all()
    choices: list[Callable[[], hsp.NullSpaceField]] = [
        lambda: hsp.TargetPosture(drawn_configurations(robot, rng, 1)[0]),
        lambda: hsp.fields.PointDistance([frame], _ball(rng)),
        lambda: _clearances(robot)[rng.integers(len(_clearances(robot)))],
    ]
    if limited:
        choices += [
            lambda: hsp.JointCentering(),
            lambda: hsp.fields.LimitBarrier(),
            lambda: hsp.Manipulability(frame),
        ]
    else:
        choices += [
            lambda: hsp.Manipulability(frame, axes="xy"),
            lambda: hsp.fields.EqualJointAngles(list(robot.joint_names)),
        ]
    count = int(rng.choice([0, 1, 1, 2]))
    total: hsp.NullSpaceField | None = None
    for k in rng.permutation(len(choices))[:count]:
        weight = float(10.0 ** rng.uniform(-2.0, 2.0))
        term = weight * choices[k]()
        total = term if total is None else total + term
    return total


@cache
def _clearances(robot: hsp.Robot) -> list[hsp.NullSpaceField]:
    """Return fields that read meshes; their balls do not touch the robot at home."""
    rng = np.random.default_rng(0)
    home = Start(robot.state(0.0, robot.home(), np.zeros(robot.nv)), Scene())
    found: list[hsp.NullSpaceField] = [hsp.SelfClearance()]
    while len(found) < 9:
        with suppress(hsp.errors.SceneError):
            found.append(hsp.ObstacleClearance([_ball(rng)]).placed(home))
    return found


def _ball(rng: np.random.Generator) -> hsp.Obstacle:
    path = _trajectory(np.array([0.3, 0.0, 0.3]), rng)
    return hsp.Obstacle("ball", hsp.Sphere(float(rng.uniform(0.0, 0.3))), path)


def _limits(robot: hsp.Robot, rng: np.random.Generator) -> hsp.Limits:
    own = OWN_EFFORTS.get(robot.name)
    bounded = bool(rng.random() < 0.3)  # a QP with many rows
    scale = 10.0 ** rng.uniform(-1.5, 0.0)
    return hsp.Limits(
        effort=hsp.limits.Scaled(scale) if own is None else scale * np.array(own),
        effort_rate=1000.0 if rng.random() < 0.4 else None,
        velocity="robot" if bounded else None,
        acceleration=20.0 if rng.random() < 0.2 else None,
        position="robot" if bounded and own is None else None,
        bandwidth=10.0 ** rng.uniform(0.0, 2.0),
    )
