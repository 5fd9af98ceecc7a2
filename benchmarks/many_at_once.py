"""Measure forward dynamics of many states: one by one, and in Pinocchio's pool.

    .venv/bin/python benchmarks/many_at_once.py [--robot panda] [--rounds N]

Per state, medians over interleaved rounds of 1000 states: `pin.aba` through its Python
bindings, the native call of a rollout, and `pin.abaInParallel` with one and two threads
of a `pin.ModelPool`. Copying a state to where the native call reads it counts.
"""

import argparse
from collections.abc import Callable
from time import perf_counter

import numpy as np
import pinocchio as pin

from hsp_control import Robot, engine

STATES = 1000


def ways(robot: Robot) -> dict[str, Callable[[], object]]:
    """Return what computes the accelerations of all states, by name."""
    model, rng = robot.model, np.random.default_rng(0)
    q = np.array([robot.random_configuration(rng) for _ in range(STATES)])
    v, tau = rng.standard_normal((2, STATES, robot.nv))
    data, columns = model.createData(), [np.asfortranarray(x.T) for x in (q, v, tau)]
    pool, out = pin.ModelPool(model, 2), np.asfortranarray(np.zeros((robot.nv, STATES)))
    here = q[0].copy(), v[0].copy(), tau[0].copy()
    call = engine.ForwardDynamics(
        dynamics=robot.dynamics(),
        **dict(zip(("q", "v", "effort"), here, strict=True)),
        acceleration=np.zeros(robot.nv),
    )

    def bindings() -> None:
        for k in range(STATES):
            pin.aba(model, data, q[k], v[k], tau[k])

    def native() -> None:
        for k in range(STATES):
            here[0][:], here[1][:], here[2][:] = q[k], v[k], tau[k]
            call()

    def pooled(threads: int) -> Callable[[], object]:
        return lambda: pin.abaInParallel(threads, pool, *columns, out)

    return {
        "bindings": bindings,
        "native call": native,
        "pool, one thread": pooled(1),
        "pool, two threads": pooled(2),
    }


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--robot", default="panda")
    parser.add_argument("--rounds", type=int, default=31)
    options = parser.parse_args()
    compared = ways(Robot.load(options.robot))
    times: dict[str, list[float]] = {name: [] for name in compared}
    for _ in range(options.rounds):
        for name, compute in compared.items():
            start = perf_counter()
            compute()
            times[name].append(perf_counter() - start)
    reference = np.array(times["bindings"])
    print("| forward dynamics of a state | µs | bindings = 1 |\n|---|--:|--:|")
    for name, each in times.items():
        ratio = np.median(np.array(each) / reference)
        print(f"| {name} | {1e6 * np.median(each) / STATES:.2f} | {ratio:.2f} |")


if __name__ == "__main__":
    main()
