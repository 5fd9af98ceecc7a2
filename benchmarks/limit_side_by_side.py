"""An arm that reaches its limits: this law with and without limits, and TSID.

    .venv-peers/bin/python benchmarks/limit_side_by_side.py

The configurations of configs/limits on rigid bodies at 1 kHz. The cost of a step is
also measured for two arms and for Talos on two feet, with a part of their efforts.
Without TSID its rows are omitted. Writes tables into results/limits.md and draws
docs/figures/limits.png; ``--draw`` only draws, which needs no TSID.
"""

# ruff: noqa: E402
import os

# TSID's solver is built with OpenMP: see `whole_body_side_by_side`.
for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ[variable] = "1"

import argparse
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import whole_body_side_by_side as whole_body
from matplotlib.figure import Figure
from shared import beside_tsid, many_tasks
from shared.marked_sections import FIGURES, RESULTS, replace_section
from shared.standing import TALOS, Standing

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.companions.plots import new_figure, save_for_a_column, styled
from hsp_control.companions.plots.palette import INK, SERIES
from hsp_control.config import Experiment
from hsp_control.constraints.limits import RobotLimits
from hsp_control.control.actuation import Status
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import RigidBodyPlant

PERIOD = 1e-3  # [s]
ARMS_STRENGTH = 0.2  # of two Pandas' efforts; at 0.25 one joint of each is at its limit
STANDING_STRENGTHS = (0.35, 0.25)  # of Talos' efforts
NAMES = ("panda_half_strength", "panda_towards_limit")
SHOWN = ("this law, limits", "this law, no limits")
Compute = Callable[[float, Array, Array], Array]


class Run(NamedTuple):
    """A closed loop: one row per step, N rows.

    Attributes:
        t: Time, shape (N,) [s].
        q: Configuration, shape (N, nq).
        v: Velocity, shape (N, nv).
        tau: Effort, shape (N, nv).
        error: Distance of the hand from its path, shape (N,) [m].
        null_space: ‖(I - J⁺J)(g - v)‖, shape (N,) [rad/s].
        end: Why it ended early; empty if it did not.
    """

    t: Array
    q: Array
    v: Array
    tau: Array
    error: Array
    null_space: Array
    end: str


def this_law(experiment: Experiment) -> Compute:
    """Return the configuration's controller, with the applied effort fed back."""
    controller = experiment.controller

    def compute(t: float, q: Array, v: Array) -> Array:
        tau = controller.compute(t, q, v).tau
        controller.applied(tau, PERIOD)
        return tau

    return compute


def clipped(experiment: Experiment, limits: Array) -> Compute:
    """Return the configuration's controller with its efforts clipped, shape (nv,)."""
    law = this_law(experiment)
    return lambda t, q, v: np.clip(law(t, q, v), -limits, limits)


