"""Measure a control loop against the clock, in turns with an empty loop.

    .venv/bin/python benchmarks/latency.py [CONFIG] [--seconds S] [--rate HZ]
        [--priority LEVEL]

The controller of a configuration without a plan moves its own model, in the rest of
every period. Prints the table of benchmarks/results/latency.md for this machine.
"""

import argparse
from collections.abc import Callable
from time import perf_counter_ns, sleep

import numpy as np
from numpy.typing import NDArray

import hsp_control as hsp
from hsp_control.live.real_time import no_garbage_collection, real_time_priority
from hsp_control.robot.integrators import SemiImplicitEuler
from hsp_control.simulation.plants import IntegratedPlant, RigidBodyPlant

TURN = 2.0
"""Time that a loop runs before the other one has its turn [s]: disturbances of the
machine vary with time, and both loops must see the same ones."""

Times = list[tuple[int, int]]
"""Wake-up time from the period's start, and duration of the step, per period [ns]."""


class Loop:
    """A controller and the model that it moves."""

    def __init__(self, experiment: hsp.Experiment, period: float) -> None:
        """Begin at the experiment's start; a period lasts ``period`` [s]."""
        if experiment.scenario.plan is not None:
            raise SystemExit("the configuration has a plan; choose one without")
        self._controller, self._period = experiment.controller, period
        model = RigidBodyPlant(experiment.robot)
        self._plant = IntegratedPlant(model, SemiImplicitEuler(period))
        self._start = experiment.q0, experiment.v0
        self.restart()

    def restart(self) -> None:
        """Return to the start."""
        self.periods = 0
        self._q, self._v = (part.copy() for part in self._start)
        self._plant.reset(0.0, self._q, self._v)
        self._controller.restart()

    def step(self) -> None:
        """Compute the effort: the cost of a period without its input and output."""
        t = self.periods * self._period
        self._tau = self._controller.compute(t, self._q, self._v).tau

    def move(self) -> None:
        """Move the model for a period."""
        t, h = self.periods * self._period, self._period
        self._controller.applied(self._tau, h)
        self._q, self._v = self._plant.advance(t, t + h, self._tau)
        self.periods += 1


def nothing() -> None:
    """Do the work of the empty loop."""


def run(
    step: Callable[[], None], after: Callable[[], None], period: int, count: int
) -> Times:
    """Run some periods [ns]; a late one begins at once, the others on time."""
    times: Times = []
    begin = perf_counter_ns() + period
    for _ in range(count):
        if (now := perf_counter_ns()) < begin:
            sleep((begin - now) * 1e-9)
        awake = perf_counter_ns()
        step()
        times.append((awake - begin, perf_counter_ns() - awake))
        begin += period
        after()
    return times


def row(name: str, times: NDArray[np.int64]) -> str:
    """Return a line of the table."""
    most = np.quantile(times * 1e-3, [0.5, 0.99, 0.999, 1.0], method="higher")
    return f"| {name} | {' | '.join(f'{each:.0f}' for each in most)} |"


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("config", nargs="?", default="panda_obstacle")
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rate", type=float, default=1000.0)
    parser.add_argument("--priority", type=int)
    options = parser.parse_args()
    count, period = round(options.seconds * options.rate), round(1e9 / options.rate)
    turn = round(TURN * options.rate)
    loop = Loop(hsp.load_experiment(options.config), 1.0 / options.rate)
    # With ordinary priority, because Linux stops real-time
    # processes that do not sleep.
    back_to_back = []
    for _ in range(count):
        start = perf_counter_ns()
        loop.step()
        back_to_back.append(perf_counter_ns() - start)
        loop.move()
    loop.restart()
    control: Times = []
    empty: Times = []
    with no_garbage_collection(), real_time_priority(options.priority):
        while len(control) < count:
            steps = min(turn, count - len(control))
            control += run(loop.step, loop.move, period, steps)
            empty += run(nothing, nothing, period, steps)
    (wake, steps_taken), (alone, _) = np.array(control).T, np.array(empty).T
    print("| part of a period | median | p99 | p99.9 | worst |\n|---|--:|--:|--:|--:|")
    print(row("step: state and law", steps_taken))
    print(row("the same back to back, without waiting", np.array(back_to_back)))
    print(row("wake-up", wake))
    print(row("wake-up of the empty loop", alone))
    print(row("from the period's beginning to the effort", wake + steps_taken))
    missed, others = (wake + steps_taken > period).sum(), (alone > period).sum()
    print(f"\n{missed} of {count} periods were missed, {others} by the empty loop")


if __name__ == "__main__":
    main()
