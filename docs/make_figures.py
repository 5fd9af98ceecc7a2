"""Draw the figures of the documents: `make figures` (they are committed)."""

import json
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.companions.plots import (
    chosen_rows,
    new_figure,
    paper_figure,
    save_for_a_column,
    styled,
)
from hsp_control.companions.plots.curves import legend_below
from hsp_control.companions.plots.palette import DESIRED, INK, SERIES
from hsp_control.companions.sweeps import sweep_figure
from hsp_control.control.actuation import Status
from hsp_control.null_space import metrics
from hsp_control.null_space.fields import FunctionField
from hsp_control.robot.integrators import Dop853, Rk4
from hsp_control.trajectories import ComposedPose, HoldOrientation

FOLDER = Path(__file__).parent / "figures"
GAIN, FREQUENCY = 4.0, 6.0
RELATIVE = r"$\|e_N\|_W$ relative to start [-]"

TURN = 2.0 * np.pi / 3.0  # of the paper's circle [s]
WHOLE_RUN = tuple(10.0 * k / 7.0 for k in range(8))
SECOND_TURN = tuple(TURN * (1.0 + k / 8.0) for k in range(8))


class PaperFigure(NamedTuple):
    """One of the paper's Figures 2 to 5.

    Attributes:
        number: The paper's number of it.
        configuration: Which simulation it shows.
        times: When the frames of its panels (d) and (e) are taken [s]. Ours: those of
            the paper could not be read.
    """

    number: int
    configuration: str
    times: tuple[float, ...]

    @property
    def file(self) -> Path:
        """Where it is kept."""
        return FOLDER / f"{self.configuration.replace('/', '_')}.png"

    def figure(self, rollout: hsp.Rollout) -> Figure:
        """Return it, of a run of its configuration."""
        return paper_figure(rollout, times=self.times, width="117mm")

    def save(self, rollout: hsp.Rollout) -> None:
        """Write it, with a record of its sources."""
        about = provenance(rollout, self.times)
        save_for_a_column(self.figure(rollout), self.file, about)


PAPER = (
    PaperFigure(2, "paper/1_uncontrolled", WHOLE_RUN),
    PaperFigure(3, "paper/2_rest", SECOND_TURN),
    PaperFigure(4, "paper/3_equal_angles", SECOND_TURN),
    PaperFigure(5, "paper/4_moving_obstacle", SECOND_TURN),
)


def provenance(rollout: hsp.Rollout, times: tuple[float, ...]) -> dict[str, str]:
    """Return a picture's numbers of its run, so that a test can repeat it.

    The configuration, and at the frames the time, the robot's points [m] and
    det(J W⁻¹ Jᵀ).
    """
    rows = chosen_rows(rollout, times=times)
    frames = {name: rollout[name][rows] for name in ("t", "skeleton", "manipulability")}
    return {
        "configuration": json.dumps(rollout.config, sort_keys=True),
        "frames": json.dumps({name: a.tolist() for name, a in frames.items()}),
    }


def main() -> None:
    """Draw everything into docs/figures."""
    FOLDER.mkdir(exist_ok=True)
    for one in PAPER:
        one.save(hsp.load_experiment(one.configuration).run())
    with styled():
        figure, (top, middle, bottom) = column_figure(3)
        draw_propositions(top, middle)
        draw_chaos(bottom)
        save_for_a_column(figure, FOLDER / "propositions.png")
        figure, (top, bottom) = column_figure(2)
        draw_null_space_under_a_force(top)
        draw_observed_force(bottom)
        save_for_a_column(figure, FOLDER / "compliance.png")
        figure, (top, bottom) = column_figure(2)
        draw_walk(top, bottom)
        save_for_a_column(figure, FOLDER / "walking.png")
        draw_weak_arm()
    draw_sweep()
    for file in sorted(FOLDER.glob("*.png")):
        print(f"Figure: {file.relative_to(FOLDER.parents[1])}")


def column_figure(panels: int) -> tuple[Figure, list[Axes]]:
    """Return a figure as wide as a column, and its panels one below the other."""
    figure = new_figure(84.0 / 25.4, 2.3 * panels)
    return figure, figure.subplots(panels, 1, squeeze=False).ravel().tolist()


