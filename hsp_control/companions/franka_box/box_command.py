"""``hsp franka-box``: a Franka's control box without a robot."""

import argparse
import sys
from collections.abc import Callable
from contextlib import nullcontext

from hsp_control.cli.live_experiment import of_a_robot
from hsp_control.cli.loading import robot_access
from hsp_control.common.errors import LiveError
from hsp_control.companions.franka.layouts import PERIOD, PORT, VERSION
from hsp_control.companions.franka_box import Arm, ControlBox, Server
from hsp_control.companions.franka_box.gripper import Gripper
from hsp_control.companions.franka_box.log import BoxLog
from hsp_control.config import Experiment
from hsp_control.config.document import read_document
from hsp_control.live import OperatorRequests
from hsp_control.live.operator_requests import stop_signals
from hsp_control.live.real_time import real_time_priority
from hsp_control.live.simulated_robot import sampled
from hsp_control.robot import Robot
from hsp_control.robot.description.sources import is_robot

MOTOR_INERTIA = 0.1
"""Rotor inertia behind the gear of every joint, where only a robot is named [kg·m²].

That of the Panda in MuJoCo Menagerie. Without any, the wrist is so light that the
damping of libfranka's own examples is unstable at 1 kHz.
"""
_EVERY = 250
"""Periods between two updates of the terminal's last line."""
_WARM_UP = 20


def franka_box(options: argparse.Namespace) -> int:
    """Serve clients until Ctrl-C."""
    experiment = _experiment(options)
    terminal = _Terminal()
    box = _box(experiment, lambda _: None)
    for _ in range(_WARM_UP):  # first calls happen now, not in a motion
        box.step(None)
    box = _box(experiment, terminal.say)
    terminal.box = box
    requests = OperatorRequests()
    with (
        stop_signals(requests, takes_over=True),
        real_time_priority(options.priority),
        Server(
            box,
            terminal.say,
            host=options.host,
            lockstep=options.lockstep,
            deadline=1e-6 * options.deadline,
            patience=options.patience,
            cut=options.cut,
        ) as server,
        BoxLog(options.log, experiment, box) if options.log else nullcontext() as log,
    ):
        terminal.server = server
        Gripper(terminal.say, options.host)
        time = "in lockstep" if options.lockstep else "in real time"
        terminal.say(
            f"{experiment.robot.name} behind {options.host}:{PORT}, research interface "
            f"{VERSION} (libfranka 0.18 to 0.21), {time}; Ctrl-C ends it"
        )

        def on_period() -> bool:
            terminal.on_period()
            return requests.reason is None

        server.serve(on_period)
    terminal.end()
    if log is not None:
        print(f"Log: {log.path}")
    return 0


def _experiment(options: argparse.Namespace) -> Experiment:
    """Return the experiment of a configuration, or of a robot at home."""
    source, name = options.config, str(options.config)
    if is_robot(name):
        # The message concerns the robot, not a task.
        Arm(Robot.load(name, access=robot_access(name, options)))
        source = {
            "robot": {"name": name},
            "tasks": {"hand": {"type": "frame_pose"}},
            "plant": {"type": "rigid_body", "motor_inertia": MOTOR_INERTIA},
        }
    strict = options.strict or bool(options.allow)
    period = f"simulation.control_period={PERIOD}"  # whatever the configuration has
    document = read_document(source, strict=strict, allow=options.allow)
    for assignment in (*options.overrides, period):
        document.override(assignment)
    experiment = of_a_robot(document)
    if experiment.v0.any():
        raise LiveError("start: the box holds the arm at rest; leave out its velocity")
    return experiment


def _box(experiment: Experiment, say: Callable[[str], object]) -> ControlBox:
    plant = sampled(experiment.plant, experiment.integrator, PERIOD)
    return ControlBox(Arm(experiment.robot), plant, experiment.q0, say)


class _Terminal:
    """Prints a line per event, and below them the present status.

    Attributes:
        box: The box, once it exists.
        server: The server, once it exists.
    """

    def __init__(self) -> None:
        self.box: ControlBox | None = None
        self.server: Server | None = None
        self._live = sys.stderr.isatty()
        self._periods = 0

    def say(self, line: str) -> None:
        """Print a line, with the simulated time [s]."""
        time = 0.0 if self.box is None else self.box.t
        self.end()
        print(f"{time:9.3f}  {line}", flush=True)

    def on_period(self) -> None:
        """Update the last line of a terminal periodically."""
        self._periods += 1
        if self._live and self._periods % _EVERY == 0 and self.server is not None:
            print(f"\r\x1b[K{_standing(self.server)}", end="", file=sys.stderr)
            sys.stderr.flush()

    def end(self) -> None:
        """Erase the last line."""
        if self._live:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)


def _standing(server: Server) -> str:
    """Return the client, the mode, and the statistics of commands."""
    box, client = server.box, server.client
    parts = [
        f"{box.t:9.3f}  {client.name if client else 'no client'}",
        box.mode.name.lower().replace("_", " "),
    ]
    if box.motion is not None:
        motion = box.motion
        parts.append(f"{motion.commands} commands, success {motion.success_rate:.2f}")
    if client is not None:
        parts.append(f"{client.late} late, {client.outdated} outdated")
    if server.overrun > 0.1:
        parts.append(f"the box is {server.overrun:.1f} s behind real time")
    return " | ".join(parts)
