"""The cost of watching a loop: a step, and its lateness, with and without the thread.

    python hsp_control/companions/viewer/benchmark/watching.py [SECONDS] [PERIOD]

Spans with and without `hsp.viewer.watch` take turns. Of the step the time of the
thread is measured, of the loop by how much it wakes too late.
"""

import sys
from time import perf_counter, sleep, thread_time

import numpy as np

import hsp_control as hsp

SPAN = 1.0  # s


def run(controller: hsp.Controller, span: float, period: float) -> list[list[float]]:
    """Return the time of each step and how late its period began [s]."""
    robot, steps, late = controller.robot, [], []
    q, v = robot.home(), np.zeros(robot.nv)
    start = perf_counter()
    for k in range(int(span / period)):
        due = start + k * period
        while (now := perf_counter()) < due:
            sleep(max(due - now - 1e-4, 0.0))
        late.append(now - due)
        before = thread_time()
        output = controller.compute(now, q, v)
        controller.applied(output.tau, period)
        steps.append(thread_time() - before)
    return [steps, late]


def main(seconds: float = 20.0, period: float = 0.001) -> None:
    """Print the medians and the tails."""
    robot = hsp.Robot.load("panda")
    hand = hsp.FramePose(
        "panda_tcp", hsp.Circle(radius=0.1, angular_rate=1.0), name="h"
    )
    controller = hsp.Controller(robot, [hand], hsp.JointCentering())
    run(controller, SPAN, period)
    found: dict[bool, list[list[float]]] = {False: [[], []], True: [[], []]}
    for k in range(int(seconds / SPAN)):
        watched = bool(k % 2)
        page = hsp.viewer.watch(controller) if watched else None
        sleep(1.0)
        for known, new in zip(
            found[watched], run(controller, SPAN, period), strict=True
        ):
            known += new
        if page is not None:
            page.close()
    for watched, (steps, late) in found.items():
        step, tail = 1e6 * np.median(steps), 1e6 * np.percentile(late, [50, 99, 99.9])
        print(
            f"{'watched' if watched else 'alone':8} step {step:.1f} µs; late "
            f"{tail[0]:.0f} (median), {tail[1]:.0f} (99 %), {tail[2]:.0f} µs (99.9 %)"
        )


if __name__ == "__main__":
    main(*map(float, sys.argv[1:]))