def draw_sweep() -> None:
    """Draw the results of the sweep of hsp_control/companions/sweeps/page.md."""
    found = hsp.sweeps.sweep(
        "panda_obstacle",
        {
            "null_space.gain": "loguniform:2:60",
            "null_space.fields.0.weight": "loguniform:0.2:5",
            "scene.obstacles.ball.shape.radius": "uniform:0.05:0.2",
            "tasks.hand.gains.natural_frequency": "5:25",
            "start.joints.panda_joint4": "normal:-2.2:0.1",
        },
        samples=80,
        seed=1,
        overrides=["simulation.duration=6"],
    )
    with styled():
        outcomes = (
            "tracking.hand.position.rms",
            "null_space_error.rms",
            "manipulability.min",
            "distance.obstacle_clearance.min",
        )
        parameters = (
            "null_space.fields.0.weight",
            "scene.obstacles.ball.shape.radius",
            "tasks.hand.gains.natural_frequency",
        )
        figure = sweep_figure(found, outcomes, parameters=parameters, width="117mm")
        save_for_a_column(figure, FOLDER / "sweep_panda_obstacle.png")


def draw_weak_arm() -> None:
    """Draw Talos with a weak arm, with `static_effort` and without it."""
    name = "whole_body/talos_weak_arm"
    runs = {
        "with static_effort": hsp.load_experiment(name).run(),
        "without": hsp.load_experiment(name, "limits.static_effort=null").run(),
    }
    shown, (limits, names) = runs["with static_effort"], weak_arm_limits(name)
    figure = new_figure(4.6, 7.0)
    efforts, hand, mass, speed, status = figure.subplots(
        5, 1, sharex=True, height_ratios=(1.0, 1.0, 1.0, 1.0, 0.18)
    )
    dashes = ("-", "--", ":")
    for color, dash, joint in zip(SERIES, dashes, (2, 4, 5), strict=False):
        column = names.index(f"arm_right_{joint}_joint")
        used = 100.0 * np.abs(shown["tau"][:, column]) / limits[column]
        style = {"color": color, "ls": dash, "lw": 1.6, "label": f"arm joint {joint}"}
        efforts.plot(shown.t, used, **style)
    efforts.axhline(100, color=INK, lw=1.0, label="limit")
    efforts.set(ylabel="effort\n[% of limit]", ylim=(0.0, 108.0))
    efforts.set_title("(a)  Efforts, with static_effort", pad=20.0)
    hand.set_title("(b)  With static_effort, and without", pad=20.0)
    for color, dash, (label, run) in zip(SERIES, dashes, runs.items(), strict=False):
        style = {"color": color, "ls": dash, "lw": 1.6, "label": label}
        for axes, task in ((hand, "hand"), (mass, "center_of_mass")):
            error = np.linalg.norm(run[f"task.{task}.error"], axis=1)
            axes.semilogy(run.t, 1e3 * error + 1e-3, **style)
        speed.plot(run.t, np.abs(run["v"][:, 6:]).max(axis=1), **style)
    hand.set(ylabel="hand error\n[mm]", ylim=(1e-2, 1e3))
    mass.set(ylabel="centre of mass\nerror [mm]", ylim=(1e-2, 1e0))
    speed.set_ylabel("fastest joint\n[rad/s]")
    for axes, columns in ((efforts, 4), (hand, 2)):
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.02), ncols=columns)
    limited = shown["status"] >= Status.LIMITED
    status.fill_between(shown.t, 0.0, 1.0, where=limited, color=INK, alpha=0.45, lw=0)
    status.set(ylim=(0.0, 1.0), yticks=[], xlabel="time [s]")
    status.set_ylabel("limited", rotation=0, ha="right", va="center")
    status.grid(visible=False)
    figure.align_ylabels([efforts, hand, mass, speed])
    save_for_a_column(figure, FOLDER / "weak_arm.png")


def weak_arm_limits(name: str) -> tuple[Array, list[str]]:
    """Return the limits of a configuration's efforts and the names of its joints."""
    experiment = hsp.load_experiment(name)
    assert experiment.controller.limits is not None
    return experiment.controller.limits.effort, list(experiment.robot.dof_names)


