"""An arm that meets its limits: this law with and without them, and TSID.

    .venv-peers/bin/python benchmarks/limit_side_by_side.py

The configurations of configs/limits on rigid bodies at 1 kHz; without TSID its rows are
left out. Writes a table into docs/limits.md and draws docs/figures/limits.png.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from marked import DOCS, replace_part
from matplotlib.figure import Figure
from timing import ratios, spread, step_times

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.config import Experiment
from hsp_control.control.actuation import EXACT
from hsp_control.visualization.palette import INK, SERIES
from hsp_control.visualization.plots import new_figure, styled

PERIOD = 1e-3  # [s]
NAMES = ("panda_half_strength", "panda_towards_limit")
SHOWN = ("this law, limits", "this law, no limits", "TSID, posture 1e-03")
Compute = Callable[[float, Array, Array], Array]


class Run(NamedTuple):
    """A closed loop: one row a step, however far it went.

    Attributes:
        t: Time [s].
        q: Configuration.
        v: Velocity.
        tau: Effort.
        error: Distance of the hand from its path [m].
        null_space: ‖(I - J⁺J)(g - v)‖ [rad/s].
        end: Why it ended early, if it did.
    """

    t: Array
    q: Array
    v: Array
    tau: Array
    error: Array
    null_space: Array
    end: str


def this_law(experiment: Experiment) -> Compute:
    """Return the configuration's controller, told what went out."""
    controller, state = experiment.controller, hsp.RobotState(experiment.robot)

    def compute(t: float, q: Array, v: Array) -> Array:
        tau = controller.compute(state.update(t, q, v)).tau
        controller.applied(tau, PERIOD)
        return tau

    return compute


def clipped(experiment: Experiment, greatest: Array) -> Compute:
    """Return the configuration's controller behind motors that give no more."""
    law = this_law(experiment)
    return lambda t, q, v: np.clip(law(t, q, v), -greatest, greatest)


