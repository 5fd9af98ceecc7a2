"""Chunks of a policy: a wipe over a table, followed in several ways.

    .venv/bin/python benchmarks/chunks.py

A Panda's hand on springs presses on a table of MuJoCo's. A scripted policy sees where
the wipe should be, thinks for 50 to 800 ms, and emits 8 to 50 waypoints; each chunk is
some millimetres off the one before, one comes late, and in the end the policy dies. So
does a trained one, whose chunks `chunks_trained.py` has recorded. An operator leads the
hand at 60 Hz, with a clutch. Beside the policies of `hsp.Stream` stands what others do
with waypoints. Writes a table into benchmarks/results/chunks.md.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from marked_sections import RESULTS, replace_section

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.simulation import SimulationSettings
from hsp_control.trajectories import Trajectory, TrajectorySample

DURATION, PERIOD = 8.0, 0.001  # [s]
BEGIN = 1.5  # measured from here on [s]
DEATH = 5.0  # the policy emits nothing after that [s]
OPEN, CLOSED = 2.5, 3.5  # when the operator's clutch opens, and closes again [s]
MOVED = np.array([0.0, 0.06, 0.0])  # how far the operator's hand is then [m]
DEPTH = 0.008  # of the targets below where the hand touches the table [m]
LATE = 4  # number of the chunk that takes three times as long
BAND = (4.0, 40.0)  # normal forces that wipe [N]


RECORDED = Path(__file__).with_name("chunks_trained.npz")


class Chunk(NamedTuple):
    """When a chunk arrives, when it was seen, and its waypoints."""

    at: float
    made: float
    times: Array
    values: Array


class Given(Trajectory):
    """A reference that somebody writes before each step."""

    now: Any = None  # position and velocity, shape (2, 3)

    @property
    def dimension(self) -> int:
        """The number of coordinates."""
        return 3

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return the reference; its acceleration is always zero."""
        out = self._output(out)
        out.position[:], out.velocity[:] = self.now
        out.acceleration[:] = 0.0
        return out


def wipe(t: float, start: Array) -> Array:
    """Return where the hand should be: on a circle, at 0.1 m/s, pressed down [m]."""
    begun = min(max(t - 0.3, 0.0), 1.0)
    angle = 1.25 * (t - 0.3) * begun
    away = [0.08 * (np.cos(angle) - 1.0), 0.08 * np.sin(angle)]
    return np.asarray(start + np.array([*away, -DEPTH * begun]))


class Case(NamedTuple):
    """Chunks, and the path that they mean."""

    name: str
    chunks: Callable[[Array], list[Chunk]]  # of where the hand starts
    path: Callable[[float, Array], Array] = wipe
    delay: float = 0.0  # of `hsp.Stream` [s]


def scripted(waypoints: int, rate: float, every: float, inference: float) -> Case:
    """Return a scripted policy's chunks, in the order in which they arrive.

    Args:
        waypoints: How many each has.
        rate: Of the waypoints [1/s].
        every: Time from chunk to chunk [s].
        inference: Time from what is seen to the chunk [s].
    """

    def chunks(start: Array) -> list[Chunk]:
        rng, found = np.random.default_rng(0), []
        for number, made in enumerate(np.arange(0.0, DEATH, every)):
            times = np.arange(waypoints) / rate
            seam = rng.uniform(-1.0, 1.0, 3) * [0.004, 0.004, 0.002]
            values = np.array([wipe(made + each, start) + seam for each in times])
            thinks = inference * (3.0 if number == LATE else rng.uniform(0.9, 1.1))
            found.append(Chunk(made + thinks, made, times, values))
        return sorted(found, key=lambda each: each.at)

    name = (
        f"{waypoints} at {rate:g} Hz, each {1e3 * every:.0f} ms, "
        f"{1e3 * inference:.0f} ms old"
    )
    return Case(name, chunks)


@cache
def recorded() -> list[Chunk]:
    """Return the chunks of a trained policy, from where the hand starts."""
    with np.load(RECORDED) as kept:
        rows = zip(kept["at"], kept["made"], kept["values"], strict=True)
        return [Chunk(at, made, kept["times"], x) for at, made, x in rows]