def draw_walk(left: Axes, right: Axes) -> None:
    """Draw arms that swing by a field while Talos walks, and e_N in each phase."""
    plain = hsp.load_experiment("walking/talos_walk")
    joints = [plain.robot.velocity_index(f"arm_{s}_4_joint") for s in ("left", "right")]
    nv, rate, follows = plain.robot.nv, 2.0 * np.pi / 1.5, 6.0
    amplitudes, weights = np.zeros(nv), np.ones(nv)
    for joint, amplitude in zip(joints, (0.25, -0.25), strict=True):
        amplitudes[joint], weights[joint] = amplitude, follows
    swing = {
        "type": "lissajous",
        "center": [0.0] * nv,
        "amplitudes": amplitudes.tolist(),
        "rates": [rate] * nv,
    }
    run = hsp.load_experiment(
        "walking/talos_walk",
        f"null_space.fields.0.displacement={json.dumps(swing)}",
        f"null_space.fields.0.weights={weights.tolist()}",
        "simulation.log_period=0.002",
    ).run()
    t, phase = run.t, run["plan.phase"]
    share = follows / (follows + 1j * rate)
    for joint, side, color in zip(joints, ("left", "right"), SERIES, strict=False):
        angle = run["joint_positions"][:, joint][:, 0]
        left.plot(t, angle - angle[0], color=color, label=f"{side} elbow")
        predicted = (share * np.exp(1j * rate * t)).imag * amplitudes[joint]
        left.plot(t, predicted, color=INK, lw=1.0, ls="--")
    left.plot([], [], color=INK, lw=1.0, ls="--", label="predicted by the field")
    left.set(title="(a)  Arms that swing by a field", ylabel="angle [rad]")
    norm = run["null_space_norm"]
    right.semilogy(t, norm, color=SERIES[0], label=r"$\Vert e_N \Vert$")
    limited = run["status"] > 1
    begins = (np.diff(phase) != 0) | (np.diff(limited.astype(int)) != 0)
    for first, last in pairwise([0, *(np.flatnonzero(begins) + 1), len(t)]):
        if limited[first]:
            continue
        part = slice(first, last)
        decay = norm[first] * np.exp(-6.0 * (t[part] - t[first]))
        right.semilogy(t[part], decay, color=INK, lw=1.0, ls="--")
    right.semilogy(
        [], [], color=INK, lw=1.0, ls="--", label="exp(−$K_N$ t), each phase"
    )
    if limited.any():
        style = {"color": DESIRED, "alpha": 0.25, "lw": 0, "label": "limited"}
        right.fill_between(t, 1e-4, 10.0, where=limited, **style)
    right.set(
        title="(b)  Null-space error by phases",
        ylabel=r"$\Vert e_N \Vert$ [rad/s]",
        ylim=(1e-4, 1.0),
    )
    for axes in (left, right):
        axes.set(xlabel="time [s]")
        legend_below(axes)


def draw_propositions(left: Axes, middle: Axes) -> None:
    """Draw e and e_N of an iiwa that starts off its path, in three metrics."""
    robot = hsp.Robot.load("iiwa14")
    shown = {
        "$W = I$": metrics.IdentityMetric(),
        "$W$ constant": metrics.ConstantMetric(np.linspace(1.0, 3.0, 7)),
        "$W = M$": metrics.MassMatrixMetric(),
    }
    # Wide to narrow: the three lines lie on each other, that is the point.
    for color, width, name in zip(SERIES, (7.0, 4.5, 2.0), shown, strict=False):
        rollout = moving_iiwa(robot, shown[name])
        error = np.linalg.norm(rollout["task.hand.error"], axis=1)
        left.semilogy(rollout.t, error, color=color, lw=width, label=name)
        norm = rollout["null_space_norm"]
        middle.semilogy(rollout.t, norm / norm[0], color=color, lw=width, label=name)
    e0, e0_dot = (rollout[f"task.hand.{part}"][0] for part in ("error", "error_rate"))
    t = rollout.t[:, None]
    exact = (e0 + (e0_dot + FREQUENCY * e0) * t) * np.exp(-FREQUENCY * t)
    style = {"color": INK, "lw": 1.0, "ls": "--"}
    left.semilogy(rollout.t, np.linalg.norm(exact, axis=1), **style, label="predicted")
    middle.semilogy(rollout.t, np.exp(-GAIN * rollout.t), **style, label="predicted")
    left.set(
        title="(a)  The task: pose of an iiwa",
        ylabel=r"pose error $\Vert e \Vert$ [m, rad]",
    )
    middle.set(
        title="(b)  Its null space, field moving",
        ylabel=RELATIVE,
    )
    for axes in (left, middle):
        axes.set(xlabel="time [s]", ylim=(1e-7, 3.0))
        legend_below(axes)
        legend = axes.get_legend()
        assert legend is not None
        for line in legend.get_lines():
            line.set_linewidth(min(line.get_linewidth(), 3.0))  # beside its name


def moving_iiwa(robot: hsp.Robot, metric: metrics.Metric) -> hsp.Rollout:
    """Return a run with a pose task on a circle and a posture that swings."""
    state = robot.state(0.0, robot.home(), np.zeros(7))
    hand = state.frame("iiwa_link_ee")
    circle = hsp.Circle(0.1, 2.0, hand.position - [0.05, 0.0, 0.0])
    pose = ComposedPose(circle, HoldOrientation(hand.rotation))
    gains = hsp.Gains(natural_frequency=FREQUENCY)
    task = hsp.FramePose("iiwa_link_ee", pose, gains=gains, name="hand")
    swing = FunctionField(
        lambda s: 0.8 * np.sin(1.5 * s.t + np.arange(7)) - robot.joint_positions(s.q)
    )
    controller = hsp.Controller(
        robot, [task], swing, null_space_gain=GAIN, metric=metric
    )
    rng = np.random.default_rng(1)
    start = robot.integrate(state.q, 0.1 * rng.standard_normal(7))
    return hsp.simulate(
        controller,
        start,
        0.3 * rng.standard_normal(7),
        duration=3.0,
        integrator=Dop853(1e-10, 1e-10),
    )


