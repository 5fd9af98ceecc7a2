r"""robosuite's OSC_POSE and this law's HSP_POSE in robosuite's own environment.

    make sims    # makes .venv-sims
    .venv-sims/bin/python \
        hsp_control/companions/simulators/benchmark/robosuite_side_by_side.py

A Panda in the environment Lift, 500 steps of the simulation a second, goals as absolute
poses. Circle: 0.1 m at 2 rad/s, turning by ±0.3 rad about the vertical, five turns. Set
point: 5 cm aside, 5 cm up and 0.2 rad, at once. Both controllers have the gains of
OSC_POSE (kp = 150, critically damped), and its attraction to the first posture. Writes
a table into results.md.
"""

import logging
import sys
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path
from time import perf_counter_ns
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
import robosuite

sys.path.append(str(Path(__file__).parents[4] / "benchmarks"))
from shared.marked_sections import replace_section

import hsp_control.companions.simulators.robosuite  # noqa: F401  it registers HSP_POSE
from hsp_control.common.arrays import Array

STEP = 0.002  # of robosuite's simulation [s]
RATE, RADIUS, TURN = 2.0, 0.1, 0.3  # [rad/s, m, rad]
PERIOD = 2.0 * np.pi / RATE  # of a turn [s]
WAY = np.array([0.0, 0.05, 0.05])  # to the set point [m]
LAGS = np.arange(0.0, 0.3, 0.001)  # that are tried [s]
RISE, TURNS = 1.0, 5  # [s, -]
START = [0.0, 0.2, 0.0, -2.2, 0.0, 2.4, 0.785]  # robosuite's own is near a limit [rad]
SETTLED = 0.001  # [m]
ROUNDS, BLOCK = 21, 200  # of the timing; steps of the simulation in a block [-]

CIRCLE = (
    "| goals [Hz] | controller | error [mm] | [mrad] | lag [ms] | without it [mm] "
    "| [mrad] | change of efforts, rms [N·m/s] | largest in 2 ms [N·m] "
    "| posture, a turn later [mrad] | three turns later [mrad] |\n"
    "|--:|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n"
)
JUMP = (
    "| goals [Hz] | controller | within 1 mm after [s] | overshoot [mm] "
    "| left after 3 s [mm] | [mrad] | change of efforts, rms [N·m/s] "
    "| largest in 2 ms [N·m] |\n"
    "|--:|---|--:|--:|--:|--:|--:|--:|\n"
)
COST = "| goals [Hz] | controller | OSC_POSE = 1 | µs |\n|--:|---|--:|--:|\n"


class Way(NamedTuple):
    """A controller: its name in the table, its type, our settings, rate of goals."""

    name: str
    type: str
    settings: Any
    frequency: int


class Run(NamedTuple):
    """The hand's start, and the motion at every step of the simulation."""

    start: pin.SE3
    t: Array
    hand: Array
    rotations: Array
    q: Array
    effort: Array

    def part(self, which: Any) -> "Run":
        """Return some of the steps."""
        return Run(self.start, *(each[which] for each in self[1:]))


def stream(delay: float, **compensation: Any) -> dict[str, Any]:
    """Return settings with a stream that passes through all goals."""
    return {
        "stream": {"policy": "interpolate", "delay": delay},
        "compensation": {"friction_feed_forward": "urdf", **compensation},
    }


OBSERVER = {"momentum_observer": {"bandwidth": 50, "cancel": True}}
KINDS: tuple[tuple[str, str, dict[int, Any]], ...] = (
    ("OSC_POSE", "OSC_POSE", {20: None, 500: None}),
    ("goals held", "HSP_POSE", {20: {"stream": None}, 500: {"stream": None}}),
    ("bounded (default)", "HSP_POSE", {20: None, 500: None}),
    ("all goals passed", "HSP_POSE", {20: stream(0.11), 500: stream(0.02)}),
    (
        "and observer",
        "HSP_POSE",
        {20: stream(0.11, **OBSERVER), 500: stream(0.02, **OBSERVER)},
    ),
)
WAYS = tuple(
    Way(name, kind, settings[frequency], frequency)
    for frequency in (20, 500)
    for name, kind, settings in KINDS
)


