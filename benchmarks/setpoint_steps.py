"""Targets that jump: how efforts change where limits bind, and how soon it is over.

    .venv-peers/bin/python benchmarks/setpoint_steps.py

A Panda's hand is asked to be elsewhere at once; rigid bodies, efforts held for 1 ms.
This law within the robot's limits, also with a limit on the effort's rate; this law and
the operational space with efforts that are clipped; TSID with bounds on efforts,
positions and speeds. Writes a table into results/limits.md. Without TSID its rows are
omitted.
"""

from collections.abc import Callable, Iterator
from types import SimpleNamespace

import numpy as np
from controllers import operational_space
from limit_side_by_side import (
    PERIOD,
    Compute,
    Run,
    clipped,
    close_loop,
    this_law,
    tsid_of,
)
from marked_sections import RESULTS, replace_section

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import RobotLimits, own_limits

JUMPS = {
    "7 cm forwards": (0.07, 0.0, 0.0),
    "25 cm aside": (0.0, 0.25, 0.0),
    "25 cm down": (0.0, 0.0, -0.25),
}
FREQUENCIES = (20.0, 40.0)  # of the task [1/s]
K_N, POSTURE_RATE = 10.0, 1.0  # [1/s]
DURATION = 1.2  # [s]
SETTLED = 0.02  # of the jump [-]


def experiment(
    jump: tuple[float, float, float], frequency: float, limits: hsp.Limits | None
) -> hsp.Experiment:
    """Return a hand whose target is elsewhere from the beginning."""
    robot = hsp.Robot.load("panda")
    state = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    target = state.position("panda_tcp") + jump
    hand = hsp.FramePosition(
        "panda_tcp",
        hsp.Hold(target),
        gains=hsp.Gains(natural_frequency=frequency),
        name="hand",
    )
    return hsp.Experiment(
        robot,
        [hand],
        hsp.TargetPosture("home", weights=POSTURE_RATE),
        null_space_gain=K_N,
        limits=limits,
        simulation=hsp.simulation.SimulationSettings(
            duration=DURATION, control_period=PERIOD, check_rate=False
        ),
    )


def operational_space_of(free: hsp.Experiment, limits: RobotLimits) -> Compute:
    """Return Khatib's form with the same gains, and its efforts clipped."""
    (task,) = free.controller.tasks
    feedback = free.controller.feedback("hand")
    home = free.q0

    def posture(t: float, q: Array, v: Array) -> Array:
        return K_N * POSTURE_RATE * (home - q) - (K_N + POSTURE_RATE) * v

    still = SimpleNamespace(
        rotation=np.eye(3),
        angular_velocity=np.zeros(3),
        angular_acceleration=np.zeros(3),
    )
    law = operational_space.make(
        SimpleNamespace(  # type: ignore[arg-type]
            robot=free.robot,
            rows=3,
            frame="panda_tcp",
            kp=feedback.Kp[0, 0],
            kv=feedback.Kv[0, 0],
            desired=lambda t: (task.trajectory.sample(t), still),
            posture_acceleration=posture,
        )
    )
    return lambda t, q, v: np.clip(law(t, q, v), -limits.effort, limits.effort)


def controllers(
    jump: tuple[float, float, float], frequency: float, limits: RobotLimits
) -> Iterator[tuple[str, Callable[[], Compute]]]:
    """Yield what is compared, by name."""

    def made(kept: hsp.Limits | None) -> hsp.Experiment:
        return experiment(jump, frequency, kept)

    yield "this law", lambda: this_law(made(hsp.Limits()))
    with_rate = hsp.Limits(effort_rate=1000.0)
    yield "this law, 1000 N·m/s", lambda: this_law(made(with_rate))
    yield "this law, clipped", lambda: clipped(made(None), limits.effort)
    yield (
        "operational space, clipped",
        lambda: operational_space_of(made(None), limits),
    )
    try:
        import tsid  # noqa: F401
    except ImportError:
        print("TSID is not installed: make bench")
    else:
        yield "TSID, posture 1e-03", lambda: tsid_of(made(None), limits, 1e-3)


def row(what: str, name: str, run: Run, limits: RobotLimits) -> str:
    """Return a line of the table."""
    change = np.abs(np.diff(run.tau, axis=0))
    late = np.flatnonzero(run.error > SETTLED * run.error[0])
    end = run.end or ("" if run.t[late[-1]] < DURATION - 0.01 else "does not settle")
    margin = np.minimum(run.q - limits.lower, limits.upper - run.q).min()
    cells = (
        f"{change.max():.1f}",
        f"{np.sqrt(np.mean((change / PERIOD) ** 2)):.0f}",
        end or f"{1e3 * run.t[late[-1]]:.0f}",
        f"{100 * (np.abs(run.v) / limits.velocity).max():.0f} %",
        f"{1e3 * margin:.0f}",
    )
    return f"| {what} | {name} | " + " | ".join(cells) + " |\n"


HEADER = (
    "| target jumps by | controller | largest change of an effort in 1 ms [N·m] | "
    "rms of the rate [N·m/s] | time to 2 % [ms] | largest speed / limit | minimum "
    "distance from a joint's limit [mrad] |\n|---|---|--:|--:|--:|--:|--:|\n"
)


def main() -> None:
    """Run all, write the table."""
    limits = own_limits(hsp.Robot.load("panda"))
    table = HEADER
    print(table, end="")
    for what, jump in JUMPS.items():
        for frequency in FREQUENCIES:
            for name, make in controllers(jump, frequency, limits):
                run = close_loop(experiment(jump, frequency, None), make())
                line = row(f"{what}, ω₀ = {frequency:g}", name, run, limits)
                print(line, end="", flush=True)
                table += line
    replace_section(RESULTS / "limits.md", "setpoint_steps", "\n" + table + "\n")


if __name__ == "__main__":
    main()