def trained(start: Array) -> list[Chunk]:
    """Return these chunks in order of arrival."""
    found = [each._replace(values=start + each.values) for each in recorded()]
    return sorted(found, key=lambda each: each.at)


def intended(t: float, start: Array) -> Array:
    """Return where the trained policy wanted the hand, when it last looked."""
    chunk = max((c for c in recorded() if c.made <= t), key=lambda c: c.made)
    columns = [np.interp(t - chunk.made, chunk.times, x) for x in chunk.values.T]
    return np.asarray(start + columns)


def clutched(t: float, start: Array) -> Array:
    """Return where an operator's hand is, which moves on while the clutch is open."""
    return wipe(t, start) + MOVED * (t >= CLOSED)


def operator(start: Array) -> list[Chunk]:
    """Return the goals of an operator, 20 to 30 ms old."""
    rng, found = np.random.default_rng(0), []
    for made in np.arange(0.0, DEATH, 1.0 / 60.0):
        if not OPEN <= made < CLOSED:
            value = clutched(made, start)[None]
            found.append(
                Chunk(made + rng.uniform(0.02, 0.03), made, np.zeros(1), value)
            )
    return found


CASES = [
    scripted(8, 10.0, 0.3, 0.05),
    scripted(16, 20.0, 0.4, 0.2),
    scripted(50, 50.0, 0.4, 0.3),
    scripted(50, 20.0, 1.0, 0.8),
    Case("trained, 16 at 20 Hz, each 300 ms, 80 to 400 ms old", trained, intended),
    Case(
        "an operator at 60 Hz, whose clutch closes 60 mm away", operator, clutched, 0.05
    ),
]


Way = Callable[[float, Array, Array], tuple[Array, Array]]
"""Position and velocity of a reference at a time [s], from the waypoints (n, 4), times
first, and the hand's position."""


def hold(t: float, points: Array, hand: Array) -> tuple[Array, Array]:
    """Return the last waypoint that is due."""
    due = int(np.searchsorted(points[:, 0], t, "right"))
    return points[max(due - 1, 0), 1:], np.zeros(3)


def linear(t: float, points: Array, hand: Array) -> tuple[Array, Array]:
    """Return a point on the line between two waypoints."""
    k = int(np.searchsorted(points[:, 0], t, "right"))
    if k in {0, len(points)}:
        return points[max(k - 1, 0), 1:], np.zeros(3)
    (t0, *x0), (t1, *x1) = points[k - 1], points[k]
    velocity = np.subtract(x1, x0) / (t1 - t0)
    return x0 + (t - t0) * velocity, velocity


def smoothed() -> Way:
    """Return the hold behind a first-order filter of 0.1 s."""
    kept: list[Array] = []

    def way(t: float, points: Array, hand: Array) -> tuple[Array, Array]:
        goal = hold(t, points, hand)[0]
        last = kept.pop() if kept else hand
        kept.append(last + (goal - last) * PERIOD / 0.1)
        return kept[0], np.zeros(3)

    return way


def clipped(t: float, points: Array, hand: Array) -> tuple[Array, Array]:
    """Return the hold, at most 10 mm from the hand along each axis."""
    goal = hold(t, points, hand)[0]
    return hand + np.clip(goal - hand, -0.01, 0.01), np.zeros(3)


OTHERS: dict[str, Callable[[], Way]] = {
    "hold": lambda: hold,
    "linear": lambda: linear,
    "exponential smoothing": smoothed,
    "clipping": lambda: clipped,
}
OURS = ("interpolate", "extrapolate")  # with chunks latest does as interpolate


def start_of_wipe() -> Array:
    """Return where the hand starts, on the table, shape (3,) [m]."""
    wiped = hsp.load_experiment("forces/panda_wipe")
    return wiped.robot.state(0.0, wiped.q0, wiped.v0).position("panda_tcp").copy()


def wiping_with(reference: Trajectory) -> hsp.Experiment:
    """Return the experiment whose hand follows a reference over the table."""
    wiped = hsp.load_experiment("forces/panda_wipe")
    spring, stiff = hsp.Impedance(2000.0), hsp.Impedance(60.0)
    tasks: list[hsp.Task] = [
        hsp.FramePosition("panda_tcp", reference, impedance=spring, name="hand"),
        hsp.FrameOrientation("panda_tcp", impedance=stiff, name="upright"),
    ]
    return hsp.Experiment(
        wiped.robot,
        tasks,
        hsp.TargetPosture("start"),
        null_space_gain=8.0,
        plant=wiped.scenario.plant,
        simulation=SimulationSettings(
            duration=DURATION, control_period=PERIOD, log_period=PERIOD
        ),
    )


