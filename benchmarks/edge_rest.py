"""Arms at their workspace boundary: rest and steadiness, random cases, defaults only.

    .venv/bin/python benchmarks/edge_rest.py [--cases N] [--keep FILE] [--mass] [ROBOT]

Per robot, kind and period: hands whose target is 5 cm to 1 m out of reach, at once,
streamed in a line, dragged about, on springs, either above an orientation, also 5 mm
within to 1 cm beyond the reach, and along one axis or two; a centre of mass that far
from where it is; steps of 0.5 m within reach, turns of 170°, and pushes of 50 to 200 N
for 0.2 s. Efforts are held for a period and clipped. Writes the third table of
benchmarks/results/edge.md; with --mass the fourth, in the metric M(q).
"""

import argparse
import json
import warnings
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import pinocchio as pin
from shared.edge_cases import BEYOND, STEP, Arm, unit
from shared.marked_sections import RESULTS, replace_section

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.robot.inverse_kinematics import Target
from hsp_control.simulation.plants import Push, RigidBodyPlant
from hsp_control.trajectories import ComposedPose, HoldOrientation

ROBOTS = (
    "panda", "ur5", "ur10", "iiwa14", "xarm7", "kinova", "talos_arm", "planar3r",
)  # fmt: skip
PERIODS = (0.001, 0.002, 0.005, 0.01)
OUT = ("position", "pose", "spring", "levels")
KINDS = (
    *(*OUT, "push", "steady", "stream", "drag", "step", "flip", "axes", "mass"),
    *("spring above", "just out", "unlimited"),
)
AXES = ("axes", "unlimited")
ABOVE = ("levels", "spring above", "just out")  # an orientation
SPRINGS = ("spring", "steady", "spring above")
JUST = -0.005, 0.01  # beyond the reach [m]
OF_REST = tuple(kind for kind in KINDS if kind not in ("steady", "unlimited"))
IN_THE_PLANE = ("position", "spring", "push", "stream", "drag", "step")
STIFFNESS, HELD, PUSHED = (100.0, 2000.0), (5.0, 40.0), (50.0, 200.0)  # [N/m, N, N]
BEGIN, PUSH, REST, WATCHED = 0.5, 0.2, 3.0, 1.0  # [s]
RATE, LONG, DRAGGED = 30.0, 1.0, 3.0  # of messages [1/s]; how long they last [s]
AT_LEAST = 4.0  # until a stream's own motion is over, 0.5 m/s of at most 2 m [s]
SLOWEST = 1.0  # a joint that turns slower gets the time that half a turn takes [rad/s]
FLIPPED = np.deg2rad(170.0)
STILL = 1e-3  # change of an effort in 1 ms, as a part of its limit


class Case(NamedTuple):
    """A commanded motion of a hand.

    Attributes:
        robot: Name of the robot.
        kind: One of `KINDS`.
        period: How long an effort is held [s].
        q0: Configuration at the start, shape (nq,) [rad].
        goal: Where the hand should be, shape (3,) [m].
        least: The smallest distance from it that it can have [m]; NaN: not looked for.
        number: Stiffness [N/m].
        vector: Force [N]; of a flip the axis; of a drag where it passes; of axes 1 for
            each that is measured.
    """

    robot: str
    kind: str
    period: float
    q0: list[float]
    goal: list[float]
    least: float
    number: float
    vector: list[float]


def is_planar(name: str) -> bool:
    """Return whether a robot moves in the plane z = 0."""
    return name.startswith("planar")


def kinds_of(name: str) -> tuple[str, ...]:
    """Return the kinds of cases that a robot can have."""
    return IN_THE_PLANE if is_planar(name) else OF_REST