def tsid_of(experiment: Experiment, limits: RobotLimits, weight: float) -> Compute:
    """Return TSID: hand and posture tasks; bounds of efforts, positions and speeds.

    The posture task has Kp = K_N α and Kv = K_N + α for every joint, for the field
    g = -α (q - q_0) of the configurations.
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
    feedback = controller.feedback(task.name)
    hand.setKp(feedback.Kp[0, 0] * np.ones(6))
    hand.setKd(feedback.Kv[0, 0] * np.ones(6))
    hand.setMask(np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    problem.addMotionTask(hand, 1.0, 1, 0.0)

    # g is linear in q: compute its slope and its zero from two values.
    def flow(q: Array) -> Array:
        return controller.compute(0.0, q, np.zeros(nv)).field.g

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
        desired = task.trajectory.sample(t)
        place[:3], rate[:3] = desired.position, desired.velocity
        rate_dot[:3] = desired.acceleration
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
    compute.parts = (problem, solver, [hand, posture])  # type: ignore[attr-defined]
    return compute


def close_loop(experiment: Experiment, compute: Compute) -> Run:
    """Run a controller on rigid bodies, its effort held for a period."""
    robot, (task,) = experiment.robot, experiment.controller.tasks
    assert isinstance(task, hsp.FramePosition)
    reference = experiment.controller  # computes g for the measurement
    plant, integrator = RigidBodyPlant(robot), Rk4(PERIOD)
    q, v, tau = experiment.q0.copy(), experiment.v0.copy(), np.zeros(robot.nv)
    state, rows, end = hsp.RobotState(robot), [], ""

    def accelerate(t: float, q: Array, v: Array) -> Array:
        return plant.acceleration(t, q, v, tau)

    for k in range(round(experiment.scenario.simulation.duration / PERIOD)):
        t = k * PERIOD
        try:
            tau[:] = compute(t, q, v)
        except (RuntimeError, hsp.HspControlError) as fault:
            end = f"{fault} at {t:.2f} s"
            break
        frame = state.update(t, q, v).frame(task.frame)
        error = np.linalg.norm(task.trajectory.sample(t).position - frame.position)
        J = frame.jacobian[:3]
        e_N = reference.compute(t, q, v).field.g - v
        e_N = e_N - np.linalg.pinv(J) @ (J @ e_N)
        rows.append((t, q, v, tau.copy(), error, np.linalg.norm(e_N)))
        q, v = integrator.advance(robot, accelerate, t, t + PERIOD, q, v)
        if not np.abs(v).max() < 100.0:
            end = f"diverged at {t:.2f} s"
            break
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return Run(*columns, end=end)


def runs_of(
    name: str, chosen: tuple[str, ...] | None = None
) -> tuple[dict[str, Run], RobotLimits]:
    """Return the runs of a configuration by controller, and its limits.

    Args:
        name: The configuration.
        chosen: Names of controllers; None: all of them.
    """
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
        label: close_loop(load(free), controllers[label]())
        for label in chosen or controllers
    }, limits


def row(name: str, label: str, run: Run, limits: RobotLimits) -> str:
    """Return a line of the table."""
    rate = np.abs(np.diff(run.tau, axis=0)).max() / PERIOD
    margin = np.minimum(run.q - limits.lower, limits.upper - run.q).min()
    error = 1e3 * run.error
    cells = (
        f"{100 * (np.abs(run.tau) / limits.effort).max():.0f} %",
        f"{rate:.0f}",
        f"{100 * (np.abs(run.v) / limits.velocity).max():.0f} %",
        f"{1e3 * margin:.2g}",
        f"{np.sqrt((error**2).mean()):.2g} / {error.max():.2g}",
        f"{np.sqrt((run.null_space**2).mean()):.2g}",
        run.end,
    )
    return f"| `{name}` | {label} | " + " | ".join(cells) + " |\n"


HEADER = (
    "| configuration | controller | largest effort / limit | largest rate "
    "[N·m/s] | largest speed / limit | minimum distance from a joint's limit "
    "[mrad] | hand error, rms / max [mm] | ‖P(g − v)‖ rms [rad/s] | note |\n"
    "|---|---|--:|--:|--:|--:|--:|--:|---|\n"
)


def cost(name: str, run: Run, limits: RobotLimits) -> str:
    """Return rows of step times beside TSID's, without and with active limits."""
    experiment = hsp.load_experiment(f"limits/{name}")
    controller = experiment.controller

    def law(t: float, q: Array, v: Array) -> Array:
        return controller.compute(t, q, v).tau

    law.controller = controller  # type: ignore[attr-defined]
    steps = list(zip(run.t, run.q, run.v, strict=True))
    limited = [controller.compute(*step).status != Status.EXACT for step in steps]
    peer = tsid_of(hsp.load_experiment(f"limits/{name}", "limits=none"), limits, 1e-3)
    return "".join(
        beside_tsid.row(f"`{name}`, {what}", law, peer, steps, np.array(chosen))
        for what, chosen in (
            ("no limit active", ~np.array(limited)),
            ("limits active (status 2)", np.array(limited)),
        )
    )


def cost_of_two_arms() -> str:
    """Return the rows of two Pandas on circles, with a part of their efforts.

    They could not even hold their posture: the states are those of a run with all of
    their efforts, and every step is limited. With the limit on static efforts, which
    TSID does not have, the limits contradict each other.
    """
    poses = many_tasks.two_arms()
    _, states = poses.run(poses.law(), 1.0)
    weaken(poses.robot, ARMS_STRENGTH)
    what = f"two Pandas, {100 * ARMS_STRENGTH:.0f} % of their efforts"
    laws = {
        f"{what} (status 2)": poses.law(),
        f"{what}, static ones too (status 3)": poses.law(static_effort="robot"),
    }
    all_steps = np.full(len(states), True)
    return "".join(
        beside_tsid.row(label, law, poses.tsid(), states, all_steps)
        for label, law in laws.items()
    )


