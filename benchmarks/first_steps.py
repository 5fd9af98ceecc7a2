"""The first step after each kind of change, beside a step without changes.

    .venv/bin/python benchmarks/first_steps.py [--processes N] [--cases NAME,...]

Each change is made in fresh processes while the controller moves its own model at
1 kHz, without Python's garbage collector, as in a live loop. CPU time of `compute` and
`applied`: a step before the change; the most expensive one of the first after the call,
the first of the ramp and the two after its end; the minimum over the processes, since
others disturb. Where another thread sends a message, the loop waits for that thread
before each step: a step after a wait is slower, with and without a message. Writes a
table into benchmarks/results/first_steps.md.
"""

import argparse
import gc
import json
import subprocess
import sys
import warnings
from collections.abc import Callable
from queue import Queue
from statistics import median
from threading import Thread
from time import thread_time_ns
from typing import Any

import numpy as np
import pinocchio as pin
from shared.marked_sections import RESULTS, replace_section

import hsp_control as hsp
from hsp_control.control.measurement import Measurement

PERIOD = 1e-3  # [s]
CALL = 0.3  # when a change is called [s]

Change = Callable[[hsp.Controller], Any]


def later(controller: hsp.Controller) -> Any:
    """Return an object that makes a change 50 ms after the call, in 100 ms."""
    return controller.at(CALL + 0.05).ramp(0.1)


class Sender(Thread):
    """A thread that sends what is put into its queue."""

    def __init__(self, send: Callable[[Any], Any]) -> None:
        """Begin to wait."""
        super().__init__(daemon=True)
        self._send, self._queue = send, Queue[Any]()
        self.start()

    def send(self, target: Any) -> None:
        """Let the thread send a target, or nothing, and wait until it has."""
        self._queue.put(target)
        self._queue.join()

    def run(self) -> None:
        """Send."""
        while True:
            if (target := self._queue.get()) is not None:
                self._send(target)
            self._queue.task_done()


def here(controller: hsp.Controller) -> pin.SE3 | np.ndarray[Any, Any]:
    """Return a target 1 cm beside the first task's frame."""
    task: Any = controller.tasks[0]
    pose = controller.state.frame(task.frame)
    beside = pose.position + np.array([0.01, 0.0, 0.0])
    return pin.SE3(pose.rotation, beside) if task.rows == 6 else beside


def hand(controller: hsp.Controller) -> str:
    """Return the name of the first task."""
    return controller.tasks[0].name


def first_contact(controller: hsp.Controller) -> str:
    """Return the name of the last contact."""
    return controller.contacts[-1].name


def one_joint(controller: hsp.Controller) -> hsp.Task:
    """Return a task that the others leave room for."""
    joint = controller.robot.joint_names[-1]
    return hsp.JointPosture(joints=[joint], name="more", priority=9)


CHANGES: dict[str, Change] = {
    "gains": lambda c: later(c).gains(hand(c), hsp.Gains(natural_frequency=7.0)),
    "null-space gain": lambda c: later(c).null_space_gain(5.0),
    "field": lambda c: later(c).field(hsp.JointCentering()),
    "payload": lambda c: later(c).payload(c.robot.end_effector, mass=1.0),
    "gravity": lambda c: later(c).gravity([0.0, 0.0, -9.0]),
    "limits": lambda c: later(c).limits(hsp.Limits()),
    "no limits": lambda c: later(c).limits(None),
    "a task more": lambda c: later(c).add(one_joint(c)),
    "a task less": lambda c: later(c).remove(c.tasks[-1].name),
    "set_target": lambda c: c.set_target(hand(c), here(c)),
    "contact lifted": lambda c: later(c).contact(first_contact(c), active=False),
    "force": lambda c: later(c).force(
        first_contact(c), hsp.contacts.CommandedForce(20.0)
    ),
}
MESSAGES = (
    "message",
    "first message of another thread",
    "later message of another thread",
)
ARM = [name for name in CHANGES if name not in ("contact lifted", "force")]
CASES: dict[str, list[str]] = {
    "panda_obstacle": [*ARM, *MESSAGES],
    "forces/panda_wipe": ["gains", "a task more", "contact lifted", "force"],
    "whole_body/talos_lift_foot": ["gains", "payload", "a task more"],
    "walking/talos_walk": ["modes of its plan"],
}
"""Changes, by configuration."""