def case(arm: Arm, kind: str, period: float, rng: np.random.Generator) -> Case:
    """Return a random case of a kind."""
    x0, d = arm.start(rng), unit(rng)
    if is_planar(arm.name):
        x0 = np.array([0.1, 0.6, 0.6]) + x0 - arm.bent
        d = np.array([d[0], d[1], 0.0]) / np.hypot(d[0], d[1])
    here, _ = arm.at(x0)
    goal, least, number, vector = here.translation.copy(), np.nan, 0.0, np.zeros(3)
    if kind in AXES:
        vector[rng.permutation(3)[: rng.integers(1, 3)]] = 1.0
        d = vector * d / np.linalg.norm(vector * d)
    if kind == "mass":
        state = arm.robot.state(0.0, arm.configuration(x0), np.zeros(arm.robot.nv))
        goal = state.centroidal.position + rng.uniform(*BEYOND) * d
    if kind in (*OUT, "stream", "drag", *AXES, *ABOVE):
        reach = arm.extent(d, rng) - d @ goal
        beyond = rng.uniform(*(JUST if kind == "just out" else BEYOND))
        goal += (reach + beyond) * d
    if kind in ("position", "levels", "just out"):
        target = Target(arm.frame, pin.SE3(np.eye(3), goal), 3)
        least = float(np.linalg.norm(goal - arm.nearest(target, x0, rng)))
    if kind in SPRINGS:
        number = float(np.exp(rng.uniform(*np.log(STIFFNESS))))
    if kind in ("push", "steady"):
        vector = float(rng.uniform(*(PUSHED if kind == "push" else HELD))) * d
    if kind == "flip":
        vector = d
    if kind == "drag":
        vector = here.translation + 0.3 * unit(rng)
    if kind == "step":
        while True:  # within the ball whose radius is the reach in its direction
            goal = here.translation + STEP * d
            target = Target(arm.frame, pin.SE3(np.eye(3), goal), 3)
            least = float(np.linalg.norm(goal - arm.nearest(target, x0, rng)))
            if least < 1e-3:
                break
            d = unit(rng)
            if is_planar(arm.name):
                d = np.array([d[0], d[1], 0.0]) / np.hypot(d[0], d[1])
    return Case(
        arm.name, kind, period, arm.configuration(x0).tolist(), goal.tolist(), least,
        number, vector.tolist(),
    )  # fmt: skip


def messages(case: Case, here: pin.SE3, pose: bool) -> list[dict[str, Any]]:
    """Return a streamed path: a line in a second, or one that wanders for three."""
    goal, by, start = np.array(case.goal), np.array(case.vector), here.translation
    long = DRAGGED if case.kind == "drag" else LONG
    found = []
    for k in range(1, round(long * RATE) + 1):
        s = k / (long * RATE)
        x = start + s * (goal - start)
        if case.kind == "drag":  # out, back by another way, and out again
            out = 0.5 - 0.5 * np.cos(3.0 * np.pi * s)
            x = start + out * (goal - start) + 4.0 * out * (1.0 - out) * (by - start)
        value = pin.SE3ToXYZQUAT(pin.SE3(here.rotation, x)) if pose else x[:2]
        found.append({"at": BEGIN + k / RATE, "value": value.tolist()})
    return found


def controller(case: Case, robot: hsp.Robot, metric: Any = None) -> hsp.Controller:
    """Return the controller of a case; the metric is the default one if it is None."""
    frame, goal, planar = robot.end_effector, np.array(case.goal), is_planar(case.robot)
    spring = hsp.Impedance(case.number) if case.kind in SPRINGS else None
    streamed = case.kind in ("stream", "drag")
    at = robot.state(0.0, case.q0, np.zeros(robot.nv)).frame(frame)
    here = pin.SE3(at.rotation.copy(), at.position.copy())
    reference: Any = hsp.Hold(goal[:2] if planar else goal)
    pose = not planar and (streamed or case.kind in ("pose", "flip"))
    if streamed:
        stream: Any = hsp.StreamPose if pose else hsp.Stream
        given = messages(case, here, pose)
        reference = stream(messages=given, policy="latest")
    elif case.kind == "flip":
        turned = here.rotation @ pin.exp3(FLIPPED * np.array(case.vector))
        reference = ComposedPose(reference, HoldOrientation(turned))
    elif pose:
        reference = ComposedPose(reference)
    declared: dict[str, Any] = {"trajectory": reference} if streamed else {}
    if planar:
        declared["axes"] = "xy"
    if case.kind in AXES:
        counts = np.array(case.vector) > 0.0
        declared["axes"] = "".join(np.array([*"xyz"])[counts])
        reference = hsp.Hold(goal[counts])
    hand: hsp.Task
    if case.kind == "mass":
        hand = hsp.CenterOfMass(name="hand")
    elif pose:
        hand = hsp.FramePose(frame, name="hand", **declared)
    else:
        hand = hsp.FramePosition(frame, impedance=spring, name="hand", **declared)
    below = [hsp.FrameOrientation(frame, priority=2)] * (case.kind in ABOVE)
    field: Any = hsp.TargetPosture(case.q0) if planar else hsp.JointCentering()
    tasks = [hand, *below]
    own: dict[str, Any] = {"limits": None} if case.kind == "unlimited" else {}
    made = hsp.Controller(robot, tasks, field, start=case.q0, metric=metric, **own)
    if not streamed and case.kind not in ("push", "steady"):
        made.at(BEGIN).ramp(0.0).reference("hand", reference)
    return made


