"""Train a small policy to wipe, and record its chunks for `chunks.py`.

    .venv/bin/python benchmarks/chunks_trained.py

A network of two hidden layers sees where the hand is, with a millimetre of noise, and
the normal force, and emits 16 waypoints. It has learnt from an expert that goes back to
the circle from wherever the hand is (behaviour cloning). Then it wipes the table of
`chunks.py` itself, through `hsp.Stream`; what it emits is kept in chunks_trained.npz,
relative to where the hand starts, with the times at which it looked and was ready.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from chunks import DEATH, DEPTH, PERIOD, RECORDED, start_of_wipe, wiping_with

import hsp_control as hsp
from hsp_control.common.arrays import Array

TIMES = np.arange(16) / 20.0  # of the waypoints, from when it looks [s]
RADIUS, RATE = 0.08, 1.25  # of the circle [m], [rad/s]
EVERY = 0.3  # [s]
SEEN = np.array([1e-3, 1e-3, 1e-3, 1.0])  # noise of what it sees [m, N]
SCALE = np.array([0.1, 0.1, 0.01, 20.0])  # of what it sees
STEPS, BATCH = 4000, 256


def expert(seen: Array) -> Array:
    """Return where the hand should go, shape (n, 16, 3), from (n, 4), position first.

    Round the circle and down to the targets' depth, deviations decaying.
    """
    x, y = seen[:, :1] + RADIUS, seen[:, 1:2]
    angle = np.arctan2(y, x) + RATE * TIMES
    decay = np.exp(-TIMES / 0.3)
    radius = RADIUS + (np.hypot(x, y) - RADIUS) * decay
    z = -DEPTH + 0.0 * (seen[:, 2:3] + angle)
    return np.stack([radius * np.cos(angle) - RADIUS, radius * np.sin(angle), z], 2)


def states(rng: np.random.Generator, n: int) -> Array:
    """Return what the hand may feel near the circle, shape (n, 4)."""
    angle, radius = rng.uniform(-np.pi, np.pi, n), RADIUS + rng.normal(0.0, 0.015, n)
    x, y = radius * np.cos(angle) - RADIUS, radius * np.sin(angle)
    pressed = rng.uniform(0.0, 1.0, n)
    z = 0.001 - 0.003 * pressed + rng.normal(0.0, 1e-3, n)
    return np.stack([x, y, z, 20.0 * pressed + rng.normal(0.0, 2.0, n)], 1)


class Network(NamedTuple):
    """Weights and offsets of each layer."""

    weights: list[Array]
    offsets: list[Array]

    @classmethod
    def untrained(cls, rng: np.random.Generator) -> "Network":
        """Return one that knows nothing."""
        sizes = [4, 64, 64, 3 * len(TIMES)]
        weights = [rng.normal(0.0, m**-0.5, (m, n)) for m, n in pairwise(sizes)]
        return cls(weights, [np.zeros(n) for n in sizes[1:]])

    def layers(self, seen: Array) -> list[Array]:
        """Return the values of all layers."""
        found = [seen / SCALE]
        for k, (weight, offset) in enumerate(
            zip(self.weights, self.offsets, strict=True)
        ):
            value = found[-1] @ weight + offset
            found.append(np.tanh(value) if k < len(self.weights) - 1 else value)
        return found

    def chunk(self, seen: Array) -> Array:
        """Return waypoints, shape (n, 16, 3): by how much they differ from the hand."""
        away = 0.1 * self.layers(seen)[-1].reshape(len(seen), len(TIMES), 3)
        return seen[:, None, :3] + away

    def gradients(self, seen: Array, wanted: Array) -> list[Array]:
        """Return those of the squared error, of the weights and then the offsets."""
        layers = self.layers(seen)
        error = self.chunk(seen) - wanted
        back = 2.0 * 0.1 * error.reshape(len(seen), -1) / len(seen)
        weights, offsets = [], []
        for k in reversed(range(len(self.weights))):
            weights.insert(0, layers[k].T @ back)
            offsets.insert(0, back.sum(axis=0))
            back = (back @ self.weights[k].T) * (1.0 - layers[k] ** 2)
        return weights + offsets


def taught(rng: np.random.Generator) -> Network:
    """Return a network that has learnt from the expert (Adam)."""
    network = Network.untrained(rng)
    values = network.weights + network.offsets
    first, second = ([np.zeros_like(each) for each in values] for _ in range(2))
    for step in range(1, STEPS + 1):
        seen = states(rng, BATCH)
        rate = 3e-3 * (1.0 - step / STEPS)
        for value, m, v, g in zip(
            values, first, second, network.gradients(seen, expert(seen)), strict=True
        ):
            m += 0.1 * (g - m)
            v += 0.001 * (g**2 - v)
            value -= (
                rate
                * (m / (1.0 - 0.9**step))
                / (np.sqrt(v / (1.0 - 0.999**step)) + 1e-9)
            )
    seen = states(rng, 4096)
    missed = np.linalg.norm(network.chunk(seen) - expert(seen), axis=2)
    print(f"it misses the expert by {1e3 * np.sqrt((missed**2).mean()):.2f} mm rms")
    return network


def main() -> None:
    """Train the policy, let it wipe, and keep its chunks."""
    rng = np.random.default_rng(0)
    network, start = taught(rng), start_of_wipe()
    stream = hsp.Stream(policy="interpolate", delay=0.0)
    experiment = wiping_with(stream)
    at, made, values = [], [], []
    rows, waiting = iter(range(10**9)), []

    def act(_: object) -> None:
        t = PERIOD * next(rows)
        if t >= EVERY * len(made) and t < DEATH:
            state = experiment.controller.state
            wrench = experiment.plant.contact_wrenches(t, state.q, state.v, None)
            hand = state.position("panda_tcp") - start
            seen = [*hand, wrench["panda_tcp"][2]] + SEEN * rng.normal(size=4)
            thinks = 0.4 if len(made) % 6 == 4 else rng.uniform(0.08, 0.15)
            made.append(t)
            at.append(t + thinks)
            values.append(network.chunk(seen[None])[0])
            waiting.append(len(at) - 1)
        for k in [each for each in waiting if at[each] <= t]:
            waiting.remove(k)
            stream.send_chunk(start + values[k], made[k] + TIMES - t, t=t)

    run = experiment.run(on_row=act)
    force = run["plant.contact.panda_tcp.force"][:, 2]
    print(f"{len(at)} chunks; the largest force is {np.abs(force).max():.1f} N")
    kept = {"at": at, "made": made, "times": TIMES, "values": np.round(values, 6)}
    np.savez_compressed(RECORDED, **kept)


if __name__ == "__main__":
    main()