def tsid_of(experiment: Experiment, limits: hsp.Limits, weight: float) -> Compute:
    """Return TSID: hand, posture, bounds of efforts, positions and speeds.

    The posture task has Kp = K_N α and Kv = K_N + α joint by joint, for the field
    g = -α (q - q_0) that the configurations have.
    """
    import tsid

    robot, (task,) = experiment.robot, experiment.controller.tasks
    assert isinstance(task, hsp.FramePosition)
    controller, q0 = experiment.controller, experiment.q0
    model, nv = robot.model, robot.nv
    peer = tsid.RobotWrapper(model, tsid.FIXED_BASE_SYSTEM, False)
    problem = tsid.InverseDynamicsFormulationAccForce("tsid", peer, False)
    problem.computeProblemData(0.0, q0, np.zeros(nv))

    hand = tsid.TaskSE3Equality("hand", peer, task.frame)
    hand.useLocalFrame(False)
    hand.setKp(task.Kp[0, 0] * np.ones(6))
    hand.setKd(task.Kv[0, 0] * np.ones(6))
    hand.setMask(np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    problem.addMotionTask(hand, 1.0, 1, 0.0)

    # g is linear in q: its slope and its zero, from two of its values.
    still = hsp.RobotState(robot)

    def flow(q: Array) -> Array:
        controller.compute(still.update(0.0, q, np.zeros(nv)))
        return np.array(controller.field_sample.g)

    step = 1e-3
    rates = -(flow(q0 + step) - flow(q0)) / step
    goal = q0 + flow(q0) / rates
    gain = float(controller.null_space_gain[0, 0])
    posture = tsid.TaskJointPosture("posture", peer)
    posture.setKp(gain * rates)
    posture.setKd(gain + rates)
    problem.addMotionTask(posture, weight, 1, 0.0)

    efforts = tsid.TaskActuationBounds("effort", peer)
    efforts.setBounds(-limits.effort, limits.effort)
    problem.addActuationTask(efforts, 1.0, 0, 0.0)
    joints = tsid.TaskJointPosVelAccBounds("joints", peer, PERIOD, False)
    joints.setPositionBounds(limits.lower, limits.upper)
    joints.setVelocityBounds(limits.velocity)
    joints.setAccelerationBounds(np.full(nv, 500.0))
    problem.addMotionTask(joints, 1.0, 0, 0.0)

    solver = tsid.SolverHQuadProgFast("qp")
    solver.resize(problem.nVar, problem.nEq, problem.nIn)
    hand_sample, posture_sample = (
        tsid.TrajectorySample(12, 6),
        tsid.TrajectorySample(nv),
    )
    posture_sample.value(goal)
    posture_sample.derivative(np.zeros(nv))
    place, rate, rate_dot = np.zeros(12), np.zeros(6), np.zeros(6)
    place[3:] = np.eye(3).ravel()

    def compute(t: float, q: Array, v: Array) -> Array:
        wanted = task.trajectory.sample(t)
        place[:3], rate[:3] = wanted.position, wanted.velocity
        rate_dot[:3] = wanted.acceleration
        hand_sample.value(place)
        hand_sample.derivative(rate)
        hand_sample.second_derivative(rate_dot)
        hand.setReference(hand_sample)
        posture.setReference(posture_sample)
        solution = solver.solve(problem.computeProblemData(t, q, v))
        if solution.status != 0:
            raise RuntimeError("no solution")
        return np.array(problem.getActuatorForces(solution))

    compute.kept = (peer, hand, posture, efforts, joints)  # type: ignore[attr-defined]
    return compute


def close_loop(experiment: Experiment, compute: Compute) -> Run:
    """Run a controller on rigid bodies, its effort held for a period."""
    robot, (task,) = experiment.robot, experiment.controller.tasks
    assert isinstance(task, hsp.FramePosition)
    reference = experiment.controller  # of this experiment: for g alone
    plant, integrator = hsp.RigidBodyPlant(robot), hsp.Rk4(PERIOD)
    q, v, tau = experiment.q0.copy(), experiment.v0.copy(), np.zeros(robot.nv)
    state, rows, end = hsp.RobotState(robot), [], ""

    def accelerate(t: float, q: Array, v: Array) -> Array:
        return plant.acceleration(t, q, v, tau)

    for k in range(round(experiment.scenario.simulation.duration / PERIOD)):
        t = k * PERIOD
        try:
            tau[:] = compute(t, q, v)
        except (RuntimeError, hsp.exceptions.HspError) as error:
            end = f"{error} at {t:.2f} s"
            break
        frame = state.update(t, q, v).frame(task.frame)
        error = np.linalg.norm(task.trajectory.sample(t).position - frame.position)
        reference.compute(state)
        J = frame.jacobian[:3]
        missed = reference.field_sample.g - v
        missed = missed - np.linalg.pinv(J) @ (J @ missed)
        rows.append((t, q, v, tau.copy(), error, np.linalg.norm(missed)))
        q, v = integrator.advance(robot, accelerate, t, t + PERIOD, q, v)
        if not np.abs(v).max() < 100.0:
            end = f"diverged at {t:.2f} s"
            break
    return Run(*(np.array(column) for column in zip(*rows, strict=True)), end)


def runs_of(name: str) -> tuple[dict[str, Run], hsp.Limits]:
    """Return the runs of a configuration by controller, and its limits."""
    load = lambda *changes: hsp.load_experiment(f"limits/{name}", *changes)  # noqa: E731
    limits = load().controller.limits
    assert limits is not None
    free = "limits=null"
    controllers: dict[str, Callable[[], Compute]] = {
        "this law, limits": lambda: this_law(load()),
        "this law, no limits": lambda: this_law(load(free)),
        "this law, clipped": lambda: clipped(load(free), limits.effort),
    }
    try:
        import tsid  # noqa: F401
    except ImportError:
        print("TSID is not installed: make bench")
    else:
        for weight in (1e-3, 1e-5):
            controllers[f"TSID, posture {weight:.0e}"] = lambda weight=weight: tsid_of(
                load(free), limits, weight
            )
    return {
        label: close_loop(load(free), make()) for label, make in controllers.items()
    }, limits


def row(name: str, label: str, run: Run, limits: hsp.Limits) -> str:
    """Return a line of the table."""
    rate = np.abs(np.diff(run.tau, axis=0)).max() / PERIOD
    least = np.minimum(run.q - limits.lower, limits.upper - run.q).min()
    error = 1e3 * run.error
    cells = (
        f"{100 * (np.abs(run.tau) / limits.effort).max():.0f} %",
        f"{rate:.0f}",
        f"{100 * (np.abs(run.v) / limits.velocity).max():.0f} %",
        f"{1e3 * least:.2g}",
        f"{np.sqrt((error**2).mean()):.2g} / {error.max():.2g}",
        f"{np.sqrt((run.null_space**2).mean()):.2g}",
        run.end,
    )
    return f"| `{name}` | {label} | " + " | ".join(cells) + " |\n"


HEADER = (
    "| configuration | controller | greatest effort, of its limit | greatest rate "
    "[N·m/s] | greatest speed, of its limit | least distance from a joint's limit "
    "[mrad] | hand, rms / max [mm] | ‖P(g − v)‖ rms [rad/s] | |\n"
    "|---|---|--:|--:|--:|--:|--:|--:|---|\n"
)


def cost(name: str, run: Run, limits: hsp.Limits) -> str:
    """Return lines of what a step costs beside TSID's, limits binding or not."""
    experiment = hsp.load_experiment(f"limits/{name}")
    controller, state = experiment.controller, hsp.RobotState(experiment.robot)

    def law(t: float, q: Array, v: Array) -> Array:
        return controller.compute(state.update(t, q, v)).tau

    steps = list(zip(run.t, run.q, run.v, strict=True))
    bound = [controller.compute(state.update(*step)).status != EXACT for step in steps]
    peer = tsid_of(hsp.load_experiment(f"limits/{name}", "limits=null"), limits, 1e-3)
    lines = ""
    for label, wanted in (("none", False), ("some", True)):
        chosen = [step for step, b in zip(steps, bound, strict=True) if b == wanted]
        times = step_times({"law": law, "TSID": peer}, chosen, rounds=25, block=40)
        ratio = spread(ratios(times, "law", "TSID"))
        taken = 1e6 * np.median(times["law"])
        lines += f"| `{name}` | {label} | {len(chosen)} | {ratio} | {taken:.0f} |\n"
    return lines


COST = (
    "\n| configuration | limits that bind | steps | this law / TSID | µs |\n"
    "|---|---|--:|--:|--:|\n"
)


def figure(found: dict[str, tuple[dict[str, Run], hsp.Limits]]) -> Figure:
    """Return limits, what meets them, and what gives way."""
    drawn = new_figure(10.0, 7.2)
    axes = drawn.subplots(3, 2, sharex="col")
    half, towards = NAMES
    for column, name in enumerate((half, towards)):
        runs, limits = found[name]
        top, middle, bottom = axes[:, column]
        labels = [label for label in SHOWN if label in runs]
        for color, label in zip(SERIES, labels, strict=False):
            run = runs[label]
            style = {"color": color, "lw": 1.3, "label": label}
            shown = run.tau[:, 1] if name == half else np.rad2deg(run.q[:, 3])
            top.plot(run.t, shown, **style)
            middle.semilogy(run.t, 1e3 * run.error + 1e-6, **style)
            bottom.semilogy(run.t, run.null_space + 1e-6, **style)
        bounds = (
            (-limits.effort[1], limits.effort[1])
            if name == half
            else (np.rad2deg(limits.upper[3]),)
        )
        for bound in bounds:
            top.axhline(bound, color=INK, lw=1.0, ls="--")
        what = "effort of joint 2 [N·m]" if name == half else "joint 4 [°]"
        top.set_ylabel(what)
        middle.set_ylabel("hand off its path [mm]")
        bottom.set_ylabel("‖P(g − v)‖ [rad/s]")
        middle.set_ylim(1e-3, 3e2)
        bottom.set_ylim(1e-4, 1e2)
        bottom.set_xlabel("t [s]")
        top.set_title(name)
    axes[0, 1].legend(loc="lower center", fontsize=8)
    return drawn


def main() -> None:
    """Run, write the table, draw."""
    found = {name: runs_of(name) for name in NAMES}
    table = HEADER + "".join(
        row(name, label, run, limits)
        for name, (runs, limits) in found.items()
        for label, run in runs.items()
    )
    if any(label.startswith("TSID") for label in found[NAMES[0]][0]):
        table += COST + "".join(
            cost(name, runs["this law, limits"], limits)
            for name, (runs, limits) in found.items()
        )
    print(table)
    replace_part(DOCS / "limits.md", "limit_side_by_side", "\n" + table + "\n")
    with styled():
        figure(found).savefig(DOCS / "figures" / "limits.png", dpi=110)


if __name__ == "__main__":
    main()