def cost_of_standing(strength: float, status: Status, what: str) -> str:
    """Return the row of Talos on two feet, with a part of its efforts.

    Along its own run: on MuJoCo with all of its efforts, else on ideal contacts, until
    it falls.
    """
    from shared.controllers.standing_tsid import make

    case = Standing(TALOS)
    weaken(case.robot, strength)
    engine = case.mujoco() if strength == 1.0 else case.ideal()
    law, statuses = whole_body.this_law(case)
    run = whole_body.close_loop(case, engine, (law, statuses), 3.0)
    chosen = np.array([each[0] == str(int(status)) for each in statuses])
    peer, _ = make(case, posture_weight=1e-3)
    return beside_tsid.row(what, law, peer, run.states, chosen)


def weaken(robot: hsp.Robot, strength: float) -> None:
    """Scale the limits of a robot's efforts, for all controllers."""
    model = robot.model
    model.upperEffortLimit = strength * np.array(model.upperEffortLimit)
    model.lowerEffortLimit = strength * np.array(model.lowerEffortLimit)


def costs_of_others() -> str:
    """Return the rows of the larger robots."""
    rows = cost_of_two_arms()
    for strength in STANDING_STRENGTHS:
        what = f"Talos on two feet, {100 * strength:.0f} % of its efforts (status 2)"
        rows += cost_of_standing(strength, Status.LIMITED, what)
    what = "Talos on two feet, forces redistributed (status 1)"
    return rows + cost_of_standing(1.0, Status.REDISTRIBUTED, what)


def figure(found: dict[str, tuple[dict[str, Run], RobotLimits]]) -> Figure:
    """Draw limited quantities, tracking error and null-space error."""
    drawn = new_figure(4.6, 5.6)
    axes = drawn.subplots(3, 2, sharex="col")
    half, towards = NAMES
    titles = {half: "Half strength", towards: "Towards a limit"}
    styles = {
        SHOWN[0]: {"color": SERIES[0], "lw": 2.0, "label": "with limits"},
        SHOWN[1]: {"color": SERIES[1], "lw": 1.5, "ls": "--", "label": "without"},
    }
    for column, name in enumerate((half, towards)):
        runs, limits = found[name]
        top, middle, bottom = axes[:, column]
        for label, style in styles.items():
            run = runs[label]
            shown = run.tau[:, 1] if name == half else np.rad2deg(run.q[:, 3])
            top.plot(run.t, shown, **style)
            middle.semilogy(run.t, 1e3 * run.error + 1e-6, **style)
            bottom.semilogy(run.t, run.null_space + 1e-6, **style)
        bound = -limits.effort[1] if name == half else np.rad2deg(limits.upper[3])
        top.axhline(bound, color=INK, lw=1.0, ls=":", label="limit")
        top.set_ylabel("effort of\njoint 2 [N·m]" if name == half else "joint 4 [°]")
        middle.set_ylim(1e-3, 1e2)
        bottom.set_ylim(1e-4, 1e2)
        bottom.set_xlabel("time [s]")
        top.set_title(f"({'ab'[column]})  {titles[name]}")
    axes[1, 0].set_ylabel("hand error\n[mm]")
    axes[2, 0].set_ylabel("null-space error\n" r"$\Vert P(g - v) \Vert$ [rad/s]")
    handles, labels = axes[0, 1].get_legend_handles_labels()
    drawn.legend(handles, labels, loc="outside lower center", ncols=3)
    return drawn


def main() -> None:
    """Run, write the table, draw."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draw", action="store_true", help="only draw the figure")
    if parser.parse_args().draw:
        draw({name: runs_of(name, SHOWN) for name in NAMES})
        return
    found = {name: runs_of(name) for name in NAMES}
    table = HEADER + "".join(
        row(name, label, run, limits)
        for name, (runs, limits) in found.items()
        for label, run in runs.items()
    )
    if any(label.startswith("TSID") for label in found[NAMES[0]][0]):
        costs = beside_tsid.HEADER + "".join(
            cost(name, runs["this law, limits"], limits)
            for name, (runs, limits) in found.items()
        )
        costs += costs_of_others()
        table += f"\n{costs}\n{beside_tsid.CPP}"
    print(table)
    replace_section(RESULTS / "limits.md", "limit_side_by_side", "\n" + table + "\n")
    draw(found)


def draw(found: dict[str, tuple[dict[str, Run], RobotLimits]]) -> None:
    """Save the figure."""
    with styled():
        save_for_a_column(figure(found), FIGURES / "limits.png")


if __name__ == "__main__":
    main()