def draw_null_space_under_a_force(axes: Axes) -> None:
    """Draw ‖e_N‖ of a compliant Panda that is pushed at the hand, in two metrics."""
    robot = hsp.Robot.load("panda")
    spring = hsp.Impedance([600, 600, 600, 40, 40, 40], damping_ratio=0.8)
    push = hsp.plants.Push("panda_tcp", [10.0, 30.0, 10.0], start=0.5, duration=1.0)
    integrator = Rk4(0.001)
    start = robot.integrate(robot.home(), 0.1 * np.cos(1.0 + np.arange(7)))
    away = robot.integrate(start, 0.4 * np.sin(1.0 + np.arange(7)))
    shown = {
        "$W = I$": metrics.IdentityMetric(),
        "$W = M$": metrics.MassMatrixMetric(),
    }
    axes.axvspan(push.start, push.start + push.duration, color=INK, alpha=0.08)
    for color, width, name in zip(SERIES, (2.0, 4.5), shown, strict=False):
        rollout = hsp.simulate(
            hsp.Controller(
                robot,
                [hsp.FramePose("panda_tcp", impedance=spring)],
                hsp.TargetPosture(away),
                null_space_gain=GAIN,
                metric=shown[name],
                limits=None,
            ),
            start,
            duration=2.5,
            integrator=integrator,
            plant=hsp.plants.RigidBody(pushes=[push]).build(robot, integrator),
        )
        norm = rollout["null_space_norm"]
        axes.semilogy(rollout.t, norm / norm[0], color=color, lw=width, label=name)
    style = {"color": INK, "lw": 1.0, "ls": "--"}
    axes.semilogy(rollout.t, np.exp(-GAIN * rollout.t), **style, label="no force")
    axes.set(
        title="(a)  An unknown force of 33 N",
        xlabel="time [s]",
        ylabel=RELATIVE,
    )
    legend_below(axes)


def draw_observed_force(axes: Axes) -> None:
    """Draw the force at the hand of a bundled run: true, observed, and the spring's."""
    experiment = hsp.load_experiment("compliance/panda_cartesian_impedance")
    rollout = experiment.run()
    pushes = experiment.scenario.plant.pushes
    at_hand = [each for each in pushes if each.frame == "panda_tcp"]
    t = rollout.t
    true = sum(each.force[1] * np.array([each.is_active(x) for x in t])
               for each in at_hand)  # fmt: skip
    soft = np.clip((t - 5.0) / 0.5, 0.0, 1.0)
    soft = soft**3 * (10.0 - 15.0 * soft + 6.0 * soft**2)
    spring = -(600.0 - 450.0 * soft) * rollout["task.hand.error"][:, 1]
    axes.plot(t, spring, color=SERIES[1], lw=2.0, label="spring: $K (x - x_d)$")
    observed = rollout["observer.wrench.hand"][:, 1]
    axes.plot(t, observed, color=SERIES[0], lw=2.0, label="observed")
    axes.plot(t, true, color=INK, lw=1.0, ls="--", label="true")
    axes.set(
        title="(b)  Its spring, softer from 5 s on",
        xlabel="time [s]",
        ylabel="force along y [N]",
    )
    legend_below(axes)


def draw_chaos(axes: Axes) -> None:
    """Draw how far two starts 1e-9 rad apart get, with and without control."""
    shown = {
        "1_uncontrolled": (DESIRED, r"$\varphi_N = 0$"),
        "3_equal_angles": (SERIES[0], r"$g = -\nabla f$"),
    }
    for name, (color, label) in shown.items():
        runs = []
        for nudge in (0.0, 1e-9):
            experiment = hsp.load_experiment(f"paper/{name}")
            robot = experiment.robot
            q0 = robot.integrate(experiment.q0, np.array([nudge, 0.0, 0.0]))
            runs.append(
                hsp.simulate(
                    experiment.controller,
                    q0,
                    duration=10.0,
                    integrator=Dop853(1e-12, 1e-12),
                )
            )
        apart = np.abs(runs[0]["joint_positions"] - runs[1]["joint_positions"])
        axes.semilogy(runs[0].t, apart.max(axis=1) + 1e-17, color=color, label=label)
    axes.set(
        title="(c)  Two starts 1e-9 rad apart",
        xlabel="time [s]",
        ylabel="joints' difference [rad]",
    )
    legend_below(axes)


if __name__ == "__main__":
    main()
