"""Frozen controllers beside Python's: the same bits, whatever the state.

Of each bundled configuration that can be frozen: the states of a run of ten seconds,
and states that are drawn around its start, slow ones near it and fast ones far away.
Each is a step of both, and status and effort have to be equal.
"""

import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from frozen_library import LIB, Opened
from rich.progress import Progress

import hsp_control as hsp
from campaigns.results import keep
from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FreezeError, HspControlError
from hsp_control.common.resources import bundled_configs

PERIOD = 1e-3
"""Of a configuration whose law is evaluated at all times [s]."""
DURATION = 10.0
"""Of each run [s]."""
DRAWN = 100_000
"""States that are drawn for each configuration."""
BATCH = 1000
"""Steps of one run of drawn states."""
SPREADS = (0.05, 0.05), (0.5, 0.5), (1.5, 3.0)
"""How far from the start [rad or m], and how fast [rad/s or m/s]."""


@dataclass
class Tally:
    """What came of one configuration.

    Attributes:
        refused: Why it cannot be frozen; empty: it can.
        run: Steps of the run.
        drawn: Steps at states that were drawn.
        different: Steps whose status or effort differs in a bit.
        status: Steps by their status.
        raised: Steps that neither makes.
    """

    refused: str = ""
    run: int = 0
    drawn: int = 0
    different: int = 0
    status: Counter[int] = field(default_factory=Counter)
    raised: int = 0


class Pair:
    """A controller in Python, and the same without."""

    def __init__(
        self, controller: hsp.Controller, file: Path, period: float, tally: Tally
    ) -> None:
        self._declared, self._period, self._tally = controller, period, tally
        self._opened = Opened(file)
        self.begin()

    def begin(self) -> None:
        """Begin a run."""
        self._own = self._declared.preview()
        LIB.hsp_restart(self._opened.handle)
        self._raised = 0

    def step(self, t: float, q: Array, v: Array) -> None:
        """Make a step of both, and compare."""
        status = self._opened.step(t, q, v)
        try:
            output = self._own.compute(t, q, v)
        except HspControlError:
            self._tally.raised += 1
            self._tally.different += status >= 0
            # A library that is refused for long stops the robot; Python goes on.
            self._raised += 1
            return
        self._own.applied(output.tau, self._period)
        self._raised = 0
        same = status == output.status and np.array_equal(self._opened.tau, output.tau)
        self._tally.different += not same
        self._tally.status[status] += 1

    @property
    def lost(self) -> bool:
        """Whether so many steps in a row were refused that both have to begin anew."""
        return self._raised == 5


def compared(name: str, drawn: int, duration: float, seed: int) -> Iterator[Tally]:
    """Yield what came of a configuration so far."""
    tally = Tally()
    period = hsp.load_experiment(name).scenario.simulation.control_period or PERIOD
    given = f"simulation.duration={duration}", f"simulation.log_period={period}"
    experiment = hsp.load_experiment(name, *given)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "frozen.hsp"
        try:
            start = experiment.q0
            hsp.freeze(experiment.controller, file, period=period, start=start)
        except FreezeError as error:
            tally.refused = str(error)
            yield tally
            return
        pair = Pair(experiment.controller, file, period, tally)
        run = experiment.run()
        for t, q, v in zip(run.t, run.q, run.v, strict=True):
            pair.step(float(t), q, v)
            tally.run += 1
        yield tally
        rng, robot = np.random.default_rng(seed), experiment.robot
        for batch in range(-(-drawn // BATCH)):
            away, fast = SPREADS[batch % len(SPREADS)]
            pair.begin()
            pair.step(0.0, experiment.q0, np.zeros(robot.nv))
            for k in range(1, BATCH + 1):
                moved = rng.uniform(-away, away, robot.nv)
                q = robot.integrate(experiment.q0, moved)
                pair.step(k * period, q, rng.normal(0.0, fast, robot.nv))
                tally.drawn += 1
                if pair.lost:
                    pair.begin()
                    pair.step(k * period, experiment.q0, np.zeros(robot.nv))
            yield tally


def campaign(progress: Progress, seed: int, share: float) -> bool:
    """Compare all bundled configurations."""
    good, drawn = True, max(1, round(share * DRAWN))
    for name in bundled_configs():
        bar = progress.add_task(f"frozen {name}", total=drawn)
        for tally in compared(name, drawn, DURATION * min(share, 1.0), seed):
            progress.update(bar, completed=tally.drawn)
            counts = vars(tally) | {"wanted": DRAWN, "seed": seed}
            keep(f"frozen-{name.replace('/', '_')}", counts)
        good &= not tally.different
    return good