def rests_from(case: Case, robot: hsp.Robot) -> float:
    """Return the time from which a hand should rest [s]."""
    slowest = float(np.min(robot.model.velocityLimit))
    turn = round(np.pi / slowest, 1) if slowest < SLOWEST else 0.0
    long = {"push": PUSH, "stream": LONG + AT_LEAST, "drag": DRAGGED + AT_LEAST}
    return BEGIN + long.get(case.kind, PUSH) + REST + turn


def measure(case: Case, robot: hsp.Robot, metric: Any = None) -> dict[str, Any]:
    """Return the numbers of a run.

    Returns:
        rests: Whether no effort changes by more than `STILL`, from 3 s after the
            beginning, or the push's end, for a second.
        still: When the last larger change was [s].
        change: Largest change of an effort in 1 ms, as a part of its limit.
        speed: Largest speed, as a part of its limit.
        beyond: Largest position beyond a limit [rad].
        away: How much farther than need be the hand is from its goal, at the end [m].
        local: How much nearer it would come by going downhill from there [m].
        yields: Relative difference of the spring's length from F/k.
    """
    h, pushes = case.period, []
    if case.kind in ("push", "steady"):
        duration = PUSH if case.kind == "push" else 100.0
        pushes = [Push(robot.end_effector, case.vector, start=BEGIN, duration=duration)]
    rests, end = rests_from(case, robot), ""
    try:
        run = hsp.simulate(
            controller(case, robot, metric), case.q0, duration=rests + WATCHED,
            control_period=h, log_period=h, plant=RigidBodyPlant(robot, pushes),
        )  # fmt: skip
    except SimulationError as fault:
        run, end = cast("hsp.Rollout", fault.rollout), "diverged"
    model, ms = robot.model, 1e3 * h
    lower, upper = robot.position_limits()
    positions = np.array([robot.joint_positions(q) for q in run.q])
    limit = model.effortLimit
    if not np.isfinite(limit).all():
        limit = np.full(robot.nv, np.abs(run.tau).max())
    change = np.abs(np.diff(run.tau, axis=0)) / limit / ms
    late = change[round(rests / h) :]
    moving = np.flatnonzero(change.max(axis=1) > STILL)
    error = float(np.linalg.norm(run["task.hand.error"][-1, :3]))
    force = float(np.linalg.norm(case.vector))
    found = {
        "robot": case.robot,
        "kind": case.kind,
        "period": h,
        "rests": bool(not end and late.size and late.max() <= STILL),
        "still": float(h * (moving[-1] + 1)) if moving.size else 0.0,
        "change": float(change.max()) if len(change) else 0.0,
        "speed": float((np.abs(run.v) / model.velocityLimit).max()),
        "beyond": float(np.maximum(positions - upper, lower - positions).max()),
        "away": float(error - case.least),
        "local": None,
        "yields": None,
        "end": end,
    }
    if case.kind == "steady":
        found["yields"] = float(abs(error * case.number / force - 1.0))
    if np.isfinite(case.least):
        found["local"] = error - downhill(case, robot, positions[-1])
    return found