class Run:
    """A controller that moves its own model."""

    def __init__(self, name: str) -> None:
        """Begin at the configuration's start."""
        self.experiment = hsp.load_experiment(name)
        self.controller = self.experiment.controller
        self.q, self.v = self.experiment.q0.copy(), self.experiment.v0.copy()
        self.times: list[float] = []
        made = self.experiment.scenario.plan
        self.plan = None if made is None else made.begin(self.controller)
        self.modes: list[int] = []  # steps of other contacts or tasks than before
        self._stack: Any = None

    def step(self) -> None:
        """Make a step, and move."""
        controller, k = self.controller, len(self.times)
        if self.plan is not None:
            self.plan.update(Measurement(k, k * PERIOD, self.q, self.v))
        begun = thread_time_ns()
        output = controller.compute(k * PERIOD, self.q, self.v)
        controller.applied(output.tau, PERIOD)
        self.times.append(1e-3 * (thread_time_ns() - begun))
        if (stack := controller.active_stack) is not self._stack:
            self._stack = stack
            self.modes.append(k)
        self.v = self.v + PERIOD * output.acceleration
        self.q = pin.integrate(controller.robot.model, self.q, PERIOD * self.v)


def measured(name: str, kind: str) -> tuple[float, float]:
    """Return CPU times of a step before a change, and of the first ones of it [µs]."""
    run = Run(name)
    gc.disable()
    if kind == "modes of its plan":
        for _ in range(3000):
            run.step()
        times = run.times
        # Limits bind in some modes and not in others: beside the steps that follow.
        modes = [(median(times[k + 1 : k + 50]), times[k]) for k in run.modes[1:]]
        return max(modes, key=lambda mode: mode[1] / mode[0])
    for _ in range(round(CALL / PERIOD)):
        run.step()
    if kind in MESSAGES:
        stream = run.controller.set_target(hand(run.controller), here(run.controller))
        sender = Sender(stream.send)
        for k in range(1000):
            if k % 50 == 49 and kind.startswith("later"):
                sender.send(here(run.controller))
            elif kind.endswith("another thread"):
                sender.send(None)  # steps before it wait for the thread, too
            run.step()
    free, call = median(run.times[-100:]), len(run.times)
    if kind.endswith("another thread"):
        sender.send(here(run.controller))
    elif kind == "message":
        stream.send(here(run.controller))
    else:
        CHANGES[kind](run.controller)
    while len(run.times) < call + 300:
        run.step()
    first = [call]
    if kind == "set_target":  # which begins at once, with a ramp of 0.2 s
        first += range(call + 200, call + 203)
    elif kind not in MESSAGES:
        first += call + 50, *range(call + 150, call + 153)
    return free, max(run.times[k] for k in first)


def main() -> None:
    """Measure, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--processes", type=int, default=5)
    parser.add_argument("--cases", default=",".join(CASES))
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        warnings.simplefilter("ignore")
        print(json.dumps(measured(*options.one)))
        return
    rows = []
    for case in options.cases.split(","):
        for kind in CASES[case]:
            command = [sys.executable, __file__, "--one", case, kind]
            found = [
                json.loads(subprocess.run(command, stdout=-1, check=True).stdout)
                for _ in range(options.processes)
            ]
            share, free, first = min(
                ((first - 50.0) / free, free, first) for free, first in found
            )
            rows.append(f"| {case} | {kind} | {free:.0f} | {first:.0f} | {share:.1f} |")
            print(rows[-1], flush=True)
    table = "\n".join([HEADER, *rows]) + "\n"
    if options.cases == ",".join(CASES):
        replace_section(RESULTS / "first_steps.md", "first_steps.py", table)


HEADER = (
    "| configuration | change | step [µs] | first steps [µs] "
    "| (first − 50 µs) / step |\n|---|---|--:|--:|--:|"
)


if __name__ == "__main__":
    main()
