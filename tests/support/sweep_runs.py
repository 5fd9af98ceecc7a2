"""Small sweeps, and the commands that start a scheduler and a worker."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager

MOVING = "paper/4_moving_obstacle"
QUICK = ["simulation.duration=0.1", "simulation.integrator={type: rk4, step: 0.005}"]
OVER = {
    "null_space.gain": "log:1:100:3",
    "start.coordinates.0": "1.0:1.6:2",
    "scene.obstacles.disk.shape.radius": [0.1, 0.3],
}
SCHEDULER = [
    "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--no-dashboard",
]  # fmt: skip
WORKER = [
    "distributed.cli.dask_worker", "--nthreads", "1", "--no-dashboard", "--no-nanny",
]  # fmt: skip


@contextmanager
def open_port() -> Iterator[int]:
    """An unused port."""
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        yield listening.getsockname()[1]