def made(way: Way) -> Any:
    """Return an environment whose arm is controlled in one way, at the start."""
    config = robosuite.load_composite_controller_config(robot="Panda")
    arm = config["body_parts"]["right"]
    arm.update(type=way.type, input_type="absolute", input_ref_frame="world")
    if way.type == "HSP_POSE":
        config["type"], arm["hsp"] = "HSP", way.settings
    env = robosuite.make(
        "Lift",
        robots="Panda",
        controller_configs=config,
        control_freq=way.frequency,
        initialization_noise=None,
        hard_reset=False,  # keeps the start that is set below
        has_renderer=False,
        has_offscreen_renderer=False,
        use_camera_obs=False,
        ignore_done=True,
        seed=0,
    )
    env.robots[0].init_qpos = np.array(START)
    env.reset()
    return env


def circle(t: float, start: pin.SE3) -> pin.SE3:
    """Return where the hand should be; it begins to move slowly."""
    b = min(t / RISE, 1.0)
    share = b**3 * (10.0 - 15.0 * b + 6.0 * b**2)
    way = RADIUS * np.array([np.cos(RATE * t) - 1.0, np.sin(RATE * t), 0.0])
    turned = pin.exp3(np.array([0.0, 0.0, TURN * share * np.sin(RATE * t)]))
    return pin.SE3(turned @ start.rotation, start.translation + share * way)


def jump(t: float, start: pin.SE3) -> pin.SE3:
    """Return the set point."""
    turned = pin.exp3(np.array([0.0, 0.0, 0.2]))
    return pin.SE3(turned @ start.rotation, start.translation + WAY)


def run(way: Way, goal: Callable[[float, pin.SE3], pin.SE3], duration: float) -> Run:
    """Return the motion in an environment."""
    env = made(way)
    arm, data = env.robots[0].part_controllers["right"], env.sim.data
    site = env.sim.model.site_name2id(arm.ref_name)
    rows: list[tuple[Any, ...]] = []

    def keep(cost: int) -> None:
        place = data.site_xpos[site].copy(), data.site_xmat[site].reshape(3, 3).copy()
        rows.append((data.time, *place, data.qpos[:7].copy(), data.ctrl[:7].copy()))

    _watch(env, keep)
    start = _pose_of(env)
    for k in range(round(duration * way.frequency)):
        env.step(_action(goal(k / way.frequency, start)))
    env.close()
    return Run(start, *map(np.array, zip(*rows, strict=True)))


def _watch(env: Any, keep: Callable[[int], None]) -> None:
    """Call a function after each control of the arm, with the time it took [ns]."""
    arm = env.robots[0]
    control = type(arm).control.__get__(arm)

    def watched(*arguments: Any, **options: Any) -> None:
        before = perf_counter_ns()
        control(*arguments, **options)
        keep(perf_counter_ns() - before)

    arm.control = watched


def _pose_of(env: Any) -> pin.SE3:
    arm = env.robots[0].part_controllers["right"]
    rotation = pin.Quaternion(arm.ref_ori_mat).normalized().toRotationMatrix()
    return pin.SE3(rotation, arm.ref_pos.copy())


def _action(pose: pin.SE3) -> Array:
    """Return an absolute action, with the gripper open."""
    return np.concatenate([pose.translation, pin.log3(pose.rotation), [-1.0]])


def errors(one: Run, goal: Any, lag: float = 0.0) -> tuple[Array, Array]:
    """Return the errors of position and orientation at every step [m, rad]."""
    poses = [goal(t - lag, one.start) for t in one.t]
    position = one.hand - np.array([each.translation for each in poses])
    turned = [
        pin.log3(pose.rotation @ rotation.T)
        for pose, rotation in zip(poses, one.rotations, strict=True)
    ]
    return np.linalg.norm(position, axis=1), np.linalg.norm(turned, axis=1)