def downhill(case: Case, robot: hsp.Robot, x: Array) -> float:
    """Return the hand's distance from its goal where going nearer ends [m]."""
    arm, goal = Arm(case.robot), np.array(case.goal)

    def cost(x: Array) -> tuple[float, Array]:
        pose, J = arm.at(x)
        e = goal - pose.translation
        return 0.5 * float(e @ e), -(e @ J[:3])

    return float(np.sqrt(2.0 * arm.minimized(cost, x).fun))


def drawn(robots: list[str], count: int, first: int = 0) -> "list[Case]":
    """Return ``count`` cases of a kind, robot and period; the same in every call."""
    found = []
    for name in robots:
        arm = Arm(name)
        for seed in range(first, first + count):
            for kind in kinds_of(name):
                for period in PERIODS:
                    key = [KINDS.index(kind), round(1e3 * period)]
                    rng = np.random.default_rng([seed, *key])
                    found.append(case(arm, kind, period, rng))
    return found


def half_and_most(found: list[float]) -> str:
    """Return the median and the largest."""
    return f"{np.median(found):.2g} / {max(found):.2g}" if found else "-"


HEADER = (
    "| robot | of | rests at 1 | 2 | 5 | 10 ms | latest rest [s] | change in 1 ms / "
    "limit, half / most | speed / limit | beyond a position [rad] | farther than the "
    "nearest point [mm], half / most | than the nearest downhill |\n"
    "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n"
)


def rows(runs: list[dict[str, Any]]) -> str:
    """Return a line per robot and kind."""
    text = ""
    for robot, kind in dict.fromkeys((run["robot"], run["kind"]) for run in runs):
        of = [run for run in runs if (run["robot"], run["kind"]) == (robot, kind)]
        rests = []
        for period in PERIODS:
            each = [run["rests"] for run in of if run["period"] == period]
            rests.append(f"{sum(each)} of {len(each)}")
        speeds = [run["speed"] for run in of]
        away = [1e3 * run["away"] for run in of if run["local"] is not None]
        local = [1e3 * run["local"] for run in of if run["local"] is not None]
        text += (
            f"| {robot} | {kind} | {' | '.join(rests)} | "
            f"{max(run['still'] for run in of):.1f} | "
            f"{half_and_most([run['change'] for run in of])} | {max(speeds):.2g} | "
            f"{max(0.0, *(run['beyond'] for run in of)):.2g} | "
            f"{half_and_most(away)} | {half_and_most(local)} |\n"
        )
    return text


def main() -> None:
    """Run all cases, print the table and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=40, help="of a kind and robot")
    parser.add_argument("--keep", type=Path, help="a file of runs, which is extended")
    parser.add_argument("--mass", action="store_true", help="in the metric M(q)")
    parser.add_argument("robots", nargs="*", default=list(ROBOTS))
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    metric = hsp.metrics.MassMatrixMetric() if options.mass else None
    made: dict[str, dict[str, Any]] = {}
    if options.keep and options.keep.exists():
        for line in options.keep.read_text(encoding="utf-8").splitlines():
            made |= {json.loads(line)["key"]: json.loads(line)}
    runs = []
    loaded = {name: hsp.Robot.load(name) for name in options.robots}
    for seed in range(options.cases):
        for name in options.robots:
            for k, each in enumerate(drawn([name], 1, seed)):
                key = f"{name} {seed} {k}"
                if key not in made:
                    made[key] = {"key": key, **measure(each, loaded[name], metric)}
                    if options.keep:
                        with options.keep.open("a", encoding="utf-8") as file:
                            file.write(json.dumps(made[key]) + "\n")
                runs.append(made[key])
    runs.sort(key=lambda run: options.robots.index(run["robot"]))
    table = HEADER + rows(runs)
    print(table)
    if options.robots == list(ROBOTS):
        section = "rest in M" if options.mass else "rest"
        replace_section(RESULTS / "edge.md", section, table)


if __name__ == "__main__":
    main()
