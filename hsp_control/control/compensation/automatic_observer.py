"""Conditions and rate of the automatic momentum observer.

It is on wherever the robot may differ from its model and nothing is to yield: a spring
that yields to a hand, and a contact that presses, are forces that the model does not
explain, too, and an observer would cancel them.

The rate. On a robot whose inertia is 1/ρ times the model's the loop is, slower than the
observer's own poles,

    e'' = -ρ (Kp e + Kv e') (s + K_O)/(s + ρ K_O).

A heavy robot (ρ < 1, rotors that the model lacks) makes the observer ρ K_O slow: with
Kp = 100 and Kv = 20 it winds up below ρ = 0.08 at 50 1/s, and below 0.11 at 30. On a
lighter one (ρ > 1) a fast observer tolerates less delay: with 2 ms and a lag of 3 ms,
up to ρ = 4 at 50 1/s, 2 at 100. Its noise is less than that of the law's own
damping up to 58 1/s at 1 kHz (`MomentumObserver.order`). So 50 1/s; and at longer
periods as many per period, since half a period of hold and one of computing is delay.
"""

from math import exp
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.compensation.momentum_observer import (
    MomentumObserver,
    RunningObserver,
)
from hsp_control.control.compensation.stage import Run
from hsp_control.control.controller import Controller
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.compliant_task import impedance_of

BANDWIDTH = 50.0
"""Rate K_O at short periods [1/s]."""
MOST_PER_PERIOD = 0.1
"""Maximum of K_O h [-]."""
LARGEST_SHARE = 0.5
"""Largest cancelled effort relative to a joint's limit [-]: gravity wrong by a fifth,
and the load that an arm's manufacturer permits, are well below it."""


class Choice(NamedTuple):
    """The automatic observer, or the reason why there is none."""

    observer: MomentumObserver | None
    reason: str  # the reason why it is inactive, empty if active


def automatic_observer(
    controller: Controller, period: float | None, exact: bool
) -> Choice:
    """Return the observer of ``momentum_observer: auto``.

    Args:
        controller: The controller.
        period: The control period [s]; None: efforts are not held.
        exact: Whether the plant is the controller's model.
    """
    if period is None:
        return Choice(None, "efforts are not held for a period")
    if exact:
        return Choice(None, "the robot is its model")
    if reason := _what_forbids(controller):
        return Choice(None, reason)
    rate = min(BANDWIDTH, MOST_PER_PERIOD / period)
    clip = [
        each if each < np.inf else None
        for each in largest_cancelled(controller.robot).tolist()
    ]
    unlimited = all(each is None for each in clip)
    observer = MomentumObserver(rate, None if unlimited else clip, order=2)
    return Choice(observer, "")


def begin_automatic(controller: Controller) -> "AutomaticObserver | None":
    """Return the observer of a real robot for one run; None if there is none.

    It learns of the period from its periods.
    """
    return None if _what_forbids(controller) else AutomaticObserver(controller)


class AutomaticObserver(RunningObserver):
    """The automatic observer in one run.

    A task that is added may have an impedance: then the cancelled effort fades
    at the observer's rate, and returns when that task is removed.
    """

    def __init__(self, controller: Controller) -> None:
        clip = largest_cancelled(controller.robot)
        super().__init__(BANDWIDTH, clip, 2, most_per_period=MOST_PER_PERIOD)
        self._tasks, self._forbidden = controller.planned_tasks, False
        self._weight = 1.0  # fraction of the estimate that is cancelled

    def measure(self, run: Run) -> None:
        """Learn from the effort that acted; see `Stage.measure`."""
        tasks = run.controller.planned_tasks
        if tasks != self._tasks:
            self._tasks = tasks
            self._forbidden = bool(_what_forbids(run.controller))
        wanted = 0.0 if self._forbidden else 1.0
        left = exp(-min(BANDWIDTH * run.last_period, MOST_PER_PERIOD))
        self._weight = wanted + left * (self._weight - wanted)
        super().measure(run)

    def update(self, state: RobotState, tau: Array, period: float) -> Array:
        """Return r; see `RunningObserver.update`."""
        disturbance = super().update(state, tau, period)
        self.cancelled *= self._weight
        return disturbance


def _what_forbids(controller: Controller) -> str:
    """Return why nothing may be cancelled, empty if nothing forbids it."""
    if controller.robot.unactuated:
        return "the base floats, and its contact forces are not known"
    if controller.contacts:
        return "a contact presses"
    for task in controller.planned_tasks:
        if impedance_of(task) is not None:
            return f"a hand with an impedance yields, task {task.name!r}"
    return ""


def largest_cancelled(robot: Robot) -> Array:
    """Return the largest effort that is cancelled, shape (nv,); inf: any."""
    return LARGEST_SHARE * robot.largest_efforts()