def followed(case: Case, way: str) -> tuple[str, ...]:
    """Return a row of the table: one way to follow a policy's chunks."""
    start = start_of_wipe()
    left, other = case.chunks(start), OTHERS.get(way, OTHERS["hold"])()
    last = max(left, key=lambda each: each.made).values[-1]
    now = np.array([start, np.zeros(3)])
    reference: Trajectory = (
        hsp.Stream(policy=way, delay=case.delay) if way in OURS else Given(now)
    )
    experiment = wiping_with(reference)
    points, rows, newest = np.array([[-1.0, *start]]), iter(range(10**9)), -1.0

    def deliver(_: object) -> None:
        nonlocal points, newest
        t = PERIOD * next(rows)
        while left and left[0].at <= t:
            at, made, times, values = left.pop(0)
            if isinstance(reference, hsp.Stream) and len(times) == 1:
                reference.send(values[0], t=made)
            elif isinstance(reference, hsp.Stream):  # its clock is that of its messages
                reference.send_chunk(values, made + times - at, t=at)
            elif made > newest:  # nobody goes back to an older chunk
                newest, new = made, np.column_stack([made + times, values])
                points = np.vstack([points[points[:, 0] < made], new])
        hand = experiment.controller.state.position("panda_tcp")
        now[:] = other(t, points, hand)

    run = experiment.run(on_row=deliver)
    return case.name, way, *figures(run, case.path, start, last)


def figures(
    run: hsp.Rollout, path: Callable[[float, Array], Array], start: Array, last: Array
) -> tuple[str, ...]:
    """Return what a run shows: the force, the path, the efforts, and the end."""
    t, hand = run.t, run["task.hand.actual"]
    force = np.abs(run["plant.contact.panda_tcp.force"][:, 2])
    wiping = (t > BEGIN) & (t < DEATH)
    if path is clutched:
        wiping &= (t < OPEN) | (t > CLOSED + 0.5)
    pressed = np.mean((force[wiping] > BAND[0]) & (force[wiping] < BAND[1]))
    delays = np.arange(0.0, 0.6, 0.01)

    def error(delay: float) -> float:
        wanted = np.array([path(each - delay, start) for each in t[wiping][::10]])
        away = (hand[wiping][::10] - wanted)[:, :2]
        return float(np.sqrt(np.mean((away**2).sum(axis=1))))

    errors = [error(delay) for delay in delays]
    best = int(np.argmin(errors))
    change = np.abs(np.diff(run.tau[t > BEGIN], axis=0))
    moved = np.linalg.norm(hand[-1] - hand[t > DURATION - 0.5][0])
    good = pressed > 0.98 and force.max() < 2 * BAND[1] and moved < 1e-3
    return (
        "yes" if good else "no",
        f"{100 * pressed:.1f}",
        f"{force[t > BEGIN].max():.1f}",
        f"{1e3 * delays[best]:.0f}",
        f"{1e3 * errors[best]:.2f}",
        f"{np.sqrt(np.mean(change**2)) / PERIOD:.0f}",
        f"{change.max():.2f}",
        f"{1e3 * np.linalg.norm(run['task.hand.reference'][-1] - last):.1f}",
    )


def main() -> None:
    """Follow all policies in all ways, and write the table."""
    head = (
        "| chunks | reference | wiped | pressed [%] | largest force [N] | delay [ms] | "
        "error [mm] | change of efforts, rms [N·m/s] | largest in 1 ms [N·m] | "
        "ends beside [mm] |\n"
        "|---|---|---|--:|--:|--:|--:|--:|--:|--:|\n"
    )
    lines = []
    for case in CASES:
        for way in (*OTHERS, *OURS):
            row = followed(case, way)
            print(*row, sep="  ", flush=True)
            lines.append(f"| {' | '.join(row)} |\n")
    replace_section(RESULTS / "chunks.md", "chunks.py", head + "".join(lines))


if __name__ == "__main__":
    main()