def rms(values: Array) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def effort_rates(one: Run) -> Array:
    """Return the rate of the efforts in every step, shape (steps, 7) [N·m/s]."""
    return np.asarray(np.diff(one.effort, axis=0) / STEP)


def circle_row(way: Way) -> str:
    """Return a row of the circle's table; the first turn does not count."""
    one = run(way, circle, RISE + TURNS * PERIOD)
    after = one.part(one.t > RISE + PERIOD)
    some = after.part(slice(None, None, 25))
    lag = min(LAGS, key=lambda lag: rms(errors(some, circle, lag)[0]))
    position, orientation = errors(after, circle)
    left, left_turned = errors(after, circle, lag)
    rates, turn = effort_rates(after), round(PERIOD / STEP)
    closes, drift = (
        np.abs(one.q[-1] - one.q[-1 - turns * turn]).max() for turns in (1, 3)
    )
    return (
        f"| {way.frequency} | {way.name} | {1e3 * rms(position):.2f} "
        f"| {1e3 * rms(orientation):.1f} | {1e3 * lag:.0f} | {1e3 * rms(left):.2f} "
        f"| {1e3 * rms(left_turned):.1f} | {rms(rates):.0f} "
        f"| {STEP * np.abs(rates).max():.1f} | {1e3 * closes:.1f} "
        f"| {1e3 * drift:.1f} |\n"
    )


def jump_row(way: Way) -> str:
    """Return a row of the set point's table."""
    one = run(way, jump, 3.0)
    position, orientation = errors(one, jump)
    outside = np.nonzero(position > SETTLED)[0]
    beyond = (one.hand - one.start.translation) @ WAY / np.linalg.norm(WAY)
    rates = effort_rates(one)[1:]  # without the jump itself
    return (
        f"| {way.frequency} | {way.name} | {one.t[outside[-1]] - one.t[0]:.2f} "
        f"| {1e3 * max(beyond.max() - np.linalg.norm(WAY), 0.0):.1f} "
        f"| {1e3 * position[-1]:.2f} | {1e3 * orientation[-1]:.2f} | {rms(rates):.0f} "
        f"| {STEP * np.abs(rates).max():.1f} |\n"
    )


def cost_rows(frequency: int) -> Iterator[str]:
    """Yield the time of `robot.control` at a step, as a ratio to OSC_POSE's.

    Blocks of all controllers follow one another, so that disturbances of the machine
    affect all of them. A block's steps count with their mean: some have a new goal.
    """
    ways = [way for way in WAYS if way.frequency == frequency]
    envs, costs = [made(way) for way in ways], np.zeros((len(ways), ROUNDS))
    starts = [_pose_of(env) for env in envs]
    steps = BLOCK * frequency // 500  # of the environment
    for k in range(ROUNDS):
        for which in np.roll(range(len(ways)), -k):
            spent: list[int] = []
            _watch(envs[which], spent.append)
            for step in range(k * steps, (k + 1) * steps):
                envs[which].step(_action(circle(step / frequency, starts[which])))
            costs[which, k] = np.mean(spent)
    for way, own in zip(ways, costs, strict=True):
        low, middle, high = np.quantile(own / costs[0], [0.25, 0.5, 0.75])
        yield (
            f"| {frequency} | {way.name} | {middle:.2f} ({low:.2f} to {high:.2f}) "
            f"| {1e-3 * np.median(own):.0f} |\n"
        )


def main() -> None:
    """Run everything, and write the tables."""
    logging.disable(logging.WARNING)
    for name, head, rows in (
        ("circle", CIRCLE, map(circle_row, WAYS)),
        ("set point", JUMP, map(jump_row, WAYS)),
        ("time", COST, chain(cost_rows(20), cost_rows(500))),
    ):
        lines = [head]
        for row in rows:
            print(row, end="", flush=True)
            lines.append(row)
        section = f"robosuite_side_by_side.py, {name}"
        replace_section(Path(__file__).with_name("results.md"), section, "".join(lines))


if __name__ == "__main__":
    main()
